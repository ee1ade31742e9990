//! The world in which every simulation takes place.

use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use tldi::Backend;
use tldi::glamx::Vec3;

/// Length of a step in seconds.
pub const DT: f32 = 1.0 / 60.0;
/// Standard gravity in m/s².
pub(crate) const GRAVITY: f32 = 9.81;
/// Gap up to which surfaces are drawn as touching, in mean radii of the coarser one: what sampling leaves uncertain.
pub(crate) const TOUCHING_GAP: f32 = 0.2;

/// An empty world with gravity against `up` (unit length), and the pipeline that is attached to it.
pub(crate) fn attached(
    up: Vec3,
    backend: Box<dyn Backend>,
) -> Result<(PhysicsWorld, TldiPipeline), TldiError> {
    let tldi = TldiPipeline::with_backend(TldiConfig::default(), backend)?;
    let mut world = PhysicsWorld {
        gravity: -GRAVITY * up,
        ..PhysicsWorld::default()
    };
    world.integration_parameters.dt = DT;
    tldi.attach(&mut world);
    Ok((world, tldi))
}
