//! Binary data after the header.

use super::faces::{Faces, Fan};
use super::header::{Element, Kind, Role};
use crate::SourceErrorKind;
use crate::collector::{Collector, Sample};
use crate::error::Result;
use crate::input::Input;
use crate::scalar::{Endian, Scalar};
use crate::slot::{Column, Columns, Slot};

/// The properties of the vertices that are kept, with byte offsets as if lists had no items, or,
/// where there are lists, property indices.
pub(super) fn columns(element: &Element) -> Columns {
    let by_index = record_size(element).is_none();
    let mut offset = 0;
    let mut kept = Vec::new();
    for (index, property) in element.properties.iter().enumerate() {
        let Kind::One(scalar) = property.kind else {
            continue;
        };
        if let Some(slot) = Slot::from_name(&property.name) {
            let place = if by_index { index } else { offset };
            kept.push(Column {
                slot,
                scalar,
                place,
            });
        }
        offset += scalar.size();
    }
    Columns::new(without_packed(kept))
}

/// PLY has no packed colours: `rgb` means nothing there.
pub(super) fn without_packed(columns: Vec<Column>) -> impl Iterator<Item = Column> {
    columns.into_iter().filter(|c| !c.slot.is_packed())
}

/// Size of one record in bytes, unless it has lists.
fn record_size(element: &Element) -> Option<usize> {
    element
        .properties
        .iter()
        .map(|p| match p.kind {
            Kind::One(scalar) => Some(scalar.size()),
            Kind::List { .. } => None,
        })
        .sum()
}

/// Reads all records of one element.
pub(super) fn read(
    input: &mut Input<'_>,
    element: &Element,
    endian: Endian,
    columns: &Columns,
    collector: &mut Collector,
    faces: &mut Faces,
) -> Result<()> {
    match (element.role, record_size(element)) {
        // A record fits into the buffer: a header has at most 10,000 lines, a value 8 bytes.
        (Role::Vertices, Some(size)) => {
            let sample = |record: &[u8]| columns.sample(record, endian);
            collector.read_records(input, size, Some(element.count), "the vertices", sample)
        }
        (Role::Vertices, None) => read_vertices(input, element, endian, columns, collector),
        (_, Some(size)) => {
            let bytes = element.count.saturating_mul(size as u64);
            input.skip(bytes, &element.name)
        }
        (Role::Faces, None) => {
            faces.reserve(element.count);
            for _ in 0..element.count {
                read_face(input, element, endian, faces)?;
            }
            Ok(())
        }
        (Role::Other, None) => {
            for _ in 0..element.count {
                for property in &element.properties {
                    skip(input, element, property.kind, endian)?;
                }
            }
            Ok(())
        }
    }
}

/// Vertices with lists among their properties.
fn read_vertices(
    input: &mut Input<'_>,
    element: &Element,
    endian: Endian,
    columns: &Columns,
    collector: &mut Collector,
) -> Result<()> {
    for _ in 0..element.count {
        let mut sample = Sample::EMPTY;
        for (index, property) in element.properties.iter().enumerate() {
            match property.kind {
                Kind::One(scalar) => {
                    let bytes = input.bytes(scalar.size(), "the vertices")?;
                    if let Some(column) = columns.0.iter().find(|c| c.place == index) {
                        sample.set(column.slot, scalar.decode(bytes, endian));
                    }
                }
                list @ Kind::List { .. } => skip(input, element, list, endian)?,
            }
        }
        collector
            .push(&sample)
            .map_err(|kind| input.error_at_byte(kind))?;
        input.points_read = collector.count();
    }
    Ok(())
}

fn read_face(
    input: &mut Input<'_>,
    element: &Element,
    endian: Endian,
    faces: &mut Faces,
) -> Result<()> {
    let corner_list = element.corner_list();
    for (index, property) in element.properties.iter().enumerate() {
        match property.kind {
            Kind::List { count, item } if Some(index) == corner_list => {
                let corners = list_length(input, count, endian, element)?;
                read_corners(input, corners, item, endian, faces)?;
            }
            kind => skip(input, element, kind, endian)?,
        }
    }
    Ok(())
}

fn read_corners(
    input: &mut Input<'_>,
    mut left: u64,
    item: Scalar,
    endian: Endian,
    faces: &mut Faces,
) -> Result<()> {
    let mut fan = Fan::default();
    while left > 0 {
        let position = input.byte_position();
        let corners = input.records(item.size(), left, "the faces")?;
        left -= (corners.len() / item.size()) as u64;
        for bytes in corners.chunks_exact(item.size()) {
            faces
                .corner(item.decode_integer(bytes, endian))
                .and_then(|corner| fan.push(corner, faces))
                .map_err(|kind| kind.at(position))?;
        }
    }
    Ok(())
}

fn list_length(
    input: &mut Input<'_>,
    count: Scalar,
    endian: Endian,
    element: &Element,
) -> Result<u64> {
    let position = input.byte_position();
    let bytes = input.bytes(count.size(), &element.name)?;
    let length = count.decode_integer(bytes, endian);
    length.and_then(|n| u64::try_from(n).ok()).ok_or_else(|| {
        let length = length.map_or("more than 2⁶³".to_owned(), |n| n.to_string());
        SourceErrorKind::value(format!("a list has {length} items")).at(position)
    })
}

/// Passes over one property.
fn skip(input: &mut Input<'_>, element: &Element, kind: Kind, endian: Endian) -> Result<()> {
    let bytes = match kind {
        Kind::One(scalar) => scalar.size() as u64,
        Kind::List { count, item } => {
            let length = list_length(input, count, endian, element)?;
            length.saturating_mul(item.size() as u64)
        }
    };
    input.skip(bytes, &element.name)
}
