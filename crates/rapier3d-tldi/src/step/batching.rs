//! From candidate pairs to the entries of a batch.

use crate::TldiConfig;
use crate::narrow_phase::parts::{Hint, ShapePair, append_part_pairs};
use crate::shape::exact::ExactShape;
use crate::step::candidates::{Candidate, contact_reach, effective_prediction, parent_of, pose_of};
use crate::step::measured::Measured;
use crate::step::pair_memory::PairMemory;
use crate::step::prepared::{Apart, Batch, PreparedPair, Question};
use rapier3d::dynamics::{IntegrationParameters, RigidBody, RigidBodySet};
use rapier3d::geometry::{Collider, ColliderHandle, ColliderSet};
use rapier3d::math::{Pose, Vector};
use std::sync::atomic::AtomicBool;
use std::sync::{Mutex, Once};

/// All that a batch is made from.
pub(crate) struct BatchSource<'a> {
    pub(crate) gravity: Vector,
    pub(crate) integration: &'a IntegrationParameters,
    pub(crate) bodies: &'a RigidBodySet,
    pub(crate) colliders: &'a ColliderSet,
    pub(crate) config: &'a TldiConfig,
    pub(crate) memory: &'a PairMemory,
    /// Colliders whose shape was changed since the last step.
    pub(crate) changed: &'a [ColliderHandle],
}

impl<'a> BatchSource<'a> {
    /// Appends a candidate to the batch if its colliders are within reach of each other, or are kept apart.
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
        let shapes = || [collider1, collider2].map(|c| c.shared_shape().clone());
        if candidate.is_apart {
            batch.apart.push(Apart {
                shapes: shapes(),
                poses: [pose1, pose2],
            });
            return;
        }
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
            self.push_parts(looked_for, candidate, [pose1, pose2], batch, sides);
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
                shapes: shapes(),
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
        poses: [Pose; 2],
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
                let world_from_a = part1.map_or(poses[0], |part1| poses[0] * *part1);
                let a_from_world = world_from_a.rotation.inverse();
                let middle = world_from_a * middle;
                let motion = self.motion(collider2, middle) - self.motion(collider1, middle);
                let shapes = [pair.shape1, pair.shape2];
                let last_axis = self.memory.axis(colliders, parts, shapes, poses);
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
