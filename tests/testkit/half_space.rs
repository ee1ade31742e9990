//! An unbounded exact surface.

use tldi::glamx::Vec3;
use tldi::{Aabb, RayHit, RaySurface};

/// The half-space y < 0, known exactly.
#[derive(Clone, Copy, Debug)]
pub struct HalfSpace;

impl RaySurface for HalfSpace {
    fn bounds(&self) -> Aabb {
        Aabb {
            min: Vec3::NEG_INFINITY,
            max: Vec3::new(f32::INFINITY, 0.0, f32::INFINITY),
        }
    }

    fn crossings(&self, origin: Vec3, direction: Vec3, max_distance: f32, hits: &mut Vec<RayHit>) {
        let distance = -origin.y / direction.y;
        if (0.0..=max_distance).contains(&distance) {
            hits.push(RayHit {
                distance,
                normal: Vec3::Y,
            });
        }
    }

    fn project(&self, point: Vec3) -> (f32, Vec3) {
        (point.y, Vec3::Y)
    }

    fn is_closed(&self) -> bool {
        true
    }
}
