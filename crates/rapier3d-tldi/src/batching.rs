//! From candidate pairs to the entries of a batch.

use crate::TldiConfig;
use crate::candidates::{Candidate, effective_prediction, parent_of, pose_of};
use crate::exact::ExactShape;
use crate::measured::Measured;
use crate::parts::{Hint, ShapePair, append_part_pairs, within_reach};
use crate::prepared::{Batch, PairKey, PreparedPair};
use rapier3d::dynamics::{IntegrationParameters, RigidBody, RigidBodySet};
use rapier3d::geometry::{Collider, ColliderHandle, ColliderSet};
use rapier3d::math::{Pose, Vector};
use std::sync::atomic::{AtomicBool, Ordering};

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
        let pos12 = pose1.inv_mul(&pose_of(collider2, self.bodies));
        let prediction = effective_prediction(collider1, collider2, self.bodies, self.integration);
        let (shape1, shape2) = (collider1.shape(), collider2.shape());
        if !within_reach(shape1, shape2, &pos12, prediction) {
            return;
        }
        let pair = ShapePair {
            shape1,
            shape2,
            pos12,
            prediction,
        };
        let is_measured_anew = collider1.is_sensor()
            || collider2.is_sensor()
            || colliders.iter().any(|handle| self.changed.contains(handle));
        let kept = self
            .memory
            .measured(colliders)
            .filter(|measured| !is_measured_anew && measured.holds(&pos12, prediction));
        let first_part = batch.parts.len();
        if kept.is_none() {
            self.push_parts(pair, candidate, &pose1, batch, sides);
        }
        batch.push(
            PairKey::new(shape1, shape2, &pos12),
            PreparedPair {
                colliders,
                prediction,
                parts: first_part..batch.parts.len(),
                used: AtomicBool::new(false),
                is_kept: kept.is_some(),
                measured: kept.or_else(|| Measured::new(&pair, self.config)),
                _shapes: [collider1, collider2].map(|c| c.shared_shape().clone()),
            },
        );
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
        append_part_pairs(
            pair,
            self.config,
            &mut batch.parts,
            sides,
            |parts, part1, middle| {
                let world_from_a = part1.map_or(*pose1, |part1| *pose1 * *part1);
                let middle = world_from_a * middle;
                let motion = self.motion(collider2, middle) - self.motion(collider1, middle);
                Hint {
                    motion: world_from_a.rotation.inverse() * motion,
                    last_axis: self.memory.axis(colliders, parts),
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

/// What is remembered about pairs from step to step, until they separate. All in ascending order.
#[derive(Default)]
pub(crate) struct PairMemory {
    /// Main view axis of each comparison, by colliders and parts.
    axes: Vec<((PairId, [u32; 2]), Vector)>,
    /// The measurements that rapier's manifolds are from.
    measured: Vec<(PairId, Measured)>,
    older_axes: Vec<((PairId, [u32; 2]), Vector)>,
    older_measured: Vec<(PairId, Measured)>,
}

impl PairMemory {
    fn axis(&self, colliders: [ColliderHandle; 2], parts: [u32; 2]) -> Option<Vector> {
        let key = (pair_id(colliders), parts);
        let at = self.axes.binary_search_by_key(&key, |(key, _)| *key).ok()?;
        Some(self.axes[at].1)
    }

    fn measured(&self, colliders: [ColliderHandle; 2]) -> Option<Measured> {
        let key = pair_id(colliders);
        let found = self.measured.binary_search_by_key(&key, |(key, _)| *key);
        found.ok().map(|at| self.measured[at].1)
    }

    /// After a step: what its batch measured, if rapier took it. What sleeps stays as it is.
    pub(crate) fn update(&mut self, candidates: &[Candidate], batch: &Batch) {
        std::mem::swap(&mut self.axes, &mut self.older_axes);
        std::mem::swap(&mut self.measured, &mut self.older_measured);
        self.axes.clear();
        self.measured.clear();
        for candidate in candidates.iter().filter(|candidate| candidate.asleep) {
            let id = pair_id([candidate.collider1, candidate.collider2]);
            self.retain_axes(id);
            let found = self.older_measured.binary_search_by_key(&id, |(id, _)| *id);
            self.measured
                .extend(found.ok().map(|at| self.older_measured[at]));
        }
        for pair in &batch.pairs {
            let id = pair_id(pair.colliders);
            let was_used = pair.used.load(Ordering::Relaxed);
            self.measured.extend(
                pair.measured
                    .filter(|_| was_used)
                    .map(|measured| (id, measured)),
            );
            if pair.is_kept {
                self.retain_axes(id);
                continue;
            }
            for part in &batch.parts[pair.parts.clone()] {
                let axes = part
                    .comparison
                    .as_ref()
                    .map(|comparison| &batch.results[comparison.query].axes);
                if let Some(axis) = axes.and_then(|axes| axes.first()) {
                    self.axes.push(((id, part.parts), *axis));
                }
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
