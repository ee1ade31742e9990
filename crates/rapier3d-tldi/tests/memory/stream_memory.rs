//! A thousand frames of 0 to 300,000 points: nothing is lost, nothing fails, and memory does not grow.

use crate::alone;
use fastrand::Rng;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use rapier3d_tldi::{CloudRecipe, RadiusRule};
use std::error::Error;
use tldi_memory::held;

/// Frames, in three rounds with the same counts. The first one is the longest in which anything grows: it begins without
/// points.
const FRAMES: usize = 1000;
/// Most points of a frame.
const MOST: usize = 300_000;
/// Bytes by which the third round may exceed the second: what rapier and the threads keep of their own.
const SLACK: usize = 64 << 10;

#[test]
fn a_thousand_frames_lose_nothing_and_keep_nothing() -> Result<(), Box<dyn Error>> {
    let _alone = alone();
    let mut world = PhysicsWorld::default();
    let mut tldi = TldiPipeline::new(TldiConfig::default())?;
    tldi.attach(&mut world);
    let recipe = CloudRecipe {
        radii: RadiusRule::Global(0.01),
        ..CloudRecipe::default()
    };
    let mut stream = CloudStream::new(&mut world.colliders, recipe)?;
    let ball = RigidBodyBuilder::dynamic().translation(0.3 * Vector::Y);
    let (ball, _) = world.insert(ball, ColliderBuilder::ball(0.2));
    let sensor = Pose::from_parts(2.0 * Vector::Y, Rotation::from_rotation_x(0.3));
    let sensor_from_world = sensor.inverse();
    let mut rng = Rng::with_seed(33);
    // Every tenth frame is empty, the others have any number.
    let counts: Vec<usize> = (0..FRAMES / 3)
        .map(|frame| {
            if frame % 10 == 9 {
                0
            } else {
                rng.usize(..=MOST)
            }
        })
        .collect();
    let mut seen: Vec<Vector> = Vec::with_capacity(MOST);
    let mut most = [0; 3];
    for (round, most) in most.iter_mut().enumerate() {
        // The same points in all rounds.
        let mut rng = Rng::with_seed(34);
        world.bodies[ball].set_translation(0.3 * Vector::Y, true);
        world.bodies[ball].set_linvel(Vector::ZERO, true);
        for (frame, &count) in counts.iter().enumerate() {
            seen.clear();
            let mut invalid = 0;
            for i in 0..count {
                let p = Vector::new(
                    4.0 * rng.f32() - 2.0,
                    0.005 * rng.f32(),
                    4.0 * rng.f32() - 2.0,
                );
                let valid = i % 97 != 96;
                invalid += usize::from(!valid);
                seen.push(if valid {
                    sensor_from_world * p
                } else {
                    Vector::splat(f32::NAN)
                });
            }
            let taken = stream.frame(
                &mut tldi,
                &world.bodies,
                &mut world.colliders,
                &seen,
                &sensor,
            )?;
            assert_eq!(
                (taken.points, taken.dropped, taken.own),
                (count - invalid, invalid, 0),
                "round {round}, frame {frame}"
            );
            let report = tldi.step(&mut world)?;
            assert_eq!(report.pairs_missed, 0);
            // Empty frames let the ball fall for a step, 3 mm; it is laid back.
            if count == 0 {
                world.bodies[ball].set_translation(0.3 * Vector::Y, true);
            }
            *most = held().max(*most);
        }
    }
    assert!(most[2] <= most[1] + SLACK, "{most:?}");
    Ok(())
}
