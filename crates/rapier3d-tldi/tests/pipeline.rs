//! Worlds with clouds, stepped through the pipeline.

mod common;

use common::{SPACING, attached, cloud, cube, shape, square};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use std::error::Error;

type TestResult = Result<(), Box<dyn Error>>;

const HALF: f32 = 0.2;

/// Rapier leaves a millimetre of penetration (`normalized_allowed_linear_error`), and depths are
/// good to 0.15 of the radius, here 6 mm; a lost contact is well beyond.
const REST_TOLERANCE: f32 = 0.007;

fn dynamic_at(height: f32) -> RigidBodyBuilder {
    RigidBodyBuilder::dynamic().translation(Vector::Y * height)
}

/// Steps until everything sleeps; the deepest penetration after the first second.
fn settle(world: &mut PhysicsWorld, tldi: &mut TldiPipeline) -> Result<f32, Box<dyn Error>> {
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

/// Every kind of body comes to rest on a floor, at the height where its surface touches it.
#[track_caller]
fn rests(
    body: ColliderBuilder,
    floor: ColliderBuilder,
    floor_first: bool,
    height: f32,
) -> TestResult {
    let (mut world, mut tldi) = attached();
    let fixed = RigidBodyBuilder::fixed();
    let dynamic = dynamic_at(height + 0.03);
    let body = body.friction(0.8);
    let handle = if floor_first {
        world.insert(fixed, floor);
        world.insert(dynamic, body).0
    } else {
        let handle = world.insert(dynamic, body).0;
        world.insert(fixed, floor);
        handle
    };
    let deepest = settle(&mut world, &mut tldi)?;
    let body = &world.bodies[handle];
    assert!(
        (body.translation().y - height).abs() < REST_TOLERANCE,
        "rests at {} instead of {height}",
        body.translation().y
    );
    assert!(
        body.translation().with_y(0.0).length() < 0.01,
        "{:?}",
        body.translation()
    );
    assert!(deepest < REST_TOLERANCE, "{deepest}");
    Ok(())
}

#[test]
fn cloud_rests_on_cloud() -> TestResult {
    for floor_first in [true, false] {
        rests(
            cloud_collider(shape(&cube(HALF))),
            cloud_collider(shape(&square(0.8))),
            floor_first,
            HALF,
        )?;
    }
    Ok(())
}

#[test]
fn rapier_shapes_rest_on_cloud() -> TestResult {
    for floor_first in [true, false] {
        for body in [
            ColliderBuilder::cuboid(HALF, HALF, HALF),
            ColliderBuilder::cylinder(HALF, HALF),
            ColliderBuilder::round_cuboid(0.15, 0.15, 0.15, 0.05),
        ] {
            rests(body, cloud_collider(shape(&square(0.8))), floor_first, HALF)?;
        }
    }
    Ok(())
}

#[test]
fn cloud_rests_on_rapier_shapes() -> TestResult {
    let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]];
    let vertices = corners.map(|[x, z]| Vector::new(x, 0.0, z)).to_vec();
    for floor_first in [true, false] {
        for floor in [
            ColliderBuilder::new(SharedShape::new(HalfSpace::new(Vector::Y))),
            ColliderBuilder::cuboid(1.0, 0.5, 1.0).translation(Vector::Y * -0.5),
            ColliderBuilder::trimesh(vertices.clone(), vec![[0, 1, 2], [0, 2, 3]])?,
        ] {
            rests(cloud_collider(shape(&cube(HALF))), floor, floor_first, HALF)?;
        }
    }
    Ok(())
}

/// A compound of two cloud cubes on a cloud floor: nothing in rapier's own dispatcher knows it.
#[test]
fn compound_of_clouds_rests_on_cloud() -> TestResult {
    let part = SharedShape::new(shape(&cube(0.1)));
    let parts = [-0.1, 0.1].map(|x| (Pose::from_translation(Vector::X * x), part.clone()));
    for floor_first in [true, false] {
        rests(
            ColliderBuilder::compound(parts.to_vec()),
            cloud_collider(shape(&square(0.8))),
            floor_first,
            0.1,
        )?;
    }
    Ok(())
}

/// A cloud and a cuboid in one compound, on a cuboid: the cuboid part is left to rapier.
#[test]
fn mixed_compound_rests_on_cuboid() -> TestResult {
    let parts = vec![
        (
            Pose::from_translation(Vector::X * -0.1),
            SharedShape::new(shape(&cube(0.1))),
        ),
        (
            Pose::from_translation(Vector::X * 0.1),
            SharedShape::cuboid(0.1, 0.1, 0.1),
        ),
    ];
    rests(
        ColliderBuilder::compound(parts),
        ColliderBuilder::cuboid(1.0, 0.5, 1.0).translation(Vector::Y * -0.5),
        true,
        0.1,
    )
}

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
    world.insert(
        RigidBodyBuilder::fixed(),
        tldi.collider(cloud(&square(0.8))),
    );
    let (body, _) = world.insert(dynamic_at(HALF), tldi.collider(cloud(&cube(HALF))));
    tldi.prepare(
        world.gravity,
        &world.integration_parameters,
        &world.bodies,
        &world.colliders,
    )?;
    world.bodies[body].set_translation(Vector::new(0.1, HALF - 0.002, 0.0), true);
    world.step();
    let report = tldi.finish(&world.narrow_phase, &world.colliders)?;
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
    world.insert(
        RigidBodyBuilder::fixed(),
        tldi.collider(cloud(&square(0.8))),
    );
    let (body, _) = world.insert(dynamic_at(HALF + 0.02), tldi.collider(cloud(&cube(HALF))));
    for _ in 0..60 {
        world.step();
    }
    assert!((world.bodies[body].translation().y - HALF).abs() < REST_TOLERANCE);
    let report = tldi.finish(&world.narrow_phase, &world.colliders)?;
    assert_eq!(report.pairs_batched, 0);
    assert!(report.pairs_missed > 0);
    Ok(())
}

/// The paper's variant cannot compare a cloud with a ball: the step says so, names the colliders
/// and leaves the world as it was.
#[test]
fn error_of_the_batch_names_the_pair() -> TestResult {
    let config = TldiConfig {
        variant: Variant::Paper,
        ..TldiConfig::default()
    };
    let mut world = PhysicsWorld::default();
    let mut tldi = TldiPipeline::new(config)?;
    tldi.attach(&mut world);
    let (_, floor) = world.insert(
        RigidBodyBuilder::fixed(),
        tldi.collider(cloud(&square(0.4))),
    );
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
    let config = TldiConfig {
        variant: Variant::Paper,
        ..TldiConfig::default()
    };
    let mut world = PhysicsWorld::default();
    let mut tldi = TldiPipeline::new(config)?;
    tldi.attach(&mut world);
    world.insert(
        RigidBodyBuilder::fixed(),
        tldi.collider(cloud(&square(0.4))),
    );
    let (body, _) = world.insert(dynamic_at(0.1), ColliderBuilder::ball(0.1));
    world.step();
    world.step();
    match tldi.finish(&world.narrow_phase, &world.colliders) {
        Err(TldiError::OnTheSpot { count: 2, .. }) => {}
        other => return Err(format!("{other:?}").into()),
    }
    world.remove_body(body);
    assert!(tldi.step(&mut world).is_ok(), "the error is returned once");
    Ok(())
}

/// Contacts at rest are measured once and kept; with a drift of 0 they are measured every time.
#[test]
fn contacts_at_rest_are_kept() -> TestResult {
    for (kept_drift, is_kept) in [(0.05, true), (0.0, false)] {
        let config = TldiConfig {
            kept_drift,
            ..TldiConfig::default()
        };
        let mut world = PhysicsWorld::default();
        let mut tldi = TldiPipeline::new(config)?;
        tldi.attach(&mut world);
        world.insert(
            RigidBodyBuilder::fixed(),
            tldi.collider(cloud(&square(0.8))),
        );
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
        // 0.05 radii are 2 mm: less is not worth a measurement, more is.
        for (rise, batched) in [(0.0005, usize::from(!is_kept)), (0.004, 1)] {
            let moved = rest.translation + Vector::Y * rise;
            world.bodies[body].set_position(Pose::from_parts(moved, rest.rotation), true);
            assert_eq!(tldi.step(&mut world)?.pairs_batched, batched, "{rise}");
        }
    }
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
    let finished = tldi.finish(&world.narrow_phase, &world.colliders);
    assert_eq!(finished.err(), Some(TldiError::NotAttached));
    tldi.attach(&mut world);
    tldi.step(&mut world)?;
    assert!(world.bodies[body].translation().y < 1.0);
    Ok(())
}

#[test]
fn bad_settings_are_refused() {
    for kept_drift in [-1.0, f32::NAN, f32::INFINITY] {
        let config = TldiConfig {
            kept_drift,
            ..TldiConfig::default()
        };
        assert!(matches!(
            TldiPipeline::new(config).err(),
            Some(TldiError::BadConfig {
                setting: "kept_drift",
                ..
            })
        ));
    }
    for pixel_scale in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let config = TldiConfig {
            pixel_scale,
            ..TldiConfig::default()
        };
        assert!(matches!(
            TldiPipeline::new(config).err(),
            Some(TldiError::BadConfig {
                setting: "pixel_scale",
                ..
            })
        ));
    }
}

/// New points under a sleeping body wake it, in the same step and without a miss, and it follows.
#[test]
fn new_points_wake_sleepers() -> TestResult {
    let (mut world, mut tldi) = attached();
    let (_, floor) = world.insert(
        RigidBodyBuilder::fixed(),
        tldi.collider(cloud(&square(0.8))),
    );
    let (body, _) = world.insert(dynamic_at(HALF), tldi.collider(cloud(&cube(HALF))));
    settle(&mut world, &mut tldi)?;
    let resting = tldi.step(&mut world)?;
    assert_eq!((resting.pairs_batched, resting.pairs_in_contact), (0, 1));
    assert!(resting.max_penetration < REST_TOLERANCE);

    let sunk: Vec<Vector> = square(0.8).iter().map(|p| *p - Vector::Y * 0.03).collect();
    tldi.set_points(&mut world, floor, &sunk, None)?;
    let report = tldi.step(&mut world)?;
    assert_eq!((report.pairs_batched, report.pairs_missed), (1, 0));
    assert!(!world.bodies[body].is_sleeping());
    settle(&mut world, &mut tldi)?;
    assert!((world.bodies[body].translation().y - (HALF - 0.03)).abs() < REST_TOLERANCE);
    Ok(())
}

#[test]
fn set_points_errors_leave_the_cloud() -> TestResult {
    let (mut world, mut tldi) = attached();
    let (body, ball) = world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.1));
    let (_, scan) = world.insert(
        RigidBodyBuilder::fixed(),
        tldi.collider(cloud(&square(0.4))),
    );
    let points = square(0.2);
    assert_eq!(
        tldi.set_points(&mut world, ball, &points, None),
        Err(TldiError::NotACloud(ball))
    );
    assert_eq!(
        tldi.set_points(&mut world, scan, &[], None),
        Err(TldiError::Cloud {
            collider: scan,
            source: CloudError::Empty { dropped: 0 }
        })
    );
    let shape = world.colliders[scan].shape().as_shape::<PointCloudShape>();
    assert_eq!(shape.map(|s| s.cloud().len()), Some(square(0.4).len()));
    world.remove_body(body);
    assert_eq!(
        tldi.set_points(&mut world, ball, &points, None),
        Err(TldiError::NoSuchCollider(ball))
    );
    Ok(())
}

/// A cloud that two bodies share is replaced for one of them only.
#[test]
fn shared_points_are_replaced_for_one() -> TestResult {
    let (mut world, mut tldi) = attached();
    let shape = shape(&square(0.4));
    let insert = |world: &mut PhysicsWorld| {
        world
            .insert(RigidBodyBuilder::fixed(), cloud_collider(shape.clone()))
            .1
    };
    let (first, second) = (insert(&mut world), insert(&mut world));
    tldi.set_points(&mut world, first, &square(0.2), None)?;
    let count = |handle: ColliderHandle| {
        let shape = world.colliders[handle]
            .shape()
            .as_shape::<PointCloudShape>();
        shape.map(|s| s.cloud().len())
    };
    assert_eq!(count(first), Some(square(0.2).len()));
    assert_eq!(count(second), Some(square(0.4).len()));
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
    world.insert(
        RigidBodyBuilder::fixed(),
        tldi.collider(cloud(&square(0.4))),
    );
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
        world.insert(
            RigidBodyBuilder::fixed(),
            tldi.collider(cloud(&square(0.8))),
        );
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
