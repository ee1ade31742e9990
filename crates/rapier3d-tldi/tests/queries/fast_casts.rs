//! Shape casts at any speed that `f32` holds, against where a cube truly meets the floor.

use crate::common::worlds::{TestResult, attached, insert_floor};
use crate::common::{SPACING, cube, shape, square};
use rapier3d::parry::query::details::ShapeCastOptions;
use rapier3d::parry::query::{NonlinearRigidMotion, QueryDispatcher};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;

/// How far the cube of [`HALF`] falls from here until it meets the floor, metres.
const FALL: f32 = 1.0;
const HALF: f32 = 0.2;

/// Casts are early by up to a pixel and good to 0.2 of the radius (see the dispatcher's docs).
const EARLY: f32 = SPACING;
const LATE: f32 = 0.2 * SPACING;

fn start() -> Pose {
    Pose::from_translation(Vector::Y * (FALL + HALF))
}

/// From 1 to 10³⁷ m/s for a second: what is met is met in its time, and turning makes it no later.
#[test]
fn what_is_fast_meets_what_is_in_its_way() -> TestResult {
    let (world, tldi) = attached();
    let dispatcher = tldi.dispatcher();
    let body = shape(&cube(HALF));
    let (cloud, ground) = (shape(&square(0.8)), HalfSpace::new(Vector::Y));
    let still = NonlinearRigidMotion::constant_position(Pose::IDENTITY);
    for floor in [&cloud as &dyn Shape, &ground] {
        for exponent in 1..=37 {
            let speed = 10.0_f32.powi(exponent);
            let fall = -speed * Vector::Y;
            for spin in [0.0, 3.0, 300.0, 1e9, 1e18] {
                let motion =
                    NonlinearRigidMotion::new(start(), Vector::ZERO, fall, spin * Vector::X);
                let hit = dispatcher
                    .cast_shapes_nonlinear(&still, floor, &motion, &body, 0.0, 1.0, false)?
                    .ok_or(format!("{speed} m/s, {spin} rad/s passed"))?;
                let fallen = hit.time_of_impact * speed;
                // A corner that turns reaches the floor before a face does. A piece of the motion is early
                // by what it turns, by no more than half of what it moves.
                let earliest = if spin > 0.0 { 0.0 } else { FALL - EARLY };
                assert!(
                    (earliest..FALL + LATE).contains(&fallen),
                    "{speed} m/s, {spin} rad/s: {fallen} m"
                );
            }
            let until_a_second = ShapeCastOptions {
                stop_at_penetration: false,
                ..ShapeCastOptions::with_max_time_of_impact(1.0)
            };
            let hit = dispatcher
                .cast_shapes(&start(), fall, floor, &body, until_a_second)?
                .ok_or(format!("{speed} m/s passed"))?;
            let fallen = hit.time_of_impact * speed;
            assert!((fallen - FALL).abs() < LATE, "{speed} m/s: {fallen} m");
        }
    }
    drop(world);
    Ok(())
}

/// From 10 km away, in pixels of centimetres: the images hold only the end of the way.
#[test]
fn long_casts_meet_their_target() -> TestResult {
    let (_, tldi) = attached();
    let body = shape(&cube(HALF));
    let (cloud, ground) = (shape(&square(0.8)), HalfSpace::new(Vector::Y));
    for floor in [&cloud as &dyn Shape, &ground] {
        let height = 10_000.0;
        let pose = Pose::from_translation(Vector::Y * height);
        let options = ShapeCastOptions::with_max_time_of_impact(f32::MAX);
        let dispatcher = tldi.dispatcher();
        let hit = dispatcher
            .cast_shapes(&pose, -Vector::Y, floor, &body, options)?
            .ok_or("passed")?;
        assert!(
            (hit.time_of_impact - (height - HALF)).abs() < LATE,
            "{hit:?}"
        );
    }
    Ok(())
}

/// A motion that leaves the numbers has no answer, and the pipeline says why.
#[test]
fn motions_that_are_not_finite_are_refused() -> TestResult {
    let (mut world, mut tldi) = attached();
    insert_floor(&mut world, 0.8);
    let (body, floor) = (shape(&cube(HALF)), shape(&square(0.8)));
    let still = NonlinearRigidMotion::constant_position(Pose::IDENTITY);
    for (velocity, spin) in [
        (-f32::MAX * Vector::Y, Vector::ZERO),
        (Vector::NAN, Vector::ZERO),
        (Vector::ZERO, Vector::splat(f32::INFINITY)),
    ] {
        let motion = NonlinearRigidMotion::new(start(), Vector::ZERO, velocity, spin);
        let answer = tldi
            .dispatcher()
            .cast_shapes_nonlinear(&still, &floor, &motion, &body, 0.0, 2.0, false)?;
        assert!(answer.is_none());
        match tldi.finish(&mut world.bodies, &world.narrow_phase, &world.colliders) {
            Err(TldiError::OnTheSpot { count: 1, first }) => {
                assert!(first.to_string().contains("not finite"), "{first}");
            }
            other => return Err(format!("{other:?}").into()),
        }
    }
    Ok(())
}
