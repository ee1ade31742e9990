//! LAS and LAZ (ASPRS LAS specification 1.0 to 1.4; LASzip).
//!
//! Read with the crates las and laz, which trust what a header says about sizes; so these are
//! checked here against the length of the file before they see it ([`Preview`], [`laszip`]). On
//! packed data that is damaged without a change of sizes, laz may panic; that is caught
//! ([`guarded`]).

mod laszip;
mod preview;

use crate::collector::{Collector, ColorScale, Layout, Sample, check_count};
use crate::error::Result;
use crate::input::Input;
use crate::seekable::{self, ReadSeek, guarded};
use crate::{Format, Position, RawCloud, ReadOptions, SourceError, SourceErrorKind};
use ::las::{Error, Header, Reader};
use preview::{Preview, seek, truncated};
use std::io::ErrorKind;
use std::path::Path;

/// Bytes of point records that are unpacked at once.
const BATCH_BYTES: u64 = 1 << 20;

pub(crate) fn parse(
    input: &mut Input<'_>,
    path: Option<&Path>,
    options: &ReadOptions,
) -> Result<RawCloud> {
    let (source, length) = seekable::open(input, path, Format::Las)?;
    guarded(Format::Las, || read(input, source, length, options))
}

fn read(
    input: &mut Input<'_>,
    mut source: Box<dyn ReadSeek>,
    length: u64,
    options: &ReadOptions,
) -> Result<RawCloud> {
    let preview = Preview::read(&mut source, length)?;
    check_count(preview.points, options)?;
    seek(&mut source, 0)?;
    let header = Header::new(&mut source).map_err(|e| error(e, Position::Unknown))?;
    if header.point_format().is_compressed {
        laszip::check(&mut source, &header, &preview)?;
    } else if preview.end_of_points() > length {
        return Err(truncated("the points", length));
    }
    seek(&mut source, 0)?;
    let mut reader = Reader::new(source).map_err(|e| error(e, Position::Unknown))?;

    let layout = Layout {
        colors: header
            .point_format()
            .has_color
            .then_some(ColorScale::Integers),
        wide: true,
        ..Layout::default()
    };
    let mut collector = Collector::new(layout, preview.points, options);
    let batch = (BATCH_BYTES / preview.record_length).max(1);
    while collector.count() < preview.points {
        let position = Position::Point(collector.count());
        let points = reader.read_points(batch).map_err(|e| error(e, position))?;
        if points.is_empty() {
            return Err(SourceErrorKind::truncated("the points").at(position));
        }
        let mut colors = points.rgb();
        for ((x, y), z) in points.x().zip(points.y()).zip(points.z()) {
            let mut sample = Sample::EMPTY;
            sample.position = [x, y, z];
            if let Some((red, green, blue)) = colors.as_mut().and_then(Iterator::next) {
                sample.color[..3].copy_from_slice(&[red, green, blue].map(f32::from));
            }
            collector.push(&sample).map_err(|kind| kind.at(position))?;
        }
        input.points_read = collector.count();
        input.report_share(collector.count(), preview.points);
    }
    Ok(collector.finish()?)
}

fn error(error: Error, position: Position) -> SourceError {
    let kind = match error {
        Error::Io(e) if e.kind() == ErrorKind::UnexpectedEof => {
            SourceErrorKind::truncated("the points")
        }
        Error::Io(e) if e.kind() != ErrorKind::Other => SourceErrorKind::Io(e),
        other => SourceErrorKind::header(Format::Las, other.to_string()),
    };
    kind.at(position)
}
