//! Which points are in the overlap of two bodies: a box in the frame of the query and one in that of the other surface.

use crate::Aabb;
use crate::cloud::reach::Ring;
use glamx::{Pose3, Vec3};

/// By how much motions of points and boxes are rounded, in shares of the largest coordinate: each adds up a few
/// products, to half a step of `f32` each.
const ROUNDING: f32 = 16.0 * f32::EPSILON;

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
    /// All that is in a box in the frame of the query.
    pub(crate) fn of_box(bounds: Aabb) -> Self {
        Self {
            overlap: bounds,
            other_from_frame: Pose3::IDENTITY,
            other_bounds: bounds,
            ring: Ring::default(),
            included: 0.0,
        }
    }

    /// The region of the points of a radius, metres.
    pub(super) fn of_radius(&self, radius: f32) -> Self {
        let beyond = self.ring.beyond(self.included, radius);
        self.loosened(beyond)
    }

    /// Both boxes loosened by `distance` metres.
    pub(crate) fn loosened(&self, distance: f32) -> Self {
        Self {
            overlap: self.overlap.loosened(distance),
            other_bounds: self.other_bounds.loosened(distance),
            ..*self
        }
    }

    /// Whether a point, in the frame of the query, is in it.
    pub(crate) fn contains(&self, point: Vec3) -> bool {
        self.overlap.contains(point) && self.other_bounds.contains(self.other_from_frame * point)
    }

    /// A box in the frame of a cloud around all of its points that are in the region. Rounding does not move a point
    /// out of it.
    pub(super) fn bounds_in(&self, frame_from_cloud: &Pose3) -> Aabb {
        let cloud_from_frame = frame_from_cloud.inverse();
        let cloud_from_other = cloud_from_frame * self.other_from_frame.inverse();
        let exact = (self.overlap.transformed(&cloud_from_frame))
            .intersection(self.other_bounds.transformed(&cloud_from_other));
        let corners = [
            exact.min,
            exact.max,
            self.overlap.min,
            self.overlap.max,
            cloud_from_frame.translation,
            cloud_from_other.translation,
        ];
        let largest = corners.map(|corner| corner.abs().max_element());
        exact.loosened(ROUNDING * largest.into_iter().fold(0.0, f32::max))
    }
}
