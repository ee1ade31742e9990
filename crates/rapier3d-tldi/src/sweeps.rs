//! What the contacts of a step tell its sweeps (CCD).
//!
//! A body of which a part is on the wrong side of a sheet leaves it through the side that its contacts
//! remember: a sweep must not hold it there, from behind. Rapier asks for sweeps without naming the colliders:
//! they are known by their shapes, and by where what moves was when the step began.

use crate::prepared::{Batch, address};
use rapier3d::math::Pose;
use rapier3d::parry::shape::Shape;
use tldi::Penetration;

/// Least cosine between the side that is remembered and the normal of a contact that pushes there.
const SAME_SIDE: f32 = 0.5;

/// A pair that rapier sweeps: what moves, and its target.
pub(crate) struct SweptPair<'a> {
    pub(crate) shapes: [&'a dyn Shape; 2],
    /// Of what moves in world space, at first.
    pub(crate) pose1: Pose,
}

impl Batch {
    /// How two parts of a swept pair are in each other, by the contacts that push them to the side that is
    /// remembered of them. The normal is in world space.
    pub(crate) fn penetration(
        &self,
        swept: &SweptPair<'_>,
        parts: [u32; 2],
    ) -> Option<Penetration> {
        let shapes = swept.shapes.map(address);
        let (pair, order) = self.pairs.iter().find_map(|pair| {
            let is_it = |[k, l]: &[usize; 2]| {
                let of_pair = [&pair.shapes[*k], &pair.shapes[*l]];
                of_pair.map(|shape| address(&*shape.0)) == shapes && pair.poses[*k] == swept.pose1
            };
            Some((pair, [[0, 1], [1, 0]].into_iter().find(is_it)?))
        })?;
        let parts = order.map(|k| parts[k]);
        let part = (self.parts[pair.parts.clone()].iter()).find(|part| part.parts == parts)?;
        let comparison = part.comparison.as_ref()?;
        let normal = -comparison.last_axis()?;
        let depth = (self.results[comparison.query].patches.iter())
            .filter(|patch| patch.normal.dot(normal) >= SAME_SIDE)
            .flat_map(|patch| &patch.points)
            .fold(0.0, |depth, point| f32::max(depth, -point.gap));
        let in_collider = part.poses[0].map_or(normal, |pose| pose.rotation * normal);
        let from_first = pair.poses[0].rotation * in_collider;
        (depth > 0.0).then_some(Penetration {
            normal: if order == [0, 1] {
                from_first
            } else {
                -from_first
            },
            depth,
        })
    }
}
