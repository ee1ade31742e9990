//! Colliders that share one shape are told apart.

use crate::common::worlds::{HALF, REST_TOLERANCE, TestResult, attached, insert_floor};
use crate::common::{cloud, cube, shape, square};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;

/// A solid and a sensor share a shape and a body, in both orders: neither is answered by the other's comparison.
#[test]
fn solid_and_sensor_of_one_shape() -> TestResult {
    for sensor_first in [true, false] {
        let (mut world, mut tldi) = attached();
        insert_floor(&mut world, 0.8);
        let collider = cloud_collider(shape(&cube(HALF)));
        let body = RigidBodyBuilder::dynamic()
            .translation(Vector::Y * HALF)
            .can_sleep(false);
        let (body, first) = world.insert(body, collider.sensor(sensor_first));
        let shared = world.colliders[first].shared_shape().clone();
        let second = ColliderBuilder::new(shared)
            .active_hooks(world.colliders[first].active_hooks())
            .sensor(!sensor_first);
        world.insert_collider(second, Some(body));
        let mut kept = 0;
        for step in 0..120 {
            let report = tldi.step(&mut world)?;
            assert_eq!(report.pairs_missed, 0, "{sensor_first}, step {step}");
            kept += report.pairs_kept;
        }
        // The solid's contacts hold while it rests; a sensor is looked at in every step.
        assert!(kept > 60, "{sensor_first}: {kept}");
        let height = world.bodies[body].translation().y;
        assert!((height - HALF).abs() < REST_TOLERANCE, "{height}");
    }
    Ok(())
}

/// Bodies of one shape that lie alike, to the bit, on tiles of one shape: each has its own memory.
#[test]
fn bodies_that_lie_alike_on_tiles() -> TestResult {
    let (mut world, mut tldi) = attached();
    let tile = tldi.collider(cloud(&square(0.8))).build();
    let body = cloud_collider(shape(&cube(HALF))).build();
    for x in [0.0, 16.0] {
        let at = Vector::X * x;
        world.insert(RigidBodyBuilder::fixed().translation(at), tile.clone());
        let upright = RigidBodyBuilder::dynamic()
            .translation(at + Vector::Y * HALF)
            .enabled_translations(false, true, false)
            .lock_rotations()
            .can_sleep(false);
        world.insert(upright, body.clone());
    }
    let mut kept = 0;
    for step in 0..60 {
        let report = tldi.step(&mut world)?;
        assert_eq!(report.pairs_missed, 0, "step {step}");
        kept = report.pairs_kept;
    }
    assert_eq!(kept, 2);
    Ok(())
}
