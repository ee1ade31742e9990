//! New points for a cloud that is in a world.

use crate::common::worlds::{
    HALF, REST_TOLERANCE, TestResult, attached, dynamic_at, insert_floor, settle,
};
use crate::common::{SPACING, cloud, cube, shape, square};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;

/// New points under a sleeping body wake it, in the same step and without a miss, and it follows.
#[test]
fn new_points_wake_sleepers() -> TestResult {
    let (mut world, mut tldi) = attached();
    let floor = insert_floor(&mut world, 0.8);
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

/// Another cloud, coarser and with radii of its own, does as well.
#[test]
fn another_cloud_takes_the_place_of_the_first() -> TestResult {
    let (mut world, mut tldi) = attached();
    let floor = insert_floor(&mut world, 0.8);
    let (body, collider) = world.insert(dynamic_at(HALF), tldi.collider(cloud(&cube(HALF))));
    settle(&mut world, &mut tldi)?;
    let sunk = |p: &Vector| *p - Vector::Y * 0.03;
    let coarser: Vec<Vector> = square(0.8).iter().step_by(2).map(sunk).collect();
    let radii = vec![1.5 * SPACING; coarser.len()];
    let next = PointCloud::builder(coarser).radii(radii).build()?;
    tldi.set_cloud(&mut world, floor, next.into_owned())?;
    let report = tldi.step(&mut world)?;
    assert_eq!((report.pairs_batched, report.pairs_missed), (1, 0));
    assert!(!world.bodies[body].is_sleeping());
    settle(&mut world, &mut tldi)?;
    let height = world.bodies[body].translation().y;
    assert!(
        (height - (HALF - 0.03)).abs() < 2.0 * REST_TOLERANCE,
        "{height}"
    );
    let (_, ball) = world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.1));
    let refused = tldi.set_cloud(&mut world, ball, cloud(&cube(HALF)));
    assert_eq!(refused, Err(TldiError::NotACloud(ball)));
    world.remove_body(body);
    let refused = tldi.set_cloud(&mut world, collider, cloud(&cube(HALF)));
    assert_eq!(refused, Err(TldiError::NoSuchCollider(collider)));
    Ok(())
}

#[test]
fn set_points_errors_leave_the_cloud() -> TestResult {
    let (mut world, mut tldi) = attached();
    let (body, ball) = world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.1));
    let scan = insert_floor(&mut world, 0.4);
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

/// The points that a cloud has already wake nobody.
#[test]
fn the_same_points_leave_sleepers_asleep() -> TestResult {
    let (mut world, mut tldi) = attached();
    let floor = insert_floor(&mut world, 0.8);
    let (body, _) = world.insert(dynamic_at(HALF), tldi.collider(cloud(&cube(HALF))));
    settle(&mut world, &mut tldi)?;
    for _ in 0..3 {
        tldi.set_points(&mut world, floor, &square(0.8), None)?;
        let report = tldi.step(&mut world)?;
        assert_eq!(report.pairs_batched, 0);
        assert!(world.bodies[body].is_sleeping());
    }
    Ok(())
}

/// Moves a floor at `velocity` m/s for a second under a cube and returns the cube's position and
/// velocity relative to the floor; as a deforming surface, or as new points.
fn carried(velocity: Vector, floor_first: bool, deforms: bool) -> Result<[Vector; 2], TldiError> {
    carried_every(1, velocity, floor_first, deforms)
}

/// The same where the points are new in one of `every` steps only.
fn carried_every(
    every: usize,
    velocity: Vector,
    floor_first: bool,
    deforms: bool,
) -> Result<[Vector; 2], TldiError> {
    let (mut world, mut tldi) = attached();
    let cube = tldi.collider(cloud(&cube(HALF)));
    let (floor, body) = if floor_first {
        let floor = insert_floor(&mut world, 1.6);
        (floor, world.insert(dynamic_at(HALF), cube).0)
    } else {
        let body = world.insert(dynamic_at(HALF), cube).0;
        (insert_floor(&mut world, 1.6), body)
    };
    let dt = world.integration_parameters.dt;
    let mut moved = Vector::ZERO;
    for step in 0..90 {
        if step >= 30 && step % every == 0 {
            moved += velocity * (every as f32 * dt);
            let points: Vec<Vector> = square(1.6).into_iter().map(|p| p + moved).collect();
            if deforms {
                tldi.deform(&mut world, floor, &points, None)?;
            } else {
                tldi.set_points(&mut world, floor, &points, None)?;
            }
        }
        tldi.step(&mut world)?;
    }
    // In its last steps the surface went on from the last points.
    moved += velocity * (every as f32 * dt);
    let body = &world.bodies[body];
    let start = Vector::Y * HALF;
    Ok([body.translation() - start - moved, body.linvel() - velocity])
}

/// A floor that slides and rises carries what stands on it, in either order of the colliders.
#[test]
fn deforming_floors_carry_what_stands_on_them() -> TestResult {
    for floor_first in [true, false] {
        for velocity in [
            Vector::X * 0.5,
            Vector::Y * 0.5,
            Vector::new(0.3, 0.3, -0.2),
        ] {
            let [behind, slower] = carried(velocity, floor_first, true)?;
            let case = format!("{velocity}, floor first {floor_first}: {behind} m, {slower} m/s");
            // Friction of 0.5 brings it to the speed within 0.1 s and 25 mm. A floor that rises by 0.2 r̄ in
            // every step lifts it corner by corner: it rocks, and walks by up to a fifth of the way.
            let aside = 0.025 + 0.2 * velocity.y;
            assert!(
                behind.with_y(0.0).length() < aside + 0.5 * SPACING,
                "{case}"
            );
            assert!(behind.y.abs() < 0.25 * SPACING, "{case}");
            assert!(slower.with_y(0.0).length() < 0.2, "{case}");
        }
    }
    // New points have no velocity: they slide away under the cube.
    let [behind, _] = carried(Vector::X * 0.5, true, false)?;
    assert!(behind.x < -0.4, "{behind}");
    Ok(())
}

/// On a floor that sinks a cube falls in small hops, since rapier ends every step without relative
/// velocity, and rocks; as a rule little.
#[test]
fn sinking_floors_let_what_stands_on_them_down() -> TestResult {
    let mut sideways = Vec::new();
    for k in 0..24 {
        for floor_first in [true, false] {
            let velocity = Vector::Y * (-0.4 - 0.008 * k as f32);
            let [behind, slower] = carried(velocity, floor_first, true)?;
            assert!(behind.length() < 1.5 * SPACING, "{velocity}: {behind} m");
            sideways.push(slower.with_y(0.0).length());
        }
    }
    sideways.sort_by(f32::total_cmp);
    assert!(sideways[24] < 0.1 && sideways[47] < 0.4, "{sideways:?}");
    Ok(())
}

/// A floor that rises faster than rapier undoes penetrations (3 m/s) takes along what stands on it,
/// whether its points are known to be the same or not. From 6 m/s on it passes half of the cube in two steps, and may leave
/// it behind.
#[test]
fn fast_floors_push_what_stands_on_them() -> TestResult {
    for floor_first in [true, false] {
        for deforms in [true, false] {
            let [behind, slower] = carried(Vector::Y * 5.0, floor_first, deforms)?;
            let case = format!("deforms {deforms}, floor first {floor_first}: {behind}, {slower}");
            // It is thrown a little, and gravity takes 0.16 m/s in a step.
            assert!(
                (-0.5 * SPACING..2.0 * SPACING).contains(&behind.y),
                "{case}"
            );
            assert!((-0.5..0.5).contains(&slower.y), "{case}");
        }
    }
    Ok(())
}

/// It passes what rapier's solver keeps apart: bodies of other solver groups, and those that a joint lets pass.
#[test]
fn fast_floors_push_only_what_they_touch() -> TestResult {
    let apart = InteractionGroups::new(Group::GROUP_1, Group::GROUP_1, InteractionTestMode::And);
    let others = InteractionGroups::new(Group::GROUP_2, Group::GROUP_2, InteractionTestMode::And);
    for (case, of_floor, of_body, is_joined) in [
        ("same groups", apart, apart, false),
        ("other groups", apart, others, false),
        ("a joint", apart, apart, true),
    ] {
        let (mut world, mut tldi) = attached();
        let collider = tldi.collider(cloud(&square(0.8))).solver_groups(of_floor);
        let (ground, floor) = world.insert(RigidBodyBuilder::fixed(), collider);
        let collider = tldi.collider(cloud(&cube(HALF))).solver_groups(of_body);
        let (body, _) = world.insert(dynamic_at(HALF).gravity_scale(0.0), collider);
        if is_joined {
            let free = GenericJointBuilder::new(JointAxesMask::empty()).contacts_enabled(false);
            world.insert_impulse_joint(ground, body, free);
        }
        let rise = Vector::Y * 6.0 * world.integration_parameters.dt;
        for k in 1..=3 {
            let risen: Vec<Vector> = (square(0.8).iter()).map(|p| *p + k as f32 * rise).collect();
            tldi.deform(&mut world, floor, &risen, None)?;
            tldi.step(&mut world)?;
        }
        let speed = world.bodies[body].linvel().y;
        let is_right = match case {
            "same groups" => speed > 5.0,
            _ => speed == 0.0,
        };
        assert!(is_right, "{case}: {speed} m/s");
    }
    Ok(())
}

/// It pushes along where its body was turned to since the last step.
#[test]
fn fast_floors_push_as_their_bodies_were_turned() -> TestResult {
    let (mut world, mut tldi) = attached();
    let upright = Rotation::from_rotation_z(0.5 * std::f32::consts::PI);
    let (ground, floor) = world.insert(
        RigidBodyBuilder::fixed().rotation(upright.to_scaled_axis()),
        tldi.collider(cloud(&square(0.8))),
    );
    let body = dynamic_at(HALF).gravity_scale(0.0);
    let (body, _) = world.insert(body, tldi.collider(cloud(&cube(HALF))));
    world.bodies[ground].set_rotation(Rotation::IDENTITY, true);
    let rise = Vector::Y * 6.0 * world.integration_parameters.dt;
    let risen: Vec<Vector> = square(0.8).iter().map(|p| *p + rise).collect();
    tldi.deform(&mut world, floor, &risen, None)?;
    tldi.step(&mut world)?;
    let speed = world.bodies[body].linvel().y;
    assert!(speed > 5.0, "{speed} m/s");
    Ok(())
}

/// So does one that a sensor sees in every second step only: it is not taken to be twice as fast, nor
/// for one that stands still in between.
#[test]
fn fast_floors_push_between_their_frames() -> TestResult {
    for floor_first in [true, false] {
        let [behind, slower] = carried_every(2, Vector::Y * 4.0, floor_first, false)?;
        let case = format!("floor first {floor_first}: {behind}, {slower}");
        assert!(
            (-0.5 * SPACING..2.0 * SPACING).contains(&behind.y),
            "{case}"
        );
        assert!((-0.5..0.5).contains(&slower.y), "{case}");
    }
    Ok(())
}

/// A surface that is replaced by a higher one once does not throw what lies on it.
#[test]
fn a_surface_that_jumps_does_not_throw() -> TestResult {
    let (mut world, mut tldi) = attached();
    let floor = insert_floor(&mut world, 0.8);
    let (body, _) = world.insert(dynamic_at(HALF), tldi.collider(cloud(&cube(HALF))));
    settle(&mut world, &mut tldi)?;
    let raised: Vec<Vector> = square(0.8).iter().map(|p| *p + 0.08 * Vector::Y).collect();
    tldi.set_points(&mut world, floor, &raised, None)?;
    for _ in 0..5 {
        tldi.step(&mut world)?;
        let speed = world.bodies[body].linvel().length();
        assert!(speed < 0.5, "{speed}"); // 0.08 m in a step are 4.8 m/s
    }
    Ok(())
}

/// A surface that deforms may have points that are not finite, the same ones in every frame or others: it carries what
/// stands on it.
#[test]
fn surfaces_with_dropped_points_deform() -> TestResult {
    let missing = Vector::splat(f32::NAN);
    let velocity = Vector::X * 0.5;
    for changes in [false, true] {
        let (mut world, mut tldi) = attached();
        let dt = world.integration_parameters.dt;
        let frame = |k: usize| -> Vec<Vector> {
            let lost = if changes { k % 7 } else { 3 };
            let moved = (square(1.6).into_iter()).map(|p| p + k as f32 * dt * velocity);
            let seen = moved.enumerate().map(|(i, p)| match i % 7 == lost {
                true => missing,
                false => p,
            });
            seen.collect()
        };
        let floor = cloud(&frame(0));
        let (_, floor) = world.insert(RigidBodyBuilder::fixed(), tldi.collider(floor));
        let (body, _) = world.insert(dynamic_at(HALF), tldi.collider(cloud(&cube(HALF))));
        for k in 1..=60 {
            tldi.deform(&mut world, floor, &frame(k), None)?;
            tldi.step(&mut world)?;
        }
        // Friction of 0.5 brings it to the speed within 0.1 s.
        let slower = world.bodies[body].linvel() - velocity;
        assert!(
            slower.with_y(0.0).length() < 0.05,
            "{changes}: {slower} m/s"
        );
        let one_more: Vec<Vector> = frame(0).into_iter().chain([Vector::ZERO]).collect();
        assert_eq!(
            tldi.deform(&mut world, floor, &one_more, None),
            Err(TldiError::OtherPoints {
                collider: floor,
                expected: one_more.len() - 1,
                found: one_more.len(),
            })
        );
    }
    Ok(())
}

/// Velocities are those of the points that a deforming surface has: a shape that takes its place in the same frame, with as
/// many points or with fewer, has none.
#[test]
fn another_shape_has_no_motion() -> TestResult {
    for size in [1.6, 0.8] {
        let (mut world, mut tldi) = attached();
        let floor = insert_floor(&mut world, 1.6);
        let (body, _) = world.insert(dynamic_at(HALF), tldi.collider(cloud(&cube(HALF))));
        let slid: Vec<Vector> = square(1.6).iter().map(|p| *p + 0.1 * Vector::X).collect();
        tldi.deform(&mut world, floor, &slid, None)?;
        let shape = PointCloudShape::new(cloud(&square(size)));
        world.colliders[floor].set_shape(SharedShape::new(shape));
        tldi.step(&mut world)?;
        // 0.1 m in a step are 6 m/s.
        let speed = world.bodies[body].linvel().length();
        assert!(speed < 0.01, "{size}: {speed}");
    }
    Ok(())
}

/// A surface comes to rest when it is not moved any more, and other points are no motion.
#[test]
fn motion_lasts_for_a_step() -> TestResult {
    let (mut world, mut tldi) = attached();
    let floor = insert_floor(&mut world, 0.8);
    let (body, _) = world.insert(dynamic_at(HALF), tldi.collider(cloud(&cube(HALF))));
    let slid: Vec<Vector> = square(0.8)
        .into_iter()
        .map(|p| p + Vector::X * 0.01)
        .collect();
    tldi.deform(&mut world, floor, &slid, None)?;
    for _ in 0..60 {
        tldi.step(&mut world)?;
    }
    assert!(world.bodies[body].linvel().length() < 0.01);
    let fewer = &slid[1..];
    assert_eq!(
        tldi.deform(&mut world, floor, fewer, None),
        Err(TldiError::OtherPoints {
            collider: floor,
            expected: slid.len(),
            found: fewer.len()
        })
    );
    // New points, as many as before, after a motion in the same step.
    tldi.deform(&mut world, floor, &square(0.8), None)?;
    tldi.set_points(&mut world, floor, &slid, None)?;
    tldi.step(&mut world)?;
    assert!(world.bodies[body].linvel().length() < 0.01);
    Ok(())
}
