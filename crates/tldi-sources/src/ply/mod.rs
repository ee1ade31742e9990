//! PLY: the polygon file format of Stanford (Greg Turk, "The PLY Polygon File Format", 1994).
//!
//! The parser is our own because the crate at hand, ply-rs-bw 4, though safe against large counts,
//! refuses `nan`, `.5` and `1.` in ascii files, reads lines of any length into memory, stores the
//! lists it is told to ignore, and tells neither progress nor byte offsets.
//!
//! Read are the element `vertex` (see [`Slot`](crate::slot::Slot) for the names of properties; with those of
//! Gaussian splats, see [`splat`](crate::splat)) and
//! the list `vertex_indices` or `vertex_index` of the element `face`; faces of fewer than three
//! corners are left out. Other elements and properties, triangle strips among them, are passed
//! over, but must be there.

mod ascii;
mod binary;
mod header;

use crate::collector::{Collector, Layout, check_count};
use crate::error::Result;
use crate::input::Input;
use crate::slot::Columns;
use crate::{Format, RawCloud, ReadOptions, SourceErrorKind};
use header::{Element, Encoding, Header, Role};

/// Triangles allowed for each point allowed: a closed mesh has 2.
const TRIANGLES_PER_POINT: u64 = 4;

/// Triangles reserved for at most before any has been read.
const MAX_RESERVED_FACES: u64 = 1 << 16;

pub(crate) fn parse(input: &mut Input<'_>, options: &ReadOptions) -> Result<RawCloud> {
    let header = Header::read(input)?;
    let header_error = |input: &Input<'_>, reason: &str| {
        input.error_at_line(SourceErrorKind::Header {
            format: Format::Ply,
            reason: reason.to_owned(),
        })
    };
    let Some(vertices) = header.elements.iter().find(|e| e.role == Role::Vertices) else {
        return Err(header_error(input, "there is no element `vertex`"));
    };
    let columns = vertices.columns(header.encoding);
    if !columns.has_position() {
        let reason = "the element `vertex` lacks one of the properties x, y, z";
        return Err(header_error(input, reason));
    }
    check_count(vertices.count, options).map_err(|kind| input.error_at_line(kind))?;

    let mut collector = Collector::new(Layout::of(&columns, options), vertices.count, options);
    let mut faces = Faces::new(vertices.count, options);
    for element in &header.elements {
        match header.encoding {
            Encoding::Ascii => ascii::read(input, element, &columns, &mut collector, &mut faces)?,
            Encoding::Binary(endian) => {
                binary::read(input, element, endian, &columns, &mut collector, &mut faces)?;
            }
        }
    }
    let mut cloud = collector.finish()?;
    cloud.faces = faces.triangles;
    Ok(cloud)
}

impl Element {
    /// The properties that are kept, if these are the vertices.
    fn columns(&self, encoding: Encoding) -> Columns {
        match encoding {
            Encoding::Ascii => ascii::columns(self),
            Encoding::Binary(_) => binary::columns(self),
        }
    }
}

/// Gathers triangles.
struct Faces {
    triangles: Vec<[u32; 3]>,
    points: u64,
    limit: u64,
}

impl Faces {
    fn new(points: u64, options: &ReadOptions) -> Self {
        Self {
            triangles: Vec::new(),
            points,
            limit: options.max_points.saturating_mul(TRIANGLES_PER_POINT),
        }
    }

    fn reserve(&mut self, expected: u64) {
        // Fits: small.
        let reserve = expected.min(MAX_RESERVED_FACES).min(self.limit) as usize;
        self.triangles.reserve(reserve);
    }

    /// The corner of a face, if there is such a vertex.
    fn corner(&self, index: Option<i64>) -> std::result::Result<u32, SourceErrorKind> {
        let index = index.unwrap_or(i64::MAX);
        u32::try_from(index)
            .ok()
            .filter(|i| u64::from(*i) < self.points)
            .ok_or(SourceErrorKind::FaceIndex {
                index,
                points: self.points,
            })
    }

    fn push(&mut self, triangle: [u32; 3]) -> std::result::Result<(), SourceErrorKind> {
        if self.triangles.len() as u64 >= self.limit {
            return Err(SourceErrorKind::TooManyTriangles { limit: self.limit });
        }
        self.triangles.push(triangle);
        Ok(())
    }
}

/// Cuts one polygon into the triangles that share its first corner.
#[derive(Default)]
struct Fan {
    first: Option<u32>,
    previous: Option<u32>,
}

impl Fan {
    /// Adds the next corner.
    fn push(&mut self, corner: u32, faces: &mut Faces) -> std::result::Result<(), SourceErrorKind> {
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
