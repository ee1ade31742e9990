//! What the contacts of a step tell its sweeps (CCD), and what these tell the bodies.
//!
//! A body of which a part is on the wrong side of a sheet leaves it through the side that its contacts
//! remember: a sweep must not hold it there, from behind. And a body that is deep in a trough may move
//! against its slope, which no contact faces, since the body's own flat bottom decides on the normal: the sweep holds it in
//! every step, its corrections included, and it would keep its velocity until the trough has closed over
//! it. So it loses there what is directed into the slope, as by an impact without friction or rebound.
//!
//! Rapier asks for sweeps without naming the colliders: they are known by their shapes, and by where what
//! moves was when the step began.

use crate::corrections::impulses::{PushedPoint, separate};
use crate::step::prepared::{Batch, PreparedPair, address, locked};
use rapier3d::dynamics::RigidBodySet;
use rapier3d::geometry::{Collider, ColliderSet};
use rapier3d::math::{Pose, Vector};
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

/// Where a sweep holds a pair, in world space.
#[derive(Clone, Copy)]
pub(crate) struct Blocked {
    pub(crate) point: Vector,
    /// Unit normal from the first collider of the pair towards the second.
    pub(crate) normal: Vector,
}

impl Batch {
    /// The pair that is swept, and which of its colliders the first and the second shape belong to.
    fn swept(&self, swept: &SweptPair<'_>) -> Option<(&PreparedPair, [usize; 2])> {
        let shapes = swept.shapes.map(address);
        self.pairs.iter().find_map(|pair| {
            let is_it = |[k, l]: &[usize; 2]| {
                let of_pair = [&pair.shapes[*k], &pair.shapes[*l]];
                of_pair.map(|shape| address(&*shape.0)) == shapes && pair.poses[*k] == swept.pose1
            };
            Some((pair, [[0, 1], [1, 0]].into_iter().find(is_it)?))
        })
    }

    /// How two parts of a swept pair are in each other, by the contacts that push them to the side that is
    /// remembered of them. The normal is in world space.
    pub(crate) fn penetration(
        &self,
        swept: &SweptPair<'_>,
        parts: [u32; 2],
    ) -> Option<Penetration> {
        let (pair, order) = self.swept(swept)?;
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

    /// Records that a swept pair is held where it is; the normal is from the first shape towards the second.
    pub(crate) fn block(&self, swept: &SweptPair<'_>, at: Blocked) {
        if let Some((pair, order)) = self.swept(swept) {
            let normal = if order == [0, 1] {
                at.normal
            } else {
                -at.normal
            };
            *locked(&pair.blocked) = Some(Blocked { normal, ..at });
        }
    }

    /// Takes from the bodies of the pairs that are held what they move into each other by.
    pub(crate) fn stop_blocked(&self, bodies: &mut RigidBodySet, colliders: &ColliderSet) {
        let blocked = self.pairs.iter().filter_map(|pair| {
            let Blocked { point, normal } = locked(&pair.blocked).take()?;
            let [collider1, collider2] = pair.colliders.map(|handle| colliders.get(handle));
            let colliders = [collider1?, collider2?];
            (!colliders.iter().any(|collider| collider.is_sensor())).then(|| PushedPoint {
                bodies: colliders.map(Collider::parent),
                point,
                normal,
                speed: 0.0,
                impulse: 0.0,
            })
        });
        separate(&mut blocked.collect::<Vec<_>>(), bodies);
    }
}
