//! What surfaces that deform do to bodies, whatever these are, against what rapier does with a surface that its body moves.

use crate::common::worlds::{HALF, TestResult, attached, dynamic_at, insert_floor};
use crate::common::{SPACING, square};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;

/// Half the edges of the floor, metres.
const FLOOR: f32 = 1.6;

fn floor_at(offset: Vector) -> Vec<Vector> {
    square(FLOOR).iter().map(|p| *p + offset).collect()
}

fn box_collider() -> ColliderBuilder {
    ColliderBuilder::cuboid(HALF, HALF, HALF)
}

/// How far a floor that slides at 0.3 m/s for a second carries a box, metres, if it is told so in each step by as many
/// calls as `ways` has, each of which puts the floor that far from where it is then.
fn carried(ways: &[f32]) -> Result<f32, TldiError> {
    let (mut world, mut tldi) = attached();
    let floor = insert_floor(&mut world, FLOOR);
    let (body, _) = world.insert(dynamic_at(HALF), box_collider());
    let step = 0.3 * world.integration_parameters.dt;
    for k in 1..=60 {
        for way in ways {
            let points = floor_at((k as f32 * step + way) * Vector::X);
            tldi.deform(&mut world, floor, &points, None)?;
        }
        tldi.step(&mut world)?;
    }
    Ok(world.bodies[body].translation().x)
}

/// Of several deformations before a step, all together count: the same points again, half of the way first, and what was
/// taken back change nothing.
#[test]
fn deformations_before_a_step_add_up() -> TestResult {
    let once = carried(&[0.0])?;
    assert!((once - 0.3).abs() < 0.01, "{once} m");
    for ways in [[0.0, 0.0], [-0.0025, 0.0], [0.2, 0.0]] {
        let several = carried(&ways)?;
        assert!((several - once).abs() < 1e-4, "{ways:?}: {several} m");
    }
    Ok(())
}

/// A floor that goes down and back up before a step did not move.
#[test]
fn what_is_back_before_a_step_throws_nothing() -> TestResult {
    let (mut world, mut tldi) = attached();
    let floor = insert_floor(&mut world, FLOOR);
    let (body, _) = world.insert(dynamic_at(HALF), box_collider());
    for k in 0..60 {
        if k == 30 {
            for height in [-0.5, 0.0] {
                tldi.deform(&mut world, floor, &floor_at(height * Vector::Y), None)?;
            }
        }
        tldi.step(&mut world)?;
        let speed = world.bodies[body].linvel().length();
        assert!(speed < 0.05, "{k}: {speed} m/s");
    }
    Ok(())
}

/// Steps for `steps` with a floor that rises at `speed` m/s, at first at height 0. `watch` is told the height after each.
fn rise(
    (world, tldi): (&mut PhysicsWorld, &mut TldiPipeline),
    floor: ColliderHandle,
    (speed, steps): (f32, usize),
    mut watch: impl FnMut(&PhysicsWorld, f32),
) -> TestResult {
    for k in 1..=steps {
        let height = k as f32 * speed * world.integration_parameters.dt;
        tldi.deform(world, floor, &floor_at(height * Vector::Y), None)?;
        tldi.step(world)?;
        watch(world, height);
    }
    Ok(())
}

/// A link on a vertical rail is lifted by a floor that rises faster than free bodies wait for. Rapier's own mesh on a body
/// of this speed is at most 6 mm deep in it.
#[test]
fn links_are_lifted() -> TestResult {
    for speed in [1.0, 2.0, 3.0] {
        let (mut world, mut tldi) = attached();
        let floor = insert_floor(&mut world, FLOOR);
        let root = world.insert_body(RigidBodyBuilder::fixed().translation(0.35 * Vector::Y));
        let (link, _) = world.insert(dynamic_at(0.35), box_collider());
        world.insert_multibody_joint(root, link, PrismaticJointBuilder::new(Vector::Y));
        let mut deepest = 0.0_f32;
        rise(
            (&mut world, &mut tldi),
            floor,
            (speed, 60),
            |world, height| {
                let below = world.bodies[link].translation().y - HALF;
                deepest = deepest.max(height - below);
            },
        )?;
        assert!(deepest < 0.01, "{speed} m/s: {deepest} m deep");
    }
    Ok(())
}

/// A body that dominates the floor's is not pushed, as it is not by rapier's contacts.
#[test]
fn what_dominates_is_not_pushed() -> TestResult {
    for (dominance, lifted) in [(0, true), (5, false)] {
        let (mut world, mut tldi) = attached();
        let floor = insert_floor(&mut world, FLOOR);
        // Of a fixed body everything is dominated.
        let body = world.colliders[floor].parent().ok_or("a body")?;
        world.bodies[body].set_body_type(RigidBodyType::KinematicPositionBased, true);
        let above = dynamic_at(0.35)
            .gravity_scale(0.0)
            .dominance_group(dominance);
        let (body, _) = world.insert(above, box_collider());
        rise((&mut world, &mut tldi), floor, (2.0, 60), |_, _| ())?;
        let height = world.bodies[body].translation().y;
        assert_eq!(height > 1.9, lifted, "dominance {dominance}: {height} m");
        assert!(lifted || (height - 0.35).abs() < 1e-3, "{height} m");
    }
    Ok(())
}

/// A body that cannot rise is not spun away. Rapier's own mesh on a body of this speed throws it at 6 m/s.
#[test]
fn what_is_locked_is_not_spun() -> TestResult {
    let (mut world, mut tldi) = attached();
    let floor = insert_floor(&mut world, FLOOR);
    let locked = dynamic_at(0.35).enabled_translations(true, false, true);
    let (body, _) = world.insert(locked, box_collider());
    let mut fastest = 0.0_f32;
    rise((&mut world, &mut tldi), floor, (4.0, 30), |world, _| {
        let body = &world.bodies[body];
        let of_edges = HALF * body.angvel().length();
        fastest = fastest.max(body.linvel().length()).max(of_edges);
    })?;
    // Rapier corrects penetrations at up to 3 m/s, here by spinning the body.
    assert!(fastest < 10.0, "{fastest} m/s");
    Ok(())
}

/// Of a floor that moves at `velocity` m/s along one axis, but is seen in one of `every` steps only: how far a box is at most
/// from where it would be if it moved with the floor, metres. With `repeats`, each step is told the last points again.
fn off_a_floor(velocity: Vector, every: usize, repeats: bool) -> Result<f32, TldiError> {
    let (mut world, mut tldi) = attached();
    let floor = insert_floor(&mut world, FLOOR);
    let (body, _) = world.insert(dynamic_at(HALF), box_collider());
    let dt = world.integration_parameters.dt;
    let mut off = 0.0_f32;
    for k in 0..150 {
        // It starts after half a second: no earlier time tells how often it is seen.
        if k >= 30 && (repeats || k % every == 0) {
            let seen = (k - 30) / every + 1;
            let moved = (seen * every) as f32 * dt * velocity;
            tldi.deform(&mut world, floor, &floor_at(moved), None)?;
        }
        tldi.step(&mut world)?;
        let way = (k as f32 - 29.0).max(0.0) * dt * velocity;
        let from_floor = world.bodies[body].translation() - HALF * Vector::Y - way;
        off = off.max(from_floor.dot(velocity.normalize()).abs());
    }
    Ok(off)
}

/// A floor that is seen every few steps carries a box as fast as it moves, from the first time on: the box is no farther off
/// than the floor jumps from one time to the next, and a little more.
#[test]
fn floors_that_are_seen_every_few_steps_have_their_speed() -> TestResult {
    for velocity in [Vector::Y, 2.0 * Vector::Y, 0.5 * Vector::X] {
        for every in [1, 2, 3, 6] {
            for repeats in [false, true] {
                let off = off_a_floor(velocity, every, repeats)?;
                // Friction of 0.5 brings it to 0.5 m/s within 26 mm; a fast floor throws it a little.
                let most = every as f32 * velocity.length() / 60.0 + 0.05;
                let case = format!("{velocity} m/s, every {every}, repeats {repeats}");
                assert!(off < most, "{case}: {off} m of {most}");
            }
        }
    }
    Ok(())
}

/// How deep a body sinks at most into a floor of new points in every step, metres. The floor comes to rise at `speed` m/s
/// within half a second.
fn sinks(collider: ColliderBuilder, half_height: f32, speed: f32) -> Result<f32, TldiError> {
    let (mut world, mut tldi) = attached();
    let floor = insert_floor(&mut world, FLOOR);
    let (body, _) = world.insert(dynamic_at(half_height), collider);
    let dt = world.integration_parameters.dt;
    let mut rng = fastrand::Rng::with_seed(4);
    let (mut height, mut deepest) = (0.0_f32, 0.0_f32);
    for k in 0..120 {
        height += speed * (k as f32 * dt / 0.5).min(1.0) * dt;
        let aside = SPACING * Vector::new(rng.f32(), 0.0, rng.f32());
        tldi.set_points(
            &mut world,
            floor,
            &floor_at(height * Vector::Y + aside),
            None,
        )?;
        tldi.step(&mut world)?;
        let below = world.bodies[body].translation().y - half_height;
        deepest = deepest.max(height - below);
    }
    Ok(deepest)
}

/// New points tell how fast a floor rises: bodies ride on it, thin ones as well. What rises by less than 0.2 r̄ a step is not
/// told from noise. Rapier's correction alone follows 40 ms, 2.4 steps, behind: 0.5 r̄ at most, and depths are good to 0.15 r̄.
/// Without the floor's speed it is 1 r̄ at 1 m/s.
#[test]
fn floors_of_new_points_carry_bodies() -> TestResult {
    for speed in [0.5, 1.0, 2.0] {
        let plate = ColliderBuilder::cuboid(HALF, SPACING, HALF);
        for (name, body, half_height) in [
            ("box", box_collider(), HALF),
            ("ball", ColliderBuilder::ball(HALF), HALF),
            ("plate", plate, SPACING),
        ] {
            let deepest = sinks(body, half_height, speed)?;
            assert!(deepest < 0.7 * SPACING, "{name}, {speed} m/s: {deepest} m");
        }
    }
    Ok(())
}
