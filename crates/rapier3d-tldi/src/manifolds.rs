//! From contact patches to rapier's manifolds.
//!
//! Rapier's solver keeps references into a pair's manifolds. A pair whose manifolds are rebuilt
//! must own a workspace, which tells rapier to rebuild those references
//! (`OUTCOME_FULL_COMPOSITE` in rapier3d's `narrow_phase/pair_update.rs`); without one, replacing
//! or removing manifolds corrupts the solver. So every call here leaves a [`ManifoldWorkspace`].

use crate::measured::Measured;
use crate::parts::{PartPair, ShapePair, part};
use rapier3d::geometry::{ContactManifold, ContactManifoldData};
use rapier3d::parry::query::details::{
    ContactManifoldsWorkspace, TypedWorkspaceData, WorkspaceData,
};
use rapier3d::parry::query::{DefaultQueryDispatcher, PersistentQueryDispatcher, TrackedContact};
use rapier3d::parry::shape::PackedFeatureId;
use tldi::{ContactPatch, PairResult};

/// A contact inherits the impulses of a near one of the step before if their normals agree within
/// this angle's cosine (26°): what matters is that the impulse pushes the same way.
const COS_SAME_NORMAL: f32 = 0.9;

/// Manifolds of the step before and memory for the next, kept by rapier for each pair.
#[derive(Clone, Default)]
struct ManifoldWorkspace {
    previous: Vec<ContactManifold>,
    measured: Option<Measured>,
}

impl WorkspaceData for ManifoldWorkspace {
    fn as_typed_workspace_data(&self) -> TypedWorkspaceData<'_> {
        TypedWorkspaceData::Custom
    }

    fn clone_dyn(&self) -> Box<dyn WorkspaceData> {
        Box::new(self.clone())
    }
}

/// Carries a pair's manifolds over to the relative pose of `pair` if they still hold there, and
/// returns whether they do.
pub(crate) fn keep(
    pair: &ShapePair<'_>,
    manifolds: &mut [ContactManifold],
    workspace: &mut Option<ContactManifoldsWorkspace>,
) -> bool {
    let measured = workspace_of(workspace).measured;
    let holds = measured.is_some_and(|measured| measured.holds(&pair.pos12, pair.prediction));
    if !holds {
        return false;
    }
    for manifold in manifolds {
        let mut a_from_b = pair.pos12;
        if let Some(pose2) = manifold.subshape_pos2() {
            a_from_b *= *pose2;
        }
        if let Some(pose1) = manifold.subshape_pos1() {
            a_from_b = pose1.inv_mul(&a_from_b);
        }
        manifold.local_n2 = a_from_b.rotation.inverse() * -manifold.local_n1;
        manifold.update_separations(&a_from_b);
    }
    true
}

/// Replaces a pair's manifolds by those of `parts`, whose comparisons have the results `results`,
/// and carries the impulses of the step before over to the contacts nearest by. `measured` tells
/// for how long they hold.
pub(crate) fn fill(
    pair: &ShapePair<'_>,
    measured: Option<Measured>,
    parts: &[PartPair],
    results: &[PairResult],
    manifolds: &mut Vec<ContactManifold>,
    workspace: &mut Option<ContactManifoldsWorkspace>,
) {
    let workspace = workspace_of(workspace);
    workspace.measured = measured;
    let previous = &mut workspace.previous;
    std::mem::swap(manifolds, previous);
    // `manifolds` now holds those of two steps ago, of use for their memory only.
    let mut filled = 0;
    for part_pair in parts {
        let first = filled;
        let match_distance = match &part_pair.comparison {
            Some(comparison) => {
                for patch in &results[comparison.query].patches {
                    if !patch.points.is_empty() {
                        write_patch(patch, part_pair, emptied(manifolds, filled));
                        filled += 1;
                    }
                }
                comparison.match_distance()
            }
            None => {
                manifolds.truncate(filled);
                append_exact(pair, part_pair, manifolds);
                filled = manifolds.len();
                pair.prediction
            }
        };
        for manifold in &mut manifolds[first..filled] {
            manifold.subshape1 = part_pair.parts[0];
            manifold.subshape2 = part_pair.parts[1];
            manifold.set_subshape_pos1(part_pair.poses[0]);
            manifold.set_subshape_pos2(part_pair.poses[1]);
            inherit_impulses(manifold, previous, match_distance);
        }
    }
    manifolds.truncate(filled);
}

/// The pair's workspace; a new one where it has none of ours.
fn workspace_of(workspace: &mut Option<ContactManifoldsWorkspace>) -> &mut ManifoldWorkspace {
    let ours = workspace
        .as_ref()
        .is_some_and(|workspace| workspace.0.is::<ManifoldWorkspace>());
    if !ours {
        *workspace = None;
    }
    workspace
        .get_or_insert_with(|| ManifoldWorkspace::default().into())
        .0
        .downcast_mut()
        .expect("replaced above unless it is one")
}

/// The manifold with this index, appended if there are just so many, without points and with data
/// that refers to nothing; its memory is kept.
fn emptied(manifolds: &mut Vec<ContactManifold>, index: usize) -> &mut ContactManifold {
    if index == manifolds.len() {
        manifolds.push(ContactManifold::new());
    }
    let manifold = &mut manifolds[index];
    manifold.points.clear();
    let mut solver_contacts = std::mem::take(&mut manifold.data.solver_contacts);
    solver_contacts.clear();
    manifold.data = ContactManifoldData::default();
    manifold.data.solver_contacts = solver_contacts;
    manifold
}

fn write_patch(patch: &ContactPatch, pair: &PartPair, manifold: &mut ContactManifold) {
    let b_from_a = pair.a_from_b.inverse();
    manifold.local_n1 = patch.normal;
    manifold.local_n2 = b_from_a.rotation * -patch.normal;
    manifold.points.extend(patch.points.iter().map(|point| {
        TrackedContact::new(
            point.point_a,
            b_from_a * point.point_b,
            PackedFeatureId::UNKNOWN, // points of a cloud are no features
            PackedFeatureId::UNKNOWN,
            point.gap,
        )
    }));
}

/// Appends rapier's own manifolds for two parts of which none is a cloud. Its dispatcher knows all
/// such pairs of single shapes, and says so for those it does not, in which case there is none.
fn append_exact(pair: &ShapePair<'_>, parts: &PartPair, manifolds: &mut Vec<ContactManifold>) {
    let mut found: Vec<ContactManifold> = Vec::new();
    let answer = DefaultQueryDispatcher.contact_manifolds(
        &parts.a_from_b,
        part(pair.shape1, parts.parts[0]).1,
        part(pair.shape2, parts.parts[1]).1,
        pair.prediction,
        &mut found,
        &mut None,
    );
    if answer.is_ok() {
        manifolds.extend(found.into_iter().filter(|m| !m.points.is_empty()));
    }
}

/// Hands the impulses of the old contacts to the new ones nearest to them, each at most once.
///
/// A contact stays put on at least one of the two shapes (both at rest, one when sliding), so the
/// nearer of the two distances counts. Manifolds the solver did not see (rapier solved clusters in
/// their place, and matches those itself) have nothing to inherit.
fn inherit_impulses(
    manifold: &mut ContactManifold,
    previous: &mut [ContactManifold],
    match_distance: f32,
) {
    let normal = manifold.local_n1;
    let subshapes = [manifold.subshape1, manifold.subshape2];
    let mut inherits_user_data = true;
    for point in &mut manifold.points {
        let mut nearest = None;
        let mut nearest_squared = match_distance * match_distance;
        for (m, old) in previous.iter().enumerate() {
            if [old.subshape1, old.subshape2] != subshapes
                || old.data.solver_contacts.is_empty()
                || old.local_n1.dot(normal) < COS_SAME_NORMAL
            {
                continue;
            }
            for (p, old_point) in old.points.iter().enumerate() {
                let squared = old_point
                    .local_p1
                    .distance_squared(point.local_p1)
                    .min(old_point.local_p2.distance_squared(point.local_p2));
                if squared < nearest_squared {
                    nearest = Some((m, p));
                    nearest_squared = squared;
                }
            }
        }
        if let Some((m, p)) = nearest {
            let old = &mut previous[m];
            point.data = old.points.swap_remove(p).data;
            if std::mem::take(&mut inherits_user_data) {
                manifold.data.user_data = old.data.user_data;
            }
        }
    }
}
