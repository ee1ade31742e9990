//! What the pipeline and the dispatchers it handed to rapier share: the results of the batch, the
//! workspaces for pairs that are not in it, and the errors that rapier would drop.

use crate::narrow_phase::parts::{
    Hint, PartPair, ShapePair, append_part_pairs, append_queries, results_of,
};
use crate::step::measured::{Measured, rolls};
use crate::{TldiConfig, TldiError};
use rapier3d::dynamics::{RigidBodyHandle, RigidBodyVelocity};
use rapier3d::geometry::{ColliderHandle, SharedShape};
use rapier3d::math::{Pose, Vector};
use rapier3d::parry::shape::{Ball, Shape};
use std::collections::HashMap;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError, RwLock};
use tldi::{
    Backend, BackendError, ContactPatch, CpuBackend, Impact, ImpactQuery, PairQuery, PairResult,
    Room,
};

/// A distance that no other dispatcher gives.
pub(crate) const PROBE_ANSWER: f32 = -1.0;

/// What rapier asks about a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Question {
    /// Contacts up to this gap, metres.
    Contacts(f32),
    /// Whether the surfaces of a pair with a sensor cross.
    Crossing,
}

/// What the dispatcher sees of a pair: the question, the addresses of both shapes, and the relative pose,
/// bit by bit. A solid and a sensor that share a shape are told apart by the question.
#[derive(PartialEq, Eq, Hash)]
pub(crate) struct PairKey {
    /// Bits of the gap; of none for a crossing.
    contacts_up_to: Option<u32>,
    shapes: [usize; 2],
    pos12: [u32; 7],
}

/// What a shape is known by.
pub(crate) fn address(shape: &dyn Shape) -> usize {
    std::ptr::from_ref(shape).cast::<()>() as usize
}

impl PairKey {
    pub(crate) fn new(question: Question, shapes: [&dyn Shape; 2], pos12: &Pose) -> Self {
        let [x, y, z] = pos12.translation.to_array();
        let [i, j, k, w] = pos12.rotation.to_array();
        Self {
            contacts_up_to: match question {
                Question::Contacts(gap) => Some(gap.to_bits()),
                Question::Crossing => None,
            },
            shapes: shapes.map(address),
            pos12: [x, y, z, i, j, k, w].map(f32::to_bits),
        }
    }
}

/// Where a sweep holds a pair, in world space.
#[derive(Clone, Copy)]
pub(crate) struct Blocked {
    pub(crate) point: Vector,
    /// Unit normal from the first collider of the pair towards the second.
    pub(crate) normal: Vector,
}

/// A pair of the batch.
pub(crate) struct PreparedPair {
    pub(crate) colliders: [ColliderHandle; 2],
    /// Of the colliders.
    pub(crate) bodies: [Option<RigidBodyHandle>; 2],
    /// Whether one of these is a link of a multibody.
    pub(crate) has_link: bool,
    /// Of the colliders in world space.
    pub(crate) poses: [Pose; 2],
    /// What rapier is expected to ask.
    pub(crate) question: Question,
    /// Its parts, in [`Batch::parts`].
    pub(crate) parts: Range<usize>,
    /// Whether rapier asked for it and took this answer.
    pub(crate) used: AtomicBool,
    /// Where a sweep held it in this step, though its contacts let it go on.
    pub(crate) blocked: Mutex<Option<Blocked>>,
    /// Whether the user's hooks took all contacts of a manifold away in this step: sweeps let it through, too.
    pub(crate) is_let_through: AtomicBool,
    /// It is not compared: the manifolds that rapier has are expected to hold.
    pub(crate) is_kept: bool,
    /// The measurement that this is, or the earlier one that holds.
    pub(crate) measured: Option<Measured>,
    /// Keeps the shapes alive, so that no other can come to lie at their addresses, and shared, so
    /// that a change of theirs in place moves them to other ones.
    pub(crate) shapes: [SharedShape; 2],
}

#[cfg(test)]
impl PreparedPair {
    /// A pair without bodies that rapier asked for.
    pub(crate) fn without_bodies(
        colliders: [ColliderHandle; 2],
        shapes: [SharedShape; 2],
        poses: [Pose; 2],
        question: Question,
        parts: Range<usize>,
    ) -> Self {
        Self {
            colliders,
            bodies: [None; 2],
            has_link: false,
            poses,
            question,
            parts,
            used: AtomicBool::new(true),
            blocked: Mutex::default(),
            is_let_through: AtomicBool::new(false),
            is_kept: false,
            measured: None,
            shapes,
        }
    }
}

/// A pair that rapier asks no contacts of: a joint or the types of the bodies keep it apart.
pub(crate) struct Apart {
    pub(crate) shapes: [SharedShape; 2],
    /// Of the colliders in world space.
    pub(crate) poses: [Pose; 2],
}

/// The pairs of a step and their results.
#[derive(Default)]
pub(crate) struct Batch {
    /// The last pair with a key; the one before it is in `alike`.
    index: HashMap<PairKey, usize>,
    /// Of each pair the one before it with the same key.
    alike: Vec<Option<usize>>,
    pub(crate) pairs: Vec<PreparedPair>,
    pub(crate) apart: Vec<Apart>,
    pub(crate) parts: Vec<PartPair>,
    /// The result of query `k` is `results[k]`; there may be left-over ones behind.
    pub(crate) results: Vec<PairResult>,
    /// Of the bodies before the step.
    pub(crate) velocities: HashMap<RigidBodyHandle, RigidBodyVelocity<f32>>,
}

impl Batch {
    /// Forgets the pairs, keeping the memory.
    pub(crate) fn clear(&mut self) {
        self.index.clear();
        self.alike.clear();
        self.pairs.clear();
        self.apart.clear();
        self.parts.clear();
    }

    /// Appends a pair.
    pub(crate) fn push(&mut self, pair: PreparedPair, pos12: &Pose) {
        let key = PairKey::new(
            pair.question,
            [&*pair.shapes[0].0, &*pair.shapes[1].0],
            pos12,
        );
        self.alike.push(self.index.insert(key, self.pairs.len()));
        self.pairs.push(pair);
    }

    /// The error of the backend, with the colliders it is about.
    pub(crate) fn error(&self, source: BackendError) -> TldiError {
        let query_of_error = match &source {
            BackendError::Unsupported { pair, .. } => Some(*pair),
            _ => None,
        };
        let is_culprit = |part: &PartPair| {
            let query = part.comparison.as_ref().map(|c| c.query);
            query.is_some() && query == query_of_error
        };
        let culprit = self
            .pairs
            .iter()
            .find(|pair| self.parts[pair.parts.clone()].iter().any(is_culprit));
        match culprit {
            Some(pair) => TldiError::Pair {
                collider1: pair.colliders[0],
                collider2: pair.colliders[1],
                source,
            },
            None => TldiError::Batch {
                pairs: self.pairs.len(),
                source,
            },
        }
    }

    /// Forgets the measurements that do not outlive the step, once the results are there.
    pub(crate) fn expire(&mut self) {
        let (parts, results) = (&self.parts, &self.results);
        for pair in self.pairs.iter_mut().filter(|pair| !pair.is_kept) {
            pair.measured
                .take_if(|_| rolls(&parts[pair.parts.clone()], results));
        }
    }

    /// The pair with this key. Of several (bodies that share shapes and lie alike) the one of these bodies,
    /// which a pair's old manifolds tell, or else the first: without contacts so far, it answers for all.
    pub(crate) fn get(
        &self,
        key: &PairKey,
        bodies: Option<[Option<RigidBodyHandle>; 2]>,
    ) -> Option<&PreparedPair> {
        let alike = || {
            std::iter::successors(self.index.get(key).copied(), |&i| self.alike[i])
                .map(|i| &self.pairs[i])
        };
        let own = alike().find(|pair| Some(pair.bodies) == bodies);
        own.or_else(|| alike().last())
    }

    /// Pairs that are compared, and those whose earlier contacts hold.
    pub(crate) fn counts(&self) -> (usize, usize) {
        let kept = self.pairs.iter().filter(|pair| pair.is_kept).count();
        (self.pairs.len() - kept, kept)
    }

    /// Contact pixels of the pairs that rapier asked for.
    pub(crate) fn contact_pixels(&self) -> usize {
        let parts = self.used_parts();
        parts.map(|parts| count_pixels(parts, &self.results)).sum()
    }

    /// By how much pixels were made larger, the most of the pairs that rapier asked for.
    pub(crate) fn coarser_pixels(&self) -> Option<f32> {
        self.used_parts()
            .filter_map(|parts| coarser_pixels(parts, &self.results))
            .reduce(f32::max)
    }

    /// Parts of the pairs that rapier asked for.
    fn used_parts(&self) -> impl Iterator<Item = &[PartPair]> {
        let pairs = self.pairs.iter();
        let used = pairs.filter(|pair| pair.used.load(Ordering::Relaxed));
        used.map(|pair| &self.parts[pair.parts.clone()])
    }
}

fn count_pixels(parts: &[PartPair], results: &[PairResult]) -> usize {
    let results = results_of(parts, results);
    results.map(|result| result.contacts.len()).sum()
}

fn coarser_pixels(parts: &[PartPair], results: &[PairResult]) -> Option<f32> {
    let results = results_of(parts, results);
    results.filter_map(|result| result.coarser).reduce(f32::max)
}

/// A CPU backend and its memory, for one pair at a time.
#[derive(Default)]
pub(crate) struct Spot {
    backend: CpuBackend,
    pub(crate) parts: Vec<PartPair>,
    pub(crate) results: Vec<PairResult>,
}

/// Comparisons on the spot since the batch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SpotCounts {
    pub(crate) pairs: usize,
    pub(crate) contact_pixels: usize,
    /// By how much pixels were made larger, the most of them.
    pub(crate) coarser_pixels: Option<f32>,
}

/// State shared by a pipeline and its dispatchers.
pub(crate) struct Shared {
    config: TldiConfig,
    /// Mean radii of a pixel where a time budget decides, as bits of an `f32`.
    coarsening: AtomicU32,
    /// A shape that only this pipeline's dispatchers know, by its address: its distance to itself
    /// is [`PROBE_ANSWER`].
    pub(crate) probe: Ball,
    batch: RwLock<Batch>,
    /// Taken out while in use: no lock is held during a comparison.
    spots: Mutex<Vec<Spot>>,
    spot_pairs: AtomicUsize,
    spot_pixels: AtomicUsize,
    /// Bits of an `f32`, which are in the order of positive numbers; 0 where no pixels were made larger.
    spot_coarser: AtomicU32,
    failed: Mutex<Option<(usize, BackendError)>>,
}

impl Shared {
    pub(crate) fn new(config: TldiConfig) -> Self {
        Self {
            config,
            coarsening: AtomicU32::new(1.0f32.to_bits()),
            probe: Ball::new(1.0),
            batch: RwLock::default(),
            spots: Mutex::default(),
            spot_pairs: AtomicUsize::new(0),
            spot_pixels: AtomicUsize::new(0),
            spot_coarser: AtomicU32::new(0),
            failed: Mutex::default(),
        }
    }

    /// The settings for the pairs of this step.
    pub(crate) fn config(&self) -> TldiConfig {
        self.config.settled(self.coarsening())
    }

    fn coarsening(&self) -> f32 {
        f32::from_bits(self.coarsening.load(Ordering::Relaxed))
    }

    /// Lets the time that a batch took decide the pixels of the next one.
    pub(crate) fn took(&self, seconds: f64) {
        let next = self.config.resolution.coarsened(self.coarsening(), seconds);
        self.coarsening.store(next.to_bits(), Ordering::Relaxed);
    }

    pub(crate) fn batch(&self) -> std::sync::RwLockReadGuard<'_, Batch> {
        self.batch.read().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn batch_mut(&self) -> std::sync::RwLockWriteGuard<'_, Batch> {
        self.batch.write().unwrap_or_else(PoisonError::into_inner)
    }

    /// Compares a pair that is not in the batch and hands its parts and their results to `read`
    /// (none where it is out of reach). `None` if the comparison failed, which is kept for
    /// [`take_failures`](Self::take_failures).
    pub(crate) fn compare_on_the_spot<R>(
        &self,
        pair: ShapePair<'_>,
        config: &TldiConfig,
        read: impl FnOnce(&[PartPair], &[PairResult]) -> R,
    ) -> Option<R> {
        if !pair.is_within_reach() {
            return Some(read(&[], &[]));
        }
        self.spot_pairs.fetch_add(1, Ordering::Relaxed);
        self.on_the_spot(|spot| {
            spot.compare(pair, config, CpuBackend::compare)?;
            let pixels = count_pixels(&spot.parts, &spot.results);
            self.spot_pixels.fetch_add(pixels, Ordering::Relaxed);
            self.tell_coarser(coarser_pixels(&spot.parts, &spot.results));
            Ok(read(&spot.parts, &spot.results))
        })
    }

    /// Hands the contacts of a pair of parts on its way to `read`, which no batch could hold; `room` is that of the
    /// motion.
    pub(crate) fn contacts_on_the_way<R>(
        &self,
        pair: ShapePair<'_>,
        config: &TldiConfig,
        room: &mut Room,
        read: impl FnOnce(&[ContactPatch]) -> Option<R>,
    ) -> Option<R> {
        if !pair.is_within_reach() {
            return None;
        }
        self.on_the_spot(|spot| {
            spot.compare(pair, config, |backend, queries, results| {
                results.resize_with(queries.len(), PairResult::default);
                let mut pairs = queries.iter().zip(results);
                pairs.try_for_each(|(query, result)| backend.compare_within(query, room, result))
            })?;
            Ok(spot
                .results
                .first()
                .and_then(|result| read(&result.patches)))
        })
        .flatten()
    }

    /// The impact in a motion, whose pieces share `room`; `None` also if the comparison failed, which is kept for
    /// [`take_failures`](Self::take_failures).
    pub(crate) fn impact_on_the_spot(
        &self,
        query: &ImpactQuery,
        room: &mut Room,
    ) -> Option<Impact> {
        self.on_the_spot(|spot| spot.backend.impact_within(query, room))
            .flatten()
    }

    /// Keeps by how much pixels were made larger for [`take_spot_counts`](Self::take_spot_counts).
    pub(crate) fn tell_coarser(&self, coarser: Option<f32>) {
        if let Some(coarser) = coarser {
            self.spot_coarser
                .fetch_max(coarser.to_bits(), Ordering::Relaxed);
        }
    }

    fn on_the_spot<R>(&self, run: impl FnOnce(&mut Spot) -> Result<R, BackendError>) -> Option<R> {
        let mut spot = locked(&self.spots).pop().unwrap_or_default();
        let answer = run(&mut spot);
        locked(&self.spots).push(spot);
        answer.map_err(|error| self.fail(error)).ok()
    }

    /// Keeps an error for [`take_failures`](Self::take_failures).
    pub(crate) fn fail(&self, error: BackendError) {
        match &mut *locked(&self.failed) {
            Some((count, _)) => *count += 1,
            failed @ None => *failed = Some((1, error)),
        }
    }

    /// Comparisons on the spot since the last call.
    pub(crate) fn take_spot_counts(&self) -> SpotCounts {
        SpotCounts {
            pairs: self.spot_pairs.swap(0, Ordering::Relaxed),
            contact_pixels: self.spot_pixels.swap(0, Ordering::Relaxed),
            coarser_pixels: Some(self.spot_coarser.swap(0, Ordering::Relaxed))
                .filter(|&bits| bits > 0)
                .map(f32::from_bits),
        }
    }

    /// How many comparisons on the spot failed since the last call, and the first error.
    pub(crate) fn take_failures(&self) -> Option<(usize, BackendError)> {
        locked(&self.failed).take()
    }
}

pub(crate) fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Spot {
    /// Compares a pair by `run`; no part of it has a hint.
    pub(crate) fn compare(
        &mut self,
        pair: ShapePair<'_>,
        config: &TldiConfig,
        run: impl FnOnce(
            &mut CpuBackend,
            &[PairQuery],
            &mut Vec<PairResult>,
        ) -> Result<(), BackendError>,
    ) -> Result<(), BackendError> {
        let mut sides = Vec::new();
        self.parts.clear();
        append_part_pairs(pair, config, &mut self.parts, &mut sides, |_, _, _| {
            Hint::default()
        });
        let mut queries = Vec::with_capacity(sides.len());
        append_queries(&self.parts, &sides, &mut queries);
        run(&mut self.backend, &queries, &mut self.results)
    }
}
