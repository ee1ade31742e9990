//! The world in which every simulation takes place.

use crate::devices::Devices;
use crate::step_totals::StepTotals;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use tldi::Backend;
use tldi::glamx::{Pose3, Vec3};

/// Length of a step in seconds.
pub const DT: f32 = 1.0 / 60.0;
/// Standard gravity in m/s².
pub(crate) const GRAVITY: f32 = 9.81;
/// Gap up to which surfaces are drawn as touching, in mean radii of the coarser one: what sampling leaves uncertain.
const TOUCHING_GAP: f32 = 0.2;

/// A world, the pipeline that is attached to it, and what is counted over its steps.
pub(crate) struct Stage {
    pub(crate) world: PhysicsWorld,
    pub(crate) tldi: TldiPipeline,
    pub(crate) totals: StepTotals,
    /// Deepest penetration in metres over all steps.
    pub(crate) max_penetration: f32,
}

impl Stage {
    /// An empty world with gravity against `up` (unit length).
    pub(crate) fn new(up: Vec3, backend: Box<dyn Backend>) -> Result<Self, TldiError> {
        let mut totals = StepTotals::new(DT);
        totals.devices = Devices::of(&*backend);
        let tldi = TldiPipeline::with_backend(TldiConfig::default(), backend)?;
        let mut world = PhysicsWorld {
            gravity: -GRAVITY * up,
            ..PhysicsWorld::default()
        };
        world.integration_parameters.dt = DT;
        tldi.attach(&mut world);
        Ok(Self {
            world,
            tldi,
            totals,
            max_penetration: 0.0,
        })
    }

    /// Takes a step. The caller counts it.
    pub(crate) fn step(&mut self) -> Result<StepReport, TldiError> {
        let report = self.tldi.step(&mut self.world)?;
        self.max_penetration = self.max_penetration.max(report.max_penetration);
        Ok(report)
    }

    /// The contacts of all clouds after the last step.
    pub(crate) fn contacts(&self) -> impl Iterator<Item = CloudContact> {
        (self.tldi).contacts(&self.world.narrow_phase, &self.world.colliders)
    }

    /// Those of surfaces that are drawn as touching, where the coarser one has this mean radius in metres.
    pub(crate) fn touching(&self, mean_radius: f32) -> impl Iterator<Item = CloudContact> {
        let least_depth = -TOUCHING_GAP * mean_radius;
        (self.contacts()).filter(move |contact| contact.depth > least_depth)
    }

    /// Where a body is.
    pub(crate) fn pose(&self, body: RigidBodyHandle) -> Pose3 {
        *self.world.bodies[body].position()
    }

    /// The points of a collider that was made of a cloud, as they are now.
    pub(crate) fn cloud(&self, collider: ColliderHandle) -> Option<&PointCloud<'static>> {
        let shape = self.world.colliders[collider].shape();
        (shape.as_shape::<PointCloudShape>()).map(PointCloudShape::cloud)
    }
}

/// Whether a contact is one of this collider.
pub(crate) fn is_of(contact: &CloudContact, collider: ColliderHandle) -> bool {
    [contact.collider1, contact.collider2].contains(&collider)
}
