//! Meshes and points to measure with.

use crate::bumpy_ball;
use crate::protocol::normalised;
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
