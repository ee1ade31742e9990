//! What a user changes between two steps.

use crate::common::worlds::{HALF, TestResult, attached, dynamic_at, insert_floor};
use crate::common::{cloud, shape, square};
use fastrand::Rng;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;

/// A ball of 20 cm that touches a floor.
fn ball_on_floor() -> (PhysicsWorld, TldiPipeline, ColliderHandle, RigidBodyHandle) {
    let (mut world, tldi) = attached();
    let floor = insert_floor(&mut world, 1.0);
    let (ball, _) = world.insert(
        dynamic_at(0.199).can_sleep(false),
        ColliderBuilder::ball(HALF),
    );
    (world, tldi, floor, ball)
}

fn floor_at(offset: Vector) -> Vec<Vector> {
    square(1.0).iter().map(|p| *p + offset).collect()
}

/// A floor that slides, in a world whose contacts undo no penetration, and one that rises in a step without time.
#[test]
fn velocities_stay_finite() -> TestResult {
    for softens in [true, false] {
        let (mut world, mut tldi, floor, ball) = ball_on_floor();
        if softens {
            let integration = &mut world.integration_parameters;
            integration.contact_softness.natural_frequency = 0.0;
            integration.static_contact_softness.natural_frequency = 0.0;
        }
        for k in 1..=5 {
            let way = match softens {
                true => 0.005 * k as f32 * Vector::X,
                false => 0.05 * Vector::Y,
            };
            tldi.deform(&mut world, floor, &floor_at(way), None)?;
            if !softens {
                world.integration_parameters.dt = 0.0;
            }
            tldi.step(&mut world)?;
        }
        let ball = &world.bodies[ball];
        assert!(ball.is_enabled() && ball.linvel().is_finite(), "{softens}");
    }
    Ok(())
}

/// A sensor that becomes solid is compared in the batch of its first step.
#[test]
fn a_sensor_becomes_solid() -> TestResult {
    let (mut world, mut tldi, floor, _) = ball_on_floor();
    world.gravity = Vector::ZERO;
    for is_sensor in [true, true, false, false] {
        world.colliders[floor].set_sensor(is_sensor);
        let report = tldi.step(&mut world)?;
        assert_eq!(report.pairs_missed, 0, "{is_sensor}");
    }
    Ok(())
}

/// Points that are changed through the collider's shape, behind the pipeline's back, are compared in the batch.
#[test]
fn points_may_be_changed_through_the_shape() -> TestResult {
    let (mut world, mut tldi, floor, _) = ball_on_floor();
    let mut rng = Rng::with_seed(3);
    for step in 0..20 {
        let noise = 0.01 * Vector::new(rng.f32(), 0.0, rng.f32());
        let shape = world.colliders[floor].shape_mut();
        let shape = shape.as_shape_mut::<PointCloudShape>().ok_or("a cloud")?;
        shape.set_points(&floor_at(noise), None)?;
        assert_eq!(tldi.step(&mut world)?.pairs_missed, 0, "{step}");
    }
    Ok(())
}

/// A cloud that touches a box on three sides becomes a small ball inside of it: one contact is left.
#[test]
fn a_cloud_becomes_a_ball() -> TestResult {
    let (mut world, mut tldi) = attached();
    world.gravity = Vector::ZERO;
    let cube = ColliderBuilder::cuboid(HALF, HALF, HALF);
    world.insert(RigidBodyBuilder::fixed(), cube);
    let plates = |p: &Vector| {
        [
            Vector::new(p.x, 0.199, p.z),
            Vector::new(0.199, p.x, p.z),
            Vector::new(-0.199, p.x, p.z),
        ]
    };
    let points: Vec<Vector> = square(HALF).iter().flat_map(plates).collect();
    let clamp = cloud_collider(shape(&points)).density(100.0);
    let (_, clamp) = world.insert(RigidBodyBuilder::dynamic().can_sleep(false), clamp);
    let count = |world: &PhysicsWorld| -> usize {
        let pairs = world.narrow_phase.contact_pairs();
        pairs.map(|pair| pair.manifolds().len()).sum()
    };
    tldi.step(&mut world)?;
    assert!(count(&world) > 1);
    world.colliders[clamp].set_shape(SharedShape::ball(0.05));
    for _ in 0..5 {
        tldi.step(&mut world)?;
        assert!(count(&world) <= 1);
    }
    Ok(())
}

/// How a surface gets its points.
type Give =
    fn(&mut TldiPipeline, &mut PhysicsWorld, ColliderHandle, &[Vector]) -> Result<(), TldiError>;

/// A camera whose frames come twice is told of a rising floor as well: the same points again leave its speed, however they
/// are given. One of them is not finite.
#[test]
fn points_that_come_twice_keep_their_speed() -> TestResult {
    let ways: [(&str, Give); 3] = [
        ("set_points", |tldi, world, floor, points| {
            tldi.set_points(world, floor, points, None)
        }),
        ("set_cloud", |tldi, world, floor, points| {
            tldi.set_cloud(world, floor, cloud(points))
        }),
        ("deform", |tldi, world, floor, points| {
            tldi.deform(world, floor, points, None)
        }),
    ];
    for (way, give) in ways {
        let (mut world, mut tldi, floor, ball) = ball_on_floor();
        let mut rng = Rng::with_seed(3);
        let mut height = 0.0;
        let missing = [Vector::NAN];
        let mut points: Vec<Vector> = (floor_at(Vector::ZERO).into_iter().chain(missing)).collect();
        tldi.set_cloud(&mut world, floor, cloud(&points))?;
        for step in 0..40 {
            if step % 2 == 0 {
                height += 0.08; // 2.4 m/s
                let aside = |rng: &mut Rng| 0.005 * rng.f32();
                let new = floor_at(Vector::new(aside(&mut rng), height, aside(&mut rng)));
                points = new.into_iter().chain(missing).collect();
            }
            give(&mut tldi, &mut world, floor, &points)?;
            tldi.step(&mut world)?;
        }
        let above = world.bodies[ball].translation().y - height;
        assert!(
            above > 0.15,
            "{way}: its middle is {above} m above the floor"
        );
    }
    Ok(())
}

/// A belt carries a cube at its speed after a pause, in which steps take no time, and where steps take different times.
#[test]
fn speeds_count_time() -> TestResult {
    let speed = 1.0;
    for is_paused in [false, true] {
        let (mut world, mut tldi) = attached();
        let belt = insert_floor(&mut world, 2.0);
        let moving = dynamic_at(0.199).linvel(speed * Vector::X);
        let cube = ColliderBuilder::cuboid(HALF, HALF, HALF);
        let (cube, _) = world.insert(moving.can_sleep(false), cube);
        let mut way = 0.0;
        for step in 0..40 {
            if is_paused && step == 21 {
                world.integration_parameters.dt = 0.0;
                for _ in 0..100 {
                    tldi.step(&mut world)?;
                }
            }
            world.integration_parameters.dt = match step % 3 {
                2 if !is_paused => 1.0 / 120.0,
                _ => 1.0 / 60.0,
            };
            if step % 2 == 0 {
                let points = square(2.0);
                let points: Vec<Vector> = points.iter().map(|p| *p + way * Vector::X).collect();
                tldi.deform(&mut world, belt, &points, None)?;
            }
            tldi.step(&mut world)?;
            way += speed * world.integration_parameters.dt;
            // Friction changes it by 0.08 m/s in a step. The first points stood still before.
            let off = (world.bodies[cube].linvel().x - speed).abs();
            assert!(
                step < 10 || off < 0.02,
                "{is_paused}, step {step}: {off} m/s"
            );
        }
    }
    Ok(())
}
