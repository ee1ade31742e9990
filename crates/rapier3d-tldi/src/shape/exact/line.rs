//! The ray in `f64`.

use rapier3d::glamx::{DVec3, Vec3};
use tldi::RayHit;

/// A line whose part `0 ≤ t ≤ max` is of interest.
pub(super) struct Line {
    pub(super) origin: DVec3,
    /// Of unit length.
    pub(super) direction: DVec3,
    /// In metres.
    pub(super) max: f64,
}

impl Line {
    /// `None` without a direction: the ray crosses nothing.
    pub(super) fn new(origin: Vec3, direction: Vec3, max_distance: f32) -> Option<Self> {
        Some(Self {
            origin: origin.as_dvec3(),
            direction: direction.as_dvec3().try_normalize()?,
            max: max_distance.into(),
        })
    }

    pub(super) fn at(&self, t: f64) -> DVec3 {
        self.origin + t * self.direction
    }

    /// Adds the crossing at `t`, if it is within the part of interest.
    pub(super) fn push(&self, t: f64, normal: DVec3, hits: &mut Vec<RayHit>) {
        if 0.0 <= t && t <= self.max {
            hits.push(RayHit {
                distance: t as f32,
                normal: normal.as_vec3(),
            });
        }
    }

    /// The part of the whole line, also behind the origin, inside a box, with the axes at which it
    /// enters and leaves.
    pub(super) fn clip(&self, min: DVec3, max: DVec3) -> Option<[(f64, usize); 2]> {
        let mut entry = (f64::NEG_INFINITY, 0);
        let mut exit = (f64::INFINITY, 0);
        for axis in 0..3 {
            let (o, d) = (self.origin[axis], self.direction[axis]);
            if d == 0.0 {
                if o < min[axis] || o > max[axis] {
                    return None;
                }
                continue;
            }
            let (t0, t1) = ((min[axis] - o) / d, (max[axis] - o) / d);
            if t0.min(t1) > entry.0 {
                entry = (t0.min(t1), axis);
            }
            if t0.max(t1) < exit.0 {
                exit = (t0.max(t1), axis);
            }
        }
        (entry.0 <= exit.0).then_some([entry, exit])
    }
}
