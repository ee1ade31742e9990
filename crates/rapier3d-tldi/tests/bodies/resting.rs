//! Bodies that come to rest on each other, clouds and shapes of rapier's in all pairings.

use crate::common::worlds::{HALF, REST_TOLERANCE, TestResult, attached, dynamic_at, settle};
use crate::common::{SPACING, cube, shape, square};
use rapier3d::parry::shape::Ball;
use rapier3d::parry::utils::Array2;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use std::error::Error;

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

/// A ball that falls straight down leaves a flat cloud straight up, wherever the step before ended above it.
#[test]
fn balls_do_not_leave_sideways() -> TestResult {
    let floor = shape(&square(1.0));
    let ball = PointCloudShape::new(sample_shape(&Ball::new(HALF), SPACING)?);
    for case in 0..40 {
        let (mut world, mut tldi) = attached();
        world.insert(RigidBodyBuilder::fixed(), cloud_collider(floor.clone()));
        let case = case as f32;
        // Not over a point; up to 7 m/s.
        let from = Vector::new(0.013 * case % SPACING, HALF + 0.05 * case, 0.01);
        let falling = RigidBodyBuilder::dynamic().translation(from);
        let (body, _) = world.insert(falling, cloud_collider(ball.clone()));
        let mut most = 0.0_f32;
        for _ in 0..70 {
            tldi.step(&mut world)?;
            most = most.max(world.bodies[body].linvel().with_y(0.0).length());
        }
        assert!(most < 0.1, "from {from}: {most} m/s sideways");
    }
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

/// Boards that are thinner than their points are apart rest on an edge, if something keeps them upright.
#[test]
fn boards_rest_on_their_edges() -> TestResult {
    let floor = || cloud_collider(shape(&square(0.8)));
    let own_floor = || ColliderBuilder::cuboid(0.8, 0.1, 0.8).translation(-0.1 * Vector::Y);
    for thickness in [0.0, 0.25 * SPACING, SPACING] {
        let board: Vec<Vector> = square(HALF)
            .iter()
            .flat_map(|p| [0.5, -0.5].map(|side| *p + side * thickness * Vector::Y))
            .collect();
        for (lean, floor) in [0.0_f32, 3.0].into_iter().zip([floor(), own_floor()]) {
            let turn = Rotation::from_rotation_z((90.0 - lean).to_radians());
            let heights = board.iter().map(|p| (turn * *p).y);
            let height = -heights.fold(f32::INFINITY, f32::min);
            let (mut world, mut tldi) = attached();
            world.insert(RigidBodyBuilder::fixed(), floor);
            let pose = Pose::from_parts((height + 0.03) * Vector::Y, turn);
            let body = RigidBodyBuilder::dynamic().pose(pose).lock_rotations();
            let (body, _) = world.insert(body, cloud_collider(shape(&board)));
            settle(&mut world, &mut tldi)?;
            let rests_at = world.bodies[body].translation().y;
            let is_close = (rests_at - height).abs() < REST_TOLERANCE;
            assert!(is_close, "{thickness} m, {lean}°: {rests_at}, not {height}");
        }
    }
    Ok(())
}

/// A six-sided frustum, `2 · HALF` metres high, with its wider end down.
fn frustum(lower_radius: f32, upper_radius: f32) -> Result<ColliderBuilder, Box<dyn Error>> {
    let ring = |radius: f32, height: f32| {
        (0..6).map(move |k| {
            let (sin, cos) = (std::f32::consts::FRAC_PI_3 * k as f32).sin_cos();
            Vector::new(radius * cos, height, radius * sin)
        })
    };
    let corners: Vec<Vector> = ring(lower_radius, -HALF)
        .chain(ring(upper_radius, HALF))
        .collect();
    ColliderBuilder::convex_hull(&corners).ok_or_else(|| "the corners span no hull".into())
}

#[test]
fn rapier_shapes_rest_on_cloud() -> TestResult {
    for floor_first in [true, false] {
        for body in [
            ColliderBuilder::cuboid(HALF, HALF, HALF),
            ColliderBuilder::cylinder(HALF, HALF),
            ColliderBuilder::cone(HALF, HALF),
            // Lying.
            ColliderBuilder::capsule_x(HALF, HALF),
            ColliderBuilder::round_cuboid(0.15, 0.15, 0.15, 0.05),
            frustum(0.25, 0.15)?,
        ] {
            rests(body, cloud_collider(shape(&square(0.8))), floor_first, HALF)?;
        }
    }
    Ok(())
}

/// A plateau at height 0, 80 cm wide, in a plain 10 cm below.
fn plateau() -> ColliderBuilder {
    let inner = 3..8;
    let is_high = |k: usize| inner.contains(&(k / 11)) && inner.contains(&(k % 11));
    let heights = (0..121).map(|k| f32::from(u8::from(is_high(k))));
    let heights = Array2::new(11, 11, heights.collect());
    ColliderBuilder::heightfield(heights, Vector::new(2.0, 0.1, 2.0)).translation(Vector::Y * -0.1)
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
            plateau(),
            frustum(1.2, 1.0)?.translation(Vector::Y * -HALF),
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

/// Bodies with slanted sides that begin one or two radii deep in a bare floor, their middles above it, are pushed up.
#[test]
fn slanted_bodies_stay_above_a_bare_floor() -> TestResult {
    // Metres: the floor's radius, and half the height of the bodies.
    const R: f32 = 0.02;
    const COUNT: i32 = 40;
    const HALF_HEIGHT: f32 = 0.1;
    let corners = [[1.0, 1.0], [-1.0, 1.0], [1.0, -1.0], [-1.0, -1.0]];
    let corners = corners.map(|[x, z]| HALF_HEIGHT * Vector::new(x, -1.0, z));
    let pyramid = [&corners[..], &[HALF_HEIGHT * Vector::Y]].concat();
    let pyramid = SharedShape::convex_hull(&pyramid).ok_or("no hull")?;
    for body in [pyramid, SharedShape::cone(HALF_HEIGHT, HALF_HEIGHT)] {
        for depth in [1.0, 2.0] {
            for seed in 0..8 {
                let mut rng = fastrand::Rng::with_seed(seed);
                let mut at = |k: i32| R * ((k - COUNT / 2) as f32 + rng.f32() - 0.5);
                let floor: Vec<Vector> = (0..COUNT * COUNT)
                    .map(|k| Vector::new(at(k % COUNT), 0.0, at(k / COUNT)))
                    .collect();
                let floor = PointCloud::builder(floor).radius(R).build()?.into_owned();
                let (mut world, mut tldi) = attached();
                world.insert(RigidBodyBuilder::fixed(), tldi.collider(floor));
                let turn = Vector::Y * seed as f32;
                let start = dynamic_at(HALF_HEIGHT - depth * R)
                    .rotation(turn)
                    .linvel(-2.0 * Vector::Y);
                let (handle, _) = world.insert(start, ColliderBuilder::new(body.clone()));
                for _ in 0..60 {
                    tldi.step(&mut world)?;
                }
                let height = world.bodies[handle].translation().y;
                let case = format!("{:?} {depth} {seed}", body.shape_type());
                assert!((height - HALF_HEIGHT).abs() < R, "{case}: {height}");
            }
        }
    }
    Ok(())
}
