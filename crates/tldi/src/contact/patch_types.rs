//! Contact pixels, points and patches.

use arrayvec::ArrayVec;
use glamx::{Pose3, Vec3};

/// A pixel in which both surfaces are close or penetrate. Vectors are in the frame of the first
/// surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactPixel {
    /// Column and row in the view's pixel grid.
    pub pixel: [i32; 2],
    /// Index of the view in [`PairResult::axes`](crate::PairResult::axes).
    pub view: u32,
    /// Point on the first surface, metres.
    pub point_a: Vec3,
    /// Point on the second surface, metres; on the same ray as `point_a`.
    pub point_b: Vec3,
    /// Outward normal of the first surface, towards the second. It has unit length on a face and is
    /// shorter at an edge ([`Layer::agreement`](crate::Layer::agreement)). It is zero where a surface ends in its rim.
    pub normal_a: Vec3,
    /// Outward normal of the second surface, towards the first, with its length as for `normal_a`.
    pub normal_b: Vec3,
    /// Signed distance between the surfaces along the normal, metres. A penetration is negative,
    /// and cut to what the neighbouring pixels confirm.
    pub gap: f32,
}

impl ContactPixel {
    /// Unit normal from the first surface towards the second: the mean of both sides'.
    pub fn normal(&self) -> Vec3 {
        let [a, b] = [self.normal_a, self.normal_b].map(Vec3::normalize_or_zero);
        (a - b).normalize_or(a)
    }

    /// Midway between the surfaces, metres.
    pub fn middle(&self) -> Vec3 {
        0.5 * (self.point_a + self.point_b)
    }

    /// Whether a surface ends there in its rim.
    pub(crate) fn is_at_rim(&self) -> bool {
        self.normal_a == Vec3::ZERO || self.normal_b == Vec3::ZERO
    }
}

/// One point of a [`ContactPatch`]. Vectors are in the frame of the first surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ContactPoint {
    /// Point on the first surface, metres.
    pub point_a: Vec3,
    /// Point on the second surface, metres: `point_a + gap * normal`.
    pub point_b: Vec3,
    /// Signed distance along the patch's normal, metres; negative: penetration.
    pub gap: f32,
}

impl ContactPoint {
    /// The point about `middle` where the surfaces are `gap` metres apart along a unit normal.
    pub(crate) fn about(middle: Vec3, gap: f32, normal: Vec3) -> Self {
        Self {
            point_a: middle - 0.5 * gap * normal,
            point_b: middle + 0.5 * gap * normal,
            gap,
        }
    }

    /// Midway between the surfaces, metres.
    pub fn middle(&self) -> Vec3 {
        0.5 * (self.point_a + self.point_b)
    }
}

/// Most points in one patch, as many as a solver's manifold takes.
pub const PATCH_POINTS: usize = 4;

/// Neighbouring contact pixels with one normal, reduced to a few points that are far out or deep.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactPatch {
    /// Unit normal from the first surface towards the second, in the frame of the first.
    pub normal: Vec3,
    /// One to [`PATCH_POINTS`] points.
    pub points: ArrayVec<ContactPoint, PATCH_POINTS>,
    /// Set if the gaps form a bowl, so that the contact rolls. There is one vector along each main
    /// axis, as long as the relative radius of curvature of the surfaces, 1 / (1 / R_a + 1 / R_b),
    /// metres. The bowl's lowest point moves by that length for each radian of turn. The lowest
    /// point is then the only one. If noise hides where it is, four points stand around it at the
    /// distance of the uncertainty. On a line, such as a cylinder on a floor, the second vector is
    /// zero, and the points are the ends of the line.
    pub relative_radii: Option<[Vec3; 2]>,
    /// Standard deviation of the gaps about a plane or bowl, in metres. It says how far the gap of
    /// one point can be trusted.
    pub roughness: f32,
}

impl ContactPatch {
    /// The same patch in another frame, by the pose of its frame there.
    ///
    /// ```
    /// use tldi::{ContactPatch, ContactPoint, glamx::{Pose3, Vec3}};
    /// let point = ContactPoint { point_a: Vec3::ZERO, point_b: Vec3::Y, gap: 1.0 };
    /// let points = [point].into_iter().collect();
    /// let patch = ContactPatch { normal: Vec3::Y, points, ..ContactPatch::default() };
    /// let moved = patch.transformed(&Pose3::from_translation(Vec3::X));
    /// assert_eq!(moved.points[0].point_b, Vec3::new(1.0, 1.0, 0.0));
    /// ```
    pub fn transformed(&self, pose: &Pose3) -> Self {
        let moved = |point: &ContactPoint| ContactPoint {
            point_a: pose.transform_point(point.point_a),
            point_b: pose.transform_point(point.point_b),
            gap: point.gap,
        };
        Self {
            normal: pose.rotation * self.normal,
            points: self.points.iter().map(moved).collect(),
            relative_radii: (self.relative_radii)
                .map(|radii| radii.map(|radius| pose.rotation * radius)),
            roughness: self.roughness,
        }
    }

    /// Whether the surfaces touch in one round spot, or along a line, and so roll.
    pub fn is_round(&self) -> bool {
        self.relative_radii.is_some()
    }
}
