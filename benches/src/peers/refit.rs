//! parry's bounding volume hierarchy, whose leaves are moved and which is refitted.

use super::bvh::{ball_bounds, overlapping};
use super::{Found, Frame, Peer};
use crate::stopwatch::Stopwatch;
use rapier3d::parry::bounding_volume::Aabb;
use rapier3d::parry::partitioning::{Bvh, BvhBuildStrategy, BvhWorkspace};
use tldi::glamx::Vec3;

/// The hierarchies of the first frame, refitted: for points that keep their numbers. Where a sensor
/// numbers them anew, leaves jump about and the hierarchy degenerates.
#[derive(Default)]
pub struct BvhRefit {
    trees: Option<[Bvh; 2]>,
    workspace: BvhWorkspace,
}

impl Peer for BvhRefit {
    fn name(&self) -> String {
        "bvh refit".to_owned()
    }

    fn compare(&mut self, frame: &Frame) -> Found {
        let build = |points: &[Vec3]| {
            let leaves: Vec<Aabb> = points
                .iter()
                .map(|p| ball_bounds(p, frame.radius))
                .collect();
            Bvh::from_leaves(BvhBuildStrategy::Binned, &leaves)
        };
        // The first build is not counted.
        let [a, b] = self
            .trees
            .get_or_insert_with(|| [build(frame.a), build(frame.b)]);
        let start = Stopwatch::of_thread();
        for (tree, points) in [(&mut *a, frame.a), (&mut *b, frame.b)] {
            for (i, p) in points.iter().enumerate() {
                tree.insert_or_update_partially(ball_bounds(p, frame.radius), i as u32, 0.0);
            }
            tree.refit(&mut self.workspace);
        }
        let built = start.seconds();
        let contacts = overlapping(a, b, frame);
        Found::new(&start, built, contacts)
    }
}
