//! parry's voxels, rebuilt in every frame, with rapier's contact manifolds.

use super::{Found, Frame, Peer};
use rapier3d::geometry::ContactManifold;
use rapier3d::math::{Pose, Vector};
use rapier3d::parry::query::{DefaultQueryDispatcher, PersistentQueryDispatcher};
use rapier3d::parry::shape::Voxels;
use std::time::Instant;
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
        let start = Instant::now();
        let mut build = |points: &[Vec3]| {
            self.points.clear();
            self.points
                .extend(points.iter().map(|p| Vector::new(p.x, p.y, p.z)));
            Voxels::from_points(Vector::splat(2.0 * frame.radius), &self.points)
        };
        let (a, b) = (build(frame.a), build(frame.b));
        let built = start.elapsed().as_secs_f64();
        let mut manifolds: Vec<ContactManifold> = Vec::new();
        let mut workspace = None;
        let outcome = DefaultQueryDispatcher.contact_manifolds(
            &Pose::IDENTITY,
            &a,
            &b,
            0.0,
            &mut manifolds,
            &mut workspace,
        );
        let points = manifolds.iter().flat_map(|manifold| &manifold.points);
        let contacts = points.filter(|point| point.dist <= 0.0).count();
        Found {
            build_seconds: built,
            query_seconds: start.elapsed().as_secs_f64() - built,
            collides: outcome.is_ok() && contacts > 0,
            contacts,
        }
    }
}
