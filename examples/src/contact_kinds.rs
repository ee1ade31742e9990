//! The deepest contacts of a run by what may help against them.

use rapier3d::prelude::*;
use rapier3d_tldi::prelude::CloudContact;
use serde::Serialize;
use std::collections::HashSet;
use std::io::{self, Write};
use tldi::glamx::Vec3;

/// Cosine between two pushes on a body from which on it is held between them (120°).
const OPPOSED: f32 = -0.5;

/// What may help against the depth of a contact.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Between two things neither of which gives way, such as a hoof on a scripted path and the ground. It is as
    /// deep as the script says.
    Scripted,
    /// Of a body that has no room: things that do not give way push it from opposite sides in the same
    /// step.
    Squeezed,
    /// Of a body that what does not give way moves into, such as what comes into the view of a depth camera: it is
    /// as deep as the way that it moved, less what the body gave way. It is that until the body is out again.
    Pushed,
    /// Any other, which the solver answers for.
    Resting,
}

/// Something for each kind of contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ByKind<T> {
    /// See [`Kind::Scripted`].
    pub scripted: T,
    /// See [`Kind::Squeezed`].
    pub squeezed: T,
    /// See [`Kind::Pushed`].
    pub pushed: T,
    /// See [`Kind::Resting`].
    pub resting: T,
}

impl<T: Copy> ByKind<T> {
    /// What is for each kind, and its name.
    pub(crate) fn each(&self) -> [(&'static str, T); 4] {
        [
            ("scripted", self.scripted),
            ("squeezed", self.squeezed),
            ("pushed", self.pushed),
            ("resting", self.resting),
        ]
    }

    /// What is for contacts of a kind.
    pub fn of(&mut self, kind: Kind) -> &mut T {
        match kind {
            Kind::Scripted => &mut self.scripted,
            Kind::Squeezed => &mut self.squeezed,
            Kind::Pushed => &mut self.pushed,
            Kind::Resting => &mut self.resting,
        }
    }
}

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
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct ContactKinds {
    /// The deepest of each kind.
    #[serde(flatten)]
    pub deepest: ByKind<Option<WorstContact>>,
    /// Bodies that something moved into and that are not out again.
    #[serde(skip)]
    inside: HashSet<ColliderHandle>,
}

impl ContactKinds {
    /// Counts the contacts of a step. `moved_in` says of a contact with what does not give way whether it has moved to
    /// where it touches. A body is out again when no contact of it is deeper than what rapier leaves
    /// (`allowed_linear_error`). Gives the kind of each contact.
    pub fn count(
        &mut self,
        step: usize,
        contacts: &[CloudContact],
        world: &PhysicsWorld,
        moved_in: impl Fn(&CloudContact) -> bool,
    ) -> Vec<Kind> {
        let gives_way = |collider: ColliderHandle| {
            let parent = world.colliders.get(collider).and_then(Collider::parent);
            let body = parent.and_then(|parent| world.bodies.get(parent));
            body.is_some_and(RigidBody::is_dynamic)
        };
        // Contacts of bodies with what does not give way, and where to that pushes them.
        let pushes: Vec<(ColliderHandle, Vec3, &CloudContact)> = (contacts.iter())
            .filter(|contact| contact.depth > 0.0)
            .filter_map(|c| match [c.collider1, c.collider2].map(gives_way) {
                [false, true] => Some((c.collider2, c.normal, c)),
                [true, false] => Some((c.collider1, -c.normal, c)),
                _ => None,
            })
            .collect();
        let left = world.integration_parameters.allowed_linear_error();
        let is_deep = |push: &&(ColliderHandle, Vec3, &CloudContact)| push.2.depth > left;
        let still_deep: HashSet<ColliderHandle> =
            (pushes.iter().filter(is_deep)).map(|push| push.0).collect();
        self.inside.retain(|body| still_deep.contains(body));
        let comes = pushes.iter().filter(|push| moved_in(push.2));
        self.inside.extend(comes.map(|push| push.0));
        let own = |body: ColliderHandle| pushes.iter().filter(move |push| push.0 == body);
        let is_squeezed = |body| own(body).any(|a| own(body).any(|b| a.1.dot(b.1) < OPPOSED));
        let kind_of = |contact: &CloudContact| {
            let pair = [contact.collider1, contact.collider2];
            if !pair.into_iter().any(gives_way) {
                Kind::Scripted
            } else if pair.into_iter().any(is_squeezed) {
                Kind::Squeezed
            } else if pair.iter().any(|body| self.inside.contains(body)) {
                Kind::Pushed
            } else {
                Kind::Resting
            }
        };
        let kinds: Vec<Kind> = contacts.iter().map(kind_of).collect();
        for (contact, kind) in contacts.iter().zip(&kinds) {
            let worst = self.deepest.of(*kind);
            if contact.depth > worst.map_or(0.0, |worst| worst.depth) {
                *worst = Some(WorstContact {
                    depth: contact.depth,
                    position: contact.point.to_array(),
                    step,
                });
            }
        }
        kinds
    }

    /// Writes a line for each kind, for people.
    pub(crate) fn write_lines(&self, out: &mut dyn Write) -> io::Result<()> {
        let more = [
            ", neither gives way",
            " between the two",
            " by what moves in",
            " and others",
        ];
        for ((name, worst), more) in self.deepest.each().into_iter().zip(more) {
            match worst {
                Some(WorstContact {
                    depth,
                    position: [x, y, z],
                    step,
                }) => writeln!(
                    out,
                    "deepest {name}{more}: {:.2} mm at {x:.3},{y:.3},{z:.3} in step {step}",
                    1e3 * depth
                )?,
                None => writeln!(out, "deepest {name}{more}: none")?,
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
        let mut world = PhysicsWorld::default();
        let ground = world.colliders.insert(ColliderBuilder::ball(1.0));
        let mut with = |builder| world.insert(builder, ColliderBuilder::ball(1.0)).1;
        let hoof = with(RigidBodyBuilder::kinematic_velocity_based());
        let body = with(RigidBodyBuilder::dynamic());
        let contact = |collider1, collider2, normal, depth| CloudContact {
            collider1,
            collider2,
            point: Vec3::X * depth,
            normal,
            depth,
        };
        // By steps: contacts, whether what comes from the side has just moved there, and the deepest since then: scripted,
        // squeezed, pushed and resting, each with its step.
        let on_ground = contact(ground, body, Vec3::Y, 0.01);
        let stamped = contact(ground, hoof, Vec3::Y, 0.3);
        let gap = contact(ground, body, Vec3::Y, -0.01);
        // The hoof comes from above: its normal leads from the hoof down into the body.
        let under_hoof = contact(hoof, body, -Vec3::Y, 0.2);
        // Something comes from the side: the body is not only resting, wherever it touches.
        let from_side = contact(ground, body, Vec3::X, 0.1);
        // What came stands still, and the body is still inside, even deeper: it is not resting yet.
        let deeper = contact(ground, body, Vec3::X, 0.12);
        // It is out when all that is left is what rapier leaves, a millimetre, and rests from then on.
        let left = contact(ground, body, Vec3::Y, 0.0009);
        let again = contact(ground, body, Vec3::Y, 0.02);
        let (stamp, rest) = (Some((0.3, 1)), Some((0.01, 1)));
        let (squeeze, push) = (Some((0.2, 3)), Some((0.12, 5)));
        let steps = [
            (vec![on_ground, stamped], false, [stamp, None, None, rest]),
            (vec![gap], false, [stamp, None, None, rest]),
            (
                vec![on_ground, under_hoof],
                false,
                [stamp, squeeze, None, rest],
            ),
            (
                vec![on_ground, from_side],
                true,
                [stamp, squeeze, Some((0.1, 4)), rest],
            ),
            (vec![on_ground, deeper], false, [stamp, squeeze, push, rest]),
            (vec![left], false, [stamp, squeeze, push, rest]),
            (vec![again], false, [stamp, squeeze, push, Some((0.02, 7))]),
        ];
        let mut kinds = ContactKinds::default();
        for (k, (contacts, has_moved, expected)) in steps.into_iter().enumerate() {
            let moved_in = |c: &CloudContact| has_moved && c.normal == Vec3::X;
            kinds.count(k + 1, &contacts, &world, moved_in);
            let found = kinds.deepest.each().map(|(_, worst)| worst);
            let told = found.map(|worst| worst.map(|worst| (worst.depth, worst.step)));
            assert_eq!(told, expected, "step {}", k + 1);
            let mut places = found.into_iter().flatten();
            assert!(places.all(|w| w.position == [w.depth, 0.0, 0.0]));
        }
    }
}
