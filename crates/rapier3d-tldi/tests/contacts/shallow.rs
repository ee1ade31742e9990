//! Bodies that touch, or nearly do, are not told to be deep in each other, and deep ones not to touch.

use rapier3d::parry::query;
use rapier3d::prelude::*;
use rapier3d_tldi::{prelude::*, sample_shape};
use std::f32::consts::{FRAC_PI_2, TAU};

/// Deepest contact in metres of two clouds with outward normals after a step without gravity, `velocity` that of the second.
fn depth_of(clouds: [&PointCloudShape; 2], poses: [Pose; 2], velocity: Vector) -> f32 {
    let mut world = PhysicsWorld {
        gravity: Vector::ZERO,
        ..PhysicsWorld::default()
    };
    let mut tldi = TldiPipeline::new(TldiConfig::default()).expect("the settings are valid");
    tldi.attach(&mut world);
    for (k, (cloud, pose)) in clouds.into_iter().zip(poses).enumerate() {
        let body = RigidBodyBuilder::dynamic().pose(pose);
        world.insert(
            body.linvel(k as f32 * velocity),
            cloud_collider(cloud.clone()),
        );
    }
    let report = tldi.step(&mut world).expect("nothing fails");
    report.max_penetration
}

fn sampled(shape: &SharedShape, spacing: f32) -> PointCloudShape {
    PointCloudShape::new(sample_shape(&*shape.0, spacing).expect("it has a surface"))
}

/// Depths in metres by the pipeline and by parry, of solids in 1,600 random poses, by parry's depth `least` to `most` in each
/// other.
fn depths(least: f32, most: f32) -> Vec<(&'static str, f32, f32)> {
    let block = SharedShape::cuboid(0.2, 0.2, 0.2);
    let mut depths = Vec::new();
    for (name, body) in [
        ("box", SharedShape::cuboid(0.3, 0.2, 0.1)),
        ("plate", SharedShape::cuboid(0.3, 0.3, 0.06)),
        ("cylinder", SharedShape::cylinder(0.3, 0.1)),
        ("rod", SharedShape::cuboid(0.4, 0.05, 0.05)),
    ] {
        let clouds = [&body, &block].map(|shape| sampled(shape, 0.01));
        let mut rng = fastrand::Rng::with_seed(11);
        let mut poses = 0;
        while poses < 400 {
            let mut u = || 2.0 * rng.f32() - 1.0;
            let mut turn = || Rotation::from_xyzw(u(), u(), u(), u()).normalize();
            let turns = [turn(), turn()];
            let place = 0.5 * Vector::new(u(), u(), u());
            let pose1 = Pose::from_parts(Vector::ZERO, turns[0]);
            let pose2 = Pose::from_parts(place, turns[1]);
            let found = query::contact(&pose1, &*body.0, &pose2, &*block.0, 0.1);
            let Some(contact) = found.expect("parry knows both") else {
                continue;
            };
            let truth = -contact.dist;
            if (least..most).contains(&truth) {
                poses += 1;
                let told = depth_of([&clouds[0], &clouds[1]], [pose1, pose2], Vector::ZERO);
                depths.push((name, told, truth));
            }
        }
    }
    depths
}

/// A contact that is 6 cm too deep is a view of the width of an overlap from the side. Five of 1,600 are left. Before views
/// told each other what is apart, there were 37.
#[test]
fn shallow_solids_are_not_told_to_be_deep() {
    let mut depths = depths(0.0, 0.02);
    depths.retain(|(_, told, truth)| *told > truth + 0.06);
    assert!(depths.len() <= 8, "{} of 1600: {depths:?}", depths.len());
}

/// Three of 1,600 are told to be less than half as deep as they are: rods.
#[test]
fn deep_solids_are_not_told_to_be_shallow() {
    let mut depths = depths(0.05, 0.2);
    depths.retain(|(_, told, truth)| *told < 0.5 * truth);
    assert!(depths.len() <= 6, "{} of 1600: {depths:?}", depths.len());
}

/// Large boxes with points up to 60 cm apart, one above the other by a fraction of that. Seen from the side, they are
/// beside each other; from above, they are farther apart than rapier asks for contacts.
#[test]
fn equal_boxes_that_are_apart_do_not_touch() {
    for (half, across) in [(2.0, 8.0), (2.0, 20.0), (5.0, 8.0), (5.0, 20.0)] {
        let radius = half / across;
        let cloud = sampled(&SharedShape::cuboid(half, half, half), radius);
        for gap in [0.1, 0.2, 0.3, 0.5, 0.8] {
            for closing in [0.0, 0.1, 0.3, 0.6, 1.0] {
                for aside in [0.0, 0.003] {
                    let poses = [
                        Pose::from_translation(aside * radius * Vector::new(1.0, 0.0, 2.0)),
                        Pose::from_translation((2.0 * half + gap * radius) * Vector::Y),
                    ];
                    let velocity = -60.0 * closing * radius * Vector::Y;
                    let depth = depth_of([&cloud, &cloud], poses, velocity);
                    // A tenth of a radius is what samples scatter.
                    let most = 0.1 * radius;
                    assert!(
                        depth < most,
                        "{half} m, r {radius}, {gap} r apart, {closing} r a step: {depth} m"
                    );
                }
            }
        }
    }
}

/// Two rings hang in each other like links of a chain, tubes of 6 cm at most 4 mm in each other.
#[test]
fn links_that_touch_are_not_told_to_be_deep() {
    let (large, small, n) = (0.1, 0.03, 48);
    let at = |k: u32| {
        let (around, across) = (
            TAU * (k / n) as f32 / n as f32,
            TAU * (k % n) as f32 / n as f32,
        );
        let out = large + small * across.cos();
        Vector::new(out * around.cos(), small * across.sin(), out * around.sin())
    };
    let corner = |i: u32, j: u32| i % n * n + j % n;
    let faces = (0..n * n).flat_map(|k| {
        let (i, j) = (k / n, k % n);
        let [a, b] = [corner(i, j), corner(i + 1, j)];
        let [c, d] = [corner(i + 1, j + 1), corner(i, j + 1)];
        [[a, c, b], [a, d, c]]
    });
    let ring = SharedShape::trimesh((0..n * n).map(at).collect(), faces.collect());
    let ring = ring.expect("it is a mesh");
    for spacing in [0.012, 0.006] {
        let cloud = sampled(&ring, spacing);
        let mut rng = fastrand::Rng::with_seed(5);
        for case in 0..200 {
            let mut u = || 2.0 * rng.f32() - 1.0;
            let tilt = Rotation::from_scaled_axis(0.1 * Vector::new(u(), u(), u()));
            let place = Vector::new(0.003 * u(), -0.14 + 0.002 * u(), 0.003 * u());
            let poses = [
                Pose::from_parts(Vector::ZERO, Rotation::from_rotation_x(FRAC_PI_2)),
                Pose::from_parts(place, Rotation::from_rotation_z(FRAC_PI_2) * tilt),
            ];
            let depth = depth_of([&cloud, &cloud], poses, Vector::ZERO);
            assert!(depth < small, "{spacing}, {case}: {depth} m");
        }
    }
}
