//! `PointCloudShape` as a shape of parry's: metadata, rays, projections, copies.

use crate::exact::unit;
use rapier3d::glamx::{Pose3, Vec3};
use rapier3d::parry::query::{PointQuery, Ray, RayCast};
use rapier3d::parry::shape::{FeatureId, Shape, ShapeType};
use rapier3d::prelude::{ColliderBuilder, PhysicsWorld, RigidBodyBuilder, SharedShape};
use rapier3d_tldi::{CloudError, MassModel, PointCloud, PointCloudShape, sample_shape};

/// Random points of the unit sphere, with outward normals if asked for.
fn sphere(count: usize, with_normals: bool) -> PointCloud<'static> {
    let mut rng = fastrand::Rng::with_seed(1);
    let points: Vec<Vec3> = (0..count).map(|_| unit(&mut rng)).collect();
    let builder = PointCloud::builder(points.clone()).knn_radii(7, 0.65);
    let builder = if with_normals {
        builder.normals(points)
    } else {
        builder
    };
    builder.build().unwrap()
}

/// A square grid of `n × n` points in the plane y = 0, spaced by 0.1 from the origin on.
fn plane(n: usize, with_normals: bool) -> PointCloud<'static> {
    let points: Vec<Vec3> = (0..n * n)
        .map(|k| 0.1 * Vec3::new((k % n) as f32, 0.0, (k / n) as f32))
        .collect();
    let builder = PointCloud::builder(points).radius(0.08);
    let builder = if with_normals {
        builder.normals(vec![Vec3::Y; n * n])
    } else {
        builder
    };
    builder.build().unwrap()
}

#[test]
fn bounds_hold_the_points_grown_by_the_mean_radius() {
    let shape = PointCloudShape::new(plane(11, true));
    let aabb = shape.compute_local_aabb();
    assert!(
        (aabb.mins - Vec3::new(-0.08, -0.08, -0.08))
            .abs()
            .max_element()
            < 1e-6
    );
    assert!(
        (aabb.maxs - Vec3::new(1.08, 0.08, 1.08))
            .abs()
            .max_element()
            < 1e-6
    );
    let sphere = shape.compute_local_bounding_sphere();
    for corner in [aabb.mins, aabb.maxs] {
        assert!(corner.distance(sphere.center) <= sphere.radius * (1.0 + 1e-6));
    }
    // A sheet counts as two radii thick, a body by its smallest extent.
    assert_eq!(shape.ccd_thickness(), 0.08);
    let ball = PointCloudShape::new(self::sphere(2000, false));
    assert!((ball.ccd_thickness() - 1.0).abs() < 0.01);
    assert_eq!(ball.shape_type(), ShapeType::Custom);
    assert!(!ball.is_convex());
}

#[test]
fn rays_hit_a_plane_where_it_is() {
    let mut rng = fastrand::Rng::with_seed(2);
    let with_normals = PointCloudShape::new(plane(11, true));
    let without = PointCloudShape::new(plane(11, false));
    for _ in 0..500 {
        let target = Vec3::new(rng.f32(), 0.0, rng.f32());
        let origin = target + 2.0 * unit(&mut rng);
        if origin.y.abs() < 0.2 {
            continue;
        }
        // The direction need not be of unit length.
        let ray = Ray::new(origin, 0.5 * (target - origin));
        let hit = with_normals
            .cast_local_ray_and_get_normal(&ray, 10.0, true)
            .unwrap();
        // f32 rounding of coordinates around 2.
        assert!(ray.point_at(hit.time_of_impact).distance(target) < 1e-5);
        assert_eq!(hit.normal, Vec3::Y * origin.y.signum());
        let FeatureId::Vertex(index) = hit.feature else {
            panic!("{:?}", hit.feature);
        };
        assert!(with_normals.cloud().point(index as usize).distance(target) <= 0.08 + 1e-5);
        assert!(
            with_normals.cast_local_ray(&ray, 1.9, true).is_none(),
            "beyond the end"
        );
        // Discs that face the ray are off by radius · tan of the angle to the normal.
        let hit = without
            .cast_local_ray_and_get_normal(&ray, 10.0, true)
            .unwrap();
        let cos = (ray.dir.normalize().y).abs();
        let tan = (1.0 - cos * cos).sqrt() / cos;
        let short = 2.0 - hit.time_of_impact * ray.dir.length();
        assert!(short.abs() < 0.08 * tan + 1e-5, "{short} {tan}");
        assert!(hit.normal.distance(-ray.dir.normalize()) < 1e-6);
    }
    let away = Ray::new(Vec3::new(0.5, 1.0, 0.5), Vec3::Y);
    assert!(
        with_normals.cast_local_ray(&away, 10.0, true).is_none(),
        "behind the origin"
    );
    // From within the reach of a disc, but past it or too short of it.
    let close = Vec3::new(0.5, 0.05, 0.5);
    assert!(
        with_normals
            .cast_local_ray(&Ray::new(close, Vec3::Y), 10.0, true)
            .is_none()
    );
    let down = Ray::new(close, -Vec3::Y);
    assert!(with_normals.cast_local_ray(&down, 0.04, true).is_none());
    assert!(with_normals.cast_local_ray(&down, 0.06, true).is_some());
    let past = Ray::new(Vec3::new(1.2, 1.0, 0.5), -Vec3::Y);
    assert!(
        with_normals.cast_local_ray(&past, 10.0, true).is_none(),
        "beside the plane"
    );
}

#[test]
fn rays_and_projections_find_a_sphere_within_the_stated_error() {
    let mut rng = fastrand::Rng::with_seed(3);
    let shape = PointCloudShape::new(sphere(5000, true));
    let radius = shape.cloud().max_radius();
    let sagitta = 0.5 * radius * radius;
    let (mut gaps, mut inside) = (0, 0);
    for _ in 0..500 {
        let origin = 2.0 * unit(&mut rng);
        let target = 0.8 * unit(&mut rng);
        let direction = (target - origin).normalize();
        // The analytic hit.
        let closest = -origin.dot(direction);
        let half_chord = (1.0 - (origin + closest * direction).length_squared()).sqrt();
        let t = closest - half_chord;
        let normal = origin + t * direction;
        let ray = Ray::new(origin, direction);
        let hit = shape.cast_local_ray_and_get_normal(&ray, 10.0, true);
        // Some gaps are left between the discs of a random sample: there the ray goes through, and
        // may hit the far side, half a metre on.
        let Some(hit) = hit.filter(|hit| hit.time_of_impact < t + 0.5) else {
            gaps += 1;
            continue;
        };
        // The disc may be met at a flatter angle than the sphere.
        let cos = -normal.dot(direction).max(hit.normal.dot(direction));
        assert!(
            (hit.time_of_impact - t).abs() < sagitta / cos + 1e-5,
            "{cos}"
        );
        // Tilted by the disc's own radius over the sphere's.
        assert!(hit.normal.distance(normal) < 1.1 * radius / cos);

        let point = (0.5 + rng.f32()) * unit(&mut rng);
        let (projection, feature) = shape.project_local_point_and_get_feature(point);
        assert!(matches!(feature, FeatureId::Vertex(_)));
        assert!(projection.point.length() - 1.0 < sagitta + 1e-5);
        assert!(projection.point.length() > 1.0 - 1e-5);
        let height = point.length() - 1.0;
        if height.abs() > sagitta {
            assert_eq!(projection.is_inside, height < 0.0);
            inside += usize::from(projection.is_inside);
        }
        let distance = shape.distance_to_local_point(point, false);
        // The foot lies beside the true one by up to the sample spacing, raised by the sagitta.
        assert!(
            (distance - height).abs() < 2.0 * sagitta + 1e-5,
            "{distance} {height}"
        );
        assert_eq!(
            shape.project_local_point(point, true).point == point,
            projection.is_inside,
            "a point inside a solid is its own projection"
        );
    }
    // Balls of one radius leave e^(-7 · 0.65²) = 5 % of a random sample uncovered.
    assert!(gaps < 25 && inside > 100, "{gaps} {inside}");
}

/// Far from a sharp shape's samples, hardly any point counts to the wrong side; near them, where depths are as large as
/// radii, all count to the right one. Beyond a tip or an edge the nearest sample may be of the face around it.
#[test]
fn insides_end_at_tips_and_edges() {
    let mut rng = fastrand::Rng::with_seed(5);
    for exact in [
        SharedShape::cone(0.3, 0.25),
        SharedShape::cone(0.5, 0.15),
        SharedShape::cuboid(0.3, 0.2, 0.25),
        SharedShape::cylinder(0.2, 0.2),
    ] {
        let shape = PointCloudShape::new(sample_shape(&*exact, 0.02).unwrap());
        let (mut wrong, mut count) = (0, 0);
        while count < 4000 {
            let size = [1.0, 0.35][count % 2];
            let mut coordinate = || size * (2.0 * rng.f32() - 1.0);
            let point = Vec3::new(coordinate(), coordinate(), coordinate());
            let depth = exact.project_local_point(point, false);
            if (depth.point - point).length() < 0.02 {
                continue;
            }
            count += 1;
            let found = shape.project_local_point(point, true);
            wrong += usize::from(found.is_inside != depth.is_inside);
        }
        assert!(
            wrong <= count / 50,
            "{:?}: {wrong} of {count}",
            exact.shape_type()
        );
    }
}

#[test]
fn projections_without_normals_go_to_the_nearest_point() {
    let mut rng = fastrand::Rng::with_seed(4);
    let shape = PointCloudShape::new(sphere(800, false));
    for _ in 0..300 {
        let point = 1.5 * rng.f32() * unit(&mut rng);
        let nearest = shape
            .cloud()
            .points()
            .iter()
            .copied()
            .min_by(|a, b| {
                a.distance_squared(point)
                    .total_cmp(&b.distance_squared(point))
            })
            .unwrap();
        let projection = shape.project_local_point(point, true);
        assert_eq!(projection.point.distance(point), nearest.distance(point));
        assert!(!projection.is_inside);
    }
    let nan = Vec3::splat(f32::NAN);
    assert!(!shape.project_local_point(nan, true).is_inside);
    assert!(
        shape
            .cast_local_ray(&Ray::new(nan, Vec3::X), 1.0, true)
            .is_none()
    );
    assert!(
        shape
            .cast_local_ray(&Ray::new(Vec3::ZERO, Vec3::ZERO), 1.0, true)
            .is_none()
    );
}

#[test]
fn moved_points_move_everything_but_the_mass_and_leave_clones_alone() {
    let mut shape = PointCloudShape::new(sphere(2000, true));
    let clone = shape.clone();
    assert_eq!(shape.revision(), clone.revision());
    let mass = shape.mass_properties(1.0).mass();
    let ray = Ray::new(Vec3::new(0.0, 0.0, 5.0), -Vec3::Z);
    assert!((shape.cast_local_ray(&ray, 10.0, true).unwrap() - 4.0).abs() < 0.01);

    let radii: Vec<f32> = (0..2000).map(|i| shape.cloud().radius(i)).collect();
    let doubled: Vec<Vec3> = shape.cloud().points().iter().map(|&p| 2.0 * p).collect();
    let normals = shape.cloud().normals().unwrap().to_vec();
    shape.move_points(&doubled, Some(&normals)).unwrap();
    assert_ne!(shape.revision(), clone.revision());
    assert!(shape.compute_local_aabb().maxs.x > 1.9);
    assert!(clone.compute_local_aabb().maxs.x < 1.2);
    assert!((clone.cast_local_ray(&ray, 10.0, true).unwrap() - 4.0).abs() < 0.01);
    assert_eq!(
        (0..2000)
            .map(|i| shape.cloud().radius(i))
            .collect::<Vec<_>>(),
        radii
    );
    assert_eq!(shape.mass_properties(1.0).mass(), mass, "kept");

    // No clone shares the points any more: the same again, in place.
    let before = shape.revision();
    assert!((shape.cast_local_ray(&ray, 10.0, true).unwrap() - 3.0).abs() < 0.02);
    let aside = 5.0 * Vec3::X;
    let moved: Vec<Vec3> = doubled.iter().map(|p| aside + 0.75 * *p).collect();
    shape.move_points(&moved, Some(&normals)).unwrap();
    assert!(shape.revision() > before);
    // A neighbour's disc may stand out by radius² / 2R, here 0.3 mm.
    let ray = Ray::new(moved[0] + 2.0 * normals[0], -normals[0]);
    let t = shape.cast_local_ray(&ray, 10.0, true);
    assert!(
        t.is_some_and(|t| (t - 2.0).abs() < 1e-3),
        "the tree of the former points is gone: {t:?}"
    );
    shape.refresh_mass();
    assert!((shape.mass_properties(1.0).mass() / mass - 3.375).abs() < 0.15);

    let revision = shape.revision();
    let refused = shape.set_points(&[], None);
    assert!(
        matches!(refused, Err(CloudError::Empty { .. })),
        "{refused:?}"
    );
    assert_eq!((shape.revision(), shape.cloud().len()), (revision, 2000));
}

#[test]
fn scaling_keeps_the_cover_and_the_outside() {
    let shape =
        PointCloudShape::with_mass_model(sphere(3000, true), MassModel::Shell { thickness: 0.01 })
            .expect("a sheet has this thickness");
    let scale = Vec3::new(-2.0, 1.0, 0.5);
    let scaled = shape.scale_dyn(scale, 0).unwrap();
    let scaled = scaled.as_shape::<PointCloudShape>().unwrap();
    assert_eq!(scaled.mass_model(), MassModel::Shell { thickness: 0.02 });
    for i in (0..3000).step_by(37) {
        let (from, to) = (shape.cloud().point(i), scaled.cloud().point(i));
        assert_eq!(to, from * scale);
        assert!((scaled.cloud().radius(i) - 2.0 * shape.cloud().radius(i)).abs() < 1e-6);
        // Gradient of the ellipsoid's equation.
        let normal = (to / (scale * scale)).normalize();
        assert!(scaled.cloud().normals().unwrap()[i].distance(normal) < 1e-5);
    }
    assert!(scaled.cloud().normals_oriented());
    let points: Vec<Vec3> = shape.cloud().points().to_vec();
    let noisy = PointCloud::builder(points).radius(0.1).noise(0.01);
    let noisy = PointCloudShape::new(noisy.build().unwrap());
    let scaled = noisy.scale_dyn(scale, 0).unwrap();
    let scaled = scaled.as_shape::<PointCloudShape>().unwrap();
    assert_eq!(scaled.cloud().noise(), 0.02);
    assert!(shape.scale_dyn(Vec3::new(1.0, 0.0, 1.0), 0).is_none());
    assert!(shape.scale_dyn(Vec3::new(1.0, f32::NAN, 1.0), 0).is_none());
    let doubled = PointCloudShape::new(plane(5, true)).scale_dyn(Vec3::new(2.0, 1.0, 1.0), 0);
    let doubled = doubled.unwrap();
    let doubled = doubled.as_shape::<PointCloudShape>().unwrap();
    assert_eq!(doubled.cloud().max_radius(), 0.16);
    let unoriented = PointCloud::builder(sphere(500, false).points().to_vec())
        .radius(0.2)
        .pca_normals(8)
        .build()
        .unwrap();
    let scaled = PointCloudShape::new(unoriented)
        .scale_dyn(Vec3::splat(3.0), 0)
        .unwrap();
    let scaled = scaled.as_shape::<PointCloudShape>().unwrap();
    assert!(scaled.cloud().normals().is_some() && !scaled.cloud().normals_oriented());
}

#[test]
fn rapier_accepts_the_shape_and_lets_it_fall() {
    let mut world = PhysicsWorld::default();
    let shape = SharedShape::new(PointCloudShape::new(sphere(2000, true)));
    let (body, collider) = world.insert(
        RigidBodyBuilder::dynamic().pose(Pose3::translation(0.0, 10.0, 0.0)),
        ColliderBuilder::new(shape).density(2.0),
    );
    for _ in 0..30 {
        world.step();
    }
    let body = &world.bodies[body];
    let volume = 4.0 / 3.0 * std::f32::consts::PI;
    assert!(
        (body.mass() / (2.0 * volume) - 1.0).abs() < 0.02,
        "{}",
        body.mass()
    );
    // Half a second of free fall: 1.2 m, and a step's share more.
    assert!(
        (8.5..9.0).contains(&body.translation().y),
        "{}",
        body.translation().y
    );
    let shape = world.colliders[collider].shape();
    assert!(shape.as_shape::<PointCloudShape>().is_some());
}
