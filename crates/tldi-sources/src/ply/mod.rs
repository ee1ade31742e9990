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
mod faces;
mod header;

use crate::collector::{Collector, Layout, check_count};
use crate::error::Result;
use crate::input::Input;
use crate::slot::Columns;
use crate::{Format, RawCloud, ReadOptions, SourceErrorKind};
use faces::Faces;
use header::{Element, Encoding, Header, Role};

pub(crate) fn parse(input: &mut Input<'_>, options: &ReadOptions) -> Result<RawCloud> {
    let header = Header::read(input)?;
    let header_error = |input: &Input<'_>, reason: &str| {
        input.error_at_line(SourceErrorKind::header(Format::Ply, reason))
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
