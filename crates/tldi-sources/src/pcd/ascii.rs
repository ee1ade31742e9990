//! Data as text: one point a line.

use super::header::Header;
use crate::SourceErrorKind;
use crate::collector::{Collector, Sample};
use crate::error::Result;
use crate::input::Input;
use crate::scalar::{Scalar, parse_number};
use crate::slot::{Column, Columns};

pub(super) fn read(
    input: &mut Input<'_>,
    header: &Header,
    columns: &Columns,
    collector: &mut Collector,
) -> Result<()> {
    let width: usize = header.fields.iter().map(|f| f.count).sum();
    // The column of each place in the line.
    let columns: Vec<Option<&Column>> = (0..width)
        .map(|place| columns.0.iter().find(|c| c.place == place))
        .collect();
    let mut left = header.points;
    while left > 0 {
        let Some(line) = input.line()? else {
            return Err(input.error_at_line(SourceErrorKind::truncated("the points")));
        };
        if line.trim_ascii().is_empty() {
            continue;
        }
        left -= 1;
        read_point(line, &columns)
            .and_then(|sample| collector.push(&sample))
            .map_err(|kind| input.error_at_line(kind))?;
        input.points_read = collector.count();
    }
    Ok(())
}

fn read_point(
    line: &[u8],
    columns: &[Option<&Column>],
) -> std::result::Result<Sample, SourceErrorKind> {
    let mut tokens = line
        .split(u8::is_ascii_whitespace)
        .filter(|token| !token.is_empty());
    let count = columns.len();
    let wrong_number = || SourceErrorKind::value(format!("the line does not have {count} values"));
    let mut sample = Sample::EMPTY;
    for column in columns {
        let token = tokens.next().ok_or_else(wrong_number)?;
        if let Some(column) = column {
            let value = parse_number(token)?;
            if column.slot.is_packed() {
                sample.set_packed(column.slot, packed_bits(column, value));
            } else {
                sample.set(column.slot, value);
            }
        }
    }
    match tokens.next() {
        None => Ok(sample),
        Some(_) => Err(wrong_number()),
    }
}

/// The bits of a packed colour. Of type F, it is the float with these bits, which is tiny, huge or
/// NaN; but old files have the integer itself, as in `4.2108e+06`.
fn packed_bits(column: &Column, value: f64) -> u32 {
    let is_whole = (1.0..16_777_216.0).contains(&value) && value.fract() == 0.0;
    match column.scalar {
        Scalar::F32 if !is_whole => (value as f32).to_bits(),
        // Wraps: an opaque alpha makes the number negative.
        Scalar::I32 => value as i64 as u32,
        _ => value as u32,
    }
}
