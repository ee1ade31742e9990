//! What has no thickness collides with clouds or is named as what passes.

use crate::common::worlds::{HALF, TestResult, attached, dynamic_at, insert_floor};
use crate::common::{SPACING, cloud, cube};
use rapier3d::prelude::*;
use rapier3d_tldi::{Passes, prelude::*};

/// Steps for two seconds; the errors that came.
fn run(world: &mut PhysicsWorld, tldi: &mut TldiPipeline) -> Vec<TldiError> {
    (0..120).filter_map(|_| tldi.step(world).err()).collect()
}

/// Thin ground, which is a surface all the same.
fn sheets() -> Vec<(&'static str, ColliderBuilder)> {
    let [a, b, c] = [
        Vector::new(-3.0, 0.0, -3.0),
        Vector::new(0.0, 0.0, 6.0),
        Vector::new(3.0, 0.0, -3.0),
    ];
    vec![
        ("triangle", ColliderBuilder::triangle(a, b, c)),
        ("cuboid", ColliderBuilder::cuboid(1.0, 0.0, 1.0)),
        ("cylinder", ColliderBuilder::cylinder(0.0, 1.0)),
        (
            "half-space",
            ColliderBuilder::new(SharedShape::halfspace(Vector::Y)),
        ),
        (
            "trimesh",
            ColliderBuilder::trimesh(vec![a, b, c], vec![[0, 1, 2]]).expect("one triangle"),
        ),
    ]
}

/// A cloud rests on what is thin.
#[test]
fn sheets_hold_clouds() -> TestResult {
    for (name, sheet) in sheets() {
        let (mut world, mut tldi) = attached();
        world.insert(RigidBodyBuilder::fixed(), sheet);
        let (body, _) = world.insert(dynamic_at(HALF + 0.01), tldi.collider(cloud(&cube(HALF))));
        let errors = run(&mut world, &mut tldi);
        assert!(errors.is_empty(), "{name}: {errors:?}");
        // Half a radius: what is measured against a sheet of no thickness is good to a fifth of it at rest.
        let height = world.bodies[body].translation().y;
        assert!((height - HALF).abs() < 0.5 * SPACING, "{name}: {height}");
    }
    Ok(())
}

/// A solid whose rim or corner came through a thin plate is pushed back, not further through.
#[test]
fn rims_through_a_plate_are_pushed_back() -> TestResult {
    const R: f32 = 0.01;
    let solids = [
        SharedShape::cone(7.0 * R, 10.0 * R),
        SharedShape::cylinder(6.0 * R, 9.0 * R),
        SharedShape::cuboid(9.0 * R, 7.0 * R, 8.0 * R),
    ];
    for (k, solid) in solids.iter().enumerate() {
        let cloud = PointCloudShape::new(sample_shape(&**solid, R)?);
        for case in 0..12 {
            let turn = 0.15 + 0.05 * case as f32;
            let rotation = Rotation::from_scaled_axis(turn * Vector::new(0.8, 0.0, 0.6));
            let lowest = solid.compute_aabb(&Pose::from_rotation(rotation)).mins.y;
            // From 1.5 to 2.6 radii thick on both sides, and the lowest point 0.5 to 1.7 radii below.
            let half = R * (1.5 + 0.1 * case as f32);
            let below = R * (0.5 + 0.1 * ((5 * case) % 13) as f32);
            let (mut world, mut tldi) = attached();
            world.integration_parameters.length_unit = 20.0 * R;
            let plate = ColliderBuilder::cuboid(30.0 * R, half, 30.0 * R);
            world.insert(RigidBodyBuilder::fixed(), plate);
            let place = Pose::from_parts(Vector::Y * (-half - below - lowest), rotation);
            let body = RigidBodyBuilder::dynamic().pose(place);
            world.insert(body, cloud_collider(cloud.clone()));
            tldi.step(&mut world)?;
            let manifolds =
                || (world.narrow_phase.contact_pairs()).flat_map(|pair| pair.manifolds());
            let deepest = |is_meant: fn(Vector) -> bool| {
                let meant = manifolds().filter(|m| is_meant(m.data.normal));
                let depths = meant.flat_map(|m| m.points.iter().map(|point| -point.dist / R));
                depths.fold(0.0, f32::max)
            };
            let [up, down] = [deepest(|n| n.y > 0.0), deepest(|n| n.y <= 0.0)];
            let what = format!(
                "solid {k}, turned by {turn}, {:.1} r below: {up} and {down}",
                below / R
            );
            assert!(up > 1.0, "{what}");
            // What is measured against an exact surface is good to a fifth of a radius.
            assert!(down <= 0.2, "{what}");
        }
    }
    Ok(())
}

/// Lines pass, along an axis or not, and the pipeline names each of them once; the world goes on.
#[test]
fn lines_pass_and_are_named() -> TestResult {
    let up = Vector::Y * 0.1;
    let line = vec![-0.1 * Vector::X, Vector::ZERO, up];
    let lines = vec![
        (
            "segment on an axis",
            ColliderBuilder::segment(-0.1 * Vector::X, 0.1 * Vector::X),
        ),
        (
            "segment",
            ColliderBuilder::segment(Vector::new(-0.1, 0.02, 0.03), up),
        ),
        ("polyline", ColliderBuilder::polyline(line, None)),
        (
            "triangle without width",
            ColliderBuilder::triangle(-up, Vector::ZERO, up),
        ),
        ("ball without size", ColliderBuilder::ball(0.0)),
    ];
    for (name, line) in lines {
        let (mut world, mut tldi) = attached();
        let floor = insert_floor(&mut world, 0.8);
        let (body, collider) = world.insert(dynamic_at(0.2).additional_mass(1.0), line);
        let mut other = dynamic_at(HALF);
        other = other.translation(Vector::new(0.5, HALF, 0.5));
        let (other, _) = world.insert(other, ColliderBuilder::ball(HALF));
        let errors = run(&mut world, &mut tldi);
        let named = TldiError::PassesThrough {
            collider,
            cloud: floor,
            reason: Passes::Line,
        };
        assert_eq!(errors, [named], "{name}");
        assert!(world.bodies[body].translation().y < -1.0, "{name}");
        assert!(world.bodies[other].translation().y > 0.5 * HALF, "{name}");
    }
    Ok(())
}

/// Rapier's soft bodies pass; each skin is named once.
#[test]
fn soft_bodies_pass_and_are_named() -> TestResult {
    let (mut world, mut tldi) = attached();
    let floor = insert_floor(&mut world, 0.8);
    let [du, dv] = [Vector::X, Vector::Z].map(|axis| 0.4 * axis);
    world.insert_soft_body(SoftBodyBuilder::cloth(
        Vector::new(-0.2, 0.1, -0.2),
        du,
        dv,
        5,
        5,
    ));
    let errors = run(&mut world, &mut tldi);
    let [
        TldiError::PassesThrough {
            collider,
            cloud,
            reason,
        },
    ] = errors[..]
    else {
        return Err(format!("{errors:?}").into());
    };
    assert_eq!((cloud, reason), (floor, Passes::SoftBody));
    assert!(world.colliders[collider].deformable_mesh_ref().is_some());
    Ok(())
}
