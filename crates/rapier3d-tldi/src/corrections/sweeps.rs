//! What the contacts of a step tell its sweeps (CCD), and what these tell the bodies.
//!
//! **Leaving a sheet.** A part of a body may be on the wrong side of a sheet. It leaves through the side that its contacts
//! remember. A sweep meets the sheet from behind and must not hold the body there.
//!
//! **Blocked sweeps.** A body deep in a trough may move against the trough's slope. No contact faces the slope, because
//! the flat bottom of the body decides the normal. The sweep then stops the body in every step, but leaves its velocity
//! as it is, until the trough has closed over it. So the body loses the part of its velocity that points into the slope,
//! as in an impact without friction and rebound.
//!
//! **Let through.** A user's hook may take the contacts of a pair away, as a one-way platform does, or their impulses. A
//! joint or the types of the bodies may keep the pair apart. Rapier's sweeps ask nevertheless. They do not hold its own
//! shapes while they touch, and a sweep must not hold such a pair either.
//!
//! Rapier does not name the colliders of a sweep. They are found by their shapes, by the pose of the moving one at the
//! beginning of the step, and by the place of its target.

use crate::corrections::impulses::{PushedPoint, may_separate, separate};
use crate::step::prepared::{Batch, Blocked, PreparedPair, Question, address, locked};
use rapier3d::dynamics::RigidBodySet;
use rapier3d::geometry::{Collider, ColliderHandle, ColliderSet};
use rapier3d::math::Pose;
use rapier3d::parry::shape::Shape;
use std::sync::atomic::Ordering;
use tldi::Penetration;

/// A pair that rapier sweeps: what moves, and its target.
pub(crate) struct SweptPair<'a> {
    pub(crate) shapes: [&'a dyn Shape; 2],
    /// In world space, at first. A target that the step has moved already is where it is then.
    pub(crate) poses: [Pose; 2],
}

impl Batch {
    /// The pair that is swept, if it was prepared, and which of its colliders the first and the second shape belong to.
    fn swept(&self, swept: &SweptPair<'_>) -> Option<(&PreparedPair, [usize; 2])> {
        let (pair, order) = self.found(swept)?;
        Some((pair?, order))
    }

    /// The same, without a prepared pair if the two are kept apart. If several targets share a shape (tiles), it is the one
    /// nearest to the target's place. Sensors hold nothing.
    fn found(&self, swept: &SweptPair<'_>) -> Option<(Option<&PreparedPair>, [usize; 2])> {
        let addresses = swept.shapes.map(address);
        let solid = (self.pairs.iter()).filter(|pair| pair.question != Question::Crossing);
        let solid = solid.map(|pair| (Some(pair), &pair.shapes, &pair.poses));
        let apart = self.apart.iter();
        let apart = apart.map(|pair| (None, &pair.shapes, &pair.poses));
        let alike = solid.chain(apart).filter_map(|(pair, shapes, poses)| {
            let is_it = |[k, l]: &[usize; 2]| {
                let of_pair = [&shapes[*k], &shapes[*l]];
                of_pair.map(|shape| address(&*shape.0)) == addresses && poses[*k] == swept.poses[0]
            };
            let order = [[0, 1], [1, 0]].into_iter().find(is_it)?;
            let target = swept.poses[1].translation;
            let off = poses[order[1]].translation.distance_squared(target);
            Some((off, (pair, order)))
        });
        let nearest = alike.min_by(|(off, _), (other, _)| off.total_cmp(other))?;
        Some(nearest.1)
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
        let part = (self.parts[pair.parts.clone()].iter()).find(|part| part.indices == parts)?;
        let comparison = part.comparison.as_ref()?;
        let normal = -comparison.last_axis()?;
        let depth = (self.results[comparison.query].patches.iter())
            .filter(|patch| patch.normal.dot(normal) > 0.0)
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

    /// Records that the user's hooks took the contacts of the colliders away. The order of these does not matter.
    pub(crate) fn let_through(&self, colliders: [ColliderHandle; 2]) {
        let is_it = |pair: &&PreparedPair| colliders.iter().all(|c| pair.colliders.contains(c));
        if let Some(pair) = self.pairs.iter().find(is_it) {
            pair.is_let_through.store(true, Ordering::Relaxed);
        }
    }

    /// Whether they did so for a swept pair, or it is kept apart.
    pub(crate) fn lets_through(&self, swept: &SweptPair<'_>) -> bool {
        let found = self.found(swept);
        let is_let_through = |pair: &PreparedPair| pair.is_let_through.load(Ordering::Relaxed);
        found.is_some_and(|(pair, _)| pair.is_none_or(is_let_through))
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

    /// Takes from the bodies of held pairs the part of their velocities with which they move into each other.
    pub(crate) fn stop_blocked(&self, bodies: &mut RigidBodySet, colliders: &ColliderSet) {
        let blocked = self.pairs.iter().filter_map(|pair| {
            let Blocked { point, normal } = locked(&pair.blocked).take()?;
            let [collider1, collider2] = pair.colliders.map(|handle| colliders.get(handle));
            let colliders = [collider1?, collider2?];
            let of = colliders.map(Collider::parent);
            may_separate(colliders[0], colliders[1])
                .then(|| PushedPoint::at(point, normal, 0.0, of, bodies))
        });
        let mut blocked: Vec<_> = blocked.collect();
        separate(&mut blocked, bodies);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::narrow_phase::parts::{Hint, ShapePair, append_part_pairs};
    use crate::{PointCloudShape, TldiConfig};
    use rapier3d::prelude::*;
    use std::sync::Mutex;
    use tldi::{ContactPatch, ContactPoint, PairResult, PointCloud};

    /// Rapier sweeps bodies of other solver groups, too, but does not stop them.
    #[test]
    fn sweeps_stop_what_the_solver_may() {
        let [first, second] = [Group::GROUP_1, Group::GROUP_2]
            .map(|group| InteractionGroups::new(group, group, InteractionTestMode::And));
        for (of_body, speed) in [(first, 0.0), (second, 3.0)] {
            let (mut bodies, mut colliders) = (RigidBodySet::new(), ColliderSet::new());
            let body = bodies.insert(RigidBodyBuilder::dynamic().linvel(-3.0 * Vector::Y));
            let [ground, ball] = [SharedShape::ball(1.0), SharedShape::ball(0.1)];
            let floor = ColliderBuilder::new(ground.clone()).solver_groups(first);
            let of_ball = ColliderBuilder::new(ball.clone()).solver_groups(of_body);
            let handles = [
                colliders.insert(floor),
                colliders.insert_with_parent(of_ball, body, &mut bodies),
            ];
            let (poses, question) = ([Pose::IDENTITY; 2], Question::Contacts(0.1));
            let pair = PreparedPair {
                blocked: Mutex::new(Some(Blocked {
                    point: Vector::ZERO,
                    normal: Vector::Y,
                })),
                ..PreparedPair::without_bodies(handles, [ground, ball], poses, question, 0..0)
            };
            bodies[body].recompute_mass_properties_from_colliders(&colliders);
            let mut batch = Batch::default();
            batch.push(pair, &Pose::IDENTITY);
            batch.stop_blocked(&mut bodies, &colliders);
            assert_eq!(bodies[body].linvel().length(), speed);
        }
    }

    /// A body between two tiles of one shape is as deep in each as that one's contacts say; a sensor tile holds nothing.
    #[test]
    fn targets_of_one_shape_are_told_apart() {
        let points: Vec<Vector> = (0..64)
            .map(|k| 0.1 * Vector::new((k % 8) as f32, 0.0, (k / 8) as f32))
            .collect();
        let cloud = PointCloud::builder(points).radius(0.1).build().unwrap();
        let [tile, body] =
            [cloud.clone(), cloud].map(|c| SharedShape::new(PointCloudShape::new(c)));
        let at = Pose::from_translation(0.05 * Vector::Y);
        let tiles = [0.0, 0.1, 0.1].map(|x| Pose::from_translation(x * Vector::X));
        let mut batch = Batch::default();
        let mut sides = Vec::new();
        for (k, pose) in tiles.into_iter().enumerate() {
            let question = match k {
                2 => Question::Crossing,
                _ => Question::Contacts(0.1),
            };
            let pair = ShapePair::new(&*tile.0, &*body.0, pose.inv_mul(&at), 0.1);
            let hint = |_, _: Option<&Pose>, _| Hint {
                motion: Vector::ZERO,
                last_axis: Some(-Vector::Y),
            };
            let first = batch.parts.len();
            let config = TldiConfig::default();
            append_part_pairs(pair, &config, &mut batch.parts, &mut sides, hint);
            let contact = ContactPoint {
                gap: -0.01 * (k + 1) as f32,
                ..ContactPoint::default()
            };
            batch.results.push(PairResult {
                patches: vec![ContactPatch {
                    normal: Vector::Y,
                    points: [contact].into_iter().collect(),
                    ..ContactPatch::default()
                }],
                ..PairResult::default()
            });
            let handles = [k as u32, 9].map(|i| ColliderHandle::from_raw_parts(i, 0));
            let (shapes, parts) = ([tile.clone(), body.clone()], first..batch.parts.len());
            let prepared =
                PreparedPair::without_bodies(handles, shapes, [pose, at], question, parts);
            batch.push(prepared, &pair.pos12);
        }
        for (pose, depth) in [(tiles[0], 0.01), (tiles[1], 0.02)] {
            let swept = SweptPair {
                shapes: [&*body.0, &*tile.0],
                poses: [at, pose],
            };
            let found = batch.penetration(&swept, [0, 0]).unwrap();
            assert_eq!((found.normal, found.depth), (-Vector::Y, depth));
        }
    }
}
