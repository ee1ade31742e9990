//! How rapier comes to ask a pipeline.

use super::TldiPipeline;
use crate::TldiDispatcher;
use crate::corrections::surface_motion::TldiHooks;
use crate::step::prepared::PROBE_ANSWER;
use rapier3d::geometry::NarrowPhase;
use rapier3d::math::Pose;
use rapier3d::parry::query::{DefaultQueryDispatcher, QueryDispatcher};
use rapier3d::pipeline::{PhysicsHooks, PhysicsWorld};
use std::sync::Arc;

impl TldiPipeline {
    /// Makes the world's narrow phase ask this pipeline, and rapier's own dispatcher about pairs
    /// without a cloud. Needed once, and again after the world was deserialised.
    ///
    /// ```
    /// # use rapier3d::prelude::*;
    /// # use rapier3d_tldi::prelude::*;
    /// let mut world = PhysicsWorld::default();
    /// let tldi = TldiPipeline::new(TldiConfig::default())?;
    /// tldi.attach(&mut world);
    /// assert!(tldi.is_attached(&world.narrow_phase));
    /// # Ok::<(), TldiError>(())
    /// ```
    pub fn attach(&self, world: &mut PhysicsWorld) {
        self.attach_narrow_phase(&mut world.narrow_phase);
    }

    /// [`attach`](Self::attach) for split sets.
    ///
    /// ```
    /// # use rapier3d::prelude::*;
    /// # use rapier3d_tldi::prelude::*;
    /// let mut narrow_phase = NarrowPhase::new();
    /// let tldi = TldiPipeline::new(TldiConfig::default())?;
    /// tldi.attach_narrow_phase(&mut narrow_phase);
    /// assert!(tldi.is_attached(&narrow_phase));
    /// # Ok::<(), TldiError>(())
    /// ```
    pub fn attach_narrow_phase(&self, narrow_phase: &mut NarrowPhase) {
        narrow_phase.set_query_dispatcher(self.dispatcher().chain(DefaultQueryDispatcher));
    }

    /// The dispatcher that [`attach`](Self::attach) installs, for a chain of your own; it must come
    /// before rapier's default one.
    ///
    /// ```
    #[doc = example_scan!()]
    /// // Distances without a world. The pose is that of the second shape in the frame of the first.
    /// use rapier3d::parry::query::QueryDispatcher;
    /// let tldi = TldiPipeline::new(TldiConfig::default())?;
    /// let (scan, ball) = (PointCloudShape::new(scan), Ball::new(0.2));
    /// let pose = Pose::from_translation(Vector::new(1.0, 0.5, 1.0));
    /// let found = tldi.dispatcher().distance(&pose, &scan, &ball)?;
    /// assert!((found.distance - 0.3).abs() < 1e-3);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn dispatcher(&self) -> TldiDispatcher {
        TldiDispatcher::new(Arc::clone(&self.shared))
    }

    /// Whether the narrow phase asks this pipeline.
    ///
    /// ```
    /// # use rapier3d::prelude::*;
    /// # use rapier3d_tldi::prelude::*;
    /// let mut world = PhysicsWorld::default();
    /// let tldi = TldiPipeline::new(TldiConfig::default())?;
    /// assert!(!tldi.is_attached(&world.narrow_phase));
    /// tldi.attach(&mut world);
    /// assert!(tldi.is_attached(&world.narrow_phase));
    /// # Ok::<(), TldiError>(())
    /// ```
    pub fn is_attached(&self, narrow_phase: &NarrowPhase) -> bool {
        let probe = &self.shared.probe;
        narrow_phase
            .query_dispatcher()
            .distance(&Pose::IDENTITY, probe, probe)
            .is_ok_and(|answer| answer.distance == PROBE_ANSWER)
    }

    /// `inner` and what tells rapier the velocities of [deforming](Self::deform) clouds: the hooks
    /// for a step with split sets.
    ///
    /// ```
    #[doc = example_world!()]
    /// let moved: Vec<Vector> = points.iter().map(|p| *p + 0.01 * Vector::X).collect(); // 0.6 m/s
    /// tldi.deform(&mut world, scan, &moved, None)?;
    /// let integration = world.integration_parameters;
    /// let (bodies, colliders) = (&world.bodies, &world.colliders);
    /// let joints = (&world.impulse_joints, &world.multibody_joints);
    /// tldi.prepare(world.gravity, &integration, bodies, colliders, joints.0, joints.1)?;
    /// world.step_with_events(&tldi.hooks(&()), &());
    /// tldi.finish(&mut world.bodies, &world.narrow_phase, &world.colliders)?;
    /// assert!(world.bodies[ball].linvel().x > 0.0, "the ball is carried along");
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn hooks<'a>(&'a self, inner: &'a dyn PhysicsHooks) -> TldiHooks<'a> {
        TldiHooks {
            motions: &self.motions,
            shared: &self.shared,
            inner,
        }
    }
}
