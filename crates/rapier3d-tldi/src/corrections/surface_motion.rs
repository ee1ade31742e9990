//! The velocity of deforming surfaces, and how it reaches rapier's contacts.
//!
//! Rapier knows velocities of bodies, not of a cloud's points. The solver gets these as the
//! `tangent_velocity` of its contacts. It treats that as a motion of the first body's surface,
//! along the normal too. Rapier resolves a penetration at a rate. An approaching surface would have
//! to penetrate until that rate keeps up, so contacts are reported deeper by that amount. Surfaces
//! that approach faster than rapier corrects push bodies before the step (`surface_push.rs`). The
//! speed of new samples is measured (`sampled_motion.rs`).

use crate::PointCloudShape;
use crate::corrections::blocks;
use crate::corrections::sampled_motion::{Snapshot, way_along};
use crate::step::candidates::{parent_of, pose_of};
use crate::step::prepared::Shared;
use rapier3d::dynamics::{IntegrationParameters, RigidBody, RigidBodyHandle, RigidBodySet};
use rapier3d::geometry::{Collider, ColliderHandle, ColliderSet, SolverFlags};
use rapier3d::math::{Pose, Vector};
use rapier3d::pipeline::{ContactModificationContext, PairFilterContext, PhysicsHooks};
use std::collections::HashMap;
use std::ops::AddAssign;
use tldi::PointCloud;

/// The known motion of clouds that got other points since the last step.
#[derive(Default)]
pub(crate) struct SurfaceMotions {
    motions: Vec<SurfaceMotion>,
    sampled: Vec<SampledMotion>,
    /// All steps that ended.
    ended: Span,
    /// Those that had ended when a collider got the points that it has.
    changed_at: HashMap<ColliderHandle, Span>,
    /// Time constant of rapier's correction of penetrations, seconds: of two dynamic bodies, and of one.
    undoing: [f32; 2],
    dt: f32,
    /// Least closing speed at which bodies are pushed, m/s.
    pub(crate) least_push: f32,
    /// The pairs that are pushed in this step, where this is needed.
    pub(crate) pushed: Vec<[ColliderHandle; 2]>,
    /// Memory of those that were forgotten.
    spare: Vec<Vec<Vector>>,
    spare_snapshots: Vec<Snapshot>,
}

/// Of a cloud that deformed.
struct SurfaceMotion {
    collider: ColliderHandle,
    /// Of the points whose velocities these are. The collider may get others without a word to the pipeline.
    revision: u64,
    /// The points that [`SurfaceMotions::before`] gave before the first deformation since the last step.
    before: Vec<Vector>,
    /// Of each point, in the collider's frame, m/s; not finite where the point was not there before.
    velocities: Vec<Vector>,
    pace: Pace,
}

/// Of a cloud that was sampled anew.
struct SampledMotion {
    collider: ColliderHandle,
    /// Its points before that, and, if it was sampled anew shortly before as well, those that it had
    /// before that.
    before: Snapshot,
    earlier: Option<Snapshot>,
    /// Where the points were in the first step that had them, in the frame of what carries them.
    base_from_points: Pose,
    pace: Pace,
}

/// Steps, and the time that they took. Steps without time, as in a paused game, do not count.
#[derive(Clone, Copy, Default)]
struct Span {
    steps: u64,
    seconds: f64,
}

impl Span {
    /// One step of `dt` seconds.
    fn step(dt: f32) -> Self {
        let has_time = dt > 0.0;
        Self {
            steps: u64::from(has_time),
            seconds: if has_time { f64::from(dt) } else { 0.0 },
        }
    }
}

impl AddAssign for Span {
    fn add_assign(&mut self, more: Self) {
        self.steps += more.steps;
        self.seconds += more.seconds;
    }
}

/// When a surface changed.
#[derive(Clone, Copy)]
struct Pace {
    /// Since the last change.
    age: Span,
    /// From the change before to the last one; at least a step, unless it has no time.
    interval: Span,
}

/// Most steps from one sampling to the next that say how fast a surface moves: a camera's 15 frames a
/// second in 120 steps. What comes later is another surface. Half or twice: no row of any suite changes.
const LONGEST_INTERVAL: u64 = 8;

impl Pace {
    /// Whether the next change is not due yet: the surface goes on as it came.
    fn is_moving(&self) -> bool {
        self.age.steps < self.interval.steps.min(LONGEST_INTERVAL)
    }
}

/// Share of rapier's fastest correction up to which that is left to do it: its contacts rub. Half: no change
/// in any suite. Twice: boxes of 5 r̄ are lost on floors of new points that rise at 3 m/s or faster.
const LEFT_TO_CORRECTION: f32 = 0.5;

impl SurfaceMotions {
    /// The points that `cloud` was given, those that were dropped as NaN, in memory to be handed to
    /// [`record`](Self::record).
    pub(crate) fn before(&mut self, cloud: &PointCloud<'_>) -> Vec<Vector> {
        let mut points = self.spare.pop().unwrap_or_default();
        points.clear();
        points.resize(cloud.len() + cloud.dropped(), Vector::NAN);
        for (i, point) in cloud.points().iter().enumerate() {
            points[cloud.given_index(i)] = *point;
        }
        points
    }

    /// The points that `cloud` has now, to be handed to
    /// [`record_sampled`](Self::record_sampled).
    pub(crate) fn snapshot(&mut self, cloud: &PointCloud<'_>) -> Snapshot {
        let mut snapshot = self.spare_snapshots.pop().unwrap_or_default();
        snapshot.take(cloud);
        snapshot
    }

    /// Records that the points [`before`](Self::before) moved to those of `shape`, as many, in the steps of `dt` seconds since
    /// they changed last. Of several times since the last step, the first one's points and steps count.
    pub(crate) fn record(
        &mut self,
        collider: ColliderHandle,
        mut before: Vec<Vector>,
        shape: &PointCloudShape,
        dt: f32,
    ) {
        let mut interval = self.since_change(collider, dt);
        let earlier = (self.motions.iter_mut()).find(|m| m.collider == collider);
        let is_again =
            |m: &&mut SurfaceMotion| m.pace.age.steps == 0 && m.before.len() == before.len();
        if let Some(motion) = earlier.filter(is_again) {
            interval = motion.pace.interval;
            std::mem::swap(&mut motion.before, &mut before);
        }
        self.forget(collider);
        self.changed_at.insert(collider, self.ended);
        let seconds = interval.seconds as f32;
        if seconds <= 0.0 {
            self.spare.push(before);
            return;
        }
        let cloud = shape.cloud();
        let mut velocities = self.spare.pop().unwrap_or_default();
        velocities.clear();
        let points = cloud.points().iter().enumerate();
        velocities.extend(points.map(|(i, new)| (*new - before[cloud.given_index(i)]) / seconds));
        self.motions.push(SurfaceMotion {
            collider,
            revision: shape.revision(),
            before,
            velocities,
            pace: Pace {
                age: Span::default(),
                interval,
            },
        });
    }

    /// Since the points of this collider changed; at least a step, of `dt` seconds. Points that never did are as old as the
    /// pipeline.
    fn since_change(&self, collider: ColliderHandle, dt: f32) -> Span {
        let changed_at = (self.changed_at.get(&collider).copied()).unwrap_or_default();
        if changed_at.steps == self.ended.steps {
            return Span::step(dt);
        }
        Span {
            steps: self.ended.steps - changed_at.steps,
            seconds: self.ended.seconds - changed_at.seconds,
        }
    }

    /// Records that this collider's surface, sampled by `before`, is sampled anew.
    pub(crate) fn record_sampled(&mut self, collider: ColliderHandle, mut before: Snapshot) {
        self.forget_velocities(collider);
        self.changed_at.insert(collider, self.ended);
        match self.sampled.iter_mut().find(|m| m.collider == collider) {
            // Twice since the last step: what lay before the first time counts.
            Some(motion) if motion.pace.age.steps == 0 => self.spare_snapshots.push(before),
            Some(motion) => {
                before.base_from_points = motion.base_from_points;
                let earlier = std::mem::replace(&mut motion.before, before);
                self.spare_snapshots.extend(motion.earlier.replace(earlier));
                motion.pace = Pace {
                    age: Span::default(),
                    interval: motion.pace.age,
                };
            }
            None => self.sampled.push(SampledMotion {
                collider,
                before,
                earlier: None,
                base_from_points: Pose::IDENTITY,
                // Without an earlier sample it says nothing.
                pace: Pace {
                    age: Span::default(),
                    interval: Span::default(),
                },
            }),
        }
    }

    /// Nothing is known of the motion of this collider's points.
    pub(crate) fn forget(&mut self, collider: ColliderHandle) {
        self.forget_velocities(collider);
        if let Some(at) = self.sampled.iter().position(|m| m.collider == collider) {
            let motion = self.sampled.swap_remove(at);
            self.spare_snapshots.push(motion.before);
            self.spare_snapshots.extend(motion.earlier);
        }
    }

    /// The points of this collider no longer move as they were deformed.
    pub(crate) fn forget_velocities(&mut self, collider: ColliderHandle) {
        if let Some(at) = self.motions.iter().position(|m| m.collider == collider) {
            let motion = self.motions.swap_remove(at);
            self.spare.extend([motion.before, motion.velocities]);
        }
    }

    /// Takes over what concerns contacts from the parameters of the step to come, and where points lie that are new in it.
    pub(crate) fn prepare(
        &mut self,
        integration: &IntegrationParameters,
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
    ) {
        for motion in self.sampled.iter_mut().filter(|m| m.pace.age.steps == 0) {
            if let Some(collider) = colliders.get(motion.collider) {
                motion.base_from_points = base_from_collider(collider, bodies);
            }
            // Where the first points were is not known.
            if motion.earlier.is_none() {
                motion.before.base_from_points = motion.base_from_points;
            }
        }
        let substep = integration.dt / integration.num_solver_iterations as f32;
        let softness = [
            integration.contact_softness,
            integration.static_contact_softness,
        ];
        let rates = softness.map(|softness| softness.erp_inv_dt(substep));
        // Where rapier undoes no penetration, a deeper one does not help.
        self.undoing = rates.map(|rate| if rate > 0.0 { 1.0 / rate } else { 0.0 });
        self.dt = integration.dt;
        self.least_push = LEFT_TO_CORRECTION * integration.max_corrective_velocity();
        self.pushed.clear();
    }

    /// After a step. Surfaces that change every few steps go on until the next change is due, and stand still from then on.
    pub(crate) fn step_ended(&mut self, colliders: &ColliderSet) {
        let step = Span::step(self.dt);
        self.ended += step;
        (self.changed_at).retain(|collider, _| colliders.contains(*collider));
        let deformed = self.motions.iter_mut().map(|motion| &mut motion.pace);
        let sampled = self.sampled.iter_mut().map(|motion| &mut motion.pace);
        deformed.chain(sampled).for_each(|pace| pace.age += step);
        let stopped = (self.motions).extract_if(.., |motion| !motion.pace.is_moving());
        (self.spare).extend(stopped.flat_map(|motion| [motion.before, motion.velocities]));
        let stopped =
            (self.sampled).extract_if(.., |motion| motion.pace.age.steps > LONGEST_INTERVAL);
        for motion in stopped {
            self.spare_snapshots.push(motion.before);
            self.spare_snapshots.extend(motion.earlier);
        }
    }

    /// Whether one of these colliders has a motion.
    pub(crate) fn have(&self, colliders: [ColliderHandle; 2]) -> bool {
        let deformed = self.motions.iter().map(|motion| motion.collider);
        let sampled = self.sampled.iter().filter(|motion| motion.pace.is_moving());
        deformed
            .chain(sampled.map(|motion| motion.collider))
            .any(|collider| colliders.contains(&collider))
    }

    /// Velocity of the collider's surface at a point, m/s, without the velocity of its body. Both are in world space. For a
    /// surface that was sampled anew it is known only along the unit vector `normal`.
    pub(crate) fn at(
        &self,
        collider: ColliderHandle,
        (bodies, colliders): (&RigidBodySet, &ColliderSet),
        point: Vector,
        normal: Vector,
    ) -> Vector {
        let Some(found) = colliders.get(collider) else {
            return Vector::ZERO;
        };
        let Some(shape) = found.shape().as_shape::<PointCloudShape>() else {
            return Vector::ZERO;
        };
        let pose = pose_of(found, bodies);
        let local = pose.inverse_transform_point(point);
        if let Some(motion) = self.motions.iter().find(|m| m.collider == collider) {
            if motion.revision != shape.revision() {
                return Vector::ZERO;
            }
            return pose.rotation * mean_near(shape.cloud(), &motion.velocities, local);
        }
        let sampled = (self.sampled.iter()).find(|m| m.collider == collider && m.pace.is_moving());
        match sampled.and_then(|m| Some((m, m.earlier.as_ref()?))) {
            Some((motion, earlier)) => {
                let normal_in_cloud = pose.rotation.inverse() * normal;
                let now = (shape.cloud(), &motion.base_from_points);
                let way = way_along(now, [earlier, &motion.before], local, normal_in_cloud);
                way / motion.pace.interval.seconds as f32 * normal
            }
            _ => Vector::ZERO,
        }
    }
}

/// Pose of a collider as seen from what carries it: its body, whose velocity rapier knows, or else the world.
fn base_from_collider(collider: &Collider, bodies: &RigidBodySet) -> Pose {
    let of_body = parent_of(collider, bodies).filter(|body| body.is_dynamic_or_kinematic());
    match (of_body, collider.position_wrt_parent()) {
        (Some(_), Some(offset)) => *offset,
        _ => pose_of(collider, bodies),
    }
}

/// Mean of the values of the points near `point`, weighted by nearness; of the nearest where none
/// is within two radii. Values that are not finite do not count.
fn mean_near(cloud: &PointCloud<'_>, values: &[Vector], point: Vector) -> Vector {
    let reach = 2.0 * cloud.mean_radius();
    let points = cloud.points();
    let (mut sum, mut total) = (Vector::ZERO, 0.0);
    let mut nearest = (f32::INFINITY, Vector::ZERO);
    for (distance, indices) in blocks::by_distance(cloud.blocks(), values.len(), point) {
        if distance > nearest.0.max(reach * reach) {
            continue;
        }
        for i in indices.filter(|&i| values[i].is_finite()) {
            let squared = points[i].distance_squared(point);
            if squared < nearest.0 {
                nearest = (squared, values[i]);
            }
            let weight = (1.0 - squared / (reach * reach)).max(0.0);
            sum += weight * values[i];
            total += weight;
        }
    }
    if total > 0.0 { sum / total } else { nearest.1 }
}

/// Hooks around the user's own, which give the velocities of surfaces with other points to rapier's solver, and let sweeps
/// (CCD) pass pairs whose contacts the user's hooks take away.
/// Get them from [`TldiPipeline::hooks`](crate::TldiPipeline::hooks).
///
/// ```
/// use rapier3d::prelude::*;
/// use rapier3d_tldi::prelude::*;
/// let mut world = PhysicsWorld::default();
/// let mut tldi = TldiPipeline::new(TldiConfig::default())?;
/// tldi.attach(&mut world);
/// // What `TldiPipeline::step` does; `()` stands for hooks and event handler of your own.
/// tldi.prepare(
///     world.gravity,
///     &world.integration_parameters,
///     &world.bodies,
///     &world.colliders,
///     &world.impulse_joints,
///     &world.multibody_joints,
/// )?;
/// world.step_with_events(&tldi.hooks(&()), &());
/// tldi.finish(&mut world.bodies, &world.narrow_phase, &world.colliders)?;
/// # Ok::<(), TldiError>(())
/// ```
pub struct TldiHooks<'a> {
    pub(crate) motions: &'a SurfaceMotions,
    pub(crate) shared: &'a Shared,
    pub(crate) inner: &'a dyn PhysicsHooks,
}

impl PhysicsHooks for TldiHooks<'_> {
    fn filter_contact_pair(&self, context: &PairFilterContext<'_>) -> Option<SolverFlags> {
        let flags = self.inner.filter_contact_pair(context);
        if flags.is_some_and(|flags| !flags.contains(SolverFlags::COMPUTE_RIGID_IMPULSES)) {
            let colliders = [context.collider1, context.collider2];
            self.shared.batch().let_through(colliders);
        }
        flags
    }

    fn filter_intersection_pair(&self, context: &PairFilterContext<'_>) -> bool {
        self.inner.filter_intersection_pair(context)
    }

    fn modify_solver_contacts(&self, context: &mut ContactModificationContext<'_>) {
        let (collider1, collider2) = (context.collider1, context.collider2);
        let sets = (context.bodies, context.colliders);
        let moves = |handle: Option<RigidBodyHandle>| {
            let body = handle.and_then(|handle| context.bodies.get(handle));
            body.is_some_and(RigidBody::is_dynamic)
        };
        let [undoing_of_both, undoing_of_one] = self.motions.undoing;
        let undoing = match moves(context.rigid_body1) && moves(context.rigid_body2) {
            true => undoing_of_both,
            false => undoing_of_one,
        };
        if self.motions.have([collider1, collider2])
            && let Some(rigid) = context.rigid_mut()
        {
            let is_pushed = (self.motions.pushed.iter())
                .any(|pair| pair.contains(&collider1) && pair.contains(&collider2));
            for contact in rigid.solver_contacts.iter_mut() {
                // Inside a hook the anchors are in world space.
                let of = |collider, anchor| self.motions.at(collider, sets, anchor, *rigid.normal);
                let velocity = of(collider1, contact.anchor1) - of(collider2, contact.anchor2);
                let closing = velocity.dot(*rigid.normal).max(0.0);
                contact.tangent_velocity += velocity;
                if !(is_pushed && closing > self.motions.least_push) {
                    contact.dist -= undoing * closing;
                }
            }
        }
        let has_contacts = |context: &ContactModificationContext<'_>| {
            let rigid = context.rigid();
            rigid.is_some_and(|rigid| !rigid.solver_contacts.is_empty())
        };
        let had_contacts = has_contacts(context);
        self.inner.modify_solver_contacts(context);
        if had_contacts && !has_contacts(context) {
            self.shared.batch().let_through([collider1, collider2]);
        }
    }
}
