//! How often a whole warm step asks for memory: candidates, batch, comparison, dispatcher, manifolds and rapier's own.

use crate::alone;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use std::error::Error;
use tldi_memory::allocations;

/// Metres.
const SPACING: f32 = 0.02;

/// Steps until memory has settled, and steps that are counted.
const WARM: usize = 200;
const COUNTED: usize = 100;

/// Allocations of a step in the mean, of which rapier has its own: 146 were measured, 153 in debug, where the compiler
/// removes none.
const MOST: f64 = 157.0;

/// A square of 2 m in the x-z plane.
fn square() -> Vec<Vector> {
    (0..10_000)
        .map(|k| SPACING * Vector::new((k % 100) as f32 - 49.5, 0.0, (k / 100) as f32 - 49.5))
        .collect()
}

/// Nine balls, clouds and exact ones, roll about on a sheet that gets new points in every step, so that nothing sleeps
/// and nothing is kept.
#[test]
fn a_warm_step_allocates_little() -> Result<(), Box<dyn Error + Send + Sync>> {
    let _alone = alone();
    assert!(
        allocations(|| drop(vec![0u8; 100])) > 0,
        "the allocator does not count"
    );
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    pool.install(|| {
        let mut world = PhysicsWorld::default();
        let mut tldi = TldiPipeline::new(TldiConfig::default())?;
        tldi.attach(&mut world);
        let sheet = PointCloud::builder(square()).radius(SPACING).build()?;
        let (_, sheet) = world.insert(RigidBodyBuilder::fixed(), tldi.collider(sheet));
        for k in 0..9 {
            let at = 0.4 * Vector::new((k % 3) as f32 - 1.0, 0.28, (k / 3) as f32 - 1.0);
            let body = RigidBodyBuilder::dynamic().translation(at).can_sleep(false);
            let ball = SharedShape::ball(0.1);
            let collider = match k % 2 {
                0 => ColliderBuilder::new(ball),
                _ => tldi.collider(rapier3d_tldi::sample_shape(&*ball, SPACING)?),
            };
            world.insert(body, collider);
        }
        let frames: Vec<Vec<Vector>> = (0..4)
            .map(|k| {
                let raised = 1e-4 * k as f32 * Vector::Y;
                square().into_iter().map(|p| p + raised).collect()
            })
            .collect();
        let mut step = |k: usize| -> Result<usize, TldiError> {
            tldi.set_points(&mut world, sheet, &frames[k % frames.len()], None)?;
            Ok(tldi.step(&mut world)?.pairs_in_contact)
        };
        for k in 0..WARM {
            step(k)?;
        }
        let mut outcome = Ok(0);
        let mut counts = Vec::new();
        for k in 0..COUNTED {
            counts.push(allocations(|| outcome = step(k)));
            let in_contact = std::mem::replace(&mut outcome, Ok(0))?;
            assert_eq!(in_contact, 9);
        }
        let mean = counts.iter().sum::<usize>() as f64 / COUNTED as f64;
        eprintln!("{mean} allocations a step: {counts:?}");
        assert!(mean <= MOST, "{mean} a step: {counts:?}");
        Ok(())
    })
}
