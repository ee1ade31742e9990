//! From candidate pairs to the entries of a batch.

use crate::TldiConfig;
use crate::narrow_phase::parts::{Comparison, Hint, ShapePair, append_part_pairs};
use crate::shape::exact::ExactShape;
use crate::step::candidates::{Candidate, contact_reach, effective_prediction, parent_of, pose_of};
use crate::step::measured::Measured;
use crate::step::prepared::{Batch, PreparedPair, Question};
use rapier3d::dynamics::{IntegrationParameters, RigidBody, RigidBodySet};
use rapier3d::geometry::{Collider, ColliderHandle, ColliderSet};
use rapier3d::math::{Pose, Vector};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, Once};
use tldi::plan::first_is_smaller;

/// All that a batch is made from.
pub(crate) struct Frame<'a> {
    pub(crate) gravity: Vector,
    pub(crate) integration: &'a IntegrationParameters,
    pub(crate) bodies: &'a RigidBodySet,
    pub(crate) colliders: &'a ColliderSet,
    pub(crate) config: &'a TldiConfig,
    pub(crate) memory: &'a PairMemory,
    /// Colliders whose shape was changed since the last step.
    pub(crate) changed: &'a [ColliderHandle],
}

impl<'a> Frame<'a> {
    /// Appends a candidate to the batch if its colliders are within reach of each other.
    pub(crate) fn push_pair(
        &self,
        candidate: &Candidate,
        batch: &mut Batch,
        sides: &mut Vec<[ExactShape<'a>; 2]>,
    ) {
        let colliders = [candidate.collider1, candidate.collider2];
        let [collider1, collider2] = colliders.map(|handle| &self.colliders[handle]);
        let pose1 = pose_of(collider1, self.bodies);
        let pose2 = pose_of(collider2, self.bodies);
        let pos12 = pose1.inv_mul(&pose2);
        let prediction = effective_prediction(collider1, collider2, self.bodies, self.integration);
        let pair = ShapePair::new(collider1.shape(), collider2.shape(), pos12, prediction);
        let looked_for = ShapePair {
            prediction: contact_reach(collider1, collider2, self.bodies, self.integration),
            ..pair
        };
        if !looked_for.is_within_reach() {
            return;
        }
        self.warn_of_recycling(collider1, collider2);
        let has_sensor = collider1.is_sensor() || collider2.is_sensor();
        let question = match has_sensor {
            true => Question::Crossing,
            false => Question::Contacts(prediction),
        };
        let is_measured_anew =
            has_sensor || colliders.iter().any(|handle| self.changed.contains(handle));
        let kept = self
            .memory
            .measured(colliders)
            .filter(|measured| !is_measured_anew && measured.holds(&pair));
        let first_part = batch.parts.len();
        if kept.is_none() {
            self.push_parts(looked_for, candidate, &pose1, batch, sides);
        }
        batch.push(
            PreparedPair {
                colliders,
                bodies: [collider1, collider2].map(Collider::parent),
                has_link: candidate.has_link,
                poses: [pose1, pose2],
                question,
                parts: first_part..batch.parts.len(),
                used: AtomicBool::new(false),
                blocked: Mutex::default(),
                is_let_through: AtomicBool::new(false),
                is_kept: kept.is_some(),
                measured: kept.or_else(|| match question {
                    Question::Contacts(_) => Measured::new(&pair, self.config),
                    Question::Crossing => None,
                }),
                shapes: [collider1, collider2].map(|c| c.shared_shape().clone()),
            },
            &pos12,
        );
    }

    /// Warns once, in the log: rapier does not ask about a pair without hooks that moves by less than its own distance for
    /// recycling, whatever the points say.
    fn warn_of_recycling(&self, collider1: &Collider, collider2: &Collider) {
        let has_hooks = !(collider1.active_hooks() | collider2.active_hooks()).is_empty();
        let is_sensor = collider1.is_sensor() || collider2.is_sensor();
        if has_hooks || is_sensor || !self.integration.contact_recycling {
            return;
        }
        static WARNING: Once = Once::new();
        WARNING.call_once(|| {
            log::warn!(
                "a cloud's collider has no active hooks: rapier keeps its contacts while it moves by less than {} m, so that \
                 small bodies sink in. Make it by cloud_collider, set ActiveHooks::FILTER_INTERSECTION_PAIR, or switch off \
                 IntegrationParameters::contact_recycling",
                self.integration.contact_recycle_distance()
            );
        });
    }

    fn push_parts(
        &self,
        pair: ShapePair<'a>,
        candidate: &Candidate,
        pose1: &Pose,
        batch: &mut Batch,
        sides: &mut Vec<[ExactShape<'a>; 2]>,
    ) {
        let colliders = [candidate.collider1, candidate.collider2];
        let [collider1, collider2] = colliders.map(|handle| &self.colliders[handle]);
        let config = match collider1.is_sensor() || collider2.is_sensor() {
            true => self.config.for_intersection(),
            false => *self.config,
        };
        append_part_pairs(
            pair,
            &config,
            &mut batch.parts,
            sides,
            |parts, part1, middle| {
                let world_from_a = part1.map_or(*pose1, |part1| *pose1 * *part1);
                let a_from_world = world_from_a.rotation.inverse();
                let middle = world_from_a * middle;
                let motion = self.motion(collider2, middle) - self.motion(collider1, middle);
                let last_axis = self.memory.axis(colliders, parts, &pair, pose1);
                Hint {
                    motion: a_from_world * motion,
                    last_axis: last_axis.map(|axis| a_from_world * axis),
                }
            },
        );
    }

    /// How far the collider's material at `point` (world space) moves over the step, gravity
    /// included, in metres.
    fn motion(&self, collider: &Collider, point: Vector) -> Vector {
        let dt = self.integration.dt;
        let velocity = |body: &RigidBody| {
            let fall = if body.is_dynamic() {
                self.gravity * body.gravity_scale() * dt
            } else {
                Vector::ZERO
            };
            body.velocity_at_point(point) + fall
        };
        parent_of(collider, self.bodies).map_or(Vector::ZERO, |body| velocity(body) * dt)
    }
}

/// Index and generation of both colliders.
type PairId = [(u32, u32); 2];

fn pair_id(colliders: [ColliderHandle; 2]) -> PairId {
    colliders.map(|handle| handle.into_raw_parts())
}

/// Colliders and parts of a comparison.
type PartsId = (PairId, [u32; 2]);

/// Steps without contact for which the last axis is remembered. A body that hops, or whose contact noise hides, is still
/// on the side where it was. After more steps it may be elsewhere. Half or twice: no row of any suite changes.
const MOST_LOST: u32 = 6;

/// Main view axis of the last contact of two parts.
#[derive(Clone, Copy)]
struct LastAxis {
    /// Unit vector in world space: bodies that roll turn under their contacts.
    axis: Vector,
    /// Pose of the second collider in the frame of the first, after the last step.
    pos12: Pose,
    /// Steps without contact since.
    lost_for: u32,
}

impl LastAxis {
    /// Whether the smaller shape was moved since the last step so far that its middle may have passed what it touched:
    /// by more than half its width along the axis. Rapier did not do so.
    fn is_outdated(&self, pair: &ShapePair, pose1: &Pose) -> bool {
        let poses = [self.pos12, pair.pos12];
        if poses[0] == poses[1] {
            return false;
        }
        let axis1 = pose1.rotation.inverse() * self.axis;
        let axis2 = pair.pos12.rotation.inverse() * axis1;
        let [aabb1, aabb2] = [pair.shape1, pair.shape2].map(|shape| shape.compute_local_aabb());
        // Of the smaller shape: its bounds and the axis in its own frame; its poses and the axis in that of the other.
        let (bounds, own_axis, poses, axis) =
            match first_is_smaller([aabb1.extents(), aabb2.extents()]) {
                true => (aabb1, axis1, poses.map(|pose| pose.inverse()), axis2),
                false => (aabb2, axis2, poses, axis1),
            };
        let [before, now] = poses.map(|pose| pose * bounds.center());
        let half_width = bounds.half_extents().dot(own_axis.abs());
        (now - before).dot(axis).abs() > half_width
    }

    /// After another step without contact.
    fn lost(self, pos12: Pose) -> Option<Self> {
        let lost_for = self.lost_for + 1;
        (lost_for <= MOST_LOST).then_some(Self {
            pos12,
            lost_for,
            ..self
        })
    }
}

/// What an ascending list holds for a key.
fn found<K: Ord + Copy, T: Copy>(list: &[(K, T)], key: K) -> Option<T> {
    let at = list.binary_search_by_key(&key, |(key, _)| *key).ok()?;
    Some(list[at].1)
}

/// What is remembered about pairs from step to step, until they separate. All in ascending order.
#[derive(Default)]
pub(crate) struct PairMemory {
    /// Of each comparison, by colliders and parts.
    axes: Vec<(PartsId, LastAxis)>,
    /// The measurements that rapier's manifolds are from.
    measured: Vec<(PairId, Measured)>,
    older_axes: Vec<(PartsId, LastAxis)>,
    older_measured: Vec<(PairId, Measured)>,
}

impl PairMemory {
    fn axis(
        &self,
        colliders: [ColliderHandle; 2],
        parts: [u32; 2],
        pair: &ShapePair,
        pose1: &Pose,
    ) -> Option<Vector> {
        found(&self.axes, (pair_id(colliders), parts))
            .filter(|last| !last.is_outdated(pair, pose1))
            .map(|last| last.axis)
    }

    fn measured(&self, colliders: [ColliderHandle; 2]) -> Option<Measured> {
        found(&self.measured, pair_id(colliders))
    }

    /// After a step: what its batch measured, if rapier took it. What sleeps stays as it is.
    pub(crate) fn update(
        &mut self,
        candidates: &[Candidate],
        batch: &Batch,
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
    ) {
        std::mem::swap(&mut self.axes, &mut self.older_axes);
        std::mem::swap(&mut self.measured, &mut self.older_measured);
        self.axes.clear();
        self.measured.clear();
        for candidate in candidates.iter().filter(|candidate| candidate.asleep) {
            let id = pair_id([candidate.collider1, candidate.collider2]);
            self.retain_axes(id);
            let measured = found(&self.older_measured, id);
            (self.measured).extend(measured.map(|measured| (id, measured)));
        }
        for pair in &batch.pairs {
            let [Some(collider1), Some(collider2)] = pair.colliders.map(|c| colliders.get(c))
            else {
                continue;
            };
            let pos12 = pose_of(collider1, bodies).inv_mul(&pose_of(collider2, bodies));
            let id = pair_id(pair.colliders);
            let was_used = pair.used.load(Ordering::Relaxed);
            let measured = pair.measured.filter(|_| was_used);
            (self.measured).extend(measured.map(|measured| (id, measured)));
            if pair.is_kept {
                let first = self.axes.len();
                self.retain_axes(id);
                self.axes[first..]
                    .iter_mut()
                    .for_each(|(_, last)| last.pos12 = pos12);
                continue;
            }
            for part in &batch.parts[pair.parts.clone()] {
                let Some(result) = part.result(&batch.results) else {
                    continue;
                };
                let key = (id, part.indices);
                // An axis without contact may be that of the few points that came near first.
                let axis = match result.contacts.is_empty() {
                    false => result.axes.first().map(|&axis| {
                        let in_collider = part.poses[0].map_or(axis, |pose| pose.rotation * axis);
                        LastAxis {
                            axis: pair.poses[0].rotation * in_collider,
                            pos12,
                            lost_for: 0,
                        }
                    }),
                    // One that was outdated for the comparison stays so.
                    true => (part.comparison.as_ref())
                        .and_then(Comparison::last_axis)
                        .and_then(|_| found(&self.older_axes, key)?.lost(pos12)),
                };
                self.axes.extend(axis.map(|axis| (key, axis)));
            }
        }
        self.axes.sort_unstable_by_key(|(key, _)| *key);
        self.measured.sort_unstable_by_key(|(key, _)| *key);
    }

    fn retain_axes(&mut self, id: PairId) {
        let start = self.older_axes.partition_point(|((key, _), _)| *key < id);
        let kept = self.older_axes[start..]
            .iter()
            .take_while(|((key, _), _)| *key == id);
        self.axes.extend(kept);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::PointCloudShape;
    use rapier3d::geometry::ColliderBuilder;
    use tldi::{ContactPixel, PairResult, PointCloud};

    /// The axis of points that came near without touching says nothing of the side of a body.
    #[test]
    fn axes_are_remembered_of_contacts() {
        let points: Vec<Vector> = (0..64)
            .map(|k| 0.1 * Vector::new((k % 8) as f32, 0.0, (k / 8) as f32))
            .collect();
        let cloud = PointCloud::builder(points).radius(0.1).build().unwrap();
        let shape: rapier3d::geometry::SharedShape =
            rapier3d::geometry::SharedShape::new(PointCloudShape::new(cloud));
        let mut set = ColliderSet::new();
        let colliders = [(); 2].map(|()| set.insert(ColliderBuilder::new(shape.clone())));
        // A quarter turn about z: from x in the collider to y in the world.
        let turned = Pose::rotation(0.5 * std::f32::consts::PI * Vector::Z);
        let mut memory = PairMemory::default();
        let mut remembered = |axis: Vector, contacts: Vec<ContactPixel>| {
            let pair = ShapePair::new(&*shape.0, &*shape.0, Pose::IDENTITY, 0.1);
            let mut batch = Batch::default();
            let last_axis = memory.axis(colliders, [0, 0], &pair, &turned);
            let hint = |_, _: Option<&Pose>, _| Hint {
                last_axis,
                ..Hint::default()
            };
            let mut sides = Vec::new();
            let config = TldiConfig::default();
            append_part_pairs(pair, &config, &mut batch.parts, &mut sides, hint);
            batch.results.push(PairResult {
                axes: vec![axis],
                contacts,
                ..PairResult::default()
            });
            let shapes = [shape.clone(), shape.clone()];
            let question = Question::Contacts(pair.prediction);
            let prepared =
                PreparedPair::without_bodies(colliders, shapes, [turned; 2], question, 0..1);
            batch.push(prepared, &pair.pos12);
            memory.update(&[], &batch, &RigidBodySet::new(), &set);
            memory.axis(colliders, [0, 0], &pair, &turned)
        };
        assert_eq!(remembered(Vector::Z, vec![]), None);
        let touching = ContactPixel {
            pixel: [0, 0],
            view: 0,
            point_a: Vector::ZERO,
            point_b: Vector::ZERO,
            normal_a: Vector::Y,
            normal_b: -Vector::Y,
            gap: 0.0,
        };
        let axis = remembered(Vector::X, vec![touching]);
        assert!(axis.is_some_and(|axis| axis.distance(Vector::Y) < 1e-6));
        for _ in 0..MOST_LOST {
            assert_eq!(remembered(Vector::Z, vec![]), axis);
        }
        assert_eq!(remembered(Vector::Z, vec![]), None);
    }
}
