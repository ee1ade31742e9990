//! Fast bodies: they stop at what they meet, and only there.

use crate::common::worlds::{TestResult, attached};
use crate::common::{SPACING, cube, shape, square};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;

/// Half the edge of the floors, metres.
const FLOOR: f32 = 3.0;

/// The lowest that the middle of a body gets above a floor at height 0, while it is over it.
fn lowest(
    body: ColliderBuilder,
    floor: ColliderBuilder,
    velocity: Velocity,
) -> Result<f32, TldiError> {
    let (mut world, mut tldi) = attached();
    world.insert(RigidBodyBuilder::fixed(), floor.friction(0.0));
    let flying = RigidBodyBuilder::dynamic()
        .translation(-2.0 * velocity.linear.normalize())
        .linvel(velocity.linear)
        .angvel(velocity.angular)
        .gravity_scale(0.0);
    let (body, _) = world.insert(flying, body.friction(0.0));
    let mut lowest = f32::INFINITY;
    for _ in 0..30 {
        tldi.step(&mut world)?;
        let middle = world.bodies[body].translation();
        if middle.with_y(0.0).abs().max_element() < FLOOR {
            lowest = lowest.min(middle.y);
        }
    }
    Ok(lowest)
}

#[derive(Clone, Copy, Debug)]
struct Velocity {
    linear: Vector,
    angular: Vector,
}

/// Clouds and exact bodies on clouds and exact floors, straight down and slanting, turning or not.
#[test]
fn fast_bodies_stop() -> TestResult {
    let bodies: [fn() -> ColliderBuilder; 3] = [
        || cloud_collider(shape(&cube(0.2))),
        || cloud_collider(shape(&cube(0.05))),
        || ColliderBuilder::ball(0.1),
    ];
    for body in bodies {
        for speed in [5.0, 30.0, 200.0] {
            for slant in [0.0, 1.0] {
                for spin in [0.0, 30.0] {
                    let velocity = Velocity {
                        linear: speed * Vector::new(slant, -1.0, 0.0).normalize(),
                        angular: spin * Vector::new(1.0, 0.5, -0.3),
                    };
                    let floors = [
                        cloud_collider(shape(&square(FLOOR))),
                        ColliderBuilder::cuboid(FLOOR, 0.02, FLOOR),
                    ];
                    let is_cloud = body().shape.as_shape::<PointCloudShape>().is_some();
                    for floor in floors.into_iter().take(1 + usize::from(is_cloud)) {
                        let is_exact = floor.shape.as_cuboid().is_some();
                        let lowest = lowest(body(), floor, velocity)?;
                        // The corners of the largest are 0.35 m from its middle.
                        let stops = 0.0 < lowest && lowest < 0.5;
                        assert!(stops, "{lowest}: {velocity:?}, exact {is_exact}");
                    }
                }
            }
        }
    }
    Ok(())
}

/// Friction-free, with edges of `2 · half` metres, its heights within so many spacings.
fn rough_floor(half: f32, spacings: f32, seed: u64) -> ColliderBuilder {
    let mut rng = fastrand::Rng::with_seed(seed);
    let rough: Vec<Vector> = square(half)
        .into_iter()
        .map(|p| p + spacings * SPACING * (rng.f32() - 0.5) * Vector::Y)
        .collect();
    cloud_collider(shape(&rough)).friction(0.0)
}

/// A fast slide over a rough floor is no impact: friction-free, it goes on undiminished.
#[test]
fn fast_slides_go_on() -> TestResult {
    let (mut world, mut tldi) = attached();
    world.insert(RigidBodyBuilder::fixed(), rough_floor(3.0, 0.3, 1));
    let slider = RigidBodyBuilder::dynamic()
        .translation(Vector::new(-2.5, 0.2, 0.0))
        .linvel(Vector::X * 30.0);
    let (slider, _) = world.insert(slider, cloud_collider(shape(&cube(0.2))).friction(0.0));
    for _ in 0..9 {
        tldi.step(&mut world)?;
    }
    let moved = world.bodies[slider].translation().x + 2.5;
    assert!((moved - 4.5).abs() < 0.05, "{moved}");
    Ok(())
}

/// The ends of a rod that spins beside a sheet stay on their side of it, at up to a turn of a radian in a step.
#[test]
fn ends_of_what_spins_stop() -> TestResult {
    let half = Vector::new(0.5, 0.06, 0.06);
    let rod: Vec<Vector> = cube(0.5).into_iter().map(|p| p * half / 0.5).collect();
    let distance = 0.35;
    for spin in [20.0, 40.0, 60.0] {
        for begins_at in [0.0, 0.3] {
            let (mut world, mut tldi) = attached();
            world.gravity = Vector::ZERO;
            let sheet = cloud_collider(shape(&square(1.0))).friction(0.0);
            world.insert(RigidBodyBuilder::fixed(), sheet);
            let spinning = RigidBodyBuilder::dynamic()
                .pose(Pose::new(distance * Vector::Y, begins_at * Vector::Z))
                .angvel(-spin * Vector::Z)
                .ccd_enabled(true);
            let (spinning, _) = world.insert(spinning, cloud_collider(shape(&rod)).friction(0.0));
            for _ in 0..60 {
                tldi.step(&mut world)?;
                let pose = world.bodies[spinning].position();
                let ends = [half.x, -half.x].map(|x| (pose * Vector::new(x, 0.0, 0.0)).y);
                let lowest = ends[0].min(ends[1]);
                // The middle of an end face is nearly as high as the rod's edge is thick when it touches.
                assert!(
                    lowest > 0.0,
                    "{lowest} m at {spin} rad/s from {begins_at} on"
                );
            }
            assert!(world.bodies[spinning].linvel().y > 0.0, "it is pushed off");
        }
    }
    Ok(())
}

/// What spins fast on a rough floor is not stopped by it: friction-free, it goes on undiminished.
#[test]
fn fast_spins_go_on() -> TestResult {
    let (mut world, mut tldi) = attached();
    world.insert(RigidBodyBuilder::fixed(), rough_floor(1.0, 1.0, 2));
    let spinner = RigidBodyBuilder::dynamic()
        .translation(0.2 * Vector::Y)
        .angvel(40.0 * Vector::Y)
        .ccd_enabled(true);
    let (spinner, _) = world.insert(spinner, cloud_collider(shape(&cube(0.2))).friction(0.0));
    let mut turned = 0.0;
    for _ in 0..30 {
        let before = *world.bodies[spinner].rotation();
        tldi.step(&mut world)?;
        turned += before.angle_between(*world.bodies[spinner].rotation());
    }
    assert!((turned - 20.0).abs() < 0.5, "{turned}");
    Ok(())
}

/// A wall with new points in every step that gives way by more than rapier's prediction distance, but by
/// less than its mean radius: a body that is faster does not keep its speed behind it.
#[test]
fn what_gives_way_slowly_stops_what_is_fast() -> TestResult {
    const RADIUS: f32 = 0.1;
    let (mut world, mut tldi) = attached();
    world.gravity = Vector::ZERO;
    let mut rng = fastrand::Rng::with_seed(1);
    let mut wall_at = |x: f32| -> Vec<Vector> {
        let mut jitter = || 0.5 * RADIUS * (rng.f32() - 0.5);
        let grid = (0..441).map(|k| RADIUS * Vector::new(0.0, (k / 21) as f32, (k % 21) as f32));
        let middle = RADIUS * Vector::new(0.0, 10.0, 10.0);
        grid.map(|p| p - middle + Vector::new(x, jitter(), jitter()))
            .collect()
    };
    let wall = PointCloud::builder(wall_at(1.0)).radius(RADIUS).build()?;
    let wall = PointCloudShape::new(wall);
    let (_, wall) = world.insert(RigidBodyBuilder::fixed(), cloud_collider(wall));
    let flying = RigidBodyBuilder::dynamic().linvel(30.0 * Vector::X);
    let (ball, _) = world.insert(flying, ColliderBuilder::ball(0.2));
    let per_step = 0.05;
    assert!(per_step > 2.0 * world.integration_parameters.prediction_distance());
    for step in 1..=12 {
        tldi.set_points(
            &mut world,
            wall,
            &wall_at(1.0 + per_step * step as f32),
            None,
        )?;
        tldi.step(&mut world)?;
    }
    let speed = world.bodies[ball].linvel().x;
    let of_wall = per_step / world.integration_parameters.dt;
    assert!(speed < 1.5 * of_wall, "{speed} m/s behind {of_wall} m/s");
    Ok(())
}

/// A plate with one end under a sheet without an inside is not held there by a sweep, once its contacts
/// have seen on which side it is; nor is the sheet.
#[test]
fn what_is_in_a_sheet_leaves_it() -> TestResult {
    let half = Vector::new(0.3, 0.02, 0.15);
    let tilt: f32 = 0.35;
    let end = half.x * tilt.sin() + half.y * tilt.cos();
    let speed = 8.0;
    for sheet_moves in [false, true] {
        let (mut world, mut tldi) = attached();
        world.gravity = Vector::ZERO;
        let builder = |moves: bool| match moves {
            true => RigidBodyBuilder::dynamic(),
            false => RigidBodyBuilder::fixed(),
        };
        let sheet = cloud_collider(shape(&square(1.0)));
        let (sheet, _) = world.insert(builder(sheet_moves), sheet.friction(0.0));
        let tilted = builder(!sheet_moves)
            .translation(Vector::new(0.0, end - 0.1 * SPACING, 0.0))
            .rotation(tilt * Vector::Z);
        let plate = ColliderBuilder::cuboid(half.x, half.y, half.z);
        let (plate, _) = world.insert(tilted, plate.friction(0.0));
        tldi.step(&mut world)?;
        let (moving, away) = if sheet_moves {
            (sheet, -Vector::Y)
        } else {
            (plate, Vector::Y)
        };
        let start = world.bodies[moving].translation() - 0.8 * end * away;
        let body = &mut world.bodies[moving];
        body.set_translation(start, true);
        body.set_linvel(speed * away, true);
        body.set_angvel(Vector::ZERO, true);
        tldi.step(&mut world)?;
        let way = (world.bodies[moving].translation() - start).dot(away);
        let free = speed * world.integration_parameters.dt;
        assert!(way > 0.9 * free, "{way} of {free} m, sheet {sheet_moves}");
    }
    Ok(())
}

/// Boxes that are up to 1.5 radii deep in waves and fly at random. What flies against a slope that none of
/// its contacts faces is stopped by it, not held by a sweep in step after step with its speed kept.
#[test]
fn what_a_slope_holds_loses_its_speed_into_it() -> TestResult {
    const RADIUS: f32 = 0.1;
    let height = |x: f32, z: f32| {
        let phase = |along: f32| along * std::f32::consts::TAU / (14.0 * RADIUS);
        2.0 * RADIUS * phase(x).sin() * phase(z).cos()
    };
    let mut rng = fastrand::Rng::with_seed(1);
    let mut sample = |k: i32| RADIUS * (k as f32 - 30.25 + 0.5 * rng.f32());
    let waves = (0..61 * 61).map(|k| {
        let (x, z) = (sample(k / 61), sample(k % 61));
        Vector::new(x, height(x, z), z)
    });
    let waves = PointCloud::builder(waves.collect::<Vec<_>>())
        .radius(RADIUS)
        .build()?;
    let waves = PointCloudShape::new(waves);
    let cube = shape(&cube(1.45 * RADIUS));
    for (seed, floor_first) in (100..200).flat_map(|seed| [(seed, true), (seed, false)]) {
        let mut rng = fastrand::Rng::with_seed(seed);
        let mut coordinate = || rng.f32() - 0.5;
        let mut vector = || Vector::new(coordinate(), coordinate(), coordinate());
        let (mut world, mut tldi) = attached();
        world.gravity = Vector::ZERO;
        let at = 14.0 * RADIUS * vector();
        let flying = RigidBodyBuilder::dynamic()
            .translation(at.with_y(height(at.x, at.z) + 2.3 * RADIUS))
            .rotation(6.0 * vector())
            .ccd_enabled(true);
        let floor = (RigidBodyBuilder::fixed(), cloud_collider(waves.clone()));
        let flying = (flying, cloud_collider(cube.clone()));
        let order = if floor_first {
            [floor, flying]
        } else {
            [flying, floor]
        };
        let [(first, _), (second, _)] = order.map(|(body, collider)| world.insert(body, collider));
        let body = if floor_first { second } else { first };
        tldi.step(&mut world)?; // it is seen where it comes from
        let flying = &mut world.bodies[body];
        let down = (1.0 + vector().x) * RADIUS;
        flying.set_translation(flying.translation() - down * Vector::Y, true);
        flying.set_linvel(200.0 * vector(), true);
        let mut held = 0;
        for step in 1..=8 {
            let before = world.bodies[body].translation();
            tldi.step(&mut world)?;
            let body = &world.bodies[body];
            let free = body.linvel().length() * world.integration_parameters.dt;
            let is_held = body.translation().distance(before) < 0.05 * free;
            held = if is_held && free > 0.5 * RADIUS {
                held + 1
            } else {
                0
            };
            assert!(held < 3, "seed {seed}, step {step}: {:?}", body.linvel());
        }
    }
    Ok(())
}

/// A capsule that tips over is fast and touches the floor all the while. Sweeps do not hold it: it would hang in the air and
/// gather speed. Its energy grows by less than half of what lifts it by its radius, in steps twice as long by less than twice
/// that. Held ones gained 15 to 28 times as much.
#[test]
fn what_tips_over_is_not_held() -> TestResult {
    let (radius, spacing) = (0.035, 0.005);
    let capsule = SharedShape::capsule_y(0.06, radius);
    let floor = SharedShape::cuboid(0.5, 0.04, 0.5);
    for (of_body, of_floor) in [(true, true), (true, false), (false, true)] {
        let collider = |shape: &SharedShape, is_cloud| -> Result<_, rapier3d_tldi::SampleError> {
            Ok(match is_cloud {
                true => cloud_collider(PointCloudShape::new(sample_shape(&**shape, spacing)?)),
                false => ColliderBuilder::new(shape.clone()),
            })
        };
        for (tilt, speed, rate, most_gained) in [
            (0.15, 0.1, 60.0, 0.5),
            (0.45, 0.0, 60.0, 0.5),
            (0.15, 0.1, 30.0, 2.0),
        ] {
            let (mut world, mut tldi) = attached();
            world.integration_parameters.dt = 1.0 / rate;
            world.integration_parameters.length_unit = 0.1;
            let ground = RigidBodyBuilder::fixed().translation(-0.04 * Vector::Y);
            world.insert(ground, collider(&floor, of_floor)?);
            let height = radius + 0.06 * f32::cos(tilt);
            let tipping = RigidBodyBuilder::dynamic()
                .translation(height * Vector::Y)
                .rotation(tilt * Vector::X)
                .linvel(speed * Vector::Z);
            let (body, _) = world.insert(tipping, collider(&capsule, of_body)?);
            world.bodies[body].recompute_mass_properties_from_colliders(&world.colliders);
            let gravity = world.gravity;
            let energy = |world: &PhysicsWorld| {
                let body = &world.bodies[body];
                body.kinetic_energy() - body.mass() * gravity.dot(body.translation())
            };
            let at_first = energy(&world);
            let allowed = most_gained * world.bodies[body].mass() * gravity.length() * radius;
            for step in 0..45 {
                tldi.step(&mut world)?;
                let gained = energy(&world) - at_first;
                assert!(
                    gained < allowed,
                    "cloud body {of_body}, cloud floor {of_floor}, {tilt} rad, {rate} Hz: {gained} J of {allowed} J in step {step}"
                );
            }
        }
    }
    Ok(())
}

/// What a joint or the types of bodies keep apart moves as if the two could not meet at all: a door through its frame.
#[test]
fn what_is_kept_apart_is_not_swept() -> TestResult {
    let half = Vector::new(0.5, 0.03, 0.2);
    let door: Vec<Vector> = cube(0.5).into_iter().map(|p| p * half / 0.5).collect();
    let apart = InteractionGroups::new(Group::GROUP_1, Group::NONE, InteractionTestMode::And);
    let swung = |joint_keeps: bool, types: ActiveCollisionTypes, groups| {
        let (mut world, mut tldi) = attached();
        world.gravity = Vector::ZERO;
        let frame = cloud_collider(shape(&square(0.8))).active_collision_types(types);
        let (frame, _) = world.insert(RigidBodyBuilder::fixed(), frame);
        let (turn, spin) = (Rotation::from_rotation_z(1.0), -9.0 * Vector::Z);
        let from_hinge = turn * (0.5 * Vector::X);
        let door = cloud_collider(shape(&door)).active_collision_types(types);
        let (door, _) = world.insert(
            RigidBodyBuilder::dynamic()
                .pose(Pose::from_parts(from_hinge, turn))
                .linvel(spin.cross(from_hinge))
                .angvel(spin),
            door.collision_groups(groups),
        );
        let hinge = RevoluteJointBuilder::new(Vector::Z)
            .local_anchor2(-0.5 * Vector::X)
            .contacts_enabled(!joint_keeps);
        world.insert_impulse_joint(frame, door, hinge);
        for _ in 0..20 {
            let report = tldi.step(&mut world)?;
            assert_eq!((report.pairs_batched, report.pairs_missed), (0, 0));
        }
        Ok::<Pose, TldiError>(*world.bodies[door].position())
    };
    let (default, all) = (ActiveCollisionTypes::default(), InteractionGroups::all());
    let free = swung(false, default, apart)?;
    assert_eq!(swung(true, default, all)?, free, "by a joint");
    let between_dynamic = ActiveCollisionTypes::DYNAMIC_DYNAMIC;
    assert_eq!(swung(false, between_dynamic, all)?, free, "by types");
    Ok(())
}
