//! Meshes and points to measure with.

use crate::bumpy_ball;
use crate::protocol::normalised;
use std::collections::HashMap;
use std::path::Path;
use tldi::glamx::Vec3;
use tldi_sources::{ReadOptions, SourceError};

/// A mesh, or the points of one, as large as the protocol has it: the longest edge of the bounds is 2.
pub struct Model {
    /// Of the file, or what it is.
    pub name: String,
    /// Vertices, about the origin.
    pub points: Vec<Vec3>,
    /// Indices of points; empty where the file has none.
    pub faces: Vec<[u32; 3]>,
}

impl Model {
    /// From a file of any format that clouds are read from.
    pub fn read(path: &Path) -> Result<Self, SourceError> {
        let raw = tldi_sources::read(path, &ReadOptions::default())?;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let stem = name.split('.').next().unwrap_or_default();
        Ok(Self {
            name: stem.to_owned(),
            points: normalised(&raw.points),
            faces: raw.faces,
        })
    }

    /// The same surface with more points, as a finer scan has them: every face in four, so many times. The order of a face's
    /// corners is that of stored rows: in another one, other points follow each other, and a case in 300 is answered otherwise.
    pub fn subdivided(mut self, times: u32) -> Self {
        for _ in 0..times {
            let mut middles = HashMap::new();
            let points = &mut self.points;
            let mut middle = |a: u32, b: u32| {
                *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                    points.push(points[a as usize].midpoint(points[b as usize]));
                    (points.len() - 1) as u32
                })
            };
            let split = |&[a, b, c]: &[u32; 3]| {
                let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            };
            self.faces = self.faces.iter().flat_map(split).collect();
            self.name += ", subdivided";
        }
        self
    }

    /// A ball with bumps of about so many points.
    pub fn generated(points: usize) -> Self {
        let (points, faces) = bumpy_ball(points);
        Self {
            name: "bumpy ball (generated)".to_owned(),
            points: normalised(&points),
            faces,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A closed surface keeps V − E + F = 2, with E = 3 F / 2, and its area.
    #[test]
    fn subdivided_surfaces_are_the_same() {
        let area = |model: &Model| -> f32 {
            let of_face = |face: &[u32; 3]| {
                let [a, b, c] = face.map(|i| model.points[i as usize]);
                0.5 * (b - a).cross(c - a).length()
            };
            model.faces.iter().map(of_face).sum()
        };
        let (coarse, fine) = (Model::generated(500), Model::generated(500).subdivided(2));
        assert_eq!(fine.faces.len(), 16 * coarse.faces.len());
        let euler = |model: &Model| 2 * model.points.len() as i64 - model.faces.len() as i64;
        assert_eq!(euler(&coarse), euler(&fine));
        assert!((area(&fine) / area(&coarse) - 1.0).abs() < 1e-4);
    }
}
