//! Compressed data, field by field. Little endian, as the machines that write it are.

use super::header::Header;
use super::lzf;
use crate::SourceErrorKind;
use crate::collector::{Collector, Sample};
use crate::error::Result;
use crate::input::Input;
use crate::scalar::{Endian, unsigned};
use crate::slot::Columns;

/// One block of LZF: two sizes, then data that unpacks to all of the first field, all of the
/// second, and so on.
pub(super) fn read(
    input: &mut Input<'_>,
    header: &Header,
    columns: &Columns,
    collector: &mut Collector,
) -> Result<()> {
    let position = input.byte_position();
    let sizes = input.bytes(8, "the sizes of the compressed points")?;
    let (packed, unpacked) = (unsigned(&sizes[..4]), unsigned(&sizes[4..]));
    // Fits: points are limited, and a record has at most 128 KiB.
    let expected = header.points.saturating_mul(header.record_size() as u64);
    let damaged = |reason| SourceErrorKind::Compression { reason }.at(position);
    if unpacked != expected {
        return Err(damaged(format!(
            "it unpacks to {unpacked} bytes, but the points need {expected}"
        )));
    }
    let packed = input.gather(packed, "the compressed points")?;
    let unpacked =
        lzf::unpack(&packed, unpacked).map_err(|reason| damaged(format!("LZF: {reason}")))?;
    drop(packed);

    // Each field takes what its size is per point: offsets within a record scale with the number
    // of points.
    let points = unpacked.len() / header.record_size().max(1);
    for index in 0..points {
        let mut sample = Sample::EMPTY;
        for column in &columns.0 {
            let start = column.place * points + index * column.scalar.size();
            sample.decode(column, &unpacked[start..], Endian::Little);
        }
        collector.push(&sample).map_err(|kind| kind.at(position))?;
    }
    input.points_read = collector.count();
    Ok(())
}
