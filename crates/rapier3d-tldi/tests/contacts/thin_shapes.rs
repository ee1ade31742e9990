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
