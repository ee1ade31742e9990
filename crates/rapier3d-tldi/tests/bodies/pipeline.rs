//! What one step compares, keeps and reports.

use crate::common::worlds::{
    HALF, REST_TOLERANCE, TestResult, attached, attached_with, dynamic_at, insert_floor, settle,
};
use crate::common::{SPACING, cloud, cube, square};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;

/// What makes rapier ask with another prediction distance or pose is foreseen: nothing is missed.
#[test]
fn batch_foresees_predictions_and_poses() -> TestResult {
    let (mut world, mut tldi) = attached();
    world.insert(
        RigidBodyBuilder::fixed().rotation(Vector::new(0.0, 0.4, 0.0)),
        tldi.collider(cloud(&square(0.8))).contact_skin(0.005),
    );
    let (body, _) = world.insert(
        RigidBodyBuilder::dynamic()
            .translation(Vector::Y * 0.5)
            .rotation(Vector::new(0.1, 0.2, 0.3))
            .linvel(Vector::new(0.3, -3.0, 0.1))
            .soft_ccd_prediction(0.3),
        tldi.collider(cloud(&cube(0.1)))
            .contact_skin(0.003)
            .position(Pose::new(Vector::X * 0.02, Vector::Z * 0.3)),
    );
    world.insert(
        RigidBodyBuilder::kinematic_velocity_based()
            .translation(Vector::new(0.4, 0.3, 0.0))
            .linvel(Vector::new(-0.5, -0.1, 0.0)),
        ColliderBuilder::ball(0.1),
    );
    let mut batched = 0;
    for step in 0..120 {
        if step == 60 {
            world.bodies[body].set_translation(Vector::new(0.1, 0.4, 0.0), true);
        }
        let report = tldi.step(&mut world)?;
        assert_eq!(report.pairs_missed, 0, "step {step}");
        batched += report.pairs_batched + report.pairs_kept;
    }
    assert!(batched > 120, "{batched}");
    assert!(world.bodies[body].translation().y > 0.05);
    Ok(())
}

/// A body moved after the batch is compared on the spot, counted, and still held up.
#[test]
fn teleport_after_the_batch_is_a_miss() -> TestResult {
    let (mut world, mut tldi) = attached();
    insert_floor(&mut world, 0.8);
    let (body, _) = world.insert(dynamic_at(HALF), tldi.collider(cloud(&cube(HALF))));
    tldi.prepare(
        world.gravity,
        &world.integration_parameters,
        &world.bodies,
        &world.colliders,
        &world.impulse_joints,
        &world.multibody_joints,
    )?;
    world.bodies[body].set_translation(Vector::new(0.1, HALF - 0.002, 0.0), true);
    world.step();
    let report = tldi.finish(&mut world.bodies, &world.narrow_phase, &world.colliders)?;
    assert_eq!((report.pairs_batched, report.pairs_missed), (1, 1));
    assert_eq!(report.pairs_in_contact, 1);
    assert!(report.contact_pixels > 0);
    assert!(report.max_penetration < REST_TOLERANCE);
    assert_eq!(tldi.step(&mut world)?.pairs_missed, 0);
    Ok(())
}

/// Without `prepare` everything is compared on the spot and the outcome is the same.
#[test]
fn plain_rapier_step_works_too() -> TestResult {
    let (mut world, mut tldi) = attached();
    insert_floor(&mut world, 0.8);
    let (body, _) = world.insert(dynamic_at(HALF + 0.02), tldi.collider(cloud(&cube(HALF))));
    for _ in 0..60 {
        world.step();
    }
    assert!((world.bodies[body].translation().y - HALF).abs() < REST_TOLERANCE);
    let report = tldi.finish(&mut world.bodies, &world.narrow_phase, &world.colliders)?;
    assert_eq!(report.pairs_batched, 0);
    assert!(report.pairs_missed > 0);
    Ok(())
}

/// Contacts at rest are measured once and kept; with a drift of 0 they are measured every time.
#[test]
fn contacts_at_rest_are_kept() -> TestResult {
    for (scatter, is_kept) in [(0.05, true), (0.0, false)] {
        let config = TldiConfig {
            scatter,
            ..TldiConfig::default()
        };
        let (mut world, mut tldi) = attached_with(config);
        insert_floor(&mut world, 0.8);
        let body = dynamic_at(HALF).can_sleep(false);
        let (body, _) = world.insert(body, tldi.collider(cloud(&cube(HALF))));
        let mut counts = (0, 0);
        for step in 0..120 {
            let report = tldi.step(&mut world)?;
            assert_eq!(report.pairs_missed, 0);
            assert_eq!(report.pairs_batched + report.pairs_kept, 1);
            assert!(step == 0 || report.pairs_in_contact == 1);
            if step >= 60 {
                counts.0 += report.pairs_batched;
                counts.1 += report.pairs_kept;
            }
        }
        let rest = *world.bodies[body].position();
        assert!((rest.translation.y - HALF).abs() < REST_TOLERANCE);
        assert_eq!(counts, if is_kept { (0, 60) } else { (60, 0) });
        // 0.05 radii are 2 mm.
        for (rise, batched) in [(0.0, usize::from(!is_kept)), (0.004, 1)] {
            let moved = rest.translation + Vector::Y * rise;
            world.bodies[body].set_position(Pose::from_parts(moved, rest.rotation), true);
            assert_eq!(tldi.step(&mut world)?.pairs_batched, batched, "{rise}");
        }
    }
    Ok(())
}

/// A sensor is told from the batch, in both orders, when the surfaces cross and when they part.
#[test]
fn sensors_notice_clouds() -> TestResult {
    for sensor_first in [true, false] {
        let (mut world, mut tldi) = attached();
        let sensor = || ColliderBuilder::cuboid(0.3, 0.3, 0.3).sensor(true);
        let early = sensor_first.then(|| world.insert(RigidBodyBuilder::fixed(), sensor()).1);
        let (body, cube) = world.insert(
            dynamic_at(0.8).gravity_scale(0.0),
            tldi.collider(cloud(&cube(HALF))),
        );
        let sensor = early.unwrap_or_else(|| world.insert(RigidBodyBuilder::fixed(), sensor()).1);
        for (height, crossing) in [(0.8, false), (0.4, true), (0.52, false), (0.3, true)] {
            world.bodies[body].set_translation(Vector::Y * height, true);
            let report = tldi.step(&mut world)?;
            assert_eq!(report.pairs_missed, 0, "at {height}");
            assert_eq!(
                world
                    .narrow_phase
                    .intersection_pair(cube, sensor)
                    .unwrap_or(false),
                crossing,
                "at {height}, sensor first: {sensor_first}"
            );
        }
    }
    Ok(())
}

/// Groups and body types are rapier's; pairs it never asks about are not compared either.
#[test]
fn pairs_that_cannot_collide_cost_nothing() -> TestResult {
    let (mut world, mut tldi) = attached();
    let apart = InteractionGroups::new(Group::GROUP_1, Group::NONE, InteractionTestMode::And);
    insert_floor(&mut world, 0.4);
    world.insert(RigidBodyBuilder::fixed(), tldi.collider(cloud(&cube(HALF))));
    world.insert(
        dynamic_at(0.1),
        tldi.collider(cloud(&cube(0.1))).collision_groups(apart),
    );
    let (body, _) = world.insert(dynamic_at(5.0), tldi.collider(cloud(&cube(0.1))));
    world.insert_collider(tldi.collider(cloud(&cube(0.1))), Some(body));
    world.insert(
        dynamic_at(0.1).enabled(false),
        tldi.collider(cloud(&cube(0.1))),
    );
    world.insert(
        dynamic_at(0.1),
        tldi.collider(cloud(&cube(0.1))).enabled(false),
    );
    let report = tldi.step(&mut world)?;
    assert_eq!((report.pairs_batched, report.pairs_missed), (0, 0));
    Ok(())
}

/// Neither are pairs that a joint keeps from touching, of each kind of joint that rapier has. Sensors see each other in spite of
/// joints.
#[test]
fn pairs_that_joints_keep_apart_cost_nothing() -> TestResult {
    let passing = FixedJointBuilder::new().contacts_enabled(false);
    let meeting = FixedJointBuilder::new().contacts_enabled(true);
    type Join = fn(&mut PhysicsWorld, [RigidBodyHandle; 2], FixedJointBuilder);
    let by_impulses: Join = |world, [body1, body2], joint| {
        world.insert_impulse_joint(body1, body2, joint);
    };
    let in_multibody: Join = |world, [body1, body2], joint| {
        world.insert_multibody_joint(body1, body2, joint);
    };
    let without_self_contacts: Join = |world, [body1, body2], joint| {
        let joint = world.insert_multibody_joint(body1, body2, joint);
        let joint = joint.expect("two bodies that nothing joins yet");
        let (multibody, _) = world.multibody_joints.get_mut(joint).expect("inserted");
        multibody.set_self_contacts_enabled(false);
    };
    for (case, join, joint, batched) in [
        ("impulses", by_impulses, meeting, 1),
        ("impulses", by_impulses, passing, 0),
        ("multibody", in_multibody, meeting, 1),
        ("multibody", in_multibody, passing, 0),
        ("no self-contacts", without_self_contacts, meeting, 0),
        ("a sensor", by_impulses, passing, 1),
    ] {
        let (mut world, mut tldi) = attached();
        let bodies = [0.0, 0.1].map(|y| {
            let collider = tldi.collider(cloud(&cube(0.1))).sensor(case == "a sensor");
            world.insert(dynamic_at(y), collider).0
        });
        join(&mut world, bodies, joint);
        let report = tldi.step(&mut world)?;
        assert_eq!(
            (report.pairs_batched, report.pairs_missed),
            (batched, 0),
            "{case} {batched}"
        );
    }
    Ok(())
}

/// The contacts for drawing lie on the surface, under the cube, with the depth reported.
#[test]
fn contacts_are_in_world_space() -> TestResult {
    let (mut world, mut tldi) = attached();
    let offset = Vector::new(3.0, 1.0, -2.0);
    let (_, floor) = world.insert(
        RigidBodyBuilder::fixed().translation(offset),
        tldi.collider(cloud(&square(0.8))),
    );
    let (_, body) = world.insert(
        RigidBodyBuilder::dynamic().translation(offset + Vector::Y * HALF),
        tldi.collider(cloud(&cube(HALF))),
    );
    settle(&mut world, &mut tldi)?;
    let contacts: Vec<_> = tldi
        .contacts(&world.narrow_phase, &world.colliders)
        .collect();
    assert!(contacts.len() >= 3, "{contacts:?}");
    for contact in contacts {
        assert_eq!((contact.collider1, contact.collider2), (floor, body));
        let point = contact.point - offset;
        assert!(point.y.abs() < REST_TOLERANCE, "{contact:?}");
        assert!(point.abs().max_element() < HALF + SPACING, "{contact:?}");
        assert!(contact.normal.y > 0.99, "{contact:?}");
        assert!(contact.depth < REST_TOLERANCE, "{contact:?}");
    }
    Ok(())
}

/// Equal worlds go the same way to the bit, and one pipeline serves two worlds in turn.
#[test]
fn several_worlds_and_runs_agree_to_the_bit() -> TestResult {
    let build = |tldi: &TldiPipeline| {
        let mut world = PhysicsWorld::default();
        tldi.attach(&mut world);
        insert_floor(&mut world, 0.8);
        let bodies: Vec<_> = (0..3)
            .map(|i| {
                let body = RigidBodyBuilder::dynamic()
                    .translation(Vector::new(0.4 * (i - 1) as f32, 0.15, 0.0))
                    .rotation(Vector::new(0.1, 0.2, 0.3) * i as f32);
                world.insert(body, tldi.collider(cloud(&cube(0.1)))).0
            })
            .collect();
        (world, bodies)
    };
    let poses = |(world, bodies): &(PhysicsWorld, Vec<RigidBodyHandle>)| -> Vec<Pose> {
        bodies
            .iter()
            .map(|b| *world.bodies[*b].position())
            .collect()
    };
    let mut alone = TldiPipeline::new(TldiConfig::default())?;
    let mut single = build(&alone);
    let mut again = TldiPipeline::new(TldiConfig::default())?;
    let mut repeated = build(&again);
    for _ in 0..90 {
        alone.step(&mut single.0)?;
        again.step(&mut repeated.0)?;
        assert_eq!(poses(&single), poses(&repeated));
    }
    // Worlds on one pipeline share what it remembers of a pair, so they need not agree to the bit.
    let mut shared = TldiPipeline::new(TldiConfig::default())?;
    let mut worlds = [build(&shared), build(&shared)];
    for _ in 0..90 {
        for (world, _) in &mut worlds {
            shared.step(world)?;
        }
    }
    for pose in worlds.iter().flat_map(poses) {
        assert!((0.08..0.2).contains(&pose.translation.y), "{pose:?}");
    }
    Ok(())
}

/// A body whose velocity is not a number is rapier's to disable. The world goes on, and others still rest.
#[test]
fn a_velocity_that_is_no_number_stops_one_body() -> TestResult {
    let (mut world, mut tldi) = attached();
    insert_floor(&mut world, 0.8);
    let (broken, _) = world.insert(dynamic_at(HALF + 0.02), tldi.collider(cloud(&cube(HALF))));
    let beside = RigidBodyBuilder::dynamic().translation(Vector::new(0.4, HALF, 0.0));
    let (body, _) = world.insert(beside, tldi.collider(cloud(&cube(HALF))));
    world.bodies[broken].set_linvel(Vector::splat(f32::NAN), true);
    for _ in 0..60 {
        tldi.step(&mut world)?;
    }
    assert!((world.bodies[body].translation().y - HALF).abs() < REST_TOLERANCE);
    Ok(())
}
