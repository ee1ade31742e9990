//! Where a surface in straight motion first meets another.

use crate::{Params, Surface};
use glamx::{Pose3, Vec3};

/// Two surfaces, the second in straight motion relative to the first.
#[derive(Clone, Copy)]
pub struct ImpactQuery<'a> {
    /// The surface at rest, in its own frame, which is the frame of the result.
    pub a: Surface<'a>,
    /// The surface that moves, in its own frame.
    pub b: Surface<'a>,
    /// From the frame of `b` into the frame of `a`, before the motion.
    pub a_from_b: Pose3,
    /// The motion of `b`, in the frame of `a`, metres; it does not turn. Up to 2¹⁷ merge gaps
    /// (2.6 km for radii of 1 cm) are resolved.
    pub motion: Vec3,
    /// What is nearer than this along the motion at its beginning, metres, touches already: it is
    /// met only if the motion goes on towards it by more than a pixel, and what is behind it may be
    /// met instead.
    pub touching: f32,
    /// Whether the rim of `b` passes what it meets: a body that slides along a rough surface is not
    /// stopped by it. It is two pixels wide, and a third one where the motion does not go on by more
    /// than three towards what is there; less where `b` is not wider than that.
    pub core_only: bool,
    /// How `b` is in `a` before the motion, if it is known on which side of `a` it belongs: on its way there it
    /// passes what it is in.
    pub penetration: Option<Penetration>,
    /// Parameters of the images; `prediction` adds to the region that is looked at.
    pub params: Params,
}

/// How a surface is in another one that has no inside. Vectors are in the frame of the first surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Penetration {
    /// Unit normal from the first surface towards where the second one belongs.
    pub normal: Vec3,
    /// How far the second surface has to move along the normal, metres.
    pub depth: f32,
}

/// The first meeting of an [`ImpactQuery`]. Vectors are in the frame of the first surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Impact {
    /// How far `b` moves until then, metres.
    pub distance: f32,
    /// Where the surfaces meet, metres.
    pub point: Vec3,
    /// Unit normal there, from the first surface towards the second; within 90° of against the
    /// motion.
    pub normal: Vec3,
}
