//! Round contacts as of the middle of the step.
//!
//! Rapier keeps a contact's points for a whole step. A body that rolls on one spot moves on
//! meanwhile. On average the points are late by half a step. Seen from its centre of mass, gravity
//! and contact are then a little off in the direction of the turn. A rocking body gains energy from
//! this, also with rapier's own shapes: a ball with its weight below the middle, 5 cm off its rest,
//! rocks at up to 10 rad/s and never comes to rest. So the points of round contacts are moved to
//! where they will be after half of the step, seen from the centre of mass. The points of a ball
//! stay where they are.

use crate::step::candidates::{parent_of, pose_of};
use crate::step::prepared::Batch;
use rapier3d::dynamics::{RigidBody, RigidBodySet};
use rapier3d::geometry::ColliderSet;
use rapier3d::math::{AngVector, Vector};
use tldi::ContactPatch;

/// Largest turn that is predicted, in radians. Surfaces that turn farther in half a step have other
/// radii of curvature there. Half or twice: no change in any suite.
const FARTHEST_TURN: f32 = 0.1;

/// Moves the round contacts of a batch that has its results to the middle of a step of `dt` seconds.
pub(crate) fn move_to_mid_step(
    batch: &mut Batch,
    bodies: &RigidBodySet,
    colliders: &ColliderSet,
    dt: f32,
) {
    let Batch {
        pairs,
        parts,
        results,
        ..
    } = batch;
    for pair in pairs.iter() {
        let [collider1, collider2] = pair.colliders.map(|handle| &colliders[handle]);
        let parents = [collider1, collider2].map(|collider| parent_of(collider, bodies));
        let Some((body, is_second)) = rolling_body(parents) else {
            continue;
        };
        let [turn1, turn2] = parents.map(|body| body.map_or(AngVector::ZERO, RigidBody::angvel));
        let turn = (0.5 * dt * (turn2 - turn1)).clamp_length_max(FARTHEST_TURN);
        for part in &parts[pair.parts.clone()] {
            let Some(comparison) = &part.comparison else {
                continue;
            };
            let pose1 = pose_of(collider1, bodies);
            let a_from_world = part.world_from_a(&pose1).inverse();
            let center_of_mass = a_from_world * body.center_of_mass();
            let turn = a_from_world.rotation * turn;
            for patch in &mut results[comparison.query].patches {
                let moved = contact_moved(patch, center_of_mass, is_second, turn);
                for point in &mut patch.points {
                    point.point_a += moved;
                    point.point_b += moved;
                }
            }
        }
    }
}

/// The body that rolls on the other, and whether it is the second. It is the dynamic one; of two dynamic ones, the
/// lighter.
fn rolling_body([first, second]: [Option<&RigidBody>; 2]) -> Option<(&RigidBody, bool)> {
    let dynamic = |body: &&RigidBody| body.is_dynamic();
    match (first.filter(dynamic), second.filter(dynamic)) {
        (Some(first), Some(second)) if first.mass() < second.mass() => Some((first, false)),
        (_, Some(second)) => Some((second, true)),
        (Some(first), None) => Some((first, false)),
        (None, None) => None,
    }
}

/// How far a round contact moves along the surfaces as seen from the centre of mass of the body that rolls, while
/// the second surface turns by `turn` relative to the first; in the frame of the first.
fn contact_moved(
    patch: &ContactPatch,
    center_of_mass: Vector,
    is_second: bool,
    turn: AngVector,
) -> Vector {
    let Some(radii) = patch.relative_radii else {
        return Vector::ZERO;
    };
    let spots = patch.points.iter().map(|point| match is_second {
        true => point.point_b,
        false => point.point_a,
    });
    let spot = spots.sum::<Vector>() / patch.points.len() as f32;
    let body_turn = if is_second { turn } else { -turn };
    // The material of the body at the contact moves with it, and the contact over the surfaces.
    let material = body_turn.cross(spot - center_of_mass);
    let slope = patch.normal.cross(turn);
    // Along a line the ends stay where they are.
    let along = |radius: Vector| {
        let axis = radius.normalize_or_zero();
        (material - radius.length() * slope).dot(axis) * axis
    };
    radii.into_iter().map(along).sum()
}
