//! The deepest contacts of a run by what may help against them.

use rapier3d::prelude::*;
use rapier3d_tldi::prelude::CloudContact;
use serde::Serialize;
use std::io::{self, Write};
use tldi::glamx::Vec3;

/// Cosine between two pushes on a body from which on it is held between them (120°).
const OPPOSED: f32 = -0.5;

/// A contact that was the deepest of its kind.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WorstContact {
    /// Penetration, metres.
    pub depth: f32,
    /// Middle between the two surfaces, in the world, metres.
    pub position: [f32; 3],
    /// Number of the step, from 1.
    pub step: usize,
}

/// The deepest contacts, by kind; null where nothing penetrated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ContactKinds {
    /// Between two things neither of which gives way, such as a hoof on a scripted path and the ground. It is as
    /// deep as the script says.
    pub scripted: Option<WorstContact>,
    /// Of a body that has no room: things that do not give way push it from opposite sides in the same
    /// step.
    pub squeezed: Option<WorstContact>,
    /// Of a body that what does not give way moves into, such as what comes into the view of a depth camera: it is
    /// as deep as the way that it moved, less what the body gave way.
    pub pushed: Option<WorstContact>,
    /// Of all others, which the solver answers for.
    pub resting: Option<WorstContact>,
}

impl ContactKinds {
    /// Counts the contacts of a step. `moved_in` says of a contact with what does not give way whether it has moved to
    /// where it touches.
    pub fn count(
        &mut self,
        step: usize,
        contacts: &[CloudContact],
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
        moved_in: impl Fn(&CloudContact) -> bool,
    ) {
        let gives_way = |collider: ColliderHandle| {
            let parent = colliders.get(collider).and_then(Collider::parent);
            let body = parent.and_then(|parent| bodies.get(parent));
            body.is_some_and(RigidBody::is_dynamic)
        };
        // Bodies, where to what does not give way pushes them, and whether it moved there.
        let pushes: Vec<(ColliderHandle, Vec3, bool)> = (contacts.iter())
            .filter(|contact| contact.depth > 0.0)
            .filter_map(|c| match [c.collider1, c.collider2].map(gives_way) {
                [false, true] => Some((c.collider2, c.normal, moved_in(c))),
                [true, false] => Some((c.collider1, -c.normal, moved_in(c))),
                _ => None,
            })
            .collect();
        let own = |body: ColliderHandle| pushes.iter().filter(move |push| push.0 == body);
        let is_squeezed = |body| own(body).any(|a| own(body).any(|b| a.1.dot(b.1) < OPPOSED));
        let is_pushed = |body| own(body).any(|push| push.2);
        for contact in contacts.iter().filter(|contact| contact.depth > 0.0) {
            let pair = [contact.collider1, contact.collider2];
            let worst = if !pair.into_iter().any(gives_way) {
                &mut self.scripted
            } else if pair.into_iter().any(is_squeezed) {
                &mut self.squeezed
            } else if pair.into_iter().any(is_pushed) {
                &mut self.pushed
            } else {
                &mut self.resting
            };
            if worst.is_none_or(|worst| worst.depth < contact.depth) {
                *worst = Some(WorstContact {
                    depth: contact.depth,
                    position: contact.point.to_array(),
                    step,
                });
            }
        }
    }

    /// Writes a line for each kind, for people.
    ///
    /// # Errors
    /// Those of writing.
    pub fn write_lines(&self, out: &mut impl Write) -> io::Result<()> {
        let kinds = [
            ("scripted, neither gives way", self.scripted),
            ("squeezed between the two", self.squeezed),
            ("pushed by what moves in", self.pushed),
            ("resting and others", self.resting),
        ];
        for (name, worst) in kinds {
            match worst {
                Some(WorstContact {
                    depth,
                    position: [x, y, z],
                    step,
                }) => writeln!(
                    out,
                    "deepest {name}: {:.2} mm at {x:.3},{y:.3},{z:.3} in step {step}",
                    1e3 * depth
                )?,
                None => writeln!(out, "deepest {name}: none")?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A hoof over the ground, and a body on it, then between the two: the depths are given.
    #[test]
    fn every_contact_is_of_its_kind() {
        let (mut bodies, mut colliders) = (RigidBodySet::new(), ColliderSet::new());
        let ground = colliders.insert(ColliderBuilder::ball(1.0));
        let mut with = |builder: RigidBodyBuilder| {
            let body = bodies.insert(builder);
            colliders.insert_with_parent(ColliderBuilder::ball(1.0), body, &mut bodies)
        };
        let hoof = with(RigidBodyBuilder::kinematic_velocity_based());
        let body = with(RigidBodyBuilder::dynamic());
        let contact = |collider1, collider2, normal, depth| CloudContact {
            collider1,
            collider2,
            point: Vec3::X * depth,
            normal,
            depth,
        };
        let worst = |depth: f32, step| {
            let position = [depth, 0.0, 0.0];
            Some(WorstContact {
                depth,
                position,
                step,
            })
        };
        let mut kinds = ContactKinds::default();
        let on_ground = contact(ground, body, Vec3::Y, 0.01);
        let stamped = contact(ground, hoof, Vec3::Y, 0.3);
        let still = |_: &CloudContact| false;
        kinds.count(1, &[on_ground, stamped], &bodies, &colliders, still);
        let gap = contact(ground, body, Vec3::Y, -0.01);
        kinds.count(2, &[gap], &bodies, &colliders, still);
        assert_eq!(
            (kinds.scripted, kinds.resting),
            (worst(0.3, 1), worst(0.01, 1))
        );
        assert_eq!(kinds.squeezed, None);
        // The hoof comes from above: its normal leads from the hoof down into the body.
        let under_hoof = contact(hoof, body, -Vec3::Y, 0.2);
        kinds.count(3, &[on_ground, under_hoof], &bodies, &colliders, still);
        assert_eq!(
            (kinds.squeezed, kinds.resting),
            (worst(0.2, 3), worst(0.01, 1))
        );
        assert_eq!(kinds.pushed, None);
        // Something comes from the side: the body is not only resting, wherever it touches.
        let from_side = contact(ground, body, Vec3::X, 0.1);
        let comes = |c: &CloudContact| c.normal == Vec3::X;
        kinds.count(4, &[on_ground, from_side], &bodies, &colliders, comes);
        assert_eq!(
            (kinds.pushed, kinds.resting),
            (worst(0.1, 4), worst(0.01, 1))
        );
    }
}
