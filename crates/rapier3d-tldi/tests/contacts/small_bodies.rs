//! Bodies that are smaller than the distance between the points of the floor beside them, as of a far wall of a scan.

use crate::common::worlds::{TestResult, attached};
use fastrand::Rng;
use rapier3d::math::Rotation;
use rapier3d::prelude::*;
use rapier3d_tldi::{prelude::*, sample_shape};

/// Distances of the floor's points in edges of the body.
const SPACINGS: [f32; 4] = [0.3, 1.0, 10.0, 100.0];

/// Edge of the body, metres, in units of which all else is told. It has 16 × 16 points to a face.
const EDGE: f32 = 0.1;

/// A horizontal floor at height 0, without normals.
fn floor(spacing: f32) -> PointCloud<'static> {
    let n = (2.0 / spacing).ceil().max(12.0) as i32;
    let at = |i: i32| EDGE * spacing * i as f32;
    let points = (-n..=n).flat_map(|i| (-n..=n).map(move |j| Vector::new(at(i), 0.0, at(j))));
    let points: Vec<Vector> = points.collect();
    let floor = PointCloud::builder(points).radius(EDGE * spacing);
    floor.build().expect("valid points")
}

/// A cube, without normals.
fn cube() -> PointCloud<'static> {
    let half = 0.5 * EDGE;
    let faces = sample_shape(&Cuboid::new(Vector::splat(half)), EDGE / 16.0);
    let points = faces.expect("it has a surface").points().to_vec();
    let bare = PointCloud::builder(points).radius(EDGE / 16.0);
    bare.build().expect("valid points")
}

/// A world with a floor and a cube that is turned at random, at a random place over the floor, its lowest corner `sunk`
/// edges under it.
fn on_floor(
    spacing: f32,
    tilt: f32,
    sunk: f32,
    rng: &mut Rng,
) -> (PhysicsWorld, TldiPipeline, RigidBodyHandle) {
    let (mut world, tldi) = attached();
    world.insert(RigidBodyBuilder::fixed(), tldi.collider(floor(spacing)));
    let across = Vector::new(rng.f32() - 0.5, 0.0, rng.f32() - 0.5).normalize();
    let turned = Rotation::from_axis_angle(across, tilt)
        * Rotation::from_axis_angle(Vector::Y, 7.0 * rng.f32());
    let lowest = |axis: Vector| 0.5 * EDGE * (turned * axis).y.abs();
    let height = lowest(Vector::X) + lowest(Vector::Y) + lowest(Vector::Z) - sunk * EDGE;
    let place = Vector::new(
        rng.f32() * spacing * EDGE,
        height,
        rng.f32() * spacing * EDGE,
    );
    let body = RigidBodyBuilder::dynamic().pose(Pose::from_parts(place, turned));
    let (body, _) = world.insert(body, tldi.collider(cube()));
    (world, tldi, body)
}

/// The gap of a cube's lowest corner, and the normal, are right on floors of any coarseness, to a fifth of the cube's
/// pixels, of which there are eight to an edge. (Were a cube's layers merged by the floor's radius, its top and its bottom
/// would be one from a spacing of 0.85 on: gaps would be a pixel off and normals 30°.)
#[test]
fn contacts_are_those_of_the_body_on_floors_of_any_coarseness() -> TestResult {
    for spacing in SPACINGS {
        for tilt in [0.0_f32, 2.0] {
            let mut rng = Rng::with_seed(5);
            for _ in 0..20 {
                let sunk = 0.005 + 0.02 * rng.f32();
                let (mut world, mut tldi, _) = on_floor(spacing, tilt.to_radians(), sunk, &mut rng);
                world.gravity = Vector::ZERO;
                tldi.step(&mut world)?;
                let contacts = || tldi.contacts(&world.narrow_phase, &world.colliders);
                let case = format!("spacing {spacing}, tilt {tilt}, sunk {sunk}");
                let depths = contacts().map(|contact| contact.depth / EDGE);
                let deepest = depths.fold(f32::NEG_INFINITY, f32::max);
                assert!((deepest - sunk).abs() < 0.2 / 8.0, "{case}: {deepest}");
                for contact in contacts() {
                    assert!(
                        contact.normal.y.abs() > 0.2_f32.to_radians().cos(),
                        "{case}"
                    );
                }
            }
        }
    }
    Ok(())
}

/// A cube that falls by a tenth of its edge comes to rest flat, wherever it falls.
#[test]
fn cubes_rest_flat_on_floors_of_any_coarseness() -> TestResult {
    for spacing in SPACINGS {
        let mut rng = Rng::with_seed(6);
        for _ in 0..10 {
            let (mut world, mut tldi, body) = on_floor(spacing, 0.0, -0.1, &mut rng);
            // Rapier's tolerances and gravity are those of bodies of a metre.
            world.integration_parameters.length_unit = EDGE;
            world.gravity *= EDGE;
            for _ in 0..120 {
                tldi.step(&mut world)?;
            }
            let pose = world.bodies[body].position();
            let (height, up) = (pose.translation.y / EDGE, (pose.rotation * Vector::Y).y);
            assert!(
                (height - 0.5).abs() < 0.02 && up > 0.9995,
                "{spacing}: {height}, {up}"
            );
        }
    }
    Ok(())
}
