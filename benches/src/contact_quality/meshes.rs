//! Meshes of the shapes of contacts, as fine as their points.

use crate::{icosphere, subdivided};
use tldi::glamx::{Pose3, Vec3};
use tldi_tests::ContactShape;

/// Vertices in metres, and faces over them.
pub(super) struct Mesh {
    pub(super) vertices: Vec<Vec3>,
    pub(super) faces: Vec<[u32; 3]>,
}

impl Mesh {
    /// The surface of a shape, with edges of about `spacing` metres, at most half as much again where
    /// it is flat.
    pub(super) fn new(shape: ContactShape, spacing: f32) -> Self {
        match shape {
            ContactShape::Sphere(radius) => {
                let area = 4.0 * std::f32::consts::PI * radius * radius;
                let (unit, mut faces) = icosphere((area / (spacing * spacing)) as usize);
                let at = |i: u32| unit[i as usize];
                for [a, b, c] in &mut faces {
                    if (at(*b) - at(*a)).cross(at(*c) - at(*a)).dot(at(*a)) < 0.0 {
                        std::mem::swap(b, c);
                    }
                }
                Self {
                    vertices: unit.into_iter().map(|p| radius * p).collect(),
                    faces,
                }
            }
            ContactShape::Box(half) => {
                let corner = |k: usize| Vec3::new(sign(k), sign(k >> 1), sign(k >> 2)) * half;
                let quads = [
                    [0, 4, 6, 2],
                    [1, 3, 7, 5],
                    [0, 1, 5, 4],
                    [2, 6, 7, 3],
                    [0, 2, 3, 1],
                    [4, 5, 7, 6],
                ];
                Self::of_quads((0..8).map(corner).collect(), &quads).refined(spacing)
            }
            ContactShape::Plane(edge) => {
                let corner = |k: usize| 0.5 * edge * Vec3::new(sign(k), 0.0, sign(k >> 1));
                Self::of_quads((0..4).map(corner).collect(), &[[0, 2, 3, 1]]).refined(spacing)
            }
            ContactShape::Ramp(size) => {
                // The foot, its far edge twice: below and above.
                let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0)];
                let corner = |k: usize| {
                    let (x, y) = corners[k % 3];
                    0.5 * size * Vec3::new(x, y, if k < 3 { -1.0 } else { 1.0 })
                };
                let quads = [[0, 1, 4, 3], [1, 2, 5, 4], [2, 0, 3, 5]];
                let mut wedge = Self::of_quads((0..6).map(corner).collect(), &quads);
                wedge.faces.extend([[0, 2, 1], [3, 4, 5]]);
                wedge.refined(spacing)
            }
        }
    }

    fn of_quads(vertices: Vec<Vec3>, quads: &[[u32; 4]]) -> Self {
        let halves = |&[a, b, c, d]: &[u32; 4]| [[a, b, c], [a, c, d]];
        Self {
            vertices,
            faces: quads.iter().flat_map(halves).collect(),
        }
    }

    /// Subdivided until no edge is longer than 1.5 × `spacing`.
    fn refined(mut self, spacing: f32) -> Self {
        while self.longest_edge() > 1.5 * spacing {
            self.faces = subdivided(&mut self.vertices, &self.faces);
        }
        self
    }

    fn longest_edge(&self) -> f32 {
        let at = |i: u32| self.vertices[i as usize];
        let edges = self
            .faces
            .iter()
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        edges.fold(0.0, |longest, [a, b]| at(a).distance(at(b)).max(longest))
    }

    /// In another frame.
    pub(super) fn moved(mut self, pose: &Pose3) -> Self {
        self.vertices.iter_mut().for_each(|p| *p = *pose * *p);
        self
    }
}

/// Of the lowest bit.
fn sign(k: usize) -> f32 {
    if k & 1 == 0 { -1.0 } else { 1.0 }
}
