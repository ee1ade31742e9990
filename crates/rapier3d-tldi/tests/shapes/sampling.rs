//! Clouds of rapier's shapes, against what geometry says about these.

use fastrand::Rng;
use rapier3d::parry::shape::{HeightField, TriMesh};
use rapier3d::parry::utils::Array2;
use rapier3d::prelude::*;
use rapier3d_tldi::{CloudError, PointCloud, SampleError, sample_shape};
use std::f32::consts::{PI, TAU};

const SPACING: f32 = 0.04;
/// Rounding of coordinates below 1 in `f32`, a few times over.
const ROUNDING: f32 = 1e-6;

/// A random place of a surface, with its outward normal.
type Place = fn(&mut Rng) -> (Vector, Vector);

struct Case {
    name: &'static str,
    shape: SharedShape,
    /// Signed distance.
    distance: fn(Vector) -> f32,
    place: Place,
    /// Square metres.
    area: f32,
}

fn unit(rng: &mut Rng) -> Vector {
    let z = 2.0 * rng.f32() - 1.0;
    let (sin, cos) = (TAU * rng.f32()).sin_cos();
    let r = (1.0 - z * z).sqrt();
    Vector::new(r * cos, r * sin, z)
}

fn box_distance(p: Vector, half: Vector) -> f32 {
    let beyond = p.abs() - half;
    beyond.max(Vector::ZERO).length() + beyond.max_element().min(0.0)
}

/// A random place of a box about the origin.
fn box_place(rng: &mut Rng, half: Vector) -> (Vector, Vector) {
    let axis = rng.usize(..3);
    let sign = if rng.bool() { 1.0 } else { -1.0 };
    let mut p = half * (2.0 * Vector::new(rng.f32(), rng.f32(), rng.f32()) - Vector::ONE);
    let mut normal = Vector::ZERO;
    (p[axis], normal[axis]) = (sign * half[axis], sign);
    (p, normal)
}

/// The surface `radius` about a box, or a segment, that `clamp` limits points to.
fn rounded_place(rng: &mut Rng, half: Vector, radius: f32) -> (Vector, Vector) {
    loop {
        let far = 2.0 * (2.0 * Vector::new(rng.f32(), rng.f32(), rng.f32()) - Vector::ONE);
        let core = far.clamp(-half, half);
        if let Some(normal) = (far - core).try_normalize() {
            return (core + radius * normal, normal);
        }
    }
}

const HALF: Vector = Vector::new(0.3, 0.2, 0.01);
const CORE: Vector = Vector::new(0.2, 0.1, 0.15);
const SEGMENT: Vector = Vector::new(0.0, 0.3, 0.0);

fn revolved(angle: f32, r: f32, y: f32) -> Vector {
    Vector::new(r * angle.cos(), y, r * angle.sin())
}

fn cases() -> Vec<Case> {
    let voxels = (0..4 * 4 * 4).map(|i| IVector::new(i % 4, i / 4 % 4, i / 16));
    vec![
        Case {
            name: "ball",
            shape: SharedShape::ball(0.4),
            distance: |p| p.length() - 0.4,
            place: |rng| {
                let n = unit(rng);
                (0.4 * n, n)
            },
            area: 4.0 * PI * 0.16,
        },
        Case {
            name: "thin box",
            shape: SharedShape::cuboid(HALF.x, HALF.y, HALF.z),
            distance: |p| box_distance(p, HALF),
            place: |rng| box_place(rng, HALF),
            area: 8.0 * (HALF.x * HALF.y + HALF.y * HALF.z + HALF.z * HALF.x),
        },
        Case {
            name: "capsule",
            shape: SharedShape::capsule_y(0.3, 0.1),
            distance: |p| p.distance(p.clamp(-SEGMENT, SEGMENT)) - 0.1,
            place: |rng| rounded_place(rng, SEGMENT, 0.1),
            area: TAU * 0.1 * 0.6 + 4.0 * PI * 0.01,
        },
        Case {
            name: "round box",
            shape: SharedShape::round_cuboid(CORE.x, CORE.y, CORE.z, 0.05),
            distance: |p| box_distance(p, CORE) - 0.05,
            place: |rng| rounded_place(rng, CORE, 0.05),
            area: 8.0 * (CORE.x * CORE.y + CORE.y * CORE.z + CORE.z * CORE.x)
                + TAU * 0.05 * 2.0 * (CORE.x + CORE.y + CORE.z)
                + 4.0 * PI * 0.0025,
        },
        Case {
            name: "cylinder",
            shape: SharedShape::cylinder(0.2, 0.3),
            distance: |p| {
                let beyond = Vector::new(p.x.hypot(p.z) - 0.3, p.y.abs() - 0.2, f32::MIN);
                beyond.max(Vector::ZERO).length() + beyond.max_element().min(0.0)
            },
            place: |rng| {
                let angle = TAU * rng.f32();
                if rng.bool() {
                    let y = 0.2 * (2.0 * rng.f32() - 1.0);
                    (revolved(angle, 0.3, y), revolved(angle, 1.0, 0.0))
                } else {
                    let sign = if rng.bool() { 1.0 } else { -1.0 };
                    let r = 0.3 * rng.f32().sqrt();
                    (revolved(angle, r, sign * 0.2), sign * Vector::Y)
                }
            },
            area: TAU * 0.3 * 0.4 + 2.0 * PI * 0.09,
        },
        Case {
            name: "cone",
            shape: SharedShape::cone(0.2, 0.3),
            distance: |p| {
                // Height above base and mantle, which is inclined by 4 : 3; inside or on them.
                let r = p.x.hypot(p.z);
                (-0.2 - p.y).max(0.8 * (r - 0.15) + 0.6 * p.y)
            },
            place: |rng| {
                let angle = TAU * rng.f32();
                let share = rng.f32().sqrt();
                if rng.bool() {
                    let p = revolved(angle, 0.3 * share, 0.2 - 0.4 * share);
                    (p, revolved(angle, 0.8, 0.6))
                } else {
                    (revolved(angle, 0.3 * share, -0.2), -Vector::Y)
                }
            },
            area: PI * 0.3 * 0.5 + PI * 0.09,
        },
        Case {
            name: "voxels",
            shape: SharedShape::voxels(Vector::splat(0.1), &voxels.collect::<Vec<_>>()),
            distance: |p| box_distance(p - Vector::splat(0.2), Vector::splat(0.2)),
            place: |rng| {
                let (p, n) = box_place(rng, Vector::splat(0.2));
                (p + Vector::splat(0.2), n)
            },
            area: 6.0 * 0.16,
        },
        Case {
            // A box that a smaller one sits on, face to face, and one that dips into both from above.
            name: "compound",
            shape: SharedShape::compound(vec![
                (Pose::IDENTITY, SharedShape::cuboid(0.3, 0.1, 0.3)),
                (
                    Pose::from_translation(Vector::new(0.0, 0.2, 0.0)),
                    SharedShape::cuboid(0.1, 0.1, 0.1),
                ),
                (
                    Pose::from_translation(Vector::new(0.1, 0.3, 0.0)),
                    SharedShape::ball(0.15),
                ),
            ]),
            distance: compound_distance,
            place: |rng| {
                // Not within 0.1 × the spacing of a seam.
                let clear = 0.11 * SPACING;
                loop {
                    let (p, n) = match rng.u8(..3) {
                        0 => box_place(rng, Vector::new(0.3, 0.1, 0.3)),
                        1 => {
                            let (p, n) = box_place(rng, Vector::splat(0.1));
                            (p + 0.2 * Vector::Y, n)
                        }
                        _ => {
                            let n = unit(rng);
                            (Vector::new(0.1, 0.3, 0.0) + 0.15 * n, n)
                        }
                    };
                    if compound_distance(p + clear * n) > 0.99 * clear
                        && compound_distance(p).abs() < ROUNDING
                    {
                        return (p, n);
                    }
                }
            },
            // Not asked for: it has seams.
            area: 0.0,
        },
    ]
}

fn compound_distance(p: Vector) -> f32 {
    let lower = box_distance(p, Vector::new(0.3, 0.1, 0.3));
    let upper = box_distance(p - 0.2 * Vector::Y, Vector::splat(0.1));
    let ball = p.distance(Vector::new(0.1, 0.3, 0.0)) - 0.15;
    lower.min(upper).min(ball)
}

/// No two points on one side nearer than 0.8 spacings; every place within one of a point of its side.
fn assert_even(name: &str, cloud: &PointCloud<'_>, spacing: f32, seed: u64, place: Place) {
    let normals = cloud.normals().expect("there are normals");
    for i in 0..cloud.len() {
        for j in 0..i {
            let distance = cloud.point(i).distance(cloud.point(j));
            let one_side = normals[i].dot(normals[j]) > 0.0;
            assert!(
                !one_side || distance > 0.8 * spacing - ROUNDING,
                "{name}: {distance}"
            );
        }
    }
    let mut rng = Rng::with_seed(seed);
    for _ in 0..3000 {
        let (place, normal) = place(&mut rng);
        let nearest = (0..cloud.len())
            .filter(|i| normals[*i].dot(normal) > 0.0)
            .map(|i| cloud.point(i).distance(place))
            .fold(f32::MAX, f32::min);
        assert!(nearest < spacing + ROUNDING, "{name}: {nearest} at {place}");
    }
}

#[test]
fn points_are_on_the_surface_even_and_close_it() {
    for case in cases() {
        for (seed, spacing) in [(1, SPACING), (2, 0.7 * SPACING)] {
            let name = case.name;
            let cloud = sample_shape(&*case.shape, spacing).expect(name);
            assert_even(name, &cloud, spacing, seed, case.place);
            assert_eq!(
                (cloud.mean_radius(), cloud.max_radius()),
                (spacing, spacing)
            );
            for (p, n) in cloud
                .points()
                .iter()
                .copied()
                .zip(cloud.normals().expect(name))
            {
                let distance = (case.distance)(p);
                assert!(distance.abs() < ROUNDING, "{name}: {distance} at {p}");
                // Outward: so far out, so far from the surface, up to the rim of an edge; in the seams
                // of a compound another part may be nearer, or hold the point up to rounding.
                let out = (case.distance)(p + 1e-3 * *n);
                let exact = (out - 1e-3).abs() < 2e-5;
                let in_seam = case.area == 0.0 && (case.distance)(p + 1e-5 * *n) > -ROUNDING;
                assert!(exact || in_seam, "{name}: {out} along {n} at {p}");
            }
            // Discs of 0.4 spacings do not overlap, and discs of a spacing cover: by the densest
            // packing of discs and their thinnest covering, on a surface with few edges.
            if case.area > 0.0 {
                let per_square = cloud.len() as f32 * spacing * spacing / case.area;
                assert!((0.385..1.804).contains(&per_square), "{name}: {per_square}");
            }
        }
    }
}

/// A mesh of a torus, whose area is known, in either winding, in mixed winding with vertices of its own for each face (as in
/// STL files), and with a hole in it.
#[test]
fn meshes_are_sampled_on_their_outside() {
    let (large, small, n) = (0.3, 0.1, 96);
    let at = |i: u32, j: u32| {
        let (sin, cos) = (TAU * j as f32 / n as f32).sin_cos();
        let center = revolved(TAU * i as f32 / n as f32, 1.0, 0.0);
        (large + small * cos) * center + small * sin * Vector::Y
    };
    let vertices: Vec<Vector> = (0..n * n).map(|k| at(k / n, k % n)).collect();
    let corner = |i: u32, j: u32| i % n * n + j % n;
    let faces: Vec<[u32; 3]> = (0..n * n)
        .flat_map(|k| {
            let (i, j) = (k / n, k % n);
            let [a, b, c, d] = [
                corner(i, j),
                corner(i + 1, j),
                corner(i + 1, j + 1),
                corner(i, j + 1),
            ];
            [[a, c, b], [a, d, c]]
        })
        .collect();
    let turned: Vec<[u32; 3]> = faces.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    // Both corners' faces of one of 9,216 squares are missing.
    let holed = faces[2..].to_vec();
    let every_third = |faces: &[[u32; 3]]| -> Vec<[u32; 3]> {
        let turned = |(k, [a, b, c]): (usize, &[u32; 3])| {
            if k % 3 == 0 {
                [*a, *c, *b]
            } else {
                [*a, *b, *c]
            }
        };
        faces.iter().enumerate().map(turned).collect()
    };
    let soup = |faces: &[[u32; 3]]| {
        let corners: Vec<Vector> = faces
            .iter()
            .flatten()
            .map(|i| vertices[*i as usize])
            .collect();
        let faces = (0..faces.len() as u32).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]);
        (corners, faces.collect::<Vec<_>>())
    };
    // Faces are inside the torus, and outside where it is a saddle, by up to the heights of two arcs.
    let sagitta = (large + 2.0 * small) * (1.0 - (PI / n as f32).cos());
    let mut counts = Vec::new();
    let meshes = [
        (vertices.clone(), every_third(&faces)),
        soup(&every_third(&holed)),
        (vertices.clone(), faces),
        (vertices.clone(), turned),
        (vertices.clone(), holed),
    ];
    for (vertices, faces) in meshes {
        let mesh = TriMesh::new(vertices, faces).expect("a mesh");
        let cloud = sample_shape(&mesh, SPACING).expect("a torus");
        for (p, n) in cloud
            .points()
            .iter()
            .copied()
            .zip(cloud.normals().expect("given"))
        {
            let middle = large * Vector::new(p.x, 0.0, p.z).normalize();
            let from_middle = p - middle;
            let depth = small - from_middle.length();
            assert!((-sagitta..sagitta).contains(&depth), "{depth} at {p}");
            assert!(n.dot(from_middle.normalize()) > 0.99, "{n} at {p}");
        }
        counts.push(cloud.len());
    }
    let area = TAU * TAU * large * small;
    for count in counts {
        // The density of maximal samples of this kind is 0.7 / (0.8 spacings)², of which a thousand
        // points scatter by few percent.
        let per_square = count as f32 * SPACING * SPACING / area;
        assert!((1.0..1.25).contains(&per_square), "{per_square}");
    }
}

/// What is open keeps the side that its faces show; a height field shows up.
#[test]
fn open_surfaces_keep_their_side() {
    let heights = Array2::new(
        4,
        4,
        (0..16).map(|i| (i % 3) as f32 * 0.1).collect::<Vec<_>>(),
    );
    let field = HeightField::new(heights, Vector::ONE);
    let cloud = sample_shape(&field, SPACING).expect("a field");
    assert!(
        cloud
            .normals()
            .is_some_and(|normals| normals.iter().all(|n| n.y > 0.5))
    );

    let (vertices, faces) = field.to_trimesh();
    let up = |faces: Vec<[u32; 3]>| {
        let mesh = TriMesh::new(vertices.clone(), faces).expect("a mesh");
        let cloud = sample_shape(&mesh, SPACING).expect("a mesh");
        let normals = cloud.normals().expect("given");
        let up = normals.iter().filter(|n| n.y > 0.5).count();
        assert!(up == 0 || up == normals.len(), "{up} of {}", normals.len());
        up > 0
    };
    let turned = faces.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
    assert_ne!(up(faces.clone()), up(turned));
}

#[test]
fn small_shapes_have_a_point_and_equal_shapes_equal_ones() {
    let ball = SharedShape::ball(0.1);
    let sample = |spacing| sample_shape(&*ball, spacing).expect("a ball");
    assert!((1..5).contains(&sample(10.0).len()));
    assert_eq!(sample(0.01).points(), sample(0.01).points());
}

#[test]
fn what_has_no_surface_is_refused() {
    let sample = |shape: SharedShape, spacing| sample_shape(&*shape, spacing).map(|c| c.len());
    for spacing in [0.0, -1.0, f32::NAN, f32::INFINITY] {
        let refused = sample(SharedShape::ball(1.0), spacing);
        assert!(matches!(refused, Err(SampleError::BadSpacing { .. })));
    }
    for shape in [
        SharedShape::halfspace(Vector::Y),
        SharedShape::segment(Vector::ZERO, Vector::X),
        SharedShape::polyline(vec![Vector::ZERO, Vector::X], None),
        SharedShape::cuboid(0.0, 0.0, 0.0),
    ] {
        let refused = sample(shape, 0.1);
        assert!(
            matches!(refused, Err(SampleError::NoSurface { .. })),
            "{refused:?}"
        );
    }
    let refused = sample(SharedShape::cuboid(10.0, 10.0, 10.0), 1e-3);
    let Err(SampleError::TooFine { area, least, .. }) = refused else {
        panic!("{refused:?}");
    };
    assert!(
        (area - 2400.0).abs() < 1e-3 && (least - 0.0169).abs() < 1e-4,
        "{area} {least}"
    );
    // Where a step of f32 is half a metre, no piece of a triangle is as small as the spacing: without a check, sampling does
    // not end.
    let far = [Vector::ZERO, Vector::X, Vector::Y].map(|corner| corner + 5_432_109.0 * Vector::Y);
    let mesh = TriMesh::new(far.to_vec(), vec![[0, 1, 2]]).expect("rapier takes it");
    let refused = sample_shape(&mesh, 0.02).map(|c| c.len());
    let too_far = CloudError::CoordinateTooLarge {
        index: 0,
        coordinate: 5_432_109.0,
        radius: 0.02,
    };
    assert_eq!(refused, Err(SampleError::Cloud(too_far)));
    let broken = vec![Vector::ZERO, Vector::X, Vector::Y, Vector::splat(f32::NAN)];
    let mesh = TriMesh::new(broken, vec![[0, 1, 2], [0, 1, 3]]).expect("rapier takes it");
    let refused = sample_shape(&mesh, 0.1).map(|c| c.len());
    assert_eq!(refused, Err(SampleError::NotFinite { face: 1 }));
}
