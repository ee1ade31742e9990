//! Bodies of a millimetre to ten metres on clouds of a millimetre to a metre between points: what a step takes in
//! memory follows the points, and they rest where the cloud is.

use crate::alone;
use crate::common::worlds::{TestResult, attached};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use tldi_memory::most_held;

/// Bytes that a pair may hold for each point: those of a cloud that lie near the body, on both sides, with normals,
/// splats, and a few fragments and layers each.
const BYTES_PER_POINT: usize = 2 << 10;

/// Bytes that a pair may hold whatever its points: images of 64 × 64 pixels, of which the body takes 8 × 8, under 50
/// splats as large as the image. Images of all splats around would be a hundred times as large.
const BYTES: usize = 1 << 20;

/// Steps in which the body comes to rest.
const STEPS: usize = 90;

/// Share of its size that a body may end up too high or too deep: contacts are told to a tenth of its pixels, of which
/// it has eight, and what stands on an edge is higher. What falls through is several sizes deep.
const RESTING: f32 = 0.2;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Body {
    Ball,
    Cuboid,
    Cloud,
}

/// A horizontal square of points `spacing` apart, with their radius.
fn sheet(edge: f32, spacing: f32) -> Result<PointCloud<'static>, CloudError> {
    let n = (0.5 * edge / spacing).ceil() as i32;
    let at = |i: i32, j: i32| spacing * Vector::new(i as f32, 0.0, j as f32);
    let points: Vec<Vector> = (-n..=n)
        .flat_map(|i| (-n..=n).map(move |j| at(i, j)))
        .collect();
    PointCloud::builder(points).radius(spacing).build()
}

/// The faces of a cube.
fn cube(half: f32, spacing: f32) -> Result<PointCloud<'static>, CloudError> {
    let n = (half / spacing).ceil() as i32;
    let at = |i: i32| half * i as f32 / n as f32;
    let points: Vec<Vector> = (-n..=n)
        .flat_map(|i| (-n..=n).map(move |j| [at(i), at(j)]))
        .flat_map(|[u, v]| {
            [half, -half].map(|w| {
                [
                    Vector::new(u, v, w),
                    Vector::new(v, w, u),
                    Vector::new(w, u, v),
                ]
            })
        })
        .flatten()
        .collect();
    PointCloud::builder(points).radius(spacing).build()
}

/// How deep the body ends up, in metres, the bytes that it takes, and the points of the pair.
fn rest(
    body: Body,
    size: f32,
    spacing: f32,
) -> Result<(f32, usize, usize), Box<dyn std::error::Error>> {
    let half = 0.5 * size;
    let floor = sheet((4.0 * size).max(24.0 * spacing), spacing)?;
    let mut count = floor.len();
    let (mut world, mut tldi) = attached();
    // Rapier's tolerances are those of bodies of a metre.
    world.integration_parameters.length_unit = size;
    world.gravity *= size;
    let floor = cloud_collider(PointCloudShape::new(floor));
    world.insert(RigidBodyBuilder::fixed(), floor);
    let collider = match body {
        Body::Ball => ColliderBuilder::ball(half),
        Body::Cuboid => ColliderBuilder::cuboid(half, half, half),
        Body::Cloud => {
            let cloud = cube(half, size / 16.0)?;
            count += cloud.len();
            cloud_collider(PointCloudShape::new(cloud))
        }
    };
    // Not over a point.
    let place = 0.3 * spacing;
    let start = Vector::new(place, half + 0.1 * size, place);
    let (handle, _) = world.insert(RigidBodyBuilder::dynamic().translation(start), collider);
    let mut result = Ok(());
    let (bytes, ()) = most_held(|| {
        for _ in 0..STEPS {
            let step = tldi.step(&mut world).map(|_| ());
            result = result.clone().and(step);
        }
    });
    result?;
    let depth = half - world.bodies[handle].translation().y;
    Ok((depth, bytes, count))
}

#[test]
fn memory_follows_points_and_bodies_rest() -> TestResult {
    let _alone = alone();
    for body in [Body::Ball, Body::Cuboid, Body::Cloud] {
        for size in [0.001, 0.01, 0.1, 1.0, 10.0] {
            // Depths are told in steps of the points' radius / 2048: of more than 100 sizes, not to a share of the size.
            for coarser in [0.1, 1.0, 10.0, 100.0] {
                let spacing = coarser * size;
                let case = format!("{body:?} of {size} m on points {spacing} m apart");
                let (depth, bytes, count) =
                    rest(body, size, spacing).map_err(|error| format!("{case}: {error}"))?;
                assert!(depth.abs() <= RESTING * size, "{case}: {depth} m deep");
                let most = BYTES + count * BYTES_PER_POINT;
                assert!(bytes <= most, "{case}: {bytes} bytes for {count} points");
            }
        }
    }
    Ok(())
}
