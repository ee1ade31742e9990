//! Worlds with a cloud for a floor.

use super::{cloud, square};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use std::error::Error;

pub(crate) type TestResult = Result<(), Box<dyn Error>>;

/// Half the edges of most bodies, metres.
pub(crate) const HALF: f32 = 0.2;

/// Rapier leaves a millimetre of penetration (`normalized_allowed_linear_error`), and depths are
/// good to 0.15 of the radius, here 6 mm; a lost contact is well beyond.
pub(crate) const REST_TOLERANCE: f32 = 0.007;

/// A world and a pipeline on the CPU, attached.
pub(crate) fn attached() -> (PhysicsWorld, TldiPipeline) {
    attached_with(TldiConfig::default())
}

/// The same with other settings.
pub(crate) fn attached_with(config: TldiConfig) -> (PhysicsWorld, TldiPipeline) {
    let mut world = PhysicsWorld::default();
    let tldi = TldiPipeline::new(config).expect("the settings are valid");
    tldi.attach(&mut world);
    (world, tldi)
}

/// A fixed horizontal cloud at height 0 with edges of `2 · half` metres.
pub(crate) fn insert_floor(world: &mut PhysicsWorld, half: f32) -> ColliderHandle {
    let floor = cloud_collider(PointCloudShape::new(cloud(&square(half))));
    world.insert(RigidBodyBuilder::fixed(), floor).1
}

pub(crate) fn dynamic_at(height: f32) -> RigidBodyBuilder {
    RigidBodyBuilder::dynamic().translation(Vector::Y * height)
}

/// Steps until everything sleeps; the deepest penetration after the first second.
pub(crate) fn settle(
    world: &mut PhysicsWorld,
    tldi: &mut TldiPipeline,
) -> Result<f32, Box<dyn Error>> {
    let mut deepest = 0.0_f32;
    for step in 0..400 {
        let report = tldi.step(world)?;
        assert_eq!(report.pairs_missed, 0, "step {step}");
        assert_eq!(&*report.backend, "cpu");
        if step > 60 {
            deepest = deepest.max(report.max_penetration);
        }
        if world
            .bodies
            .iter()
            .all(|(_, b)| b.is_fixed() || b.is_sleeping())
        {
            return Ok(deepest);
        }
    }
    Err("something is still awake after 400 steps".into())
}
