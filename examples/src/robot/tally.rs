//! Normal forces of each link's contacts, without friction, step by step.

use super::report::{Hardest, LinkReport};
use rapier3d::prelude::*;
use tldi::glamx::Vec3;

/// Contacts of a link so far.
#[derive(Clone, Default)]
pub(super) struct LinkTally {
    /// Whether it touched something in the last step.
    pub(super) touches: bool,
    /// Normal force of its contacts in the last step, N.
    pub(super) force: f32,
    contact_steps: usize,
    max_force: f32,
    force_sum: f64,
    hardest: Option<Hardest>,
}

impl LinkTally {
    /// What it says of a link with this name and as many points.
    pub(super) fn report(&self, name: &str, points: usize) -> LinkReport {
        LinkReport {
            name: name.to_owned(),
            points,
            contact_steps: self.contact_steps,
            max_force: self.max_force,
            mean_force: (self.force_sum / self.contact_steps.max(1) as f64) as f32,
            hardest: self.hardest.clone(),
        }
    }
}

/// Adds the contacts after step number `step` to the tallies. `link_of` gives the index of a link's tally, `name_of` says
/// what a collider is. Gives what else the robot touched.
pub(super) fn count(
    tallies: &mut [LinkTally],
    step: usize,
    world: &PhysicsWorld,
    link_of: impl Fn(ColliderHandle) -> Option<usize>,
    name_of: impl Fn(ColliderHandle) -> String,
) -> Vec<ColliderHandle> {
    let mut impulses = vec![Vec3::ZERO; tallies.len()];
    // Of the pair that pushes it most: the impulse, and with what.
    let mut strongest: Vec<Option<(f32, ColliderHandle)>> = vec![None; tallies.len()];
    let mut touched = Vec::new();
    for tally in tallies.iter_mut() {
        tally.touches = false;
        tally.force = 0.0;
    }
    for pair in world.narrow_phase.contact_pairs() {
        let colliders = [pair.collider1, pair.collider2];
        let links = colliders.map(&link_of);
        if links == [None, None] || pair.total_impulse_magnitude() <= 0.0 {
            continue;
        }
        let impulse = pair.total_impulse();
        for (k, sign) in [-1.0, 1.0].into_iter().enumerate() {
            let (Some(link), other) = (links[k], colliders[1 - k]) else {
                touched.push(colliders[k]);
                continue;
            };
            impulses[link] += sign * impulse;
            tallies[link].touches = true;
            let strength = impulse.length();
            if strongest[link].is_none_or(|(most, _)| most < strength) {
                strongest[link] = Some((strength, other));
            }
        }
    }
    for ((tally, impulse), strongest) in tallies.iter_mut().zip(impulses).zip(strongest) {
        let Some((_, other)) = strongest else {
            continue;
        };
        let force = impulse.length() / world.integration_parameters.dt;
        tally.force = force;
        tally.contact_steps += 1;
        tally.force_sum += f64::from(force);
        if force > tally.max_force {
            tally.max_force = force;
            let against = name_of(other);
            tally.hardest = Some(Hardest { step, against });
        }
    }
    touched
}
