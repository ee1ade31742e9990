//! What a fast surface meets takes up its velocity.
//!
//! Rapier undoes a penetration at `max_corrective_velocity` at the most (3 m/s in a world of human
//! size) and gives no velocity for it: a surface that moves faster passes through what it meets. A
//! body has its own velocity in rapier's solver, a surface that deforms has not. So before the step
//! bodies that such a surface is about to penetrate are given its velocity along the normal, as an
//! inelastic impact would.

use crate::candidates::pose_of;
use crate::parts::PartPair;
use crate::prepared::Batch;
use crate::surface_motion::SurfaceMotions;
use rapier3d::dynamics::{IntegrationParameters, RigidBodyHandle, RigidBodySet, RigidBodyVelocity};
use rapier3d::geometry::{Collider, ColliderSet};
use rapier3d::math::{Pose, Vector};
use tldi::PairResult;

/// Rounds over all contacts: a box on four corners has come to 1 % of the velocity asked for.
const ROUNDS: usize = 10;

/// Steps in which a penetration is undone: what moves as fast as the surface rapier leaves as deep in
/// it as it is. So much faster than the surface it is in the end.
const UNDONE_IN: f32 = 6.0;

/// A point in which a surface pushes a body.
struct PushedPoint {
    bodies: [Option<RigidBodyHandle>; 2],
    /// In world space, metres.
    point: Vector,
    /// Unit normal from the first collider towards the second.
    normal: Vector,
    /// Speed at which the bodies have to separate there, m/s.
    speed: f32,
    /// So far, Ns.
    impulse: f32,
}

/// Velocity that a unit of impulse along `normal` at `point` gives to a body.
fn velocity_per_impulse(
    bodies: &RigidBodySet,
    body: Option<RigidBodyHandle>,
    point: Vector,
    normal: Vector,
) -> RigidBodyVelocity<f32> {
    let body = body.and_then(|body| bodies.get(body));
    let Some(body) = body.filter(|body| body.is_dynamic()) else {
        return RigidBodyVelocity::zero();
    };
    let mass = body.mass_properties();
    let arm = point - body.center_of_mass();
    RigidBodyVelocity {
        linvel: mass.effective_inv_mass * normal,
        angvel: mass.effective_world_inv_inertia * arm.cross(normal),
    }
}

/// Velocity of a body at `point`, m/s.
fn velocity_at(bodies: &RigidBodySet, body: Option<RigidBodyHandle>, point: Vector) -> Vector {
    let body = body.and_then(|body| bodies.get(body));
    body.map_or(Vector::ZERO, |body| body.velocity_at_point(point))
}

impl PushedPoint {
    /// Raises the speed at which the bodies separate to what it has to be, or takes back what other
    /// points made needless.
    fn solve(&mut self, bodies: &mut RigidBodySet) {
        let [first, second] = self.bodies;
        let separating = (velocity_at(bodies, second, self.point)
            - velocity_at(bodies, first, self.point))
        .dot(self.normal);
        let gained = self
            .bodies
            .map(|body| velocity_per_impulse(bodies, body, self.point, self.normal));
        let mobility: f32 = self
            .bodies
            .iter()
            .zip(&gained)
            .filter_map(|(body, gained)| {
                let com = bodies.get((*body)?)?.center_of_mass();
                Some(gained.velocity_at_point(self.point, com).dot(self.normal))
            })
            .sum();
        if mobility <= 0.0 {
            return;
        }
        let impulse = (self.impulse + (self.speed - separating) / mobility).max(0.0);
        let change = impulse - self.impulse;
        self.impulse = impulse;
        if change == 0.0 {
            return;
        }
        for ((body, gained), sign) in self.bodies.iter().zip(gained).zip([-1.0, 1.0]) {
            let body = body.and_then(|body| bodies.get_mut(body));
            if let Some(body) = body.filter(|body| body.is_dynamic()) {
                let linvel = body.linvel() + sign * change * gained.linvel;
                let angvel = body.angvel() + sign * change * gained.angvel;
                body.set_linvel(linvel, true);
                body.set_angvel(angvel, true);
            }
        }
    }
}

/// Gives the bodies in the way of surfaces that close faster than `least_speed` m/s their velocity.
pub(crate) fn push(
    motions: &SurfaceMotions,
    least_speed: f32,
    batch: &Batch,
    bodies: &mut RigidBodySet,
    colliders: &ColliderSet,
    integration: &IntegrationParameters,
) {
    let mut points = Vec::new();
    for pair in batch.pairs.iter().filter(|pair| !pair.is_kept) {
        if !motions.have(pair.colliders) {
            continue;
        }
        let found = pair.colliders.map(|handle| colliders.get(handle));
        let [Some(collider1), Some(collider2)] = found else {
            continue;
        };
        if collider1.is_sensor() || collider2.is_sensor() {
            continue;
        }
        let of = [collider1, collider2].map(Collider::parent);
        let pose1 = pose_of(collider1, bodies);
        let parts = &batch.parts[pair.parts.clone()];
        for (on_surface, normal, gap) in contacts(parts, &batch.results, &pose1) {
            let velocity =
                |k: usize| motions.at(pair.colliders[k], colliders, on_surface[k], normal);
            let point = on_surface[0].midpoint(on_surface[1]);
            let speed = (velocity(0) - velocity(1)).dot(normal);
            let closing =
                (velocity_at(bodies, of[0], point) - velocity_at(bodies, of[1], point)).dot(normal);
            if speed > least_speed && gap < (speed + closing) * integration.dt {
                points.push(PushedPoint {
                    bodies: of,
                    point,
                    normal,
                    speed: speed + (-gap).max(0.0) / (UNDONE_IN * integration.dt),
                    impulse: 0.0,
                });
            }
        }
    }
    for _ in 0..ROUNDS {
        for point in &mut points {
            point.solve(bodies);
        }
    }
}

/// Points on both surfaces, normals and gaps of the contacts of `parts`, in world space; `pose1` is
/// that of the first collider.
fn contacts<'a>(
    parts: &'a [PartPair],
    results: &'a [PairResult],
    pose1: &'a Pose,
) -> impl Iterator<Item = ([Vector; 2], Vector, f32)> + 'a {
    parts.iter().flat_map(move |part| {
        let world_from_a = part.poses[0].map_or(*pose1, |pose| *pose1 * pose);
        let patches = part
            .comparison
            .as_ref()
            .map(|comparison| &results[comparison.query].patches);
        patches.into_iter().flatten().flat_map(move |patch| {
            let normal = world_from_a.rotation * patch.normal;
            let points = patch.points.iter();
            points.map(move |point| {
                let on_surface = [point.point_a, point.point_b].map(|p| world_from_a * p);
                (on_surface, normal, point.gap)
            })
        })
    })
}
