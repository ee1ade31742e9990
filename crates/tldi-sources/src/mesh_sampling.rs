//! Even samples of a triangle mesh, such as a robot's link.

use fastrand::Rng;
use std::collections::HashMap;
use tldi::glamx::{DVec3, Vec3};

/// Points on the faces of a mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MeshSample {
    /// Positions, in the frame and unit of the mesh.
    pub points: Vec<Vec3>,
    /// Unit normal of the face of each point: outside, where the mesh is closed.
    pub normals: Vec<Vec3>,
}

/// Candidates for a point, per square of the spacing.
const CANDIDATES: f64 = 12.0;
/// Least distance of two points on one side of the surface, in spacings.
const LEAST_DISTANCE: f32 = 0.75;
/// Most candidates in all: a spacing far too small for the mesh does not use up the memory.
const MAX_CANDIDATES: f64 = 2e7;

/// Scatters points over the faces of a mesh: no two on one side of the surface are nearer to each
/// other than 0.75 × `spacing`, and hardly any gap is wider than 1.5 × `spacing` (Poisson-disc
/// sampling by dart throwing).
///
/// `faces` are indices of `points`; triangles with an index out of range, or a corner that is not
/// finite, are passed over. Corners run anticlockwise when seen from outside; a mesh that encloses a
/// negative volume is taken for inside out, and its normals are turned. Nothing comes of a mesh
/// without area, or of a spacing that is not above zero.
///
/// Equal seeds give equal samples. Costs time and memory in proportion to area / spacing², with at
/// most 2·10⁷ candidates (some 2·10⁶ points).
///
/// ```
/// use tldi_sources::sample_mesh;
/// use tldi::glamx::Vec3;
/// let corners = [Vec3::ZERO, Vec3::X, Vec3::new(1.0, 1.0, 0.0), Vec3::Y];
/// let square = sample_mesh(&corners, &[[0, 1, 2], [0, 2, 3]], 0.05, 1);
/// assert!((400..700).contains(&square.points.len()));
/// assert!(square.normals.iter().all(|n| *n == Vec3::Z));
/// ```
pub fn sample_mesh(points: &[Vec3], faces: &[[u32; 3]], spacing: f32, seed: u64) -> MeshSample {
    let corners_of = |face: &[u32; 3]| {
        let [a, b, c] = face.map(|i| points.get(i as usize).filter(|p| p.is_finite()));
        Some([a?.as_dvec3(), b?.as_dvec3(), c?.as_dvec3()])
    };
    let triangles: Vec<[DVec3; 3]> = faces.iter().filter_map(corners_of).collect();
    let vector_area = |[a, b, c]: &[DVec3; 3]| 0.5 * (*b - *a).cross(*c - *a);
    let area: f64 = triangles.iter().map(|t| vector_area(t).length()).sum();
    if !(spacing > 0.0 && area > 0.0 && area.is_finite()) {
        return MeshSample::default();
    }
    // About the middle, so that an open mesh is judged by its shape and not by its place.
    let middle = triangles.iter().flatten().sum::<DVec3>() / (3 * triangles.len()) as f64;
    let volume: f64 = (triangles.iter())
        .map(|corners| corners.map(|corner| corner - middle))
        .map(|[a, b, c]| a.dot(b.cross(c)))
        .sum();
    let outside = if volume < 0.0 { -1.0 } else { 1.0 };
    let wanted = (CANDIDATES * area / f64::from(spacing).powi(2)).min(MAX_CANDIDATES);
    let per_area = wanted / area;

    let mut rng = Rng::with_seed(seed);
    let mut candidates: Vec<(Vec3, u32)> = Vec::new();
    let mut normals = Vec::with_capacity(triangles.len());
    for (k, triangle) in triangles.iter().enumerate() {
        let across = vector_area(triangle);
        normals.push((outside * across).normalize_or_zero().as_vec3());
        // The fraction is drawn, so that slivers get their share.
        let count = (per_area * across.length() + rng.f64()) as usize;
        for _ in 0..count {
            candidates.push((point_in(triangle, &mut rng).as_vec3(), k as u32));
        }
    }
    rng.shuffle(&mut candidates);
    if candidates.is_empty() {
        // A mesh smaller than its spacing still has a place.
        let [a, b, c] = triangles[0];
        candidates.push((((a + b + c) / 3.0).as_vec3(), 0));
    }
    let mut taken = Taken::new(LEAST_DISTANCE * spacing);
    for (point, face) in candidates {
        taken.offer(point, normals[face as usize]);
    }
    taken.sample
}

/// A random point of a triangle, evenly distributed.
fn point_in([a, b, c]: &[DVec3; 3], rng: &mut Rng) -> DVec3 {
    let (mut u, mut v) = (rng.f64(), rng.f64());
    if u + v > 1.0 {
        (u, v) = (1.0 - u, 1.0 - v);
    }
    *a + (*b - *a) * u + (*c - *a) * v
}

/// The points so far, in cells as wide as their least distance.
struct Taken {
    least_distance: f32,
    cells: HashMap<[i32; 3], Vec<u32>>,
    sample: MeshSample,
}

impl Taken {
    fn new(least_distance: f32) -> Self {
        Self {
            least_distance,
            cells: HashMap::new(),
            sample: MeshSample::default(),
        }
    }

    /// Takes a point unless one is near it that lies on the same side of the surface: a thin plate
    /// has both its sides.
    fn offer(&mut self, point: Vec3, normal: Vec3) {
        let cell = (point / self.least_distance)
            .to_array()
            .map(|c| c.floor() as i32);
        let is_near = |i: &u32| {
            let i = *i as usize;
            self.sample.points[i].distance(point) < self.least_distance
                && self.sample.normals[i].dot(normal) > 0.0
        };
        let around =
            (-1..=1).flat_map(|x| (-1..=1).flat_map(move |y| (-1..=1).map(move |z| [x, y, z])));
        for [x, y, z] in around {
            let neighbor = [
                cell[0].saturating_add(x),
                cell[1].saturating_add(y),
                cell[2].saturating_add(z),
            ];
            if (self.cells.get(&neighbor)).is_some_and(|taken| taken.iter().any(is_near)) {
                return;
            }
        }
        let index = self.sample.points.len() as u32;
        self.cells.entry(cell).or_default().push(index);
        self.sample.points.push(point);
        self.sample.normals.push(normal);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The faces of a box with one corner at the origin, outside anticlockwise.
    fn block(size: Vec3) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let points = (0..8)
            .map(|k| size * Vec3::new((k & 1) as f32, (k >> 1 & 1) as f32, (k >> 2) as f32))
            .collect();
        let quads = [
            [0, 2, 3, 1],
            [4, 5, 7, 6],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 4, 6, 2],
            [1, 3, 7, 5],
        ];
        let faces = quads
            .iter()
            .flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        (points, faces.collect())
    }

    #[test]
    fn points_are_even_and_on_all_faces() {
        let size = Vec3::new(0.4, 0.3, 0.004);
        let (points, faces) = block(size);
        let spacing = 0.01;
        let sample = sample_mesh(&points, &faces, spacing, 3);
        for (p, n) in sample.points.iter().zip(&sample.normals) {
            // On the face that its normal belongs to.
            let on_high_side = (*p - size).dot(n.abs()).abs() < 1e-6 && n.element_sum() > 0.0;
            let on_low_side = p.dot(n.abs()).abs() < 1e-6 && n.element_sum() < 0.0;
            assert!(on_high_side || on_low_side, "{p} {n}");
        }
        for (i, p) in sample.points.iter().enumerate() {
            for j in 0..i {
                let one_side = sample.normals[i].dot(sample.normals[j]) > 0.0;
                let distance = p.distance(sample.points[j]);
                assert!(!one_side || distance >= 0.75 * spacing - 1e-6, "{distance}");
            }
        }
        // Both wide sides of the plate are covered: no place is farther than 1.5 spacings from a
        // point of its side.
        for z in [0.0, size.z] {
            for k in 0..1200 {
                let place = Vec3::new((k % 40) as f32 * 0.01, (k / 40) as f32 * 0.01, z);
                let near = sample.points.iter().zip(&sample.normals).any(|(p, n)| {
                    (n.z > 0.0) == (z > 0.0) && n.z != 0.0 && p.distance(place) < 1.5 * spacing
                });
                assert!(near, "{place}");
            }
        }
        assert_eq!(sample, sample_mesh(&points, &faces, spacing, 3));
        assert_ne!(sample, sample_mesh(&points, &faces, spacing, 4));
    }

    #[test]
    fn a_mesh_inside_out_is_turned() {
        let (points, faces) = block(Vec3::ONE);
        let inward: Vec<[u32; 3]> = faces.iter().map(|[a, b, c]| [*a, *c, *b]).collect();
        let sample = sample_mesh(&points, &inward, 0.1, 1);
        for (p, n) in sample.points.iter().zip(&sample.normals) {
            assert!((*p - Vec3::splat(0.5)).dot(*n) > 0.49, "{n} at {p}");
        }
    }

    #[test]
    fn broken_meshes_give_what_they_can() {
        let (mut points, mut faces) = block(Vec3::ONE);
        faces.push([0, 1, 99]);
        points.push(Vec3::NAN);
        faces.push([0, 1, 8]);
        assert!(!sample_mesh(&points, &faces, 0.1, 1).points.is_empty());
        for (faces, spacing) in [
            (&faces[..0], 0.1),
            (&faces[..], 0.0),
            (&faces[..], f32::NAN),
        ] {
            assert_eq!(
                sample_mesh(&points, faces, spacing, 1),
                MeshSample::default()
            );
        }
        // Flat triangles have no area.
        assert_eq!(
            sample_mesh(&points, &[[0, 0, 1]], 0.1, 1),
            MeshSample::default()
        );
        // Coarser than the mesh.
        assert!(
            !sample_mesh(&points, &faces[..12], 100.0, 1)
                .points
                .is_empty()
        );
    }
}
