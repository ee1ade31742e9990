//! A ball for each point, as rapier's own primitives.

use super::{Found, Frame, Peer, compare_shapes, vector};
use rapier3d::math::Pose;
use rapier3d::parry::shape::{Compound, SharedShape};

/// A compound of balls for each body, both built anew, with rapier's contact manifolds.
pub struct BallCompound;

/// Most points of a body: rapier keeps a manifold for each pair of balls, which needs too much memory for more.
pub(super) const MOST_POINTS: usize = 50_000;

impl Peer for BallCompound {
    fn name(&self) -> String {
        "compound of balls".to_owned()
    }

    fn takes(&self, frame: &Frame) -> bool {
        frame.a.len().max(frame.b.len()) <= MOST_POINTS
    }

    fn compare(&mut self, frame: &Frame) -> Found {
        let ball = SharedShape::ball(frame.radius);
        compare_shapes(frame, |points| {
            let placed = points
                .iter()
                .map(|p| (Pose::from_translation(vector(p)), ball.clone()));
            Compound::new(placed.collect())
        })
    }
}
