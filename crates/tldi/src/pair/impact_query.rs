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
    /// The motion of `b` in the frame of `a`, metres, without a turn. Up to 2¹⁷ thicknesses (2.6 km
    /// for radii of 1 cm) are resolved.
    pub motion: Vec3,
    /// Surfaces that are nearer than this along the motion at its beginning, metres, touch already.
    /// They are met only if the motion goes on towards them by more than a pixel. Otherwise the
    /// surface behind them may be met.
    pub touching: f32,
    /// Whether the rim of `b` is left out, so that a rough surface does not stop a body that slides
    /// along it. The rim is two pixels wide, or three where the motion goes on by no more than
    /// three pixels towards what is there. It is narrower if `b` itself is.
    pub core_only: bool,
    /// The penetration of `b` into `a` before the motion, if its side of `a` is known. On its way
    /// there, `b` passes the surface that it is in.
    pub penetration: Option<Penetration>,
    /// Where `b` turns, too: poses that it truly takes later, from its frame into that of `a`. A point of `b` then meets
    /// `a` only if one of them takes it more than a pixel behind the surface there. Where a body rolls or tips over, its
    /// middle falls, as all of it seems to do in a motion without a turn, but its lower end does not. Empty without a
    /// turn: the motion alone decides.
    pub turned: &'a [Pose3],
    /// Parameters of the images; `prediction` adds to the region that is looked at.
    pub params: Params,
}

/// The penetration of a surface into another one that has no inside. Vectors are in the frame of
/// the first surface.
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
    /// The factor by which pixels are larger than [`Params::pixel_size`], since there was no
    /// [`Room`](crate::Room) for them. `None` if they have the size that was asked for.
    pub coarser: Option<f32>,
}
