//! The k-d tree and the radii made from it, against brute force.

use fastrand::Rng;
use tldi::glamx::Vec3;
use tldi::{CloudError, KdTree, Neighbor, PointCloud, Radii};

/// Every point's distance to the query, in order of distance, then index.
fn brute_force(points: &[Vec3], query: Vec3) -> Vec<Neighbor> {
    let mut all: Vec<Neighbor> = (0..points.len())
        .map(|index| Neighbor {
            index,
            distance_squared: (points[index].as_dvec3() - query.as_dvec3()).length_squared(),
        })
        .collect();
    all.sort_by(|a, b| {
        (a.distance_squared, a.index)
            .partial_cmp(&(b.distance_squared, b.index))
            .expect("finite")
    });
    all
}

/// Distance to the k-th nearest distinct position other than the query (or the farthest).
fn brute_force_spacing(points: &[Vec3], query: Vec3, k: usize) -> f64 {
    let mut positions: Vec<Vec3> = points.iter().copied().filter(|p| *p != query).collect();
    positions.sort_by(|a, b| a.to_array().partial_cmp(&b.to_array()).expect("finite"));
    positions.dedup();
    let mut distances: Vec<f64> = positions
        .iter()
        .map(|p| (p.as_dvec3() - query.as_dvec3()).length())
        .collect();
    distances.sort_by(f64::total_cmp);
    distances[k.min(distances.len()) - 1]
}

fn random_vec(rng: &mut Rng) -> Vec3 {
    Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 2.0 - Vec3::ONE
}

/// Clouds that are unkind to trees: clustered, repeated, flat, thin, on a grid full of ties.
fn clouds(seed: u64) -> Vec<(&'static str, Vec<Vec3>)> {
    let mut rng = Rng::with_seed(seed);
    let rng = &mut rng;
    let uniform: Vec<Vec3> = (0..700).map(|_| random_vec(rng)).collect();
    let clustered = (0..700)
        .map(|i| Vec3::splat((i % 5) as f32) + random_vec(rng) * 10f32.powi(-(i % 5)))
        .collect();
    let mut repeated: Vec<Vec3> = uniform[..50].to_vec();
    repeated.extend((0..600).map(|_| uniform[rng.usize(..9)]));
    rng.shuffle(&mut repeated);
    let direction = Vec3::new(0.3, -1.0, 0.5);
    let collinear = (0..400).map(|_| direction * (rng.f32() - 0.5)).collect();
    let axis = (0..400).map(|_| Vec3::Y * (rng.f32() - 0.5)).collect();
    let coplanar = uniform.iter().map(|p| Vec3::new(p.x, 0.25, p.z)).collect();
    let grid = (0..512)
        .map(|i| Vec3::new((i % 8) as f32, (i / 8 % 8) as f32, (i / 64) as f32))
        .collect();
    let extreme = uniform.iter().map(|p| *p * 1e17).collect();
    let tiny = uniform.iter().map(|p| *p * 1e-30).collect();
    let signed_zeros = (0..64)
        .map(|i| Vec3::new([0.0, -0.0][i % 2], [-0.0, 0.0][i / 2 % 2], (i / 4) as f32))
        .collect();
    vec![
        ("uniform", uniform),
        ("clustered", clustered),
        ("repeated", repeated),
        ("collinear", collinear),
        ("along an axis", axis),
        ("coplanar", coplanar),
        ("grid", grid),
        ("extreme", extreme),
        ("tiny", tiny),
        ("signed zeros", signed_zeros),
        ("one", vec![Vec3::ONE]),
        ("all the same", vec![Vec3::ONE; 300]),
    ]
}

/// A tree of points whose largest coordinate may be anything up to 10¹⁷.
fn tree_of(points: &[Vec3]) -> KdTree {
    let largest = points
        .iter()
        .map(|p| p.abs().max_element())
        .fold(0.0, f32::max);
    let radius = (largest * 1e-3).clamp(1e-12, 1e12);
    let cloud = PointCloud::builder(points).radius(radius).build();
    KdTree::new(&cloud.expect("valid"))
}

#[test]
fn neighbours_equal_brute_force() {
    let mut rng = Rng::with_seed(3);
    let mut found = Vec::new();
    for (name, points) in clouds(1) {
        let tree = tree_of(&points);
        assert_eq!(tree.len(), points.len());
        for round in 0..60 {
            let near = points[rng.usize(..points.len())];
            let query = match round % 3 {
                0 => near,
                1 => near + random_vec(&mut rng) * 0.1,
                _ => near + random_vec(&mut rng) * 10.0,
            };
            let expected = brute_force(&points, query);
            assert_eq!(
                tree.nearest(query, f32::INFINITY),
                Some(expected[0]),
                "{name}: nearest to {query}"
            );
            for k in [1, 2, 7, 40, 2000] {
                tree.k_nearest(query, k, &mut found);
                let k = k.min(points.len());
                assert_eq!(found, expected[..k], "{name}: {k} nearest to {query}");
            }
            // A radius that some point's distance equals, to within rounding to f32.
            let radius = expected[rng.usize(..points.len())].distance();
            tree.within(query, radius, &mut found);
            let limit = f64::from(radius).powi(2);
            let count = expected
                .iter()
                .filter(|n| n.distance_squared <= limit)
                .count();
            assert_eq!(
                found,
                expected[..count],
                "{name}: within {radius} of {query}"
            );
            let reachable = expected[0].distance_squared <= limit;
            assert_eq!(tree.nearest(query, radius).is_some(), reachable, "{name}");
        }
    }
}

#[test]
fn no_neighbours_where_there_can_be_none() {
    let tree = tree_of(&[Vec3::ZERO, Vec3::X]);
    let mut found = Vec::new();
    let nan = Vec3::new(0.0, f32::NAN, 0.0);
    for query in [nan, Vec3::splat(f32::INFINITY)] {
        assert_eq!(tree.nearest(query, f32::INFINITY), None);
        tree.k_nearest(query, 3, &mut found);
        assert!(found.is_empty());
        tree.within(query, 1.0, &mut found);
        assert!(found.is_empty());
    }
    for radius in [f32::NAN, -1.0] {
        assert_eq!(tree.nearest(Vec3::ZERO, radius), None);
        tree.within(Vec3::ZERO, radius, &mut found);
        assert!(found.is_empty());
    }
    tree.k_nearest(Vec3::ZERO, 0, &mut found);
    assert!(found.is_empty());
    // Of the point itself, distance 0 is within reach.
    assert_eq!(tree.nearest(Vec3::X, 0.0).map(|n| n.index), Some(1));
}

#[test]
fn a_hundred_thousand_duplicates_are_no_trouble() {
    // Quadratic time would be 10¹⁰ steps for each of radii and normals: not finished in a test run.
    let mut points = vec![Vec3::new(0.5, 0.25, 0.0); 100_000];
    points.extend((0..400).map(|i| Vec3::new((i % 20) as f32, (i / 20) as f32, 0.0)));
    let cloud = PointCloud::builder(&points)
        .pca_normals(8)
        .build()
        .expect("valid");
    let normals = cloud.normals().expect("asked for");
    assert!(normals.iter().all(|n| n.z.abs() > 0.999_999));
    let expected = (0.65 * brute_force_spacing(&points, points[0], 7)) as f32;
    assert!((0..100_000).all(|i| cloud.radius(i) == expected));

    let tree = KdTree::new(&cloud);
    let mut found = Vec::new();
    tree.k_nearest(Vec3::new(0.5, 0.25, 0.0), 3, &mut found);
    assert_eq!(found.iter().map(|n| n.index).collect::<Vec<_>>(), [0, 1, 2]);
    tree.within(Vec3::new(0.5, 0.25, 0.0), 0.1, &mut found);
    assert!(found.iter().enumerate().all(|(i, n)| n.index == i) && found.len() == 100_000);
}

#[test]
fn radii_equal_brute_force() {
    for (name, points) in clouds(2) {
        if ["extreme", "tiny", "one", "all the same"].contains(&name) {
            continue; // no radius is accepted there: see tests/cloud.rs
        }
        for (k, scale) in [(1, 1.0), (7, 0.65), (5000, 0.01)] {
            let cloud = PointCloud::builder(&points)
                .knn_radii(k, scale)
                .build()
                .expect(name);
            let expected: Vec<f32> = points
                .iter()
                .map(|p| (brute_force_spacing(&points, *p, k) * f64::from(scale)) as f32)
                .collect();
            let mut distinct: Vec<([f32; 3], f32)> = points
                .iter()
                .map(|p| (*p + 0.0).to_array())
                .zip(expected.iter().copied())
                .collect();
            distinct.sort_by(|a, b| a.partial_cmp(b).expect("finite"));
            distinct.dedup();
            let mut sorted: Vec<f32> = distinct.into_iter().map(|(_, r)| r).collect();
            sorted.sort_by(f32::total_cmp);
            let median = sorted[(sorted.len() - 1) / 2];
            for (i, expected) in expected.iter().enumerate() {
                let finest = points[i].abs().max_element() / 524_288.0;
                let expected = expected.min(10.0 * median).max(finest.min(median));
                assert_eq!(cloud.radius(i), expected, "{name}: point {i}, k = {k}");
            }
        }
    }
}

/// A square grid of `n` × `n` points.
fn grid(n: usize, spacing: f32, origin: Vec3) -> Vec<Vec3> {
    let point = |i: usize| origin + spacing * Vec3::new((i % n) as f32, (i / n) as f32, 0.0);
    (0..n * n).map(point).collect()
}

#[test]
fn default_radii_are_the_papers_cover() {
    let points = grid(20, 0.5, Vec3::ZERO);
    let cloud = PointCloud::builder(&points).build().expect("valid");
    // Around an inner point there are 4 points at the spacing, 4 at √2 ×, then some at 2 ×.
    let expected = (f64::from(0.65f32) * 0.5 * 2f64.sqrt()) as f32;
    assert_eq!(cloud.radius(10 * 20 + 10), expected);
    let Radii::PerPoint(radii) = cloud.radii() else {
        panic!("one radius a point");
    };
    let mean = radii.iter().sum::<f32>() / 400.0;
    assert!(
        (cloud.mean_radius() - mean).abs() < 1e-5 * mean,
        "summed in f32 here"
    );
    assert_eq!(
        cloud.max_radius(),
        radii.iter().copied().fold(0.0, f32::max)
    );
}

#[test]
fn few_points_use_the_farthest_neighbour() {
    let points = [Vec3::ZERO, Vec3::X, 3.0 * Vec3::X];
    let cloud = PointCloud::builder(&points[..])
        .knn_radii(7, 0.5)
        .build()
        .expect("valid");
    let radii: Vec<f32> = (0..3).map(|i| cloud.radius(i)).collect();
    assert_eq!(radii, [1.5, 1.0, 1.5]);
}

#[test]
fn outliers_are_capped_and_genuine_density_is_not() {
    // 100 : 1 in density, 10 : 1 in spacing, the dense part in the majority.
    let mut points = grid(40, 0.1, Vec3::ZERO);
    let dense = points.len();
    points.extend(grid(20, 1.0, Vec3::new(100.0, 0.0, 0.0)));
    let outlier = points.len();
    points.push(Vec3::new(0.0, 0.0, 1000.0));
    let cloud = PointCloud::builder(&points).build().expect("valid");
    let median = 0.65 * (0.1 * 2f32.sqrt());
    let inner_sparse = dense + 10 * 20 + 10;
    // Rounding of the coordinates near 100 (7.6e-6) against a spacing of 1.
    assert!((cloud.radius(inner_sparse) - 10.0 * median).abs() < 1e-4);
    assert!(
        (cloud.radius(outlier) - 10.0 * median).abs() < 1e-4,
        "{}",
        cloud.radius(outlier)
    );
}

#[test]
fn near_duplicates_far_from_the_origin_are_accepted() {
    // Ten points one step of f32 apart (2⁻²⁰ at 10 m) beside one of a grid: rounding makes as much of a single point.
    let mut points = grid(20, 0.1, Vec3::new(10.0, 0.0, 0.0));
    let built = |points: &[Vec3]| PointCloud::builder(points.to_vec()).build();
    let without = built(&points).expect("a grid").radius(0);
    points.extend((1..11).map(|i| Vec3::new(10.0 + i as f32 * 2f32.powi(-20), 0.0, 0.0)));
    let cloud = built(&points).expect("near duplicates are not an error");
    assert_eq!([cloud.radius(0), cloud.radius(400)], [without; 2]);

    // Twenty points two steps farther apart than that are several, but too close for their coordinates.
    points.truncate(400);
    points.extend((1..21).map(|i| Vec3::new(10.0 + i as f32 * 12.0 * 2f32.powi(-20), 0.0, 0.0)));
    let cloud = built(&points).expect("near duplicates are not an error");
    let radius = cloud.radius(410);
    assert!(
        radius >= points[410].x / 524_288.0 && radius < 1e-4,
        "{radius}"
    );

    // But a grid that is this fine as a whole is.
    let points = grid(20, 2f32.powi(-19), Vec3::new(10.0, 0.0, 0.0));
    let error = PointCloud::builder(&points)
        .build()
        .expect_err("too fine for f32");
    assert!(
        matches!(error, CloudError::CoordinateTooLarge { .. }),
        "{error}"
    );
}

#[test]
fn coincident_points_have_no_radius() {
    for count in [1, 5] {
        let points = vec![Vec3::ONE; count];
        let error = PointCloud::builder(&points)
            .build()
            .expect_err("no spacing");
        assert_eq!(error, CloudError::NoSpacing { count });
        assert!(error.to_string().contains("CloudBuilder::radius"));
    }
}

#[test]
fn results_do_not_depend_on_the_number_of_threads() {
    let mut rng = Rng::with_seed(11);
    let points: Vec<Vec3> = (0..30_000)
        .map(|i| {
            // A sphere, one point in ten repeated.
            if i % 10 == 0 {
                Vec3::Z
            } else {
                random_vec(&mut rng).normalize_or(Vec3::X)
            }
        })
        .collect();
    let run = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .expect("pool");
        pool.install(|| {
            let cloud = PointCloud::builder(&points)
                .pca_normals(10)
                .viewpoint(Vec3::new(5.0, 4.0, 3.0))
                .spatial_order()
                .build()
                .expect("valid");
            let mut found = Vec::new();
            KdTree::new(&cloud).k_nearest(Vec3::Z, 5000, &mut found);
            let radii: Vec<u32> = (0..cloud.len())
                .map(|i| cloud.radius(i).to_bits())
                .collect();
            let normals: Vec<[u32; 3]> = cloud
                .normals()
                .expect("asked for")
                .iter()
                .map(|n| n.to_array().map(f32::to_bits))
                .collect();
            (radii, normals, cloud.order().map(<[u32]>::to_vec), found)
        })
    };
    let one = run(1);
    assert!(one == run(2), "2 threads");
    assert!(one == run(7), "7 threads");
}

/// Copies of points, each coordinate off by up to two steps of `f32` at the largest one, as after a rotation.
fn rounded_differently(points: &[Vec3], rng: &mut Rng) -> Vec<Vec3> {
    let copy = |p: &Vec3| {
        let step = p.abs().max_element() * f32::EPSILON;
        let mut off = || step * rng.i32(-2..=2) as f32;
        *p + Vec3::new(off(), off(), off())
    };
    points.iter().map(copy).collect()
}

/// A cloud in which all points or some occur twice or three times, to the bit or rounded differently, has the radii and
/// normals of the single one: by brute force over its points, and to the bit where these come first.
#[test]
fn copies_of_points_change_nothing() {
    for (seed, offset) in [(1, 0.0), (2, 3.0), (3, 40.0)] {
        let mut rng = Rng::with_seed(seed);
        let single: Vec<Vec3> = (0..600)
            .map(|_| (random_vec(&mut rng) * Vec3::new(1.0, 0.02, 1.0)) + Vec3::splat(offset))
            .collect();
        let built = |points: &[Vec3]| {
            let builder = PointCloud::builder(points.to_vec()).knn_radii(7, 0.65);
            builder.pca_normals(12).build().expect("a valid cloud")
        };
        let expected = built(&single);
        for k in 0..single.len() {
            let radius = 0.65 * brute_force_spacing(&single, single[k], 7);
            assert!((f64::from(expected.radius(k)) - radius).abs() < 1e-6 * radius);
        }
        let twice = rounded_differently(&single, &mut rng);
        let thrice = rounded_differently(&single, &mut rng);
        for copies in [
            single.clone(),
            [&single[..], &single].concat(),
            single[..200].to_vec(),
            twice[..200].to_vec(),
            [&twice[..], &thrice].concat(),
        ] {
            let cloud = built(&[&single[..], &copies].concat());
            let normals = cloud.normals().expect("they were asked for");
            for (k, normal) in normals.iter().enumerate() {
                let original = k % single.len();
                assert_eq!(cloud.radius(k), expected.radius(original), "{seed}: {k}");
                let expected = expected.normals().map(|normals| normals[original]);
                assert_eq!(Some(*normal), expected, "{seed}: {k}");
            }
        }
    }
}

/// Points that differ by more than rounding are several, those that do not are one.
#[test]
fn what_f32_tells_apart_is_several_points() {
    let radii = |apart: f32| {
        let points = [Vec3::X, Vec3::X + apart * Vec3::Y, 3.0 * Vec3::X];
        let cloud = PointCloud::builder(&points[..]).knn_radii(1, 1.0).build();
        cloud.map(|cloud| [cloud.radius(0), cloud.radius(2)])
    };
    let [close, _] = radii(1e-5).expect("three points");
    assert_eq!(close, 1e-5);
    assert_eq!(radii(5e-7).expect("two points"), [2.0, 2.0]);
    let one = [Vec3::X, Vec3::X + 5e-7 * Vec3::Y];
    let error = PointCloud::builder(&one[..]).knn_radii(7, 0.65).build();
    assert!(
        matches!(error, Err(CloudError::NoSpacing { count: 2 })),
        "{error:?}"
    );
}

/// Radii and normals that are asked for together are to the bit those that are asked for alone, also where a leaf of the
/// tree spans dense and thin places.
#[test]
fn one_search_finds_what_two_do() {
    let mut rng = Rng::with_seed(5);
    let mut points: Vec<Vec3> = (0..4000)
        .map(|i| random_vec(&mut rng) * if i % 3 == 0 { 1.0 } else { 0.01 })
        .collect();
    points.extend((0..40).map(|_| 100.0 * random_vec(&mut rng)));
    points.extend(grid(20, 0.01, Vec3::X));
    for (radius_neighbors, normal_neighbors) in [(7, 12), (24, 8), (300, 3)] {
        let radii = || PointCloud::builder(&points).knn_radii(radius_neighbors, 0.65);
        let both = radii()
            .pca_normals(normal_neighbors)
            .build()
            .expect("valid");
        let alone = radii().build().expect("valid");
        assert!(both.radii() == alone.radii(), "{radius_neighbors}");
        let normals = PointCloud::builder(&points)
            .radius(1.0)
            .pca_normals(normal_neighbors);
        let normals = normals.build().expect("valid");
        assert!(both.normals() == normals.normals(), "{normal_neighbors}");
        for (i, point) in points.iter().enumerate().step_by(7) {
            let radius = (brute_force_spacing(&points, *point, radius_neighbors)
                * f64::from(0.65_f32)) as f32;
            let cap = both.max_radius();
            assert_eq!(both.radius(i), radius.min(cap), "{i}");
        }
    }
}
