//! Faces become triangles.

use crate::{ReadOptions, SourceErrorKind};

/// Triangles allowed for each point allowed: a closed mesh has 2.
const TRIANGLES_PER_POINT: u64 = 4;

/// Triangles reserved for at most before any has been read.
const MAX_RESERVED_FACES: u64 = 1 << 16;

/// Gathers triangles.
pub(super) struct Faces {
    pub(super) triangles: Vec<[u32; 3]>,
    points: u64,
    limit: u64,
}

impl Faces {
    pub(super) fn new(points: u64, options: &ReadOptions) -> Self {
        Self {
            triangles: Vec::new(),
            points,
            limit: options.max_points.saturating_mul(TRIANGLES_PER_POINT),
        }
    }

    pub(super) fn reserve(&mut self, expected: u64) {
        // Fits: small.
        let reserve = expected.min(MAX_RESERVED_FACES).min(self.limit) as usize;
        self.triangles.reserve(reserve);
    }

    /// The corner of a face, if there is such a vertex.
    pub(super) fn corner(&self, index: Option<i64>) -> std::result::Result<u32, SourceErrorKind> {
        let index = index.unwrap_or(i64::MAX);
        u32::try_from(index)
            .ok()
            .filter(|i| u64::from(*i) < self.points)
            .ok_or(SourceErrorKind::FaceIndex {
                index,
                points: self.points,
            })
    }

    pub(super) fn push(&mut self, triangle: [u32; 3]) -> std::result::Result<(), SourceErrorKind> {
        if self.triangles.len() as u64 >= self.limit {
            return Err(SourceErrorKind::TooManyTriangles { limit: self.limit });
        }
        self.triangles.push(triangle);
        Ok(())
    }
}

/// Cuts one polygon into the triangles that share its first corner.
#[derive(Default)]
pub(super) struct Fan {
    first: Option<u32>,
    previous: Option<u32>,
}

impl Fan {
    /// Adds the next corner.
    pub(super) fn push(
        &mut self,
        corner: u32,
        faces: &mut Faces,
    ) -> std::result::Result<(), SourceErrorKind> {
        match (self.first, self.previous) {
            (None, _) => self.first = Some(corner),
            (Some(_), None) => self.previous = Some(corner),
            (Some(first), Some(previous)) => {
                faces.push([first, previous, corner])?;
                self.previous = Some(corner);
            }
        }
        Ok(())
    }
}
