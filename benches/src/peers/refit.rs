//! parry's bounding volume hierarchy, whose leaves are moved and which is refitted.

use super::bvh::{ball_bounds, overlapping, trees};
use super::{Found, Frame, Peer};
use crate::stopwatch::Stopwatch;
use rapier3d::parry::partitioning::{Bvh, BvhBuildStrategy, BvhWorkspace};

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
        // The first build is not counted.
        let build = || trees(frame, BvhBuildStrategy::Binned);
        let [a, b] = self.trees.get_or_insert_with(build);
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
