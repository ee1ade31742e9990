//! Mass properties of clouds against closed formulas and the exact integrals over meshes.

use crate::exact::unit;
use crate::skip::test_data;
use rapier3d::glamx::Vec3;
use rapier3d::prelude::{Cuboid, MassProperties, Shape, SharedShape};
use rapier3d_tldi::{CloudError, MassModel, PointCloud, PointCloudShape};

type Samples = (Vec<Vec3>, Vec<Vec3>);

/// Random points of a sphere of radius 0.5 about `center`, with outward normals.
fn sphere(count: usize, center: Vec3, seed: u64) -> Samples {
    let mut rng = fastrand::Rng::with_seed(seed);
    let normals: Vec<Vec3> = (0..count).map(|_| unit(&mut rng)).collect();
    let points = normals.iter().map(|n| center + 0.5 * n).collect();
    (points, normals)
}

const HALF: Vec3 = Vec3::new(0.3, 0.5, 0.4);

/// Random points of a box of half extents `HALF` about `center`, with outward normals.
fn cuboid(count: usize, center: Vec3, seed: u64) -> Samples {
    cuboid_of(HALF, count, center, seed)
}

fn cuboid_of(half: Vec3, count: usize, center: Vec3, seed: u64) -> Samples {
    let mut rng = fastrand::Rng::with_seed(seed);
    let area = |axis: usize| half[(axis + 1) % 3] * half[(axis + 2) % 3];
    let total = area(0) + area(1) + area(2);
    (0..count)
        .map(|_| {
            let mut pick = total * rng.f32();
            let axis = (0..2)
                .find(|&a| {
                    pick -= area(a);
                    pick < 0.0
                })
                .unwrap_or(2);
            let mut p = half * Vec3::from_array([(); 3].map(|()| 2.0 * rng.f32() - 1.0));
            let mut n = Vec3::ZERO;
            n[axis] = if rng.bool() { 1.0 } else { -1.0 };
            p[axis] = n[axis] * half[axis];
            (center + p, n)
        })
        .unzip()
}

fn cloud((points, normals): Samples, with_normals: bool) -> PointCloud<'static> {
    let builder = PointCloud::builder(points).knn_radii(7, 0.65);
    let builder = if with_normals {
        builder.normals(normals)
    } else {
        builder
    };
    builder.build().unwrap()
}

/// Of a model that has mass.
fn unit_mass_properties(cloud: &PointCloud<'_>, model: MassModel) -> MassProperties {
    rapier3d_tldi::unit_mass_properties(cloud, model).expect("the model has mass")
}

/// Relative error of mass, of the centre of mass against `size` and of the inertia matrix.
fn errors(actual: &MassProperties, expected: &MassProperties, size: f32) -> [f32; 3] {
    let (i, j) = (
        actual.reconstruct_inertia_matrix(),
        expected.reconstruct_inertia_matrix(),
    );
    let norm = |m: rapier3d::glamx::Mat3| {
        (m.x_axis.length_squared() + m.y_axis.length_squared() + m.z_axis.length_squared()).sqrt()
    };
    let errors = [
        actual.mass() / expected.mass() - 1.0,
        actual.local_com.distance(expected.local_com) / size,
        norm(i - j) / norm(j),
    ];
    eprintln!("errors of mass, centre, inertia: {errors:.4?}");
    errors
}

fn assert_close(actual: &MassProperties, expected: &MassProperties, size: f32, limits: [f32; 3]) {
    for (error, limit) in errors(actual, expected, size).into_iter().zip(limits) {
        assert!(error.abs() < limit, "{error} exceeds {limit}");
    }
}

const CENTER: Vec3 = Vec3::new(3.0, -2.0, 1.0);

/// A ball of radius 0.5 and the box about `CENTER` at 1 kg/m³.
fn solid_ball() -> MassProperties {
    let mut expected = MassProperties::from_ball(1.0, 0.5);
    expected.local_com = CENTER;
    expected
}
fn solid_box() -> MassProperties {
    let mut expected = MassProperties::from_cuboid(1.0, HALF);
    expected.local_com = CENTER;
    expected
}

#[test]
fn solids_with_normals() {
    for seed in 0..3 {
        let ball = cloud(sphere(5000, CENTER, seed), true);
        let actual = unit_mass_properties(&ball, MassModel::Solid);
        // The spacing of 0.025 over the radius of 0.5, squared, is 0.25 %.
        assert_close(&actual, &solid_ball(), 0.5, [0.01, 0.005, 0.01]);
        let block = cloud(cuboid(5000, CENTER, seed), true);
        let actual = unit_mass_properties(&block, MassModel::Solid);
        // Cells at the edges are off by a part of the spacing of 0.02 over the edge of 0.6 to 1.
        assert_close(&actual, &solid_box(), 0.5, [0.01, 0.005, 0.015]);
    }
}

#[test]
fn solids_without_normals_are_told_from_outside() {
    for seed in 0..3 {
        let ball = cloud(sphere(5000, CENTER, seed), false);
        let actual = unit_mass_properties(&ball, MassModel::Solid);
        assert_close(&actual, &solid_ball(), 0.5, [0.01, 0.005, 0.015]);
        let block = cloud(cuboid(5000, CENTER, seed), false);
        let actual = unit_mass_properties(&block, MassModel::Solid);
        // Normals fitted to neighbours on both sides of an edge are slanted.
        assert_close(&actual, &solid_box(), 0.5, [0.03, 0.01, 0.04]);
    }
}

#[test]
fn walls_two_spacings_thick_have_two_sides() {
    let half = Vec3::new(0.5, 0.5, 0.02);
    let mut expected = MassProperties::from_cuboid(1.0, half);
    expected.local_com = CENTER;
    for seed in 0..3 {
        for with_normals in [true, false] {
            let wall = cloud(cuboid_of(half, 6000, CENTER, seed), with_normals);
            let actual = unit_mass_properties(&wall, MassModel::Solid);
            let limits = if with_normals {
                [0.02, 0.015, 0.03]
            } else {
                // Normals along the rim are slanted. A wall taken for one sheet is off by 80 %.
                [0.12, 0.07, 0.16]
            };
            assert_close(&actual, &expected, 0.5, limits);
        }
    }
}

#[test]
fn even_grids_weigh_like_random_samples() {
    // 21 × 21 points a side of the unit cube, corners and edges counted once.
    let mut points = Vec::new();
    for i in 0..=20 {
        for j in 0..=20 {
            for k in 0..=20 {
                if [i, j, k].iter().any(|&c| c == 0 || c == 20) {
                    points.push(Vec3::new(i as f32, j as f32, k as f32) / 20.0);
                }
            }
        }
    }
    let cube = PointCloud::builder(points).radius(0.04).build().unwrap();
    let actual = unit_mass_properties(&cube, MassModel::Solid);
    let mut expected = MassProperties::from_cuboid(1.0, Vec3::splat(0.5));
    expected.local_com = Vec3::splat(0.5);
    // Points on the edges themselves have slanted fitted normals: one in seven points.
    assert_close(&actual, &expected, 1.0, [0.06, 0.01, 0.07]);
}

#[test]
fn shells() {
    let thickness = 0.01;
    let model = MassModel::Shell { thickness };
    let ball = cloud(sphere(5000, CENTER, 5), true);
    let actual = unit_mass_properties(&ball, model);
    let mass = 4.0 * std::f32::consts::PI * 0.25 * thickness;
    // A thin spherical shell: 2/3 m r².
    let expected = MassProperties::new(CENTER, mass, Vec3::splat(2.0 / 3.0 * mass * 0.25));
    assert_close(&actual, &expected, 0.5, [0.02, 0.015, 0.03]);
    let block = cloud(cuboid(5000, CENTER, 5), true);
    let actual = unit_mass_properties(&block, model);
    let (a, b, c) = (2.0 * HALF.x, 2.0 * HALF.y, 2.0 * HALF.z);
    let mass = 2.0 * (a * b + b * c + c * a) * thickness;
    assert!(
        (actual.mass() / mass - 1.0).abs() < 0.03,
        "{} {mass}",
        actual.mass()
    );
    // A hundred times as dense on one side as on the other: areas do not follow the points.
    let (mut points, mut normals) = sphere(20_000, CENTER, 6);
    let mut rng = fastrand::Rng::with_seed(7);
    let keep: Vec<bool> = points
        .iter()
        .map(|p| p.x > CENTER.x || rng.f32() < 0.05)
        .collect();
    let mut kept = keep.iter();
    points.retain(|_| *kept.next().unwrap());
    let mut kept = keep.iter();
    normals.retain(|_| *kept.next().unwrap());
    let uneven = cloud((points, normals), true);
    assert_close(
        &unit_mass_properties(&uneven, model),
        &expected,
        0.5,
        [0.04, 0.02, 0.05],
    );
}

/// Nothing would weigh what has no thickness.
#[test]
fn thicknesses_that_are_no_lengths_are_refused() {
    let ball = cloud(sphere(500, CENTER, 5), true);
    for thickness in [0.0, -0.01, f32::NAN, f32::INFINITY] {
        let model = MassModel::Shell { thickness };
        let is_refused = |error: CloudError| {
            matches!(error, CloudError::BadParameter { parameter: "thickness", value, .. }
                if value.to_bits() == thickness.to_bits())
        };
        let mass = rapier3d_tldi::unit_mass_properties(&ball, model);
        assert!(mass.is_err_and(is_refused), "{thickness}");
        let shape = PointCloudShape::with_mass_model(ball.clone(), model);
        assert!(shape.is_err_and(is_refused), "{thickness}");
    }
}

#[test]
fn what_encloses_nothing_is_a_shell() {
    let (mut points, mut normals) = sphere(6000, CENTER, 8);
    let open: Vec<bool> = points.iter().map(|p| p.y < CENTER.y + 0.3).collect();
    let mut kept = open.iter();
    points.retain(|_| *kept.next().unwrap());
    let mut kept = open.iter();
    normals.retain(|_| *kept.next().unwrap());
    for with_normals in [true, false] {
        let bowl = cloud((points.clone(), normals.clone()), with_normals);
        let thickness = 2.0 * bowl.mean_radius();
        let actual = unit_mass_properties(&bowl, MassModel::Solid);
        // A sphere's zone: 2 π r h; its rim grows by up to 1.5 radii.
        let mass = std::f32::consts::TAU * 0.5 * 0.8 * thickness;
        let error = actual.mass() / mass - 1.0;
        assert!(error.abs() < 0.05, "{error}");
        let shell = unit_mass_properties(&bowl, MassModel::Shell { thickness });
        assert_eq!(actual.mass(), shell.mass());
    }
    // A room seen from within: closed, but nothing is inside.
    let (points, normals) = cuboid(4000, CENTER, 9);
    let room = cloud((points, normals.iter().map(|n| -n).collect()), true);
    let shell = MassModel::Shell {
        thickness: 2.0 * room.mean_radius(),
    };
    assert_eq!(
        unit_mass_properties(&room, MassModel::Solid).mass(),
        unit_mass_properties(&room, shell).mass()
    );
    // A sheet scanned from both sides, a hair apart.
    let sheet = cuboid_of(Vec3::new(0.5, 0.5, 1e-5), 6000, CENTER, 13);
    let sheet = cloud(sheet, true);
    let shell = MassModel::Shell {
        thickness: 2.0 * sheet.mean_radius(),
    };
    assert_eq!(
        unit_mass_properties(&sheet, MassModel::Solid).mass(),
        unit_mass_properties(&sheet, shell).mass()
    );
    // One point, two points and a hundred at the same place: some mass, finite and positive.
    for points in [
        vec![CENTER],
        vec![CENTER, CENTER + Vec3::X],
        vec![CENTER; 100],
    ] {
        let few = PointCloud::builder(points).radius(0.1).build().unwrap();
        let actual = unit_mass_properties(&few, MassModel::Solid);
        assert!(actual.mass().is_finite() && actual.mass() > 0.0);
        assert!(actual.principal_inertia().is_finite());
        assert!(actual.principal_inertia().min_element() > 0.0);
    }
}

#[test]
fn points_at_one_place_weigh_once() {
    let (mut points, mut normals) = sphere(3000, CENTER, 10);
    points.extend(vec![points[0]; 3000]);
    normals.extend(vec![normals[0]; 3000]);
    let heavy = cloud((points, normals), true);
    let actual = unit_mass_properties(&heavy, MassModel::Solid);
    assert_close(&actual, &solid_ball(), 0.5, [0.01, 0.005, 0.015]);
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let ball = cloud(sphere(5000, CENTER, 14), false);
    let with_threads = |count: usize| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(count)
            .build()
            .unwrap();
        pool.install(|| unit_mass_properties(&ball, MassModel::Solid))
    };
    let one = with_threads(1);
    assert_eq!(with_threads(2), one);
    assert_eq!(with_threads(7), one);
}

#[test]
fn large_clouds_are_thinned_without_bias() {
    let ball = cloud(sphere(400_000, CENTER, 11), true);
    let actual = unit_mass_properties(&ball, MassModel::Solid);
    assert_close(&actual, &solid_ball(), 0.5, [0.01, 0.005, 0.01]);
}

/// Vertices and triangles of a gzipped binary PLY with `float x y z` and `list uchar int`.
fn read_ply(path: &std::path::Path) -> Option<(Vec<Vec3>, Vec<[u32; 3]>)> {
    use std::io::Read;
    let mut bytes = Vec::new();
    flate2::read::GzDecoder::new(std::fs::File::open(path).ok()?)
        .read_to_end(&mut bytes)
        .ok()?;
    let end = bytes.windows(11).position(|w| w == b"end_header\n")? + 11;
    let header = std::str::from_utf8(&bytes[..end]).ok()?;
    let count = |element: &str| -> Option<usize> {
        let line = header.lines().find(|line| line.starts_with(element))?;
        line.rsplit(' ').next()?.parse().ok()
    };
    let (vertices, faces) = (count("element vertex")?, count("element face")?);
    let word = |at: usize| <[u8; 4]>::try_from(&bytes[at..at + 4]).ok();
    let points = (0..vertices)
        .map(|i| {
            let axis = |k: usize| word(end + 12 * i + 4 * k).map(f32::from_le_bytes);
            Some(Vec3::new(axis(0)?, axis(1)?, axis(2)?))
        })
        .collect::<Option<_>>()?;
    let first = end + 12 * vertices;
    let triangles = (0..faces)
        .map(|i| {
            let corner = |k: usize| word(first + 13 * i + 1 + 4 * k).map(u32::from_le_bytes);
            Some([corner(0)?, corner(1)?, corner(2)?])
        })
        .collect::<Option<_>>()?;
    Some((points, triangles))
}

#[test]
fn scanned_bodies_weigh_like_their_meshes() {
    for name in [
        "stanford/bunny_watertight.ply.gz",
        "stanford/armadillo_86k.ply.gz",
    ] {
        let checkout = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
        let Some(path) = test_data(checkout, name) else {
            continue;
        };
        let read = read_ply(&path);
        let (points, triangles) = read.unwrap_or_else(|| panic!("{name} cannot be read"));
        // Metres, so that the mesh's integrals keep their digits.
        let extent = points
            .iter()
            .fold(0f32, |m, p| m.max(p.abs().max_element()));
        let points: Vec<Vec3> = points.iter().map(|p| p / extent).collect();
        let mut normals = vec![Vec3::ZERO; points.len()];
        for [a, b, c] in &triangles {
            let corners = [a, b, c].map(|i| points[*i as usize]);
            let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]);
            for corner in [a, b, c] {
                normals[*corner as usize] += normal;
            }
        }
        let expected = MassProperties::from_trimesh(1.0, &points, &triangles);
        for with_normals in [true, false] {
            let scan = cloud((points.clone(), normals.clone()), with_normals);
            let actual = unit_mass_properties(&scan, MassModel::Solid);
            eprintln!("{name}, normals: {with_normals}");
            // Both have details of the size of the spacing, where fitted normals are slanted.
            let limits = if with_normals {
                [0.015, 0.005, 0.015]
            } else {
                [0.04, 0.01, 0.04]
            };
            assert_close(&actual, &expected, 1.0, limits);
        }
    }
}

#[test]
fn shapes_scale_their_mass_by_the_density() {
    let shape = PointCloudShape::new(cloud(sphere(3000, CENTER, 12), true));
    let (one, many) = (shape.mass_properties(1.0), shape.mass_properties(700.0));
    assert!((many.mass() / one.mass() / 700.0 - 1.0).abs() < 1e-5);
    let ratio = many.principal_inertia() / one.principal_inertia();
    assert!((ratio / 700.0 - 1.0).abs().max_element() < 1e-5);
    assert_eq!(many.local_com, one.local_com);
    let block = SharedShape::new(Cuboid::new(HALF));
    assert!(block.mass_properties(1.0).mass() > 0.0);
}

/// Clouds from a micrometre to a thousand kilometres have a frame of inertia, few points too.
#[test]
fn every_size_has_a_frame() {
    for exponent in -6..=6 {
        let size = 10f32.powi(exponent);
        for points in [
            vec![Vec3::ZERO],
            vec![-0.5 * size * Vec3::X, 0.5 * size * Vec3::new(1.0, 0.3, 0.2)],
        ] {
            let cloud = PointCloud::builder(points)
                .radius(0.3 * size)
                .build()
                .unwrap();
            let mass = unit_mass_properties(&cloud, MassModel::Solid);
            let frame = mass.principal_inertia_local_frame;
            assert!(frame.is_normalized(), "{size}: {frame}");
            assert!(mass.principal_inertia().cmpgt(Vec3::ZERO).all(), "{size}");
        }
    }
}
