//! A body in the way of a fast surface takes its velocity.
//!
//! Rapier resolves a penetration at `max_corrective_velocity` at most (3 m/s in a world of human
//! size), and gives the body no velocity for it. So a faster surface passes through bodies. In
//! rapier's solver a body has a velocity, but a deforming surface has none. Therefore, before the
//! step, a body that such a surface is about to penetrate gets the surface's velocity along the
//! normal, as in an inelastic impact.

use crate::corrections::impulses::{PushedPoint, may_separate, separate};
use crate::corrections::surface_motion::SurfaceMotions;
use crate::narrow_phase::parts::PartPair;
use crate::step::candidates::pose_of;
use crate::step::prepared::Batch;
use rapier3d::dynamics::{IntegrationParameters, LockedAxes, RigidBody, RigidBodySet};
use rapier3d::geometry::{Collider, ColliderHandle, ColliderSet, SolverFlags};
use rapier3d::math::{Pose, Vector};
use rapier3d::pipeline::{ActiveHooks, PairFilterContext, PhysicsHooks};
use tldi::PairResult;

/// Steps in which a penetration is resolved. A body that moves exactly as fast as the surface would
/// stay as deep as it is, so it ends up a little faster than the surface. Half or twice: no change
/// in any suite.
const UNDONE_IN: f32 = 6.0;

/// Gives the bodies in the way of surfaces that close faster than [`SurfaceMotions::least_push`] their velocity. `hooks` are the
/// user's. Returns the pairs that are pushed where this is needed. Links of multibodies, whose velocities are those of their
/// joints, and bodies with locked translations are left to rapier.
pub(crate) fn push(
    motions: &SurfaceMotions,
    batch: &Batch,
    bodies: &mut RigidBodySet,
    colliders: &ColliderSet,
    integration: &IntegrationParameters,
    hooks: &dyn PhysicsHooks,
) -> Vec<[ColliderHandle; 2]> {
    let (mut points, mut pushed) = (Vec::new(), Vec::new());
    if integration.dt <= 0.0 {
        return pushed;
    }
    for pair in batch
        .pairs
        .iter()
        .filter(|pair| !pair.is_kept && !pair.has_link)
    {
        if !motions.have(pair.colliders) {
            continue;
        }
        let found = pair.colliders.map(|handle| colliders.get(handle));
        let [Some(collider1), Some(collider2)] = found else {
            continue;
        };
        if !may_separate(collider1, collider2)
            || !hooks_let(hooks, pair.colliders, colliders, bodies)
        {
            continue;
        }
        let of = [collider1, collider2].map(Collider::parent);
        if of.iter().flatten().any(|&body| is_guided(&bodies[body])) {
            continue;
        }
        pushed.push(pair.colliders);
        let pose1 = pose_of(collider1, bodies);
        let parts = &batch.parts[pair.parts.clone()];
        for (on_surface, normal, gap) in contacts(parts, &batch.results, &pose1) {
            let velocity = |k: usize| {
                motions.at(
                    pair.colliders[k],
                    (bodies, colliders),
                    on_surface[k],
                    normal,
                )
            };
            let point = on_surface[0].midpoint(on_surface[1]);
            let speed = (velocity(0) - velocity(1)).dot(normal);
            let undone = (-gap).max(0.0) / (UNDONE_IN * integration.dt);
            let point = PushedPoint::at(point, normal, speed + undone, of, bodies);
            let closing = -point.separating(|body| Some(*bodies.get(body)?.vels()));
            if speed > motions.least_push && gap < (speed + closing) * integration.dt {
                points.push(point);
            }
        }
    }
    separate(&mut points, bodies);
    pushed
}

/// Whether a body cannot move everywhere: a blow would spin it.
fn is_guided(body: &RigidBody) -> bool {
    body.is_dynamic()
        && body
            .locked_axes()
            .intersects(LockedAxes::TRANSLATION_LOCKED)
}

/// Whether the user's hooks let rapier's solver separate the colliders.
fn hooks_let(
    hooks: &dyn PhysicsHooks,
    pair: [ColliderHandle; 2],
    colliders: &ColliderSet,
    bodies: &RigidBodySet,
) -> bool {
    let found = pair.map(|handle| &colliders[handle]);
    let is_filtered = found.iter().any(|collider| {
        let active = collider.active_hooks();
        active.contains(ActiveHooks::FILTER_CONTACT_PAIRS)
    });
    let [rigid_body1, rigid_body2] = found.map(Collider::parent);
    let context = PairFilterContext {
        bodies,
        colliders,
        collider1: pair[0],
        collider2: pair[1],
        rigid_body1,
        rigid_body2,
    };
    !is_filtered
        || (hooks.filter_contact_pair(&context))
            .is_some_and(|flags| flags.contains(SolverFlags::COMPUTE_RIGID_IMPULSES))
}

/// Points on both surfaces, normals and gaps of the contacts of `parts`, in world space; `pose1` is
/// that of the first collider.
fn contacts<'a>(
    parts: &'a [PartPair],
    results: &'a [PairResult],
    pose1: &'a Pose,
) -> impl Iterator<Item = ([Vector; 2], Vector, f32)> + 'a {
    parts.iter().flat_map(move |part| {
        let world_from_a = part.world_from_a(pose1);
        let patches = part.result(results).map(|result| &result.patches);
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
