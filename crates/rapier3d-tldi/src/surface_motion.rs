//! The velocity of deforming surfaces, and how it reaches rapier's contacts.
//!
//! Rapier knows velocities of bodies. What a cloud's points do beside is told to its solver as the
//! `tangent_velocity` of the solver contacts, which it treats as a motion of the first body's
//! surface, along the normal as well. A penetration it undoes at a rate; so that a surface that
//! comes nearer at some speed does not have to penetrate until that rate keeps up, contacts are
//! told to be deeper by as much.

use crate::PointCloudShape;
use rapier3d::dynamics::{IntegrationParameters, RigidBody, RigidBodyHandle};
use rapier3d::geometry::{ColliderHandle, ColliderSet, SolverFlags};
use rapier3d::math::Vector;
use rapier3d::pipeline::{ContactModificationContext, PairFilterContext, PhysicsHooks};
use tldi::PointCloud;

/// Velocities of the points of the clouds that deformed since the last step.
#[derive(Default)]
pub(crate) struct SurfaceMotions {
    motions: Vec<SurfaceMotion>,
    /// Seconds in which the solver undoes a penetration: between moving bodies, and with one that
    /// does not move.
    undoing: [f32; 2],
    /// Memory of those that were forgotten.
    spare: Vec<Vec<Vector>>,
}

struct SurfaceMotion {
    collider: ColliderHandle,
    /// Of each point, in the collider's frame, m/s.
    velocities: Vec<Vector>,
}

impl SurfaceMotions {
    /// The points that `cloud` has now, in memory to be handed to [`record`](Self::record).
    pub(crate) fn before(&mut self, cloud: &PointCloud<'_>) -> Vec<Vector> {
        let mut points = self.spare.pop().unwrap_or_default();
        points.clear();
        points.extend(cloud.points());
        points
    }

    /// Records that the points `before` moved to those of `cloud` within `dt` seconds.
    pub(crate) fn record(
        &mut self,
        collider: ColliderHandle,
        mut before: Vec<Vector>,
        cloud: &PointCloud<'_>,
        dt: f32,
    ) {
        for (old, new) in before.iter_mut().zip(cloud.points()) {
            *old = (new - *old) / dt;
        }
        self.forget(collider);
        self.motions.push(SurfaceMotion {
            collider,
            velocities: before,
        });
    }

    /// The points of this collider are others than before: nothing is known of their motion.
    pub(crate) fn forget(&mut self, collider: ColliderHandle) {
        if let Some(at) = self.motions.iter().position(|m| m.collider == collider) {
            self.spare.push(self.motions.swap_remove(at).velocities);
        }
    }

    /// Takes over what concerns contacts from the parameters of the step to come.
    pub(crate) fn prepare(&mut self, integration: &IntegrationParameters) {
        let substep = integration.dt / integration.num_solver_iterations as f32;
        let softness = [
            integration.contact_softness,
            integration.static_contact_softness,
        ];
        self.undoing = softness.map(|softness| 1.0 / softness.erp_inv_dt(substep));
    }

    /// After a step, surfaces stand still until they are moved again.
    pub(crate) fn clear(&mut self) {
        self.spare
            .extend(self.motions.drain(..).map(|motion| motion.velocities));
    }

    /// Velocity in world space, m/s, of the collider's surface at a point in world space, beside
    /// that of its body.
    fn at(&self, collider: ColliderHandle, colliders: &ColliderSet, point: Vector) -> Vector {
        let motion = self.motions.iter().find(|m| m.collider == collider);
        let collider = colliders.get(collider);
        let Some((motion, collider)) = motion.zip(collider) else {
            return Vector::ZERO;
        };
        let Some(shape) = collider.shape().as_shape::<PointCloudShape>() else {
            return Vector::ZERO;
        };
        let pose = collider.position();
        let local = pose.inverse_transform_point(point);
        pose.rotation * mean_near(shape.cloud(), &motion.velocities, local)
    }
}

/// Mean of the values of the points near `point`, weighted by nearness; of the nearest where none
/// is within two radii.
fn mean_near(cloud: &PointCloud<'_>, values: &[Vector], point: Vector) -> Vector {
    let reach = 2.0 * cloud.mean_radius();
    let [x, y, z] = cloud.coordinates();
    let (mut sum, mut total) = (Vector::ZERO, 0.0);
    let mut nearest = (f32::INFINITY, Vector::ZERO);
    for (block, bounds) in cloud.blocks().iter().enumerate() {
        let distance = point.clamp(bounds.min, bounds.max).distance_squared(point);
        if distance > nearest.0.max(reach * reach) {
            continue;
        }
        let first = block * tldi::BLOCK;
        for i in first..(first + tldi::BLOCK).min(values.len()) {
            let squared = Vector::new(x[i], y[i], z[i]).distance_squared(point);
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

/// Hooks that hand the velocities of deforming clouds to rapier's solver, around those of the user.
/// Got from [`TldiPipeline::hooks`](crate::TldiPipeline::hooks).
pub struct TldiHooks<'a> {
    pub(crate) motions: &'a SurfaceMotions,
    pub(crate) inner: &'a dyn PhysicsHooks,
}

impl PhysicsHooks for TldiHooks<'_> {
    fn filter_contact_pair(&self, context: &PairFilterContext<'_>) -> Option<SolverFlags> {
        self.inner.filter_contact_pair(context)
    }

    fn filter_intersection_pair(&self, context: &PairFilterContext<'_>) -> bool {
        self.inner.filter_intersection_pair(context)
    }

    fn modify_solver_contacts(&self, context: &mut ContactModificationContext<'_>) {
        let (collider1, collider2) = (context.collider1, context.collider2);
        let colliders = context.colliders;
        let moves = |handle: Option<RigidBodyHandle>| {
            let body = handle.and_then(|handle| context.bodies.get(handle));
            body.is_some_and(RigidBody::is_dynamic)
        };
        let [undoing_of_both, undoing_of_one] = self.motions.undoing;
        let undoing = match moves(context.rigid_body1) && moves(context.rigid_body2) {
            true => undoing_of_both,
            false => undoing_of_one,
        };
        let deforms =
            |motion: &SurfaceMotion| motion.collider == collider1 || motion.collider == collider2;
        if self.motions.motions.iter().any(deforms)
            && let Some(rigid) = context.rigid_mut()
        {
            for contact in rigid.solver_contacts.iter_mut() {
                // Inside a hook the anchors are in world space.
                let velocity = self.motions.at(collider1, colliders, contact.anchor1)
                    - self.motions.at(collider2, colliders, contact.anchor2);
                contact.tangent_velocity += velocity;
                contact.dist -= undoing * velocity.dot(*rigid.normal).max(0.0);
            }
        }
        self.inner.modify_solver_contacts(context);
    }
}
