//! From contact pixels to contact patches.

use glamx::Vec3;

/// A pixel in which both surfaces are close or penetrate. Vectors are in the frame of the first
/// surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactPixel {
    /// Column and row in the view's pixel grid.
    pub pixel: [i32; 2],
    /// Index of the view in [`PairResult::axes`](crate::PairResult::axes).
    pub view: u32,
    /// Point on the first surface, metres.
    pub point_a: Vec3,
    /// Point on the second surface, metres; on the same ray as `point_a`.
    pub point_b: Vec3,
    /// Outward normal of the first surface (towards the second), of unit length on a face and shorter at an edge
    /// ([`Layer::agreement`](crate::Layer::agreement)).
    pub normal_a: Vec3,
    /// Outward normal of the second surface (towards the first), as long likewise.
    pub normal_b: Vec3,
    /// Signed distance between the surfaces along the normal, metres; negative: penetration, cut to
    /// what the neighbouring pixels confirm.
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
    /// Midway between the surfaces, metres.
    pub fn middle(&self) -> Vec3 {
        0.5 * (self.point_a + self.point_b)
    }
}

/// Most points in one patch: what a solver manifold takes.
pub const PATCH_POINTS: usize = 4;

/// Neighbouring contact pixels of like normal, reduced to a few points chosen for depth and extent.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactPatch {
    /// Unit normal from the first surface towards the second, in the frame of the first.
    pub normal: Vec3,
    /// One to [`PATCH_POINTS`] points.
    pub points: arrayvec::ArrayVec<ContactPoint, PATCH_POINTS>,
    /// Where the gaps form a bowl, along both of its main axes a vector as long as the relative radius of
    /// curvature of the surfaces, 1 / (1 / R_a + 1 / R_b), metres: the bowl's lowest point moves by as much for
    /// each radian that they turn. That point is the only one, and what touches there rolls; where noise leaves
    /// open where it is, there are four around it, as far apart. Along a line, as of a cylinder on a floor, the
    /// second vector is zero and the points are the line's ends.
    pub relative_radii: Option<[Vec3; 2]>,
    /// Standard deviation, in metres, of the gaps about a plane or, where they form one, a bowl: how
    /// far the measured gap of one point can be trusted.
    pub roughness: f32,
}

impl ContactPatch {
    /// Whether the surfaces touch in one round spot, or along a line, on which they roll.
    pub fn is_round(&self) -> bool {
        self.relative_radii.is_some()
    }
}
