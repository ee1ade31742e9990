//! Normals by principal component analysis against analytic surfaces, and given ones.

use fastrand::Rng;
use std::f32::consts::TAU;
use tldi::glamx::{DVec3, Quat, Vec3};
use tldi::{CloudError, KdTree, PointCloud};

/// The normals that PCA of `k` neighbours gives, without a viewpoint.
fn pca(points: &[Vec3], k: usize) -> Vec<Vec3> {
    let builder = PointCloud::builder(points).radius(1.0).pca_normals(k);
    let cloud = builder.build().expect("valid");
    assert!(!cloud.normals_oriented());
    let normals = cloud.normals().expect("asked for");
    assert!(normals.iter().all(|n| n.is_normalized()));
    normals.to_vec()
}

/// Angle between two directions that may point either way, in radians.
fn angle(a: Vec3, b: Vec3) -> f32 {
    a.cross(b).length().atan2(a.dot(b).abs())
}

/// Distance from each point to its k-th nearest neighbour.
fn neighborhoods(points: &[Vec3], k: usize) -> Vec<f32> {
    let tree = KdTree::new(
        &PointCloud::builder(points)
            .radius(1.0)
            .build()
            .expect("valid"),
    );
    let mut found = Vec::new();
    let mut reach = |p: &Vec3| {
        tree.k_nearest(*p, k + 1, &mut found);
        found[k].distance()
    };
    points.iter().map(&mut reach).collect()
}

fn random_direction(rng: &mut Rng) -> Vec3 {
    loop {
        let v = Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 2.0 - Vec3::ONE;
        if (0.1..1.0).contains(&v.length()) {
            return v.normalize();
        }
    }
}

/// Standard normal deviate (Box and Muller).
fn gauss(rng: &mut Rng) -> f32 {
    (-2.0 * (1.0 - rng.f32()).ln()).sqrt() * (TAU * rng.f32()).cos()
}

/// `count` points of the square [−1, 1]² across `normal`, moved along it by noise of deviation
/// `sigma`.
fn plane(rng: &mut Rng, count: usize, normal: Vec3, sigma: f32) -> Vec<Vec3> {
    let (u, v) = normal.any_orthonormal_pair();
    let mut point = |_| {
        let (a, b) = (2.0 * rng.f32() - 1.0, 2.0 * rng.f32() - 1.0);
        u * a + v * b + normal * (sigma * gauss(rng) + 0.5)
    };
    (0..count).map(&mut point).collect()
}

#[test]
fn planes_are_exact() {
    let mut rng = Rng::with_seed(1);
    for _ in 0..20 {
        let normal = random_direction(&mut rng);
        let points = plane(&mut rng, 500, normal, 0.0);
        // Coordinates are rounded by up to 6e-8 (and by as much again when they are made), across
        // neighbourhoods at least 0.1 wide in their narrower direction, most of them more.
        for n in pca(&points, 10) {
            assert!(angle(n, normal) < 2e-5, "{n} {normal}");
        }
    }
}

/// Over a neighbourhood of radius h the normals of a surface with radius of curvature R turn by up
/// to h / R, which bounds the error of its best plane; on the average, errors of all sides cancel
/// for the most part.
fn assert_curved(points: &[Vec3], normals: &[Vec3], curvature_radius: f32, k: usize) {
    let found = pca(points, k);
    let reach = neighborhoods(points, k);
    let mut share = 0.0;
    for i in 0..points.len() {
        let error = angle(found[i], normals[i]);
        let bound = reach[i] / curvature_radius;
        assert!(error <= bound, "point {i}: {error} > {bound}");
        share += error / bound;
    }
    share /= points.len() as f32;
    assert!(share < 0.3, "mean error is {share} of the bound");
}

#[test]
fn spheres_and_cylinders_within_their_curvature() {
    let mut rng = Rng::with_seed(2);
    let normals: Vec<Vec3> = (0..4000).map(|_| random_direction(&mut rng)).collect();
    let center = Vec3::new(3.0, -2.0, 1.0);
    let points: Vec<Vec3> = normals.iter().map(|n| center + 0.5 * n).collect();
    assert_curved(&points, &normals, 0.5, 12);

    let pose = Quat::from_axis_angle(random_direction(&mut rng), 1.0);
    let normals: Vec<Vec3> = (0..4000)
        .map(|_| pose * Vec3::new(0.0, 1.0, 0.0).rotate_x(TAU * rng.f32()))
        .collect();
    let points: Vec<Vec3> = normals
        .iter()
        .map(|n| 0.3 * n + pose * Vec3::X * (2.0 * rng.f32()))
        .collect();
    assert_curved(&points, &normals, 0.3, 12);
}

#[test]
fn box_faces_are_exact_away_from_edges() {
    let mut rng = Rng::with_seed(3);
    let half = Vec3::new(1.0, 0.6, 0.8);
    let mut points = Vec::new();
    let mut normals = Vec::new();
    for _ in 0..6000 {
        let axis = rng.usize(..3);
        let mut p = half * (Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 2.0 - Vec3::ONE);
        p[axis] = if rng.bool() { half[axis] } else { -half[axis] };
        points.push(p);
        normals.push(Vec3::AXES[axis]);
    }
    let found = pca(&points, 12);
    let reach = neighborhoods(&points, 12);
    let mut inner = 0;
    for i in 0..points.len() {
        let mut to_edges = half - points[i].abs();
        to_edges[normals[i].max_position()] = f32::INFINITY;
        if to_edges.min_element() > reach[i] {
            inner += 1;
            assert!(
                angle(found[i], normals[i]) < 1e-6,
                "{} {}",
                points[i],
                found[i]
            );
        }
    }
    assert!(inner > 3000, "{inner}");
}

#[test]
fn noise_tilts_planes_as_statistics_predict() {
    let mut rng = Rng::with_seed(4);
    let (k, sigma) = (24, 0.01);
    let points = plane(&mut rng, 6000, Vec3::Y, sigma);
    let found = pca(&points, k);
    let reach = neighborhoods(&points, k);
    let (mut squared_error, mut predicted) = (0.0, 0.0);
    for i in 0..points.len() {
        if points[i].x.abs().max(points[i].z.abs()) > 0.8 {
            continue; // half a neighbourhood at the border
        }
        squared_error += angle(found[i], Vec3::Y).powi(2);
        // Regression over a disc of radius h, where the variance of a coordinate is h² / 4: the
        // slope in each of two directions has the variance 4 σ² / (k h²).
        predicted += 2.0 * 4.0 * sigma.powi(2) / (k as f32 * reach[i].powi(2));
    }
    let ratio = (squared_error / predicted).sqrt();
    // Noise within the neighbourhood widens it and is not small against it: some excess is due.
    assert!((0.8..1.3).contains(&ratio), "{ratio}");
}

#[test]
fn lines_and_coincident_points_give_unit_normals_that_fit() {
    let mut rng = Rng::with_seed(5);
    let mut directions: Vec<Vec3> = (0..20).map(|_| random_direction(&mut rng)).collect();
    directions.extend(Vec3::AXES);
    for direction in directions {
        let points: Vec<Vec3> = (0..50).map(|_| direction * rng.f32()).collect();
        for n in pca(&points, 8) {
            // Points may be as near as 8 neighbours in 1/50, with coordinates rounded by 3e-8.
            assert!(n.dot(direction).abs() < 1e-4, "{n} {direction}");
        }
    }
    assert_eq!(pca(&[Vec3::ONE], 8), [Vec3::Z]);
    assert_eq!(pca(&[Vec3::ONE; 4], 8), [Vec3::Z; 4]);
    assert!(pca(&[Vec3::ZERO, Vec3::ONE], 8)[0].dot(Vec3::ONE).abs() < 1e-6);
}

#[test]
fn no_other_direction_has_less_variance() {
    let mut rng = Rng::with_seed(9);
    let points: Vec<Vec3> = (0..400)
        .map(|_| random_direction(&mut rng) * rng.f32())
        .collect();
    for k in [2, 3, 5, 20] {
        let normals = pca(&points, k);
        for (p, n) in points.iter().zip(&normals) {
            let mut nearest = points.clone();
            nearest.sort_by(|a, b| a.distance_squared(*p).total_cmp(&b.distance_squared(*p)));
            nearest.truncate(k + 1); // with the point itself
            let mean = nearest.iter().map(|q| q.as_dvec3()).sum::<DVec3>() / (k + 1) as f64;
            let variance = |direction: Vec3| -> f64 {
                let d = direction.as_dvec3().normalize();
                nearest
                    .iter()
                    .map(|q| (q.as_dvec3() - mean).dot(d).powi(2))
                    .sum()
            };
            // Near a minimum, variance is flat: 1e-12 covers the rounding of n to f32.
            let least = variance(*n) - 1e-12;
            let (u, v) = n.any_orthonormal_pair();
            for other in [u, v, -u, -v].map(|turn| *n + 1e-3 * turn) {
                assert!(least <= variance(other), "{k}: {n} {other}");
            }
            assert!(least <= variance(random_direction(&mut rng)));
        }
    }
}

#[test]
fn a_narrow_strip_is_a_plane_and_not_a_line() {
    // 1 : 1000. Direct formulas for the least eigenvector lose half of the digits here.
    let mut rng = Rng::with_seed(6);
    for _ in 0..20 {
        let normal = random_direction(&mut rng);
        let (u, v) = normal.any_orthonormal_pair();
        let points: Vec<Vec3> = (0..200)
            .map(|_| u * rng.f32() + v * (1e-3 * rng.f32()))
            .collect();
        for n in pca(&points, 60) {
            // Rounding by 6e-8 across 1e-3, and a margin for uneven neighbourhoods.
            assert!(angle(n, normal) < 5e-4, "{n} {normal}");
        }
    }
}

#[test]
fn scale_does_not_matter() {
    let mut rng = Rng::with_seed(7);
    let points: Vec<Vec3> = (0..500).map(|_| random_direction(&mut rng)).collect();
    let normals = pca(&points, 10);
    // Powers of two scale without rounding.
    for scale in [2f32.powi(-19), 2f32.powi(15)] {
        let scaled: Vec<Vec3> = points.iter().map(|p| *p * scale).collect();
        assert_eq!(pca(&scaled, 10), normals, "{scale}");
    }
}

#[test]
fn normals_turn_towards_the_viewpoint() {
    let mut rng = Rng::with_seed(8);
    let points: Vec<Vec3> = (0..2000).map(|_| random_direction(&mut rng)).collect();
    let oriented = |viewpoint| {
        let builder = PointCloud::builder(&points)
            .pca_normals(12)
            .viewpoint(viewpoint);
        let cloud = builder.build().expect("valid");
        assert!(cloud.normals_oriented());
        cloud.normals().expect("asked for").to_vec()
    };
    let viewpoint = Vec3::new(0.5, 3.0, -1.0);
    for (p, n) in points.iter().zip(oriented(viewpoint)) {
        assert!(n.dot(viewpoint - p) >= 0.0, "{p} {n}");
    }
    for (p, n) in points.iter().zip(oriented(Vec3::ZERO)) {
        assert!(n.dot(*p) < -0.9, "inward: {p} {n}");
    }
}

#[test]
fn given_normals_are_borrowed_if_they_are_unit_vectors() {
    let points = [Vec3::ZERO, Vec3::X, Vec3::Y];
    let normals = [Vec3::Z, Vec3::X, Vec3::new(0.6, 0.8, 0.0)];
    let cloud = PointCloud::builder(&points[..])
        .radius(1.0)
        .pca_normals(2)
        .normals(&normals[..])
        .build()
        .expect("valid");
    assert!(cloud.normals_oriented());
    assert_eq!(
        cloud.normals().map(<[Vec3]>::as_ptr),
        Some(normals.as_ptr())
    );
}

#[test]
fn given_normals_are_normalised_and_completed() {
    let points: Vec<Vec3> = (0..6)
        .map(|i| Vec3::X * [0.0, 1.0, 2.1, 3.3, 4.5, 5.6][i])
        .collect();
    let normals = vec![
        Vec3::new(0.0, 3.0, 4.0),
        Vec3::ZERO,
        Vec3::new(0.0, -1e-40, 0.0),
        Vec3::new(f32::NAN, 1.0, 0.0),
        Vec3::new(0.0, f32::INFINITY, 0.0),
        Vec3::new(3e38, 0.0, 3e38),
    ];
    let cloud = PointCloud::builder(&points).radius(1.0).normals(&normals);
    let cloud = cloud.build().expect("completed");
    let diagonal = Vec3::new(1.0, 0.0, 1.0).normalize();
    let first = Vec3::new(0.0, 0.6, 0.8);
    let expected = [first, first, -Vec3::Y, -Vec3::Y, diagonal, diagonal];
    for (i, n) in cloud.normals().expect("given").iter().enumerate() {
        assert!((*n - expected[i]).length() < 1e-6, "{i}: {n}");
    }
}

#[test]
fn normals_that_are_all_useless_are_an_error() {
    let points = [Vec3::ZERO, Vec3::X];
    let normals = [Vec3::ZERO, Vec3::NAN];
    let error = PointCloud::builder(&points[..])
        .radius(1.0)
        .normals(&normals[..])
        .build();
    assert_eq!(error.err(), Some(CloudError::NoUsableNormal { count: 2 }));
}
