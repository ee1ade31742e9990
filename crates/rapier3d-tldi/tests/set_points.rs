//! New points for a cloud that is in a world.

mod common;

use common::worlds::{
    HALF, REST_TOLERANCE, TestResult, attached, dynamic_at, insert_floor, settle,
};
use common::{cloud, cube, shape, square};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;

/// New points under a sleeping body wake it, in the same step and without a miss, and it follows.
#[test]
fn new_points_wake_sleepers() -> TestResult {
    let (mut world, mut tldi) = attached();
    let floor = insert_floor(&mut world, 0.8);
    let (body, _) = world.insert(dynamic_at(HALF), tldi.collider(cloud(&cube(HALF))));
    settle(&mut world, &mut tldi)?;
    let resting = tldi.step(&mut world)?;
    assert_eq!((resting.pairs_batched, resting.pairs_in_contact), (0, 1));
    assert!(resting.max_penetration < REST_TOLERANCE);

    let sunk: Vec<Vector> = square(0.8).iter().map(|p| *p - Vector::Y * 0.03).collect();
    tldi.set_points(&mut world, floor, &sunk, None)?;
    let report = tldi.step(&mut world)?;
    assert_eq!((report.pairs_batched, report.pairs_missed), (1, 0));
    assert!(!world.bodies[body].is_sleeping());
    settle(&mut world, &mut tldi)?;
    assert!((world.bodies[body].translation().y - (HALF - 0.03)).abs() < REST_TOLERANCE);
    Ok(())
}

#[test]
fn set_points_errors_leave_the_cloud() -> TestResult {
    let (mut world, mut tldi) = attached();
    let (body, ball) = world.insert(RigidBodyBuilder::dynamic(), ColliderBuilder::ball(0.1));
    let scan = insert_floor(&mut world, 0.4);
    let points = square(0.2);
    assert_eq!(
        tldi.set_points(&mut world, ball, &points, None),
        Err(TldiError::NotACloud(ball))
    );
    assert_eq!(
        tldi.set_points(&mut world, scan, &[], None),
        Err(TldiError::Cloud {
            collider: scan,
            source: CloudError::Empty { dropped: 0 }
        })
    );
    let shape = world.colliders[scan].shape().as_shape::<PointCloudShape>();
    assert_eq!(shape.map(|s| s.cloud().len()), Some(square(0.4).len()));
    world.remove_body(body);
    assert_eq!(
        tldi.set_points(&mut world, ball, &points, None),
        Err(TldiError::NoSuchCollider(ball))
    );
    Ok(())
}

/// A cloud that two bodies share is replaced for one of them only.
#[test]
fn shared_points_are_replaced_for_one() -> TestResult {
    let (mut world, mut tldi) = attached();
    let shape = shape(&square(0.4));
    let insert = |world: &mut PhysicsWorld| {
        world
            .insert(RigidBodyBuilder::fixed(), cloud_collider(shape.clone()))
            .1
    };
    let (first, second) = (insert(&mut world), insert(&mut world));
    tldi.set_points(&mut world, first, &square(0.2), None)?;
    let count = |handle: ColliderHandle| {
        let shape = world.colliders[handle]
            .shape()
            .as_shape::<PointCloudShape>();
        shape.map(|s| s.cloud().len())
    };
    assert_eq!(count(first), Some(square(0.2).len()));
    assert_eq!(count(second), Some(square(0.4).len()));
    Ok(())
}
