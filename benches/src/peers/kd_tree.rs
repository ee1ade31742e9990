//! kiddo's k-d tree, rebuilt in every frame.

use super::{Found, Frame, Peer};
use crate::stopwatch::Stopwatch;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use tldi::glamx::Vec3;

/// A tree of the points of each body, both built anew and joined by distance.
#[derive(Default)]
pub struct KdTreeRebuild {
    points: Vec<[f32; 3]>,
}

impl Peer for KdTreeRebuild {
    fn name(&self) -> String {
        "k-d tree rebuild (kiddo)".to_owned()
    }

    fn compare(&mut self, frame: &Frame) -> Found {
        let start = Stopwatch::of_thread();
        let mut build = |points: &[Vec3]| -> ImmutableKdTree<f32, 3> {
            self.points.clear();
            self.points.extend(points.iter().map(Vec3::to_array));
            ImmutableKdTree::new_from_slice(&self.points).expect("there are points, all finite")
        };
        let (a, b) = (build(frame.a), build(frame.b));
        let built = start.seconds();
        let reach = 2.0 * frame.radius;
        let join = a
            .query_tree(&b)
            .within::<SquaredEuclidean<f32>>(reach * reach);
        let contacts: usize = join.count();
        Found::new(&start, built, contacts)
    }
}
