//! Triangles, triangle meshes and height fields, against every triangle in turn.

use super::{check_projection, crossings, in_box, tolerance, unit};
use rapier3d::glamx::{DVec3, Vec3};
use rapier3d::parry::shape::{
    HeightField, HeightFieldCellStatus, Shape, TriMesh, TriMeshFlags, Triangle,
};
use rapier3d::parry::utils::Array2;
use rapier3d_tldi::{ExactShape, RaySurface};

/// Möller and Trumbore in `f64`, one triangle after the other.
fn brute_force(
    triangles: &[[DVec3; 3]],
    origin: DVec3,
    direction: DVec3,
    max: f64,
) -> Vec<(f64, DVec3)> {
    let mut hits: Vec<(f64, DVec3)> = triangles
        .iter()
        .filter_map(|&[a, b, c]| {
            let (ab, ac) = (b - a, c - a);
            let p = direction.cross(ac);
            let determinant = ab.dot(p);
            let s = origin - a;
            let u = s.dot(p) / determinant;
            let q = s.cross(ab);
            let v = direction.dot(q) / determinant;
            let t = ac.dot(q) / determinant;
            (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && (0.0..=max).contains(&t))
                .then(|| (t, ab.cross(ac).normalize()))
        })
        .collect();
    hits.sort_by(|a, b| a.0.total_cmp(&b.0));
    hits
}

fn compare_with_brute_force(
    name: &str,
    shape: &dyn Shape,
    triangles: &[[DVec3; 3]],
    seed: u64,
) -> usize {
    let mut rng = fastrand::Rng::with_seed(seed);
    let mut compared = 0;
    for case in 0..600 {
        let origin = in_box(&mut rng, 2.0);
        let direction = (in_box(&mut rng, 0.8) - origin).normalize();
        let d = direction.as_dvec3().normalize();
        let max = 1.0 + 4.0 * rng.f32();
        let expected = brute_force(triangles, origin.as_dvec3(), d, max.into());
        let hits = crossings(shape, origin, direction, max);
        assert_eq!(
            hits.len(),
            expected.len(),
            "{name} {case}: {hits:?} {expected:?}"
        );
        for (hit, (t, normal)) in hits.iter().zip(&expected) {
            let off = (f64::from(hit.distance) - t).abs();
            assert!(off < tolerance(*normal, d), "{name} {case}: off by {off}");
            assert!(
                hit.normal.as_dvec3().distance(*normal) < 1e-5,
                "{name} {case}"
            );
            compared += 1;
        }
    }
    compared
}

/// A bumpy, non-convex closed surface of `24 × 16` patches, wound outward.
pub(crate) fn bumpy_sphere() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    use std::f32::consts::{PI, TAU};
    let (around, down) = (24u32, 16u32);
    let mut vertices = vec![Vec3::Y, -Vec3::Y];
    for j in 1..down {
        for i in 0..around {
            let (u, v) = (TAU * i as f32 / around as f32, PI * j as f32 / down as f32);
            let radius = 0.7 + 0.3 * (5.0 * u).sin() * (4.0 * v).sin();
            vertices.push(radius * Vec3::new(v.sin() * u.cos(), v.cos(), v.sin() * u.sin()));
        }
    }
    let at = |i: u32, j: u32| 2 + (j - 1) * around + i % around;
    let mut indices = Vec::new();
    for i in 0..around {
        indices.push([0, at(i + 1, 1), at(i, 1)]);
        indices.push([1, at(i, down - 1), at(i + 1, down - 1)]);
        for j in 1..down - 1 {
            indices.push([at(i, j), at(i + 1, j), at(i, j + 1)]);
            indices.push([at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)]);
        }
    }
    (vertices, indices)
}

/// The cube [-1, 1]³ in a grid of `n × n` squares a side, wound outward: every vertex on
/// coordinates that `f32` holds exactly.
fn gridded_cube(n: i32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut vertices, mut indices) = (Vec::new(), Vec::new());
    for axis in 0..3 {
        for side in [-1.0f32, 1.0] {
            let corner = |i: i32, j: i32| {
                let mut v = [0.0f32; 3];
                v[axis] = side;
                v[(axis + 1) % 3] = 2.0 * i as f32 / n as f32 - 1.0;
                v[(axis + 2) % 3] = 2.0 * j as f32 / n as f32 - 1.0;
                Vec3::from_array(v)
            };
            for i in 0..n {
                for j in 0..n {
                    let first = vertices.len() as u32;
                    vertices.extend([
                        corner(i, j),
                        corner(i + 1, j),
                        corner(i + 1, j + 1),
                        corner(i, j + 1),
                    ]);
                    let [a, b, c, d] = [first, first + 1, first + 2, first + 3];
                    if side > 0.0 {
                        indices.extend([[a, b, c], [a, c, d]]);
                    } else {
                        indices.extend([[a, c, b], [a, d, c]]);
                    }
                }
            }
        }
    }
    (vertices, indices)
}

fn triangles_of(mesh: &TriMesh) -> Vec<[DVec3; 3]> {
    mesh.triangles()
        .map(|t| [t.a, t.b, t.c].map(|v| v.as_dvec3()))
        .collect()
}

#[test]
fn closed_meshes_are_crossed_like_their_triangles() {
    let (vertices, indices) = bumpy_sphere();
    let mesh = TriMesh::with_flags(vertices, indices, TriMeshFlags::ORIENTED).unwrap();
    assert!(ExactShape(&mesh).is_closed());
    let compared = compare_with_brute_force("bumpy", &mesh, &triangles_of(&mesh), 4);
    assert!(compared > 1000, "{compared}");
    let mut rng = fastrand::Rng::with_seed(5);
    for _ in 0..300 {
        let origin = 3.0 * unit(&mut rng);
        let direction = (in_box(&mut rng, 0.6) - origin).normalize();
        let hits = crossings(&mesh, origin, direction, 10.0);
        assert_eq!(hits.len() % 2, 0, "from outside a closed mesh");
        for (k, hit) in hits.iter().enumerate() {
            let entering = hit.normal.dot(direction) < 0.0;
            assert_eq!(entering, k % 2 == 0, "entry and exit take turns");
        }
    }
}

#[test]
fn open_meshes_and_soups_are_crossed_like_their_triangles() {
    let (vertices, mut indices) = bumpy_sphere();
    indices.retain(|triangle| triangle[0] % 3 != 0);
    let mesh = TriMesh::new(vertices, indices).unwrap();
    assert!(!ExactShape(&mesh).is_closed());
    assert!(compare_with_brute_force("open", &mesh, &triangles_of(&mesh), 6) > 500);
    let mut rng = fastrand::Rng::with_seed(7);
    let vertices: Vec<Vec3> = (0..300).map(|_| in_box(&mut rng, 1.0)).collect();
    let indices = (0..100).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    let soup = TriMesh::new(vertices, indices).unwrap();
    assert!(compare_with_brute_force("soup", &soup, &triangles_of(&soup), 8) > 1000);
    let one = Triangle::new(Vec3::X, Vec3::Y, Vec3::Z);
    let triangles = [[DVec3::X, DVec3::Y, DVec3::Z]];
    assert!(compare_with_brute_force("triangle", &one, &triangles, 9) > 30);
}

#[test]
fn rays_through_shared_edges_and_vertices_cross_a_closed_mesh_in_pairs() {
    let (vertices, indices) = gridded_cube(4);
    // Vertices are not shared between squares: equal positions must do.
    let mesh = TriMesh::new(vertices, indices).unwrap();
    let mut through_vertices = 0;
    for axis in 0..3 {
        for i in -8i32..=8 {
            for j in -8i32..=8 {
                // Every second ray meets edges of the grid, diagonals or vertices; those at ±8 lie
                // within the cube's faces.
                let mut origin = [-3.0f32; 3];
                origin[(axis + 1) % 3] = i as f32 / 8.0;
                origin[(axis + 2) % 3] = j as f32 / 8.0;
                let hits = crossings(&mesh, origin.into(), Vec3::AXES[axis], 10.0);
                let inner = i32::max(i.abs(), j.abs()) < 8;
                if inner {
                    assert_eq!(hits.len(), 2, "{axis} {i} {j}: {hits:?}");
                    assert_eq!((hits[0].distance, hits[1].distance), (2.0, 4.0));
                    through_vertices += 1;
                } else {
                    assert!(
                        hits.is_empty() || hits.len() == 2,
                        "{axis} {i} {j}: {hits:?}"
                    );
                }
            }
        }
    }
    assert_eq!(through_vertices, 3 * 15 * 15);
    // Slanted rays aimed at vertices and at middles of edges.
    let mut rng = fastrand::Rng::with_seed(10);
    for vertex in mesh.vertices() {
        let origin = 4.0 * unit(&mut rng);
        let direction = (*vertex - origin).normalize();
        let hits = crossings(&mesh, origin, direction, 10.0);
        assert_eq!(hits.len() % 2, 0, "{hits:?}");
        assert!(hits.len() <= 2, "{hits:?}");
    }
}

fn samples_on(triangles: &[[DVec3; 3]], count: usize, rng: &mut fastrand::Rng) -> Vec<DVec3> {
    (0..count)
        .map(|_| {
            let [a, b, c] = triangles[rng.usize(..triangles.len())];
            let (mut u, mut v) = (rng.f64(), rng.f64());
            if u + v > 1.0 {
                (u, v) = (1.0 - u, 1.0 - v);
            }
            a + u * (b - a) + v * (c - a)
        })
        .collect()
}

/// Distance to triangles as the least over the plane, the edges and the vertices.
fn distance_to_triangles(triangles: &[[DVec3; 3]], p: DVec3) -> f64 {
    let to_edge = |a: DVec3, b: DVec3| {
        let s = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
        p.distance(a + s * (b - a))
    };
    triangles
        .iter()
        .map(|&[a, b, c]| {
            let n = (b - a).cross(c - a).normalize();
            let foot = p - n.dot(p - a) * n;
            let over = |a: DVec3, b: DVec3| n.dot((b - a).cross(foot - a)) >= 0.0;
            if over(a, b) && over(b, c) && over(c, a) {
                n.dot(p - a).abs()
            } else {
                to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
            }
        })
        .fold(f64::INFINITY, f64::min)
}

#[test]
fn meshes_tell_distance_side_and_normal() {
    let (vertices, indices) = bumpy_sphere();
    let oriented =
        TriMesh::with_flags(vertices.clone(), indices.clone(), TriMeshFlags::ORIENTED).unwrap();
    let topological = TriMesh::with_flags(
        vertices.clone(),
        indices.clone(),
        TriMeshFlags::HALF_EDGE_TOPOLOGY,
    )
    .unwrap();
    assert!(
        ExactShape(&topological).is_closed(),
        "no half-edge without a twin"
    );
    let plain = TriMesh::new(vertices, indices).unwrap();
    let triangles = triangles_of(&plain);
    let mut rng = fastrand::Rng::with_seed(11);
    let samples = samples_on(&triangles, 500, &mut rng);
    let (mut inside, mut outside) = (0, 0);
    for _ in 0..300 {
        let point = in_box(&mut rng, 1.2);
        let on = |p| distance_to_triangles(&triangles, p);
        let distance = check_projection("mesh", &plain, point, on, &samples);
        // Inside by parity along a generic direction.
        let direction = unit(&mut rng).as_dvec3().normalize();
        let ahead = brute_force(&triangles, point.as_dvec3(), direction, 10.0).len();
        assert_eq!(distance < 0.0, ahead % 2 == 1, "{point}: {distance}");
        *(if distance < 0.0 {
            &mut inside
        } else {
            &mut outside
        }) += 1;
        let same = ExactShape(&plain).project(point);
        assert_eq!(ExactShape(&oriented).project(point), same);
        assert_eq!(ExactShape(&topological).project(point), same);
    }
    assert!(inside > 20 && outside > 100);
    // Exactly on a vertex, between faces that do not agree: no distance, a normal outward.
    let (vertices, indices) = gridded_cube(4);
    let cube = TriMesh::new(vertices, indices).unwrap();
    for (point, expected) in [
        (Vec3::ONE, Vec3::ONE.normalize()),
        (Vec3::new(0.5, 0.5, 1.0), Vec3::Z),
        (Vec3::new(0.3, -1.0, 0.1), -Vec3::Y),
    ] {
        let (distance, normal) = ExactShape(&cube).project(point);
        assert!(distance.abs() < 1e-6);
        assert!(normal.dot(expected) > 0.9, "{point}: {normal}");
    }
    // Off a corner, where single faces would mistake the side.
    let (distance, normal) = ExactShape(&cube).project(Vec3::splat(2.0));
    assert!((distance - 3f32.sqrt()).abs() < 1e-6);
    assert!(normal.distance(Vec3::ONE.normalize()) < 1e-6);
}

pub(crate) fn hills() -> HeightField {
    let heights: Vec<f32> = (0..7 * 9)
        .map(|k| 0.3 * ((k % 7) as f32 * 1.3).sin() + 0.2 * ((k / 7) as f32 * 0.9).cos())
        .collect();
    HeightField::new(Array2::new(7, 9, heights), Vec3::new(1.7, 1.1, 2.3))
}

fn upward(field: &HeightField) -> Vec<[DVec3; 3]> {
    let triangles = field.triangles().map(|t| {
        let [a, b, c] = [t.a, t.b, t.c].map(|v| v.as_dvec3());
        if (b - a).cross(c - a).y < 0.0 {
            [a, c, b]
        } else {
            [a, b, c]
        }
    });
    triangles.collect()
}

#[test]
fn height_fields_are_crossed_like_their_triangles_and_point_up() {
    let field = hills();
    let triangles = upward(&field);
    assert_eq!(triangles.len(), 2 * 6 * 8);
    assert!(compare_with_brute_force("hills", &field, &triangles, 12) > 300);
    assert!(!ExactShape(&field).is_closed());
    // Straight down through every vertex and every middle of an edge or diagonal: once each.
    for i in 1..12 {
        for j in 1..16 {
            let origin = Vec3::new(
                (j as f32 / 16.0 - 0.5) * 1.7,
                3.0,
                (i as f32 / 12.0 - 0.5) * 2.3,
            );
            let hits = crossings(&field, origin, -Vec3::Y, 10.0);
            assert_eq!(hits.len(), 1, "{i} {j}: {hits:?}");
            assert!(hits[0].normal.y > 0.0);
        }
    }
}

/// Wherever the nearest triangle is: in the cell below, behind hills, beside the field, or beyond removed cells.
#[test]
fn height_fields_tell_distance_side_and_normal() {
    let mut field = hills();
    let mut rng = fastrand::Rng::with_seed(13);
    for half in [0.8, 4.0] {
        let triangles = upward(&field);
        let samples = samples_on(&triangles, 500, &mut rng);
        let on = |p| distance_to_triangles(&triangles, p);
        for _ in 0..200 {
            let point = in_box(&mut rng, half);
            let distance = check_projection("hills", &field, point, on, &samples);
            let is_over_or_below = point.x.abs() < 0.85 && point.z.abs() < 1.15;
            if half < 1.0 && is_over_or_below {
                let below = crossings(&field, point, Vec3::Y, 10.0).len() == 1;
                assert_eq!(distance < 0.0, below, "{point}: {distance}");
            }
        }
    }
    for (row, column) in (0..6).flat_map(|i| (0..8).map(move |j| (i, j))) {
        let status = match (row, column) {
            (0..3, _) => HeightFieldCellStatus::CELL_REMOVED,
            (3, _) => HeightFieldCellStatus::LEFT_TRIANGLE_REMOVED,
            _ => HeightFieldCellStatus::empty(),
        };
        field.set_cell_status(row, column, status);
    }
    let triangles = upward(&field);
    assert_eq!(triangles.len(), 8 + 2 * 2 * 8);
    let samples = samples_on(&triangles, 500, &mut rng);
    let on = |p| distance_to_triangles(&triangles, p);
    for _ in 0..200 {
        let point = in_box(&mut rng, 1.5);
        check_projection("hills with a hole", &field, point, on, &samples);
    }
    for (row, column) in (0..6).flat_map(|i| (0..8).map(move |j| (i, j))) {
        field.set_cell_status(row, column, HeightFieldCellStatus::CELL_REMOVED);
    }
    assert_eq!(ExactShape(&field).project(Vec3::ONE).0, f32::INFINITY);
}
