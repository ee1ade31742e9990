//! parry's voxels, rebuilt in every frame, with rapier's contact manifolds.

use super::{Found, Frame, Peer, touching_points, vector};
use crate::stopwatch::Stopwatch;
use rapier3d::math::Vector;
use rapier3d::parry::shape::Voxels;
use tldi::glamx::Vec3;

/// Voxels as large as the balls.
#[derive(Default)]
pub struct VoxelsRebuild {
    points: Vec<Vector>,
}

impl Peer for VoxelsRebuild {
    fn name(&self) -> String {
        "voxels rebuild".to_owned()
    }

    fn compare(&mut self, frame: &Frame) -> Found {
        let start = Stopwatch::of_thread();
        let mut build = |points: &[Vec3]| {
            self.points.clear();
            self.points.extend(points.iter().map(vector));
            Voxels::from_points(Vector::splat(2.0 * frame.radius), &self.points)
        };
        let (a, b) = (build(frame.a), build(frame.b));
        let built = start.seconds();
        let contacts = touching_points(&a, &b).unwrap_or(0);
        Found {
            build_seconds: built,
            query_seconds: start.seconds() - built,
            collides: contacts > 0,
            contacts,
        }
    }
}
