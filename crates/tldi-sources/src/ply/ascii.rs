//! Data after the header as text: one record a line.

use super::faces::{Faces, Fan};
use super::header::{Element, Kind, Role};
use crate::SourceErrorKind;
use crate::collector::{Collector, Sample};
use crate::error::Result;
use crate::input::Input;
use crate::scalar::{Scalar, parse_integer, parse_number};
use crate::slot::{Column, Columns, Slot};

/// The properties of the vertices that are kept, with property indices as places.
pub(super) fn columns(element: &Element) -> Columns {
    let kept = element
        .properties
        .iter()
        .enumerate()
        .filter_map(|(place, p)| match p.kind {
            // `float` restricts binary files only: text may have more digits.
            Kind::One(scalar) => Some(Column {
                slot: Slot::from_name(&p.name)?,
                scalar: match scalar {
                    Scalar::F32 => Scalar::F64,
                    other => other,
                },
                place,
            }),
            Kind::List { .. } => None,
        })
        .collect();
    Columns::new(super::binary::without_packed(kept))
}

/// Reads all records of one element.
pub(super) fn read(
    input: &mut Input<'_>,
    element: &Element,
    columns: &Columns,
    collector: &mut Collector,
    faces: &mut Faces,
) -> Result<()> {
    if element.properties.is_empty() {
        return Ok(());
    }
    if element.role == Role::Faces {
        faces.reserve(element.count);
    }
    // The slot of each property that is kept; only vertices have some.
    let slot = |i: usize| columns.0.iter().find(|c| c.place == i).map(|c| c.slot);
    let slots: Vec<Option<Slot>> = (0..element.properties.len())
        .map(|i| slot(i).filter(|_| element.role == Role::Vertices))
        .collect();
    let corner_list = element.corner_list();
    let mut left = element.count;
    while left > 0 {
        let Some(line) = input.line()? else {
            let what = format!("the element `{}`", element.name);
            return Err(input.error_at_line(SourceErrorKind::truncated(what)));
        };
        if line.trim_ascii().is_empty() {
            continue;
        }
        left -= 1;
        let mut tokens = Tokens(line);
        read_record(&mut tokens, element, &slots, corner_list, faces)
            .and_then(|sample| match element.role {
                Role::Vertices => collector.push(&sample),
                Role::Faces | Role::Other => Ok(()),
            })
            .and_then(|()| tokens.end())
            .map_err(|kind| input.error_at_line(kind))?;
        if element.role == Role::Vertices {
            input.points_read = collector.count();
        }
    }
    Ok(())
}

type Outcome<T> = std::result::Result<T, SourceErrorKind>;

/// Reads a record: the values of the `slots`, and the corners of a face into `faces`.
fn read_record(
    tokens: &mut Tokens<'_>,
    element: &Element,
    slots: &[Option<Slot>],
    corner_list: Option<usize>,
    faces: &mut Faces,
) -> Outcome<Sample> {
    let mut sample = Sample::EMPTY;
    for (index, property) in element.properties.iter().enumerate() {
        let Kind::List { .. } = property.kind else {
            let token = tokens.next()?;
            if let Some(slot) = slots[index] {
                sample.set(slot, parse_number(token)?);
            }
            continue;
        };
        let mut fan = Fan::default();
        for _ in 0..tokens.list_length()? {
            let token = tokens.next()?;
            if Some(index) == corner_list {
                let corner = faces.corner(Some(parse_integer(token)?))?;
                fan.push(corner, faces)?;
            }
        }
    }
    Ok(sample)
}

/// The words of a line.
struct Tokens<'a>(&'a [u8]);

impl<'a> Tokens<'a> {
    fn next(&mut self) -> Outcome<&'a [u8]> {
        let rest = self.0.trim_ascii_start();
        if rest.is_empty() {
            let reason = "the line has fewer values than its element has properties";
            return Err(SourceErrorKind::value(reason));
        }
        let length = rest
            .iter()
            .position(u8::is_ascii_whitespace)
            .unwrap_or(rest.len());
        let (token, rest) = rest.split_at(length);
        self.0 = rest;
        Ok(token)
    }

    fn list_length(&mut self) -> Outcome<u64> {
        let length = parse_integer(self.next()?)?;
        u64::try_from(length)
            .map_err(|_| SourceErrorKind::value(format!("a list has {length} items")))
    }

    fn end(&self) -> Outcome<()> {
        if self.0.trim_ascii().is_empty() {
            return Ok(());
        }
        let reason = "the line has more values than its element has properties";
        Err(SourceErrorKind::value(reason))
    }
}
