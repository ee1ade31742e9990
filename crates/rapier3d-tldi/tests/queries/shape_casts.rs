//! Shape casts with clouds on either side, straight and turning, against analytic truth.

use crate::common::worlds::{TestResult, attached};
use crate::common::{SPACING, cube, shape, square};
use rapier3d::parry::query::details::ShapeCastOptions;
use rapier3d::parry::query::{NonlinearRigidMotion, QueryDispatcher, ShapeCastStatus};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use std::f32::consts::FRAC_PI_4;

/// Depths are good to 0.2 of the radius.
const TOLERANCE: f32 = 0.2 * SPACING;

fn dispatcher() -> rapier3d_tldi::TldiDispatcher {
    TldiPipeline::new(TldiConfig::default())
        .expect("the settings are valid")
        .dispatcher()
}

fn until(max_time_of_impact: f32) -> ShapeCastOptions {
    ShapeCastOptions::with_max_time_of_impact(max_time_of_impact)
}

/// A cube falls onto a square: as clouds, and with either of them exact; in both orders.
#[test]
fn straight_casts() -> TestResult {
    let dispatcher = dispatcher();
    let (cloud_cube, cloud_floor) = (shape(&cube(0.2)), shape(&square(0.8)));
    let (exact_cube, exact_floor) = (Cuboid::new(Vector::splat(0.2)), HalfSpace::new(Vector::Y));
    let floor_from_cube = Pose::new(Vector::new(0.1, 1.2, 0.0), Vector::Y * FRAC_PI_4);
    let velocity = Vector::new(0.1, -2.0, 0.0);
    let pairs: [(&dyn Shape, &dyn Shape); 3] = [
        (&cloud_floor, &cloud_cube),
        (&exact_floor, &cloud_cube),
        (&cloud_floor, &exact_cube),
    ];
    for (floor, cube) in pairs {
        let hit = dispatcher
            .cast_shapes(&floor_from_cube, velocity, floor, cube, until(10.0))?
            .expect("it falls on the floor");
        assert!(
            (hit.time_of_impact - 0.5).abs() < TOLERANCE / 2.0,
            "{hit:?}"
        );
        assert_eq!(hit.status, ShapeCastStatus::Converged);
        assert!(hit.normal1.y > 0.99 && hit.normal2.y < -0.99, "{hit:?}");
        assert!(hit.witness1.y.abs() < TOLERANCE, "{hit:?}");
        assert!((hit.witness2.y + 0.2).abs() < TOLERANCE, "{hit:?}");
        // The same seen from the cube, in its frame.
        let cube_from_floor = floor_from_cube.inverse();
        let mirrored = dispatcher
            .cast_shapes(
                &cube_from_floor,
                cube_from_floor.rotation * -velocity,
                cube,
                floor,
                until(10.0),
            )?
            .expect("it falls on the floor");
        // Rounding may move points to other pixels.
        let later = mirrored.time_of_impact - hit.time_of_impact;
        assert!(later.abs() < TOLERANCE / 2.0, "{later}");
        assert!(mirrored.witness2.y.abs() < TOLERANCE, "{mirrored:?}");
        assert!(mirrored.normal2.y > 0.99, "{mirrored:?}");
        // Too short, the other way, and beside.
        let miss = |velocity, time| {
            dispatcher.cast_shapes(&floor_from_cube, velocity, floor, cube, until(time))
        };
        assert!(miss(velocity, 0.48)?.is_none());
        assert!(miss(-velocity, 10.0)?.is_none());
        assert!(miss(Vector::X, 10.0)?.is_none());
        assert!(miss(Vector::ZERO, 10.0)?.is_none());
    }
    Ok(())
}

/// A joint that turns for minutes leaves rapier a quaternion that is no unit any more: pairs and casts are answered as if it
/// were one.
#[test]
fn rotations_that_have_drifted_are_answered() -> TestResult {
    let tldi = TldiPipeline::new(TldiConfig::default())?;
    let dispatcher = tldi.dispatcher();
    let (cube, floor) = (shape(&cube(0.2)), shape(&square(0.8)));
    let rotation = Rotation::from_rotation_y(0.3);
    let at = |height: f32, drift: f32| {
        Pose::from_parts(Vector::new(0.1, height, 0.0), rotation * (1.0 + drift))
    };
    let velocity = Vector::new(0.1, -2.0, 0.0);
    let asked = |drift: f32| -> Result<[f32; 2], Box<dyn std::error::Error>> {
        let (low, high) = (at(0.19, drift), at(1.2, drift));
        let crossing = dispatcher.intersection_test(&low, &floor, &cube)?;
        assert!(crossing.intersecting, "{drift}");
        let hit = dispatcher.cast_shapes(&high, velocity, &floor, &cube, until(10.0))?;
        let turning = |start, linvel| NonlinearRigidMotion {
            start,
            local_center: Vector::ZERO,
            linvel,
            angvel: Vector::ZERO,
        };
        let motions = [
            turning(Pose::IDENTITY, Vector::ZERO),
            turning(high, velocity),
        ];
        let swept = dispatcher.cast_shapes_nonlinear(
            &motions[0],
            &floor,
            &motions[1],
            &cube,
            0.0,
            10.0,
            true,
        )?;
        Ok([
            hit.ok_or("it falls on the floor")?.time_of_impact,
            swept.ok_or("it falls on the floor")?.time_of_impact,
        ])
    };
    let (unit, drifted) = (asked(0.0)?, asked(5e-4)?);
    for (unit, drifted) in unit.into_iter().zip(drifted) {
        assert!((unit - drifted).abs() < TOLERANCE / 2.0, "{unit} {drifted}");
    }
    Ok(())
}

/// As soon as a distance is left, and what is met at the start.
#[test]
fn target_distance_and_penetration() -> TestResult {
    let dispatcher = dispatcher();
    let (cube, floor) = (shape(&cube(0.2)), shape(&square(0.8)));
    let cast = |height: f32, velocity: Vector, options| {
        let pose = Pose::from_translation(Vector::Y * height);
        dispatcher.cast_shapes(&pose, velocity, &floor, &cube, options)
    };
    let options = ShapeCastOptions {
        target_distance: 0.1,
        ..until(10.0)
    };
    let hit = cast(1.2, -2.0 * Vector::Y, options)?.expect("it falls on the floor");
    assert!(
        (hit.time_of_impact - 0.45).abs() < TOLERANCE / 2.0,
        "{hit:?}"
    );
    let hit = cast(0.25, Vector::Y, options)?.expect("it is that near");
    assert_eq!(hit.time_of_impact, 0.0);
    assert_eq!(hit.status, ShapeCastStatus::PenetratingOrWithinTargetDist);
    assert!(hit.normal1.y > 0.99, "{hit:?}");
    let through = ShapeCastOptions {
        stop_at_penetration: false,
        ..until(10.0)
    };
    assert!(cast(0.15, Vector::Y, until(10.0))?.is_some());
    assert!(cast(0.15, Vector::Y, through)?.is_none());
    // As rapier does: what goes deeper is held at once, also on a short way, and what slides is not.
    for (height, velocity, time) in [(0.15, -2.0 * Vector::Y, 10.0), (0.19, -Vector::Y, 0.02)] {
        let until = ShapeCastOptions {
            max_time_of_impact: time,
            ..through
        };
        let hit = cast(height, velocity, until)?.ok_or("it goes on into the floor")?;
        assert_eq!(hit.time_of_impact, 0.0, "{height}");
        assert_eq!(hit.status, ShapeCastStatus::PenetratingOrWithinTargetDist);
        assert!(hit.normal1.y > 0.99, "{hit:?}");
    }
    assert!(cast(0.2, Vector::X, through)?.is_none());
    Ok(())
}

/// Parts of compounds are named, and hits are in the frame of the whole.
#[test]
fn casts_at_compounds() -> TestResult {
    let dispatcher = dispatcher();
    let at = |x: f32, shape: SharedShape| (Pose::from_translation(Vector::X * x), shape);
    let compound = SharedShape::compound(vec![
        at(-1.0, SharedShape::ball(0.3)),
        at(1.0, SharedShape::new(shape(&cube(0.2)))),
    ]);
    let pose = Pose::from_translation(Vector::new(0.0, 2.0, 0.0));
    for (x, part, reach) in [(-1.0, 0, 0.3), (1.0, 1, 0.2)] {
        let cloud = shape(&cube(0.1));
        let pose = pose * Pose::from_translation(Vector::X * x);
        let hit = dispatcher
            .cast_shapes(&pose, -Vector::Y, &*compound, &cloud, until(10.0))?
            .expect("it falls on the part");
        assert!(
            (hit.time_of_impact - (1.9 - reach)).abs() < TOLERANCE,
            "{hit:?}"
        );
        assert_eq!(hit.subshape1, part);
        assert!((hit.witness1.y - reach).abs() < TOLERANCE, "{hit:?}");
        assert!((hit.witness1.x - x).abs() < 0.15, "{hit:?}");
    }
    Ok(())
}

/// A bar that turns as it falls is met where its corner is lowest, from any start on.
#[test]
fn turning_casts() -> TestResult {
    let dispatcher = dispatcher();
    let bar: Vec<Vector> = cube(0.2)
        .into_iter()
        .map(|p| p * Vector::new(1.0, 0.25, 1.0))
        .collect();
    let (bar, floor) = (shape(&bar), shape(&square(0.8)));
    // Lowest point of the bar below its middle, when turned by an angle about z.
    let drop = |angle: f32| 0.2 * angle.sin().abs() + 0.05 * angle.cos().abs();
    let still = NonlinearRigidMotion::constant_position(Pose::IDENTITY);
    for spin in [0.0, 3.0, 20.0, 60.0] {
        let (height, speed) = (1.0, 20.0);
        let motion = NonlinearRigidMotion::new(
            Pose::from_translation(Vector::Y * height),
            Vector::ZERO,
            Vector::Y * -speed,
            Vector::Z * spin,
        );
        let truth = (0..100_000)
            .map(|k| k as f32 * 1e-6)
            .find(|&t| height - speed * t <= drop(spin * t))
            .expect("it falls on the floor");
        let hit = dispatcher
            .cast_shapes_nonlinear(&motion, &bar, &still, &floor, 0.0, 0.1, false)?
            .expect("it falls on the floor");
        let late = (hit.time_of_impact - truth) * speed;
        // The rim of two pixels does not count; a bar this thin has only one at each side. Early
        // by what a piece turns, once as it does and once as it might.
        assert!(
            (-1.2 * SPACING..1.5 * SPACING).contains(&late),
            "{late} m late at {spin} rad/s"
        );
        let swapped = dispatcher
            .cast_shapes_nonlinear(&still, &floor, &motion, &bar, 0.0, 0.1, false)?
            .expect("it falls on the floor");
        assert!((swapped.time_of_impact - hit.time_of_impact).abs() < 1e-5);
        let none = dispatcher.cast_shapes_nonlinear(
            &motion,
            &bar,
            &still,
            &floor,
            0.0,
            0.9 * truth,
            false,
        )?;
        assert!(none.is_none(), "{none:?}");
    }
    Ok(())
}

/// A bar whose middle stays where it is meets the floor with its end; as clouds, and with either of them
/// exact; in both orders.
#[test]
fn casts_of_what_turns_on_the_spot() -> TestResult {
    let dispatcher = dispatcher();
    let half = Vector::new(0.4, 0.08, 0.2);
    let points: Vec<Vector> = cube(0.4).into_iter().map(|p| p * half / 0.4).collect();
    let (cloud_bar, cloud_floor) = (shape(&points), shape(&square(0.8)));
    let (exact_bar, exact_floor) = (Cuboid::new(half), HalfSpace::new(Vector::Y));
    let pairs: [(&dyn Shape, &dyn Shape); 3] = [
        (&cloud_bar, &cloud_floor),
        (&cloud_bar, &exact_floor),
        (&exact_bar, &cloud_floor),
    ];
    let (height, duration) = (0.3, 1.0 / 60.0);
    let drop = |angle: f32| half.x * angle.sin().abs() + half.y * angle.cos().abs();
    let met_at = (0..100_000)
        .map(|k| k as f32 * 1e-5)
        .find(|&angle| drop(angle) >= height);
    let met_at = met_at.expect("it is long enough");
    let still = NonlinearRigidMotion::constant_position(Pose::IDENTITY);
    for (bar, floor) in pairs {
        // Up to a step that ends a little after the end of the bar is through.
        for spin in [10.0, 40.0, 90.0] {
            let begins_at = (met_at - 0.7 * spin * duration).max(0.0);
            let motion = NonlinearRigidMotion::new(
                Pose::new(Vector::Y * height, Vector::Z * begins_at),
                Vector::ZERO,
                Vector::ZERO,
                Vector::Z * spin,
            );
            let hit = dispatcher
                .cast_shapes_nonlinear(&motion, bar, &still, floor, 0.0, duration, false)?
                .expect("its end meets the floor");
            let late = (begins_at + spin * hit.time_of_impact - met_at) * half.x;
            assert!(late.abs() < 0.5 * SPACING, "{late} m late at {spin} rad/s");
            assert!(hit.normal2.y > 0.9, "{hit:?}");
            let swapped = dispatcher
                .cast_shapes_nonlinear(&still, floor, &motion, bar, 0.0, duration, false)?
                .expect("its end meets the floor");
            assert!((swapped.time_of_impact - hit.time_of_impact).abs() < 1e-5);
            let before = 0.6 * hit.time_of_impact;
            let none = dispatcher
                .cast_shapes_nonlinear(&motion, bar, &still, floor, 0.0, before, false)?;
            assert!(none.is_none(), "{none:?}");

            // What touches already is met no earlier than the motion begins, if at all.
            let mut deep = motion;
            deep.start = Pose::new(Vector::Y * height, Vector::Z * (met_at + 0.05));
            let hit = dispatcher
                .cast_shapes_nonlinear(&deep, bar, &still, floor, 0.0, duration, false)?;
            assert!(hit.is_none_or(|hit| hit.time_of_impact > 0.0), "{hit:?}");
        }
    }
    Ok(())
}

/// What is thick is looked at in pieces in which it turns by much: its corner meets the floor no less exactly, be it
/// that it falls or that it turns once all around where it is.
#[test]
fn casts_of_what_is_thick_and_turns() -> TestResult {
    let dispatcher = dispatcher();
    let half = 1.2;
    let (cloud_cube, cloud_floor) = (shape(&cube(half)), shape(&square(2.5)));
    let exact_floor = HalfSpace::new(Vector::Y);
    let still = NonlinearRigidMotion::constant_position(Pose::IDENTITY);
    let drop = |angle: f32| half * (angle.sin().abs() + angle.cos().abs());
    for (height, fall, spin, duration) in [
        (1.8, 9.0, 20.0, 1.0 / 30.0),
        (2.1, 24.0, 60.0, 1.0 / 30.0),
        (1.5, 0.0, std::f32::consts::TAU, 1.0),
    ] {
        let met_at = (0..100_000)
            .map(|k| duration * k as f32 * 1e-5)
            .find(|&t| height - fall * t <= drop(spin * t))
            .expect("it reaches the floor");
        let motion = NonlinearRigidMotion::new(
            Pose::from_translation(Vector::Y * height),
            Vector::ZERO,
            -fall * Vector::Y,
            spin * Vector::Z,
        );
        for floor in [&cloud_floor as &dyn Shape, &exact_floor] {
            let hit = dispatcher
                .cast_shapes_nonlinear(&motion, &cloud_cube, &still, floor, 0.0, duration, false)?
                .expect("its corner meets the floor");
            // The corner comes down by so much more until then.
            let gap_at = |t: f32| height - fall * t - drop(spin * t);
            let early = gap_at(hit.time_of_impact) - gap_at(met_at);
            // A pixel, and what edges are felt late by.
            assert!(
                early.abs() < 1.25 * SPACING,
                "{early} m early at {spin} rad/s"
            );
        }
    }
    Ok(())
}

/// Both turn about a pivot far away: what they do relative to each other is what counts.
#[test]
fn casts_from_a_carousel() -> TestResult {
    let dispatcher = dispatcher();
    let (cube, floor) = (shape(&cube(0.2)), shape(&square(0.8)));
    let carousel = |start: Vector, fall: f32| {
        let pose = Pose::from_translation(start);
        NonlinearRigidMotion::new(pose, -start.with_y(0.0), Vector::Y * -fall, Vector::Y * 2.0)
    };
    let hit = dispatcher
        .cast_shapes_nonlinear(
            &carousel(Vector::X * 10.0, 0.0),
            &floor,
            &carousel(Vector::new(10.0, 1.2, 0.0), 2.0),
            &cube,
            0.0,
            1.0,
            false,
        )?
        .expect("it falls on the floor");
    // At least a piece's displacement early.
    assert!(
        (-0.5 * SPACING..TOLERANCE).contains(&(2.0 * (hit.time_of_impact - 0.5))),
        "{hit:?}"
    );
    Ok(())
}

/// Rapier's query pipeline casts shapes at clouds.
#[test]
fn casts_through_the_query_pipeline() -> TestResult {
    let (mut world, mut tldi) = attached();
    let (_, floor) = world.insert(
        RigidBodyBuilder::fixed().translation(Vector::Y * 0.5),
        cloud_collider(shape(&square(0.8))),
    );
    tldi.step(&mut world)?;
    let queries = world.broad_phase.as_query_pipeline(
        world.narrow_phase.query_dispatcher(),
        &world.bodies,
        &world.colliders,
        QueryFilter::default(),
    );
    let start = Pose::from_translation(Vector::Y * 3.0);
    let (hit_collider, hit) = queries
        .cast_shape(&start, -Vector::Y, &Ball::new(0.3), until(10.0))
        .expect("the ball falls on the floor");
    assert_eq!(hit_collider, floor);
    assert!((hit.time_of_impact - 2.2).abs() < TOLERANCE, "{hit:?}");
    let (_, hit) = queries
        .cast_shape(&start, -Vector::Y, &shape(&cube(0.2)), until(10.0))
        .expect("the cloud falls on the floor");
    assert!((hit.time_of_impact - 2.3).abs() < TOLERANCE, "{hit:?}");
    Ok(())
}

/// A ball that flies at 60° to the normal of a square comes within the target distance of it, but does not reach it.
#[test]
fn target_distances_count_along_the_normal() -> TestResult {
    let direction = Vector::new(60f32.to_radians().sin(), -0.5, 0.0);
    let end = Vector::new(0.0, 0.1 + 0.08, 0.0);
    let options = ShapeCastOptions {
        target_distance: 0.1,
        ..until(0.5)
    };
    let start = Pose::from_translation(end - 0.5 * direction);
    let (floor, ball) = (shape(&square(0.8)), Ball::new(0.1));
    let hit = dispatcher().cast_shapes(&start, direction, &floor, &ball, options)?;
    // 2 cm along the normal before the end.
    let time = hit.ok_or("it comes near")?.time_of_impact;
    // Normals of slanting impacts are good to 5°, which is 0.03 s here.
    assert!((time - 0.46).abs() < 0.03, "{time} s");
    Ok(())
}

/// A part of a compound that has no surface passes through; the others meet.
#[test]
fn a_part_without_a_surface_leaves_the_others() -> TestResult {
    let floor = shape(&square(0.8));
    let line = SharedShape::segment(Vector::ZERO, 0.2 * Vector::Y);
    let ball = (Pose::IDENTITY, SharedShape::ball(0.1));
    let body = SharedShape::compound(vec![ball, (Pose::IDENTITY, line)]);
    let start = Pose::from_translation(Vector::Y);
    let hit = dispatcher().cast_shapes(&start, -Vector::Y, &floor, &*body, until(10.0))?;
    let time = hit.ok_or("the ball meets the floor")?.time_of_impact;
    assert!((time - 0.9).abs() < TOLERANCE, "{time} s");
    Ok(())
}
