//! A point far from all others costs no more memory than any other point, and lets its body rest where it
//! would without it.

use crate::alone;
use crate::common::worlds::{HALF, REST_TOLERANCE, TestResult, attached, dynamic_at};
use crate::common::{SPACING, cloud, cube, square};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use tldi_memory::most_held;

/// Bytes a pair may hold for each of its points: 16 pixels on both sides, splats, fragments and layers.
const BYTES_PER_POINT: usize = 4 << 10;

/// Bytes a pair may hold whatever its points: the 2²² pixels of [`Room`](tldi::Room), two words each. From which side
/// a pair is seen, and so how much of the room it takes, hangs on single contact pixels: 25 or 33 MB at 7 km.
const BYTES: usize = 32 << 20;

/// The same where pixels must be larger: images of 4 Mi pixels on both sides, and their tiles.
const BYTES_OF_LARGEST: usize = 128 << 20;

/// Steps until the body lies still.
const STEPS: usize = 120;

/// Distances of the outliers, metres.
const DISTANCES: [f32; 3] = [70.0, 700.0, 7e3];

/// What the body lies on.
#[derive(Clone, Copy, Debug)]
enum Floor {
    HalfSpace,
    /// A cuboid of 10 km.
    Cuboid,
    /// A sheet, with an outlier of its own in the direction of the body's or without.
    Cloud(bool),
}

/// Where the outlier is from the body.
fn outlier(direction: Vector, distance: f32) -> Vector {
    Vector::Y * -HALF + direction.normalize() * distance
}

fn collider_of(floor: Floor, direction: Vector, distance: f32) -> (ColliderBuilder, usize) {
    match floor {
        Floor::HalfSpace => (
            ColliderBuilder::new(SharedShape::new(HalfSpace::new(Vector::Y))),
            0,
        ),
        Floor::Cuboid => {
            let half = 5e3;
            let cuboid = ColliderBuilder::cuboid(half, half, half);
            (cuboid.translation(Vector::Y * -half), 0)
        }
        Floor::Cloud(has_outlier) => {
            let mut points = square(1.0);
            if has_outlier {
                points.push(direction.normalize() * distance);
            }
            let count = points.len();
            (cloud_collider(PointCloudShape::new(cloud(&points))), count)
        }
    }
}

/// How far below the floor the body's lower face ends up, and the bytes that it takes.
fn rest(floor: Floor, direction: Vector, distance: f32) -> Result<(f32, usize, usize), TldiError> {
    let mut points = cube(HALF);
    points.push(outlier(direction, distance));
    let (floor, floor_points) = collider_of(floor, direction, distance);
    let count = points.len() + floor_points;
    let (mut world, mut tldi) = attached();
    world.insert(RigidBodyBuilder::fixed(), floor);
    // Of the cube alone: where a point is that is no part of the body says nothing about its mass.
    let mass = MassProperties::from_cuboid(1000.0, Vector::splat(HALF));
    let shape = PointCloudShape::new(cloud(&points));
    let collider = cloud_collider(shape).mass_properties(mass);
    let (body, _) = world.insert(dynamic_at(HALF + 0.25 * SPACING), collider);
    let mut result = Ok(());
    let (bytes, ()) = most_held(|| {
        for _ in 0..STEPS {
            if result.is_ok() {
                result = tldi.step(&mut world).map(|_| ());
            }
        }
    });
    result?;
    Ok((HALF - world.bodies[body].translation().y, bytes, count))
}

/// Points none of which is near another, on a floor: there is nothing to fold.
fn strewn_points_get_larger_pixels() -> TestResult {
    let radius = 0.005;
    let mut rng = fastrand::Rng::with_seed(7);
    let mut coordinate = || 200.0 * (rng.f32() - 0.5);
    let points: Vec<Vector> = (0..3000)
        .map(|_| Vector::new(coordinate(), 0.0, coordinate()))
        .collect();
    let count = points.len();
    let (mut world, mut tldi) = attached();
    let half_space = SharedShape::new(HalfSpace::new(Vector::Y));
    world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::new(half_space));
    let shape = PointCloudShape::new(PointCloud::builder(points).radius(radius).build()?);
    let mass = MassProperties::from_cuboid(1.0, Vector::new(100.0, 1.0, 100.0));
    let collider = cloud_collider(shape).mass_properties(mass);
    let (body, _) = world.insert(dynamic_at(0.5 * radius), collider);
    let (mut result, mut coarser) = (Ok(()), None::<f32>);
    let (bytes, ()) = most_held(|| {
        for _ in 0..10 {
            match tldi.step(&mut world) {
                Ok(report) => {
                    let largest = coarser.into_iter().chain(report.coarser_pixels);
                    coarser = largest.reduce(f32::max);
                }
                Err(error) => result = Err(error),
            }
        }
    });
    result?;
    let depth = -world.bodies[body].translation().y;
    assert!(depth.abs() <= REST_TOLERANCE, "{depth} m deep");
    assert!(coarser.is_some_and(|by| by > 1.0), "{coarser:?}");
    let most = BYTES_OF_LARGEST + count * BYTES_PER_POINT;
    assert!(bytes <= most, "{bytes} bytes for {count} points");
    Ok(())
}

#[test]
fn outliers_cost_what_points_cost() -> TestResult {
    let _alone = alone();
    let floors = [
        Floor::HalfSpace,
        Floor::Cuboid,
        Floor::Cloud(false),
        Floor::Cloud(true),
    ];
    // On the plane of the floor, above it, and away in all axes.
    let directions = [
        Vector::new(0.8, 0.0, 0.6),
        Vector::Y,
        Vector::new(0.5, 0.6, 0.7),
    ];
    for floor in floors {
        for direction in directions {
            for distance in DISTANCES {
                let case = format!("{floor:?}, {direction} at {distance} m");
                let (depth, bytes, count) =
                    rest(floor, direction, distance).map_err(|error| format!("{case}: {error}"))?;
                assert!(depth.abs() <= REST_TOLERANCE, "{case}: {depth} m deep");
                let most = BYTES + count * BYTES_PER_POINT;
                assert!(bytes <= most, "{case}: {bytes} bytes for {count} points");
            }
        }
    }
    strewn_points_get_larger_pixels()?;
    // Where positions are coarser than points are apart the cloud is refused.
    let beyond = PointCloud::builder(vec![Vector::ZERO, 7e6 * Vector::X]);
    let refused = beyond.radius(SPACING).build();
    assert!(
        matches!(refused, Err(CloudError::CoordinateTooLarge { .. })),
        "{refused:?}"
    );
    Ok(())
}
