//! The pipeline: a batch of comparisons, then rapier's step.

mod attaching;
mod surfaces;

use crate::corrections::rolling::move_to_mid_step;
use crate::corrections::surface_motion::SurfaceMotions;
use crate::corrections::surface_push;
use crate::narrow_phase::parts::append_queries;
use crate::narrow_phase::passing::Told;
use crate::shape::exact::ExactShape;
use crate::step::batching::BatchSource;
use crate::step::candidates::{CandidateSearch, Joints};
use crate::step::pair_memory::PairMemory;
use crate::step::prepared::Shared;
use crate::step::report::{ComparedBy, cloud_pairs, contacts_of};
use crate::{Contact, PointCloudShape, StepReport, TldiConfig, TldiError, cloud_collider};
use rapier3d::dynamics::{ImpulseJointSet, IntegrationParameters, MultibodyJointSet, RigidBodySet};
use rapier3d::geometry::{ColliderBuilder, ColliderHandle, ColliderSet, NarrowPhase};
use rapier3d::math::Vector;
use rapier3d::pipeline::{EventHandler, PhysicsHooks, PhysicsWorld};
use std::sync::Arc;
use tldi::{Backend, PairQuery, PointCloud};
use web_time::Instant;

/// Finds the contacts of point clouds for one physics world.
///
/// Before each of rapier's steps the pairs of colliders that may touch and of which one is a cloud
/// are compared in one batch ([`prepare`](Self::prepare)); rapier then finds the results through
/// the dispatcher that [`attach`](Self::attach) installs. [`step`](Self::step) prepares, steps rapier and finishes.
///
/// Several worlds may be attached to one pipeline if each is prepared, stepped and finished before
/// the next is prepared, and if no surface changes; a pipeline for each remembers more (the view axes of its pairs, and the
/// speeds of surfaces, by the handles of colliders).
///
/// ```
#[doc = example_scan!()]
/// let mut world = PhysicsWorld::default();
/// let mut tldi = TldiPipeline::new(TldiConfig::default())?;
/// tldi.attach(&mut world);
/// world.insert(RigidBodyBuilder::fixed(), tldi.collider(scan));
/// let ball = RigidBodyBuilder::dynamic().translation(Vector::new(1.0, 0.3, 1.0));
/// let (ball, _) = world.insert(ball, ColliderBuilder::ball(0.2));
/// for _ in 0..60 {
///     tldi.step(&mut world)?; // in place of `world.step()`
/// }
/// assert!((world.bodies[ball].translation().y - 0.2).abs() < 0.01);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct TldiPipeline {
    backend: Box<dyn Backend>,
    compared_by: ComparedBy,
    shared: Arc<Shared>,
    search: CandidateSearch,
    memory: PairMemory,
    changed: Vec<ColliderHandle>,
    told: Told,
    motions: SurfaceMotions,
    sides: Vec<[ExactShape<'static>; 2]>,
    queries: Vec<PairQuery<'static>>,
    prepare_seconds: f64,
}

impl TldiPipeline {
    /// A pipeline on the CPU; with the feature `gpu`, on a hardware GPU where there is one and a
    /// batch is large enough to gain from it (or what the variable `TLDI_BACKEND` asks for: `auto`,
    /// `cpu` or `gpu`).
    ///
    /// # Errors
    /// [`TldiError::BadConfig`], [`TldiError::NoBackend`] where `TLDI_BACKEND` asks for what is not
    /// there.
    ///
    /// ```
    /// # use rapier3d_tldi::prelude::*;
    /// assert!(TldiPipeline::new(TldiConfig::default()).is_ok());
    /// let error = TldiPipeline::new(TldiConfig { scatter: -1.0, ..TldiConfig::default() }).err();
    /// assert!(matches!(error, Some(TldiError::BadConfig { setting: "scatter", .. })));
    /// ```
    pub fn new(config: TldiConfig) -> Result<Self, TldiError> {
        #[cfg(feature = "gpu")]
        let backend = tldi_wgpu::BackendChoice::Auto
            .open()
            .map_err(|source| TldiError::NoBackend(source.into()))?;
        #[cfg(not(feature = "gpu"))]
        let backend = Box::new(tldi::CpuBackend::new());
        Self::with_backend(config, backend)
    }

    /// A pipeline whose batches `backend` compares. Pairs that are not in the batch are always
    /// compared on the CPU.
    ///
    /// # Errors
    /// [`TldiError::BadConfig`].
    ///
    /// ```
    /// # use rapier3d_tldi::prelude::*;
    /// use rapier3d_tldi::tldi::CpuBackend;
    /// let tldi = TldiPipeline::with_backend(TldiConfig::default(), Box::new(CpuBackend::new()))?;
    /// # Ok::<(), TldiError>(())
    /// ```
    pub fn with_backend(config: TldiConfig, backend: Box<dyn Backend>) -> Result<Self, TldiError> {
        Ok(Self {
            compared_by: ComparedBy::default(),
            backend,
            shared: Arc::new(Shared::new(config.validated()?)),
            search: CandidateSearch::default(),
            memory: PairMemory::default(),
            changed: Vec::new(),
            told: Told::default(),
            motions: SurfaceMotions::default(),
            sides: Vec::new(),
            queries: Vec::new(),
            prepare_seconds: 0.0,
        })
    }

    /// A collider for a cloud; see [`cloud_collider`]. For several bodies of one cloud, make one
    /// [`PointCloudShape`] and give each a clone.
    ///
    /// ```
    #[doc = example_scan!()]
    /// let tldi = TldiPipeline::new(TldiConfig::default())?;
    /// let mut world = PhysicsWorld::default();
    /// world.insert(RigidBodyBuilder::fixed(), tldi.collider(scan).friction(0.8));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn collider(&self, cloud: PointCloud<'static>) -> ColliderBuilder {
        cloud_collider(PointCloudShape::new(cloud))
    }

    /// Compares the pairs that rapier is going to ask about in its next step, in one batch.
    ///
    /// The arguments are those of the [`PhysicsPipeline::step`](rapier3d::pipeline::PhysicsPipeline)
    /// that follows. What is changed in between is compared on the spot. After the step, call
    /// [`finish`](Self::finish). Queries of your own that failed since the last step are reported in the [`log`], and
    /// fail no step.
    ///
    /// # Errors
    /// [`TldiError::BadConfig`] if the time step is negative or not finite, and [`TldiError::Pair`] or
    /// [`TldiError::Batch`] if the backend fails; the step should not be taken then.
    ///
    /// ```
    #[doc = example_world!()]
    /// // What `step` does, one call after the other.
    /// let integration = world.integration_parameters;
    /// let (bodies, colliders) = (&world.bodies, &world.colliders);
    /// let joints = (&world.impulse_joints, &world.multibody_joints);
    /// tldi.prepare(world.gravity, &integration, bodies, colliders, joints.0, joints.1)?;
    /// tldi.push(&mut world.bodies, &world.colliders, &integration, &());
    /// world.step_with_events(&tldi.hooks(&()), &()); // your own hooks and events
    /// let report = tldi.finish(&mut world.bodies, &world.narrow_phase, &world.colliders)?;
    /// assert_eq!((report.pairs_batched, report.pairs_missed), (1, 0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn prepare(
        &mut self,
        gravity: Vector,
        integration: &IntegrationParameters,
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
        impulse_joints: &ImpulseJointSet,
        multibody_joints: &MultibodyJointSet,
    ) -> Result<(), TldiError> {
        TldiError::check_dt(integration.dt)?;
        let start = Instant::now();
        let shared = Arc::clone(&self.shared);
        shared.take_spot_counts();
        if let Some((count, first)) = shared.take_failures() {
            log::warn!("{count} comparisons outside of a step failed; the first: {first}");
        }
        self.motions.prepare(integration, bodies, colliders);
        // Taken out and put back: no lock is held during the comparison.
        let mut batch = std::mem::take(&mut *shared.batch_mut());
        batch.clear();
        let joints = Joints {
            impulse: impulse_joints,
            multibody: multibody_joints,
        };
        let candidates = (self.search).find(bodies, colliders, &joints, integration, &self.changed);
        self.told.look_for_passing(candidates, colliders);
        let config = shared.config();
        let source = BatchSource {
            gravity,
            integration,
            bodies,
            colliders,
            config: &config,
            memory: &self.memory,
            changed: &self.changed,
        };
        let mut sides = emptied(std::mem::take(&mut self.sides));
        for candidate in candidates.iter().filter(|candidate| !candidate.asleep) {
            source.push_pair(candidate, &mut batch, &mut sides);
        }

        let mut queries = emptied(std::mem::take(&mut self.queries));
        append_queries(&batch.parts, &sides, &mut queries);
        let outcome = self.backend.compare(&queries, &mut batch.results);
        self.compared_by.update(&*self.backend);
        let error = outcome.err().map(|source| batch.error(source));
        self.queries = emptied(queries);
        self.sides = emptied(sides);
        if error.is_some() {
            batch.clear();
        } else {
            batch.expire();
            batch.note_velocities(bodies);
            move_to_mid_step(&mut batch, bodies, colliders, integration.dt);
            self.changed.clear();
        }
        *shared.batch_mut() = batch;
        self.prepare_seconds = start.elapsed().as_secs_f64();
        shared.took(self.prepare_seconds);
        error.map_or(Ok(()), Err)
    }

    /// Between [`prepare`](Self::prepare) and the step: gives bodies in the way of surfaces that
    /// close faster than rapier undoes penetrations (half of
    /// [`IntegrationParameters::max_corrective_velocity`], 1.5 m/s in a world of human size) the
    /// velocity of the surface, as an inelastic impact would. [`step`](Self::step) does so.
    ///
    /// The velocity of clouds that [`deform`](Self::deform) is known, that of clouds with [new points](Self::set_points) is
    /// measured along the normal of the contact. Cost: for each contact of such a cloud a pass over the points in the blocks
    /// around it.
    ///
    /// A surface pushes what rapier's solver lets it push: no bodies that
    /// [dominate](rapier3d::dynamics::RigidBody::dominance_group), no sensors, no colliders whose solver groups exclude each
    /// other, and what `filter_contact_pair` of your hooks lets it, which is asked here once more in each step. What
    /// `modify_solver_contacts` will do is not known yet. Links of multibodies and bodies with locked translations are not
    /// pushed: rapier corrects their penetration, at up to 3 m/s.
    ///
    /// ```
    #[doc = example_world!()]
    /// let risen: Vec<Vector> = points.iter().map(|p| *p + 0.05 * Vector::Y).collect(); // 3 m/s
    /// tldi.deform(&mut world, scan, &risen, None)?;
    /// let integration = world.integration_parameters;
    /// let (bodies, colliders) = (&world.bodies, &world.colliders);
    /// let joints = (&world.impulse_joints, &world.multibody_joints);
    /// tldi.prepare(world.gravity, &integration, bodies, colliders, joints.0, joints.1)?;
    /// tldi.push(&mut world.bodies, &world.colliders, &integration, &());
    /// assert!(world.bodies[ball].linvel().y >= 3.0, "as fast as the surface, or a little faster");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn push(
        &mut self,
        bodies: &mut RigidBodySet,
        colliders: &ColliderSet,
        integration: &IntegrationParameters,
        hooks: &dyn PhysicsHooks,
    ) {
        self.motions.pushed = surface_push::push(
            &self.motions,
            &self.shared.batch(),
            bodies,
            colliders,
            integration,
            hooks,
        );
    }

    /// Closes a step: what it did, and what failed inside it. Give it the sets of the step. Bodies that rebound do so at all
    /// their contact points at once. Fast bodies
    /// that are deep in contact, and that a sweep (CCD) held at a surface which no contact faces, lose the
    /// velocity into it.
    ///
    /// # Errors
    /// [`TldiError::NotAttached`], [`TldiError::OnTheSpot`] where comparisons inside the step
    /// failed, and [`TldiError::PassesThrough`] where a collider of a kind that does not meet clouds came near one.
    ///
    /// ```
    #[doc = example_world!()]
    /// let integration = world.integration_parameters;
    /// let (bodies, colliders) = (&world.bodies, &world.colliders);
    /// let joints = (&world.impulse_joints, &world.multibody_joints);
    /// tldi.prepare(world.gravity, &integration, bodies, colliders, joints.0, joints.1)?;
    /// world.step_with_events(&tldi.hooks(&()), &());
    /// let report = tldi.finish(&mut world.bodies, &world.narrow_phase, &world.colliders)?;
    /// assert_eq!(report.pairs_in_contact, 1);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn finish(
        &mut self,
        bodies: &mut RigidBodySet,
        narrow_phase: &NarrowPhase,
        colliders: &ColliderSet,
    ) -> Result<StepReport, TldiError> {
        let on_the_spot = self.shared.take_spot_counts();
        let mut report = StepReport {
            pairs_batched: 0,
            pairs_kept: 0,
            pairs_missed: on_the_spot.pairs,
            pairs_in_contact: 0,
            contact_pixels: on_the_spot.contact_pixels,
            coarser_pixels: on_the_spot.coarser_pixels,
            max_penetration: 0.0,
            prepare_seconds: self.prepare_seconds,
            backend: Arc::clone(&self.compared_by.backend),
            adapter: self.compared_by.adapter.clone(),
            fallback: self.compared_by.fallback.clone(),
        };
        {
            let mut batch = self.shared.batch_mut();
            batch.rebound(bodies, narrow_phase, colliders);
            batch.stop_blocked(bodies, colliders);
            (report.pairs_batched, report.pairs_kept) = batch.counts();
            report.contact_pixels += batch.contact_pixels();
            let coarser = report
                .coarser_pixels
                .into_iter()
                .chain(batch.coarser_pixels());
            report.coarser_pixels = coarser.reduce(f32::max);
            let candidates = self.search.candidates();
            self.memory.update(candidates, &batch, bodies, colliders);
            batch.clear();
        }
        self.motions.step_ended(colliders);
        if let Some((count, first)) = self.shared.take_failures() {
            return Err(TldiError::OnTheSpot { count, first });
        }
        if !self.is_attached(narrow_phase) {
            return Err(TldiError::NotAttached);
        }
        self.told.take()?;
        for pair in cloud_pairs(narrow_phase, colliders) {
            report.pairs_in_contact += usize::from(pair.has_any_active_contact());
            for contact in contacts_of(pair, colliders) {
                report.max_penetration = report.max_penetration.max(contact.depth);
            }
        }
        Ok(report)
    }

    /// Steps the world: [`prepare`](Self::prepare), [`push`](Self::push), rapier's step, [`finish`](Self::finish).
    ///
    /// # Errors
    /// Those of `prepare`, and [`TldiError::NotAttached`]: the world was not stepped. Those of
    /// `finish`: it was.
    ///
    /// ```
    #[doc = example_world!()]
    /// let report = tldi.step(&mut world)?;
    /// assert_eq!((report.pairs_batched, report.pairs_in_contact), (1, 1));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn step(&mut self, world: &mut PhysicsWorld) -> Result<StepReport, TldiError> {
        self.step_with_events(world, &(), &())
    }

    /// [`step`](Self::step) with physics hooks and an event handler.
    ///
    /// # Errors
    /// Those of [`step`](Self::step).
    ///
    /// ```
    #[doc = example_world!()]
    /// use std::sync::mpsc::channel;
    /// let (collisions, started) = channel();
    /// let ((forces, _), (tears, _)) = (channel(), channel());
    /// world.colliders[scan].set_active_events(ActiveEvents::COLLISION_EVENTS);
    /// let events = ChannelEventCollector::new(collisions, forces, tears);
    /// tldi.step_with_events(&mut world, &(), &events)?;
    /// assert!(started.try_recv()?.started());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn step_with_events(
        &mut self,
        world: &mut PhysicsWorld,
        hooks: &dyn PhysicsHooks,
        events: &dyn EventHandler,
    ) -> Result<StepReport, TldiError> {
        if !self.is_attached(&world.narrow_phase) {
            return Err(TldiError::NotAttached);
        }
        self.prepare(
            world.gravity,
            &world.integration_parameters,
            &world.bodies,
            &world.colliders,
            &world.impulse_joints,
            &world.multibody_joints,
        )?;
        self.push(
            &mut world.bodies,
            &world.colliders,
            &world.integration_parameters,
            hooks,
        );
        world.step_with_events(&self.hooks(hooks), events);
        self.finish(&mut world.bodies, &world.narrow_phase, &world.colliders)
    }

    /// The contact points of all pairs with a cloud, as of the last step in which each pair was
    /// awake, at the colliders' present poses.
    ///
    /// ```
    #[doc = example_world!()]
    /// tldi.step(&mut world)?;
    /// for contact in tldi.contacts(&world.narrow_phase, &world.colliders) {
    ///     assert!((contact.depth - 0.01).abs() < 0.01, "{} m at {}", contact.depth, contact.point);
    /// }
    /// # assert!(tldi.contacts(&world.narrow_phase, &world.colliders).count() > 0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn contacts<'a>(
        &self,
        narrow_phase: &'a NarrowPhase,
        colliders: &'a ColliderSet,
    ) -> impl Iterator<Item = Contact> + use<'a> {
        cloud_pairs(narrow_phase, colliders).flat_map(|pair| contacts_of(pair, colliders))
    }

    /// The settings.
    pub(crate) fn config(&self) -> TldiConfig {
        self.shared.config()
    }
}

/// The same vector without elements, for elements that borrow from something else: the memory is
/// kept, since the layouts are equal (collecting a vector's own iterator is done in place).
fn emptied<T, U>(mut vec: Vec<T>) -> Vec<U> {
    vec.clear();
    vec.into_iter()
        .map(|_| unreachable!("the vector was cleared"))
        .collect()
}
