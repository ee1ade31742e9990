//! Which points are in the overlap of two bodies: a box in the frame of the query and one in that of the other surface.

use crate::cloud::reach::Ring;
use crate::cpu::lanes::multiversioned;
use crate::{Aabb, BLOCK};
use glamx::{Mat3, Pose3, Vec3};

/// Which points of a cloud are kept: a box in the frame of the query and one in the frame of the
/// other surface.
#[derive(Clone, Debug, Default)]
pub struct Region {
    /// Overlap of both bounds in the frame of the query, metres.
    pub overlap: Aabb,
    /// From the frame of the query into the frame of the other surface.
    pub other_from_frame: Pose3,
    /// The other surface's bounds in its own frame, loosened: as good as an oriented box.
    pub other_bounds: Aabb,
    /// How far beyond what can touch points are culled.
    pub(crate) ring: Ring,
    /// By how much of it both boxes are loosened, metres.
    pub(crate) included: f32,
}

impl Region {
    /// The region of the points of a radius, metres.
    pub(super) fn of_radius(&self, radius: f32) -> Self {
        let beyond = self.ring.beyond(self.included, radius);
        Self {
            overlap: self.overlap.loosened(beyond),
            other_bounds: self.other_bounds.loosened(beyond),
            ..*self
        }
    }

    /// Whether a point, in the frame of the query, is in it.
    pub(super) fn contains(&self, point: Vec3) -> bool {
        self.overlap.contains(point) && self.other_bounds.contains(self.other_from_frame * point)
    }
}

/// One block's points in the frame of the query, and whether they are inside the region.
pub(super) struct Moved {
    pub(super) x: [f32; BLOCK],
    pub(super) y: [f32; BLOCK],
    pub(super) z: [f32; BLOCK],
    /// 1 or 0; 0 beyond the points of the block.
    pub(super) inside: [u8; BLOCK],
}

impl Default for Moved {
    fn default() -> Self {
        Self {
            x: [0.0; BLOCK],
            y: [0.0; BLOCK],
            z: [0.0; BLOCK],
            inside: [0; BLOCK],
        }
    }
}

/// Two rigid motions, `None` where nothing moves, and two boxes, unpacked for the inner loop.
pub(super) struct Kernel {
    pub(super) frame_from_cloud: Option<(Mat3, Vec3)>,
    overlap: Aabb,
    other_from_frame: Option<(Mat3, Vec3)>,
    other_bounds: Aabb,
}

impl Kernel {
    pub(super) fn new(frame_from_cloud: &Pose3, region: &Region) -> Self {
        let motion = |pose: &Pose3| {
            (*pose != Pose3::IDENTITY).then(|| (Mat3::from_quat(pose.rotation), pose.translation))
        };
        Self {
            frame_from_cloud: motion(frame_from_cloud),
            overlap: region.overlap,
            other_from_frame: motion(&region.other_from_frame),
            other_bounds: region.other_bounds,
        }
    }
}

multiversioned! {
/// Moves points, and tells which are inside of those that are `taken`; whether any is.
pub(super) fn classify(
    k: &Kernel,
    x: &[f32],
    y: &[f32],
    z: &[f32],
    taken: &[u8; BLOCK],
    moved: &mut Moved,
) -> bool {
    let stay = |p: [f32; 3]| p;
    let mover = |(r, t): (Mat3, Vec3)| move |[x, y, z]: [f32; 3]| [
        r.x_axis.x * x + r.y_axis.x * y + r.z_axis.x * z + t.x,
        r.x_axis.y * x + r.y_axis.y * y + r.z_axis.y * z + t.y,
        r.x_axis.z * x + r.y_axis.z * y + r.z_axis.z * z + t.z,
    ];
    let points = ([x, y, z], taken);
    let other = &k.other_bounds;
    match (k.frame_from_cloud, k.other_from_frame) {
        (None, None) => sort_out(points, stay, &k.overlap, stay, other, moved),
        (None, Some(to)) => sort_out(points, stay, &k.overlap, mover(to), other, moved),
        (Some(to), None) => sort_out(points, mover(to), &k.overlap, stay, other, moved),
        (Some(to), Some(on)) => sort_out(points, mover(to), &k.overlap, mover(on), other, moved),
    }
}
}

/// Moves points to where `overlap` is, then on to where `other` is, and tells which are in both boxes.
#[inline(always)]
fn sort_out(
    ([x, y, z], taken): ([&[f32]; 3], &[u8; BLOCK]),
    to_frame: impl Fn([f32; 3]) -> [f32; 3],
    overlap: &Aabb,
    to_other: impl Fn([f32; 3]) -> [f32; 3],
    other: &Aabb,
    moved: &mut Moved,
) -> bool {
    let n = x.len().min(y.len()).min(z.len()).min(BLOCK);
    let (x, y, z) = (&x[..n], &y[..n], &z[..n]);
    let (mx, my, mz) = (&mut moved.x[..n], &mut moved.y[..n], &mut moved.z[..n]);
    moved.inside[n..].fill(0);
    let inside = &mut moved.inside[..n];
    let within = |[x, y, z]: [f32; 3], aabb: &Aabb| {
        (x >= aabb.min.x)
            & (x <= aabb.max.x)
            & (y >= aabb.min.y)
            & (y <= aabb.max.y)
            & (z >= aabb.min.z)
            & (z <= aabb.max.z)
    };
    for i in 0..n {
        let p = to_frame([x[i], y[i], z[i]]);
        let is_inside = within(p, overlap) & within(to_other(p), other);
        [mx[i], my[i], mz[i]] = p;
        inside[i] = u8::from(is_inside) & taken[i];
    }
    inside.iter().fold(0, |any, flag| any | flag) > 0
}
