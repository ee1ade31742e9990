//! On which side of a surface a body is: remembered while it touches, whatever rapier does, and forgotten where the user
//! puts it elsewhere.

use crate::common::worlds::{HALF, REST_TOLERANCE, TestResult, attached, dynamic_at};
use crate::common::{SPACING, cloud, cube, square};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;

/// Depth at which a body is put, metres.
const DEPTH: f32 = 0.005;

/// Steps once; the one contact pair is about as deep as the body was put.
fn assert_shallow(world: &mut PhysicsWorld, tldi: &mut TldiPipeline) -> TestResult {
    let report = tldi.step(world)?;
    assert_eq!(report.pairs_in_contact, 1);
    let told = report.max_penetration;
    assert!(told < DEPTH + REST_TOLERANCE, "{told} m");
    Ok(())
}

/// A plank of rapier's own; its body and half its thickness, metres.
fn insert_plank(world: &mut PhysicsWorld) -> (RigidBodyHandle, f32) {
    let half = 0.01;
    let body = RigidBodyBuilder::kinematic_position_based();
    let (body, _) = world.insert(body, ColliderBuilder::cuboid(0.4, half, 0.4));
    (body, half)
}

/// A body that is put under the plank it rests on is below it, not above and deep in it.
#[test]
fn side_is_forgotten_where_a_body_is_put_elsewhere() -> TestResult {
    let (mut world, mut tldi) = attached();
    let (_, plank) = insert_plank(&mut world);
    let (body, _) = world.insert(dynamic_at(plank + HALF), tldi.collider(cloud(&cube(HALF))));
    for _ in 0..5 {
        tldi.step(&mut world)?;
    }
    world.bodies[body].set_translation(Vector::Y * (DEPTH - plank - HALF), true);
    assert_shallow(&mut world, &mut tldi)
}

/// So is that of a body that is put where bounds meet, but not surfaces, and comes back a step later.
#[test]
fn side_is_forgotten_before_a_body_comes_back() -> TestResult {
    let (mut world, mut tldi) = attached();
    world.gravity = Vector::ZERO;
    world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(HALF));
    let body = RigidBodyBuilder::dynamic().translation(2.0 * HALF * Vector::X);
    let (body, _) = world.insert(body, tldi.collider(cloud(&cube(HALF))));
    for _ in 0..5 {
        tldi.step(&mut world)?;
    }
    // An edge towards the ball, 0.03 m from it.
    let diagonal = (Vector::X + Vector::Y) / 2.0_f32.sqrt();
    let middle = -(HALF + 2.0_f32.sqrt() * HALF + 0.03) * diagonal;
    world.bodies[body].set_translation(middle, true);
    world.bodies[body].set_linvel(diagonal, true);
    for step in 0..20 {
        let told = tldi.step(&mut world)?.max_penetration;
        assert!(told < HALF / 4.0, "step {step}: {told} m");
    }
    assert!(world.bodies[body].linvel().dot(diagonal) < 0.1);
    assert!(world.bodies[body].translation().x < -HALF);
    Ok(())
}

/// So is that of a body whose points are put elsewhere, while its pose stays.
#[test]
fn side_is_forgotten_where_points_are_put_elsewhere() -> TestResult {
    let (mut world, mut tldi) = attached();
    world.gravity = Vector::ZERO;
    let (_, plank) = insert_plank(&mut world);
    let at = |y: f32| -> Vec<Vector> { cube(HALF).iter().map(|p| *p + y * Vector::Y).collect() };
    let (_, body) = world.insert(dynamic_at(0.0), tldi.collider(cloud(&at(plank + HALF))));
    for _ in 0..5 {
        tldi.step(&mut world)?;
    }
    tldi.set_points(&mut world, body, &at(DEPTH - plank - HALF), None)?;
    assert_shallow(&mut world, &mut tldi)
}

/// So is that of a board that lies turned in its own frame: its bounds are wide, but it is thin.
#[test]
fn side_of_a_turned_board_is_forgotten() -> TestResult {
    let (mut world, mut tldi) = attached();
    world.gravity = Vector::ZERO;
    let (_, plank) = insert_plank(&mut world);
    let turn = Pose::rotation(std::f32::consts::FRAC_PI_4 * Vector::Z);
    let half = 0.25 * SPACING;
    let board: Vec<Vector> = square(HALF)
        .iter()
        .flat_map(|p| [half, -half].map(|y| turn * (*p + y * Vector::Y)))
        .collect();
    let at = |y: f32| Pose::from_translation(y * Vector::Y) * turn.inverse();
    let body = RigidBodyBuilder::dynamic().pose(at(plank + half));
    let (body, _) = world.insert(body, tldi.collider(cloud(&board)));
    for _ in 0..5 {
        tldi.step(&mut world)?;
    }
    world.bodies[body].set_position(at(DEPTH - plank - half), true);
    assert_shallow(&mut world, &mut tldi)
}

/// A side is one of the larger collider, not of the world: if the user turns both together, nothing changes.
#[test]
fn side_turns_with_the_larger_collider() -> TestResult {
    let (mut world, mut tldi) = attached();
    world.gravity = Vector::ZERO;
    let (plank, half) = insert_plank(&mut world);
    let body = dynamic_at(half + HALF);
    let (body, _) = world.insert(body, tldi.collider(cloud(&cube(HALF))));
    for _ in 0..5 {
        assert_shallow(&mut world, &mut tldi)?;
    }
    let turn = Pose::rotation(std::f32::consts::PI * Vector::X);
    for handle in [plank, body] {
        let pose = turn * *world.bodies[handle].position();
        world.bodies[handle].set_position(pose, true);
    }
    world.bodies[body].set_linvel(Vector::X, true);
    for _ in 0..10 {
        assert_shallow(&mut world, &mut tldi)?;
    }
    Ok(())
}

/// A bare body that comes from behind a scan with normals touches its back. It does not count as deep in what lies behind.
#[test]
fn a_scan_is_met_from_behind() -> TestResult {
    let (mut world, mut tldi) = attached();
    world.gravity = Vector::ZERO;
    let points = square(1.0);
    let normals = vec![Vector::Y; points.len()];
    let scan = PointCloud::builder(points).radius(SPACING);
    let scan = scan.normals(normals).build()?;
    world.insert(RigidBodyBuilder::fixed(), tldi.collider(scan));
    let below = dynamic_at(-0.3).linvel(Vector::Y);
    let (body, _) = world.insert(below, tldi.collider(cloud(&cube(HALF))));
    for step in 0..60 {
        let told = tldi.step(&mut world)?.max_penetration;
        assert!(told < HALF / 4.0, "step {step}: {told} m");
    }
    assert!(world.bodies[body].translation().y < -0.5 * HALF);
    Ok(())
}
