//! parry's bounding volume hierarchy, rebuilt in every frame.

use super::{Found, Frame, Peer};
use crate::stopwatch::Stopwatch;
use rapier3d::math::Vector;
use rapier3d::parry::bounding_volume::Aabb;
use rapier3d::parry::partitioning::{Bvh, BvhBuildStrategy};
use tldi::glamx::Vec3;

/// A hierarchy of the balls of each body, both built anew, descended together.
pub struct BvhRebuild {
    /// `Binned` or `Ploc`.
    pub strategy: BvhBuildStrategy,
}

pub(super) fn ball_bounds(p: &Vec3, radius: f32) -> Aabb {
    let half = Vector::splat(radius);
    let middle = Vector::new(p.x, p.y, p.z);
    Aabb::new(middle - half, middle + half)
}

/// A hierarchy of the balls of each body.
pub(super) fn trees(frame: &Frame, strategy: BvhBuildStrategy) -> [Bvh; 2] {
    [frame.a, frame.b].map(|points| {
        let leaves = points.iter().map(|p| ball_bounds(p, frame.radius));
        Bvh::from_leaves(strategy, &leaves.collect::<Vec<_>>())
    })
}

/// Pairs of balls that overlap.
pub(super) fn overlapping(a: &Bvh, b: &Bvh, frame: &Frame) -> usize {
    let reach = 4.0 * frame.radius * frame.radius;
    a.leaf_pairs(b, |a, b| a.intersects(b))
        .filter(|(i, j)| frame.a[*i as usize].distance_squared(frame.b[*j as usize]) <= reach)
        .count()
}

impl Peer for BvhRebuild {
    fn name(&self) -> String {
        match self.strategy {
            BvhBuildStrategy::Binned => "bvh rebuild (binned)".to_owned(),
            BvhBuildStrategy::Ploc => "bvh rebuild (ploc)".to_owned(),
        }
    }

    fn compare(&mut self, frame: &Frame) -> Found {
        let start = Stopwatch::of_thread();
        let [a, b] = trees(frame, self.strategy);
        let built = start.seconds();
        let contacts = overlapping(&a, &b, frame);
        Found::new(&start, built, contacts)
    }
}
