//! What passes through clouds, and that a pipeline says so once for each collider.

use crate::narrow_phase::parts::{has_cloud, has_surface, part, part_count};
use crate::step::candidates::Candidate;
use crate::{Passes, TldiError};
use rapier3d::geometry::{Collider, ColliderHandle, ColliderSet};

/// Why the collider passes through clouds, if it does.
fn passes(collider: &Collider) -> Option<Passes> {
    let shape = collider.shape();
    let mut parts = (0..part_count(shape)).map(|i| part(shape, i).1);
    if collider.deformable_mesh_ref().is_some() {
        return Some(Passes::SoftBody);
    }
    (!parts.all(has_surface)).then_some(Passes::Line)
}

/// The colliders that were already reported to pass.
#[derive(Default)]
pub(crate) struct Told {
    colliders: Vec<ColliderHandle>,
    /// Not returned yet.
    next: Option<TldiError>,
}

impl Told {
    /// Looks for the first candidate that passes and was not reported so far.
    pub(crate) fn look_for_passing(&mut self, candidates: &[Candidate], colliders: &ColliderSet) {
        self.colliders.retain(|&known| colliders.contains(known));
        let passing = |[collider, other]: [ColliderHandle; 2]| {
            let reason = passes(colliders.get(collider)?)?;
            let is_new =
                has_cloud(colliders.get(other)?.shape()) && !self.colliders.contains(&collider);
            is_new.then_some(TldiError::PassesThrough {
                collider,
                cloud: other,
                reason,
            })
        };
        let mut meeting = candidates.iter().filter(|candidate| !candidate.is_apart);
        self.next = meeting.find_map(|candidate| {
            let Candidate {
                collider1: c1,
                collider2: c2,
                ..
            } = *candidate;
            passing([c1, c2]).or_else(|| passing([c2, c1]))
        });
    }

    /// The report, once for each collider.
    pub(crate) fn take(&mut self) -> Result<(), TldiError> {
        let Some(error) = self.next.take() else {
            return Ok(());
        };
        if let TldiError::PassesThrough { collider, .. } = error {
            self.colliders.push(collider);
        }
        Err(error)
    }
}
