//! Points on what carries the sensor, against exact distances.

use fastrand::Rng;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use rapier3d_tldi::{points_on, sample_shape};

const MARGIN: f32 = 0.01;

/// Asserts on random points, by the exact signed distance to the shape in its own frame: within half the margin
/// they are on it, `slack` beyond the margin they are not. Returns how many are on it.
fn assert_on(shape: &dyn Shape, distance: impl Fn(Vector) -> f32, slack: f32, seed: u64) -> usize {
    let pose = Pose::from_parts(Vector::new(1.0, 2.0, 0.5), Rotation::from_rotation_x(0.7));
    let mut rng = Rng::with_seed(seed);
    let points: Vec<Vector> = (0..20_000)
        .map(|_| 1.6 * Vector::new(rng.f32(), rng.f32(), rng.f32()) - Vector::splat(0.8))
        .collect();
    let in_world: Vec<Vector> = points.iter().map(|p| pose * *p).collect();
    let on = points_on(&in_world, &[(pose, shape)], MARGIN).expect("a margin");
    for (p, on) in points.iter().zip(&on) {
        let distance = distance(*p);
        if distance < 0.5 * MARGIN {
            assert!(on, "{p} is {distance} off");
        } else if distance > MARGIN + slack {
            assert!(!on, "{p} is {distance} off");
        }
    }
    on.iter().filter(|on| **on).count()
}

fn torus(p: Vector) -> f32 {
    (p.x.hypot(p.z) - 0.35).hypot(p.y) - 0.15
}

/// A box about the origin that is as long as it is thin.
fn bar(p: Vector) -> f32 {
    let beyond = p.abs() - Vector::new(0.5, 0.1, 0.1);
    beyond.max(Vector::ZERO).length() + beyond.max_element().min(0.0)
}

#[test]
fn rapiers_shapes_are_told_exactly() {
    let count = assert_on(&Cuboid::new(Vector::new(0.5, 0.1, 0.1)), bar, 1e-6, 3);
    // 4.0 · 10⁻² of 4.1 m³, and a margin of 10 mm about it.
    assert!((190..290).contains(&count), "{count}");
    let parts = [-0.25, 0.25].map(|x| {
        let pose = Pose::from_translation(x * Vector::X);
        (pose, SharedShape::cuboid(0.25, 0.1, 0.1))
    });
    let compound = SharedShape::compound(parts.to_vec());
    assert_eq!(assert_on(&*compound, bar, 1e-6, 3), count);
}

#[test]
fn clouds_are_told_up_to_their_radius() {
    let cuboid = SharedShape::cuboid(0.5, 0.1, 0.1);
    let cloud = sample_shape(&*cuboid, 0.02).expect("a box");
    assert_on(&PointCloudShape::new(cloud), bar, 0.02, 4);

    let mut rng = Rng::with_seed(5);
    let (points, normals): (Vec<_>, Vec<_>) = (0..20_000)
        .map(|_| {
            let (a, b) = (rng.f32(), rng.f32());
            let [a, b] = [a, b].map(|share| (std::f32::consts::TAU * share).sin_cos());
            let normal = Vector::new(a.1 * b.1, b.0, a.0 * b.1);
            let center = 0.35 * Vector::new(a.1, 0.0, a.0);
            (center + 0.15 * normal, normal)
        })
        .unzip();
    let cloud = PointCloud::builder(points)
        .normals(normals)
        .knn_radii(7, 0.65);
    let cloud = cloud.build().expect("a torus");
    let slack = cloud.max_radius();
    let count = assert_on(&PointCloudShape::new(cloud), torus, slack, 2);
    // The ring's share of the cube: 2 π² · 0.35 · 0.15² / 1.6³ = 3.8 %, with the margin 5 %.
    assert!((700..1200).contains(&count), "{count}");
}

#[test]
fn margins_that_are_no_lengths_are_refused() {
    let ball = Ball::new(0.1);
    for margin in [f32::NAN, -0.01, f32::INFINITY] {
        let on = points_on(&[Vector::ZERO], &[(Pose::IDENTITY, &ball)], margin);
        let is_refused = matches!(
            on,
            Err(CloudError::BadParameter { parameter: "margin", value, .. })
                if value.to_bits() == margin.to_bits()
        );
        assert!(is_refused, "{margin}: {on:?}");
    }
}

/// Without a side there is no inside: only what is near the samples is on them. The squares are tilted, so that
/// their bounds hold all points.
#[test]
fn bare_clouds_and_open_meshes_have_no_inside() {
    let tilted = |x: f32, z: f32| Vector::new(x, x, z);
    let square: Vec<Vector> = (0..400)
        .map(|i| {
            tilted(
                ((i % 20) as f32 - 9.5) * 0.05,
                ((i / 20) as f32 - 9.5) * 0.05,
            )
        })
        .collect();
    let bare = PointCloud::builder(&square).radius(0.05).build();
    let bare = PointCloudShape::new(bare.expect("a square").into_owned());
    let corners = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]].map(|[x, z]| tilted(x, z));
    let mesh = SharedShape::trimesh(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]]);
    let mesh = mesh.expect("a mesh");
    let normal = Vector::new(-1.0, 1.0, 0.0).normalize();
    let seen = [0.005, -0.005, 0.2, -0.2].map(|height| tilted(0.1, 0.2) + height * normal);
    for shape in [&bare as &dyn Shape, &*mesh] {
        let on = points_on(&seen, &[(Pose::IDENTITY, shape)], MARGIN);
        assert_eq!(on.expect("a margin"), [true, true, false, false]);
    }
}
