//! From contact patches to rapier's manifolds.
//!
//! Rapier's solver keeps references into a pair's manifolds. A pair whose manifolds are rebuilt
//! must own a workspace, which tells rapier to rebuild those references
//! (`OUTCOME_FULL_COMPOSITE` in rapier3d's `narrow_phase/pair_update.rs`); without one, replacing
//! or removing manifolds corrupts the solver. So every call here leaves a [`ManifoldWorkspace`].

use crate::narrow_phase::part_patch::{PartPatch, share_planes};
use crate::narrow_phase::parts::{Comparison, PartPair, ShapePair, part};
use crate::narrow_phase::steady_gaps::Before;
use crate::step::measured::Measured;
use rapier3d::geometry::{ContactData, ContactManifold, ContactManifoldData};
use rapier3d::parry::query::details::{
    ContactManifoldsWorkspace, TypedWorkspaceData, WorkspaceData,
};
use rapier3d::parry::query::{DefaultQueryDispatcher, PersistentQueryDispatcher, TrackedContact};
use rapier3d::parry::shape::PackedFeatureId;
use tldi::PairResult;

/// A contact inherits the impulses of a near one of the step before if their normals agree within
/// this angle's cosine (26°): what matters is that the impulse pushes the same way. Half or twice
/// the angle: no row of any suite changes.
pub(super) const COS_SAME_NORMAL: f32 = 0.9;

/// Manifolds of the step before and memory for the next, kept by rapier for each pair.
#[derive(Clone, Default)]
struct ManifoldWorkspace {
    previous: Vec<ContactManifold>,
    measured: Option<Measured>,
    /// Scratch.
    patches: Vec<PartPatch>,
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
    let holds = measured.is_some_and(|measured| measured.holds(pair));
    if !holds {
        return false;
    }
    carry_over(manifolds, pair);
    true
}

/// Moves contacts, which are fixed to their bodies, to the relative pose of `pair`.
fn carry_over(manifolds: &mut [ContactManifold], pair: &ShapePair<'_>) {
    for manifold in manifolds {
        manifold.local_n2 = pair.pos12.rotation.inverse() * -manifold.local_n1;
        manifold.update_separations(&pair.pos12);
    }
}

/// Lets go of a pair that holds a cloud no longer. Rapier drops its workspace then, but keeps its manifolds: of several, it
/// would fill the first, and the others would touch for ever. It counts manifolds anew only of pairs with a workspace.
pub(crate) fn leave(
    manifolds: &mut Vec<ContactManifold>,
    workspace: &mut Option<ContactManifoldsWorkspace>,
) {
    match workspace {
        None if manifolds.len() > 1 => {
            manifolds.clear();
            *workspace = Some(ManifoldWorkspace::default().into());
        }
        Some(ours) if ours.0.is::<ManifoldWorkspace>() => *workspace = None,
        _ => (),
    }
}

/// Replaces a pair's manifolds by those of `parts`, whose comparisons have the results `results`, keeps their gaps from jumping,
/// and carries the impulses and user data of the step before over to the contacts nearest by. `measured` tells
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
    let last_measured = std::mem::replace(&mut workspace.measured, measured);
    let ManifoldWorkspace {
        previous, patches, ..
    } = workspace;
    std::mem::swap(manifolds, previous);
    let last_measured = last_measured.filter(|last| last.is_of_same_points(pair));
    if last_measured.is_some() {
        carry_over(previous, pair);
    }
    patches.clear();
    for part in parts {
        match &part.comparison {
            Some(comparison) => {
                let found = results[comparison.query].patches.iter();
                let found = found.filter(|patch| !patch.points.is_empty());
                patches.extend(found.map(|patch| PartPatch::of_clouds(part, comparison, patch)));
            }
            None => append_exact(pair, part, patches),
        }
    }
    if parts.len() > 1 {
        let scatters = comparisons(parts).map(|comparison| comparison.scatter);
        share_planes(patches, scatters.fold(0.0, f32::max));
    }
    let match_distances = comparisons(parts).map(Comparison::match_distance);
    let match_distance = match_distances.fold(pair.prediction, f32::max);
    // `manifolds` now holds those of two steps ago, of use for their memory only.
    manifolds.truncate(patches.len());
    manifolds.resize_with(patches.len(), ContactManifold::new);
    for (part_patch, manifold) in patches.iter().zip(&mut *manifolds) {
        write(part_patch, pair, manifold);
        if let (Some(last), Some(pixel_size)) = (last_measured, part_patch.pixel_size) {
            let before = Before {
                manifolds: previous,
                turned: last.turned(pair),
                match_distance,
                pixel_size,
            };
            before.steady(manifold, pair);
        }
    }
    inherit_user_data(manifolds, previous, match_distance);
    for manifold in manifolds {
        inherit_impulses(manifold, previous, match_distance);
    }
}

fn comparisons(parts: &[PartPair]) -> impl Iterator<Item = &Comparison> {
    parts.iter().filter_map(|part| part.comparison.as_ref())
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

/// Replaces `manifold` by that of a patch, with data that refers to nothing; its memory is kept.
fn write(part_patch: &PartPatch, pair: &ShapePair<'_>, manifold: &mut ContactManifold) {
    let PartPatch { indices, patch, .. } = part_patch;
    let mut solver_contacts = std::mem::take(&mut manifold.data.solver_contacts);
    solver_contacts.clear();
    manifold.data = ContactManifoldData::default();
    manifold.data.solver_contacts = solver_contacts;
    [manifold.subshape1, manifold.subshape2] = *indices;
    let pos21 = pair.pos12.inverse();
    manifold.local_n1 = patch.normal;
    manifold.local_n2 = pos21.rotation * -patch.normal;
    manifold.points.clear();
    manifold.points.extend(patch.points.iter().map(|point| {
        TrackedContact::new(
            point.point_a,
            pos21 * point.point_b,
            PackedFeatureId::UNKNOWN, // points of a cloud are no features
            PackedFeatureId::UNKNOWN,
            point.gap,
        )
    }));
}

/// Appends the contacts of two parts of which none is a cloud. Rapier's dispatcher knows all
/// such pairs of single shapes, and says so for those it does not, in which case there is none.
fn append_exact(pair: &ShapePair<'_>, parts: &PartPair, patches: &mut Vec<PartPatch>) {
    let mut found: Vec<ContactManifold> = Vec::new();
    let answer = DefaultQueryDispatcher.contact_manifolds(
        &parts.a_from_b,
        part(pair.shape1, parts.indices[0]).1,
        part(pair.shape2, parts.indices[1]).1,
        pair.prediction,
        &mut found,
        &mut None,
    );
    if answer.is_ok() {
        let found = found.iter().filter(|manifold| !manifold.points.is_empty());
        patches.extend(found.map(|manifold| PartPatch::of_exact(parts, manifold)));
    }
}

/// Hands the user data of the old manifolds to the new ones nearest to them. What hooks know of a manifold holds as long as
/// the pair touches in its place, whether the solver saw it and wherever its normal turns: so a one-way platform knows
/// a body that is on its way through.
fn inherit_user_data(
    manifolds: &mut [ContactManifold],
    previous: &[ContactManifold],
    match_distance: f32,
) {
    for manifold in manifolds {
        let mut points = manifold.points.iter();
        let nearest = points.find_map(|point| nearest(point, previous, match_distance, |_| true));
        if let Some((m, _)) = nearest {
            manifold.data.user_data = previous[m].data.user_data;
        }
    }
}

/// Hands the impulses of the old contacts to the new ones nearest to them, each at most once. Manifolds the solver did
/// not see (rapier solved clusters in their place, and matches those itself) have nothing to inherit.
fn inherit_impulses(
    manifold: &mut ContactManifold,
    previous: &mut [ContactManifold],
    match_distance: f32,
) {
    let normal = manifold.local_n1;
    let is_meant = |old: &ContactManifold| {
        !old.data.solver_contacts.is_empty() && old.local_n1.dot(normal) >= COS_SAME_NORMAL
    };
    for point in &mut manifold.points {
        if let Some((m, p)) = nearest(point, previous, match_distance, is_meant) {
            point.data = previous[m].points.swap_remove(p).data;
        }
    }
}

/// Which point of which old manifold is nearest to `point`, among those that are meant and within `match_distance`.
/// A contact stays put on at least one of the two shapes (both at rest, one when sliding), so the nearer of the two
/// distances counts.
pub(super) fn nearest(
    point: &TrackedContact<ContactData>,
    previous: &[ContactManifold],
    match_distance: f32,
    is_meant: impl Fn(&ContactManifold) -> bool,
) -> Option<(usize, usize)> {
    let mut nearest = None;
    let mut nearest_squared = match_distance * match_distance;
    for (m, old) in previous.iter().enumerate().filter(|(_, old)| is_meant(old)) {
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
    nearest
}
