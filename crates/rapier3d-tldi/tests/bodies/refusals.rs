//! What the pipeline refuses, and what it leaves untouched then.

use crate::common::worlds::{HALF, TestResult, attached_with, dynamic_at, insert_floor};
use crate::common::{cloud, cube};
use rapier3d::parry::query::{NonlinearRigidMotion, QueryDispatcher};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use std::time::Duration;

/// The paper's variant cannot compare a cloud with a ball: the step says so, names the colliders
/// and leaves the world as it was.
#[test]
fn error_of_the_batch_names_the_pair() -> TestResult {
    let (mut world, mut tldi) = attached_with(TldiConfig {
        variant: Variant::Paper,
        ..TldiConfig::default()
    });
    let floor = insert_floor(&mut world, 0.4);
    world.insert(dynamic_at(HALF), tldi.collider(cloud(&cube(HALF))));
    let (body, ball) = world.insert(
        dynamic_at(0.1).linvel(Vector::X),
        ColliderBuilder::ball(0.1).collision_groups(InteractionGroups::all()),
    );
    let before = *world.bodies[body].position();
    match tldi.step(&mut world) {
        Err(TldiError::Pair {
            collider1,
            collider2,
            ..
        }) => {
            assert_eq!((collider1, collider2), (floor, ball));
        }
        other => return Err(format!("{other:?}").into()),
    }
    assert_eq!(*world.bodies[body].position(), before);
    Ok(())
}

/// The same inside rapier's step, where rapier drops it: kept, counted, returned once.
#[test]
fn error_on_the_spot_is_kept() -> TestResult {
    let (mut world, mut tldi) = attached_with(TldiConfig {
        variant: Variant::Paper,
        ..TldiConfig::default()
    });
    insert_floor(&mut world, 0.4);
    let (body, _) = world.insert(dynamic_at(0.1), ColliderBuilder::ball(0.1));
    world.step();
    world.step();
    match tldi.finish(&mut world.bodies, &world.narrow_phase, &world.colliders) {
        Err(TldiError::OnTheSpot { count: 2, .. }) => {}
        other => return Err(format!("{other:?}").into()),
    }
    world.remove_body(body);
    assert!(tldi.step(&mut world).is_ok(), "the error is returned once");
    Ok(())
}

/// A cast that the user makes between two steps fails neither of them.
#[test]
fn casts_outside_of_a_step_fail_no_step() -> TestResult {
    let (mut world, mut tldi) = attached_with(TldiConfig::default());
    let floor = insert_floor(&mut world, 0.4);
    tldi.step(&mut world)?;
    let beyond_all_numbers = NonlinearRigidMotion::new(
        Pose::IDENTITY,
        Vector::ZERO,
        Vector::Y * f32::MAX,
        Vector::ZERO,
    );
    let floor = world.colliders[floor].shape();
    let resting = NonlinearRigidMotion::identity();
    let hit = tldi.dispatcher().cast_shapes_nonlinear(
        &beyond_all_numbers,
        &Ball::new(0.1),
        &resting,
        floor,
        0.0,
        10.0,
        false,
    );
    assert!(hit.is_ok_and(|hit| hit.is_none()));
    assert!(tldi.step(&mut world).is_ok());
    Ok(())
}

#[test]
fn detached_world_is_refused() -> TestResult {
    let mut world = PhysicsWorld::default();
    let (body, _) = world.insert(dynamic_at(1.0), ColliderBuilder::ball(0.1));
    let mut tldi = TldiPipeline::new(TldiConfig::default())?;
    let other = TldiPipeline::new(TldiConfig::default())?;
    assert_eq!(tldi.step(&mut world).err(), Some(TldiError::NotAttached));
    other.attach(&mut world);
    assert_eq!(tldi.step(&mut world).err(), Some(TldiError::NotAttached));
    assert_eq!(world.bodies[body].translation().y, 1.0, "not stepped");
    let finished = tldi.finish(&mut world.bodies, &world.narrow_phase, &world.colliders);
    assert_eq!(finished.err(), Some(TldiError::NotAttached));
    tldi.attach(&mut world);
    tldi.step(&mut world)?;
    assert!(world.bodies[body].translation().y < 1.0);
    Ok(())
}

/// A step of no known time would make all places NaN.
#[test]
fn bad_time_steps_are_refused() -> TestResult {
    let (mut world, mut tldi) = attached_with(TldiConfig::default());
    let floor = insert_floor(&mut world, 0.4);
    let (body, _) = world.insert(dynamic_at(1.0), ColliderBuilder::ball(0.1));
    let before = *world.bodies[body].position();
    for dt in [f32::NAN, f32::INFINITY, -0.01] {
        world.integration_parameters.dt = dt;
        let step = tldi.step(&mut world).map(|_| ());
        let deform = tldi.deform(&mut world, floor, &[], None);
        for result in [step, deform] {
            let is_refused = matches!(result, Err(TldiError::BadConfig { setting: "dt", .. }));
            assert!(is_refused, "{dt}: {result:?}");
        }
        assert_eq!(*world.bodies[body].position(), before, "{dt}");
    }
    world.integration_parameters.dt = 0.0;
    tldi.step(&mut world)?;
    assert_eq!(*world.bodies[body].position(), before);
    Ok(())
}

#[test]
fn bad_settings_are_refused() {
    let with_drift = |scatter| TldiConfig {
        scatter,
        ..TldiConfig::default()
    };
    let with_resolution = |resolution| TldiConfig {
        resolution,
        ..TldiConfig::default()
    };
    let refused = |config| match TldiPipeline::new(config).err() {
        Some(TldiError::BadConfig { setting, .. }) => Some(setting),
        _ => None,
    };
    for bad in [-1.0, f32::NAN, f32::INFINITY] {
        assert_eq!(refused(with_drift(bad)), Some("scatter"), "{bad}");
        for resolution in [Resolution::Radii(bad), Resolution::Error(bad)] {
            assert_eq!(refused(with_resolution(resolution)), Some("resolution"));
        }
    }
    assert_eq!(refused(with_drift(0.0)), None);
    for resolution in [Resolution::Radii(0.0), Resolution::Time(Duration::ZERO)] {
        assert_eq!(refused(with_resolution(resolution)), Some("resolution"));
    }
}
