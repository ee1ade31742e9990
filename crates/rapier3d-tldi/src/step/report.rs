//! What a step did, and the contacts it left.

use crate::narrow_phase::parts::has_cloud;
use rapier3d::geometry::{ColliderHandle, ColliderSet, ContactPair, NarrowPhase};
use rapier3d::math::Vector;
use std::sync::Arc;
use tldi::Backend;

/// What one step of a [`TldiPipeline`](crate::TldiPipeline) did.
///
/// ```
#[doc = example_world!()]
/// // A ball is 1 cm deep in a scan.
/// let report = tldi.step(&mut world)?;
/// assert_eq!((report.pairs_batched, report.pairs_missed), (1, 0));
/// assert_eq!(report.pairs_in_contact, 1);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct StepReport {
    /// Pairs of colliders that were compared in one batch before the step.
    pub pairs_batched: usize,
    /// Pairs that are expected to keep their contacts of an earlier step
    /// ([`TldiConfig::scatter`](crate::TldiConfig::scatter)).
    pub pairs_kept: usize,
    /// Pairs that rapier asked for and the batch did not hold. Their poses or shapes changed after
    /// it, or rapier split the step. They were compared at once, one by one.
    pub pairs_missed: usize,
    /// Pairs with a cloud that rapier has in contact, that is, closer than its prediction distance.
    /// Sleeping pairs count.
    pub pairs_in_contact: usize,
    /// Pixels in which surfaces were close or penetrated, over the pairs that were compared and
    /// that rapier asked for.
    pub contact_pixels: usize,
    /// The largest factor by which the pixels of a pair exceed [`Resolution`](crate::Resolution),
    /// over all pairs that were compared and that rapier asked for. Deep contacts and coarse places
    /// need no smaller pixels, and widely strewn points leave no room for them
    /// ([`PairResult::coarser`](tldi::PairResult::coarser)). Casts and sweeps count, too. `None` if all pixels have the size
    /// that was asked for.
    pub coarser_pixels: Option<f32>,
    /// Deepest penetration before the step over all contacts of clouds, sleeping ones included, in
    /// metres; 0 without any.
    pub max_penetration: f32,
    /// Wall-clock time from the search for candidate pairs to the results of the batch.
    pub prepare_seconds: f64,
    /// Name of the backend that compared the batch: "cpu", "gpu", …
    pub backend: Arc<str>,
    /// Name of the device that compared it, where it was not the CPU.
    pub adapter: Option<Arc<str>>,
    /// Why the CPU compared the batch although a GPU was wanted: there is none, or it failed.
    /// Nothing is lost.
    pub fallback: Option<Arc<str>>,
}

/// What compared a batch of pairs.
#[derive(Clone, Default)]
pub(crate) struct ComparedBy {
    pub(crate) backend: Arc<str>,
    pub(crate) adapter: Option<Arc<str>>,
    pub(crate) fallback: Option<Arc<str>>,
}

impl ComparedBy {
    /// What `backend` says of its last batch. Allocates only where that changes.
    pub(crate) fn update(&mut self, backend: &dyn Backend) {
        if *self.backend != *backend.name() {
            self.backend = backend.name().into();
        }
        for (own, new) in [
            (&mut self.adapter, backend.adapter()),
            (&mut self.fallback, backend.fallback()),
        ] {
            if own.as_deref() != new {
                *own = new.map(Arc::from);
            }
        }
    }
}

/// A contact point between two colliders, at least one of which holds a cloud.
///
/// ```
#[doc = example_world!()]
/// // A ball is 1 cm deep in a scan.
/// tldi.step(&mut world)?;
/// for contact in tldi.contacts(&world.narrow_phase, &world.colliders) {
///     // Below the ball, to within the radius of a point.
///     assert!(contact.point.distance(Vector::new(1.0, 0.0, 1.0)) < 0.1, "{}", contact.point);
///     assert!(contact.normal.y.abs() > 0.99, "{}", contact.normal);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// The collider with the lower index.
    pub collider1: ColliderHandle,
    /// The other collider.
    pub collider2: ColliderHandle,
    /// Middle between the two surfaces, in world space, metres.
    pub point: Vector,
    /// Unit normal from the first collider towards the second, in world space.
    pub normal: Vector,
    /// Penetration depth in metres; negative: gap.
    pub depth: f32,
}

/// The contact pairs with a cloud.
pub(crate) fn cloud_pairs<'a>(
    narrow_phase: &'a NarrowPhase,
    colliders: &'a ColliderSet,
) -> impl Iterator<Item = &'a ContactPair> {
    let is_cloud = |handle| {
        colliders
            .get(handle)
            .is_some_and(|collider| has_cloud(collider.shape()))
    };
    narrow_phase
        .contact_pairs()
        .filter(move |pair| is_cloud(pair.collider1) || is_cloud(pair.collider2))
}

/// The contact points of a pair.
pub(crate) fn contacts_of<'a>(
    pair: &'a ContactPair,
    colliders: &'a ColliderSet,
) -> impl Iterator<Item = Contact> {
    let poses = colliders
        .get(pair.collider1)
        .zip(colliders.get(pair.collider2))
        .map(|(collider1, collider2)| (*collider1.position(), *collider2.position()));
    poses.into_iter().flat_map(move |(pose1, pose2)| {
        pair.manifolds().iter().flat_map(move |manifold| {
            manifold.points.iter().map(move |point| Contact {
                collider1: pair.collider1,
                collider2: pair.collider2,
                point: (pose1 * point.local_p1).midpoint(pose2 * point.local_p2),
                normal: pose1.rotation * manifold.local_n1,
                depth: -point.dist,
            })
        })
    })
}
