//! parry's voxels, rebuilt in every frame, with rapier's contact manifolds.

use super::{Found, Frame, Peer, compare_shapes, vector};
use rapier3d::math::Vector;
use rapier3d::parry::shape::Voxels;

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
        compare_shapes(frame, |points| {
            self.points.clear();
            self.points.extend(points.iter().map(vector));
            Voxels::from_points(Vector::splat(2.0 * frame.radius), &self.points)
        })
    }
}
