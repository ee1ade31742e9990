//! LAS and LAZ (ASPRS LAS specification 1.0 to 1.4; LASzip).
//!
//! Read with the crates las and laz, which trust what a header says about sizes; so these are
//! checked here against the length of the file before they see it ([`Preview`], [`laszip`]). On
//! packed data that is damaged without a change of sizes, laz may panic; that is caught
//! ([`guarded`]).

mod laszip;

use crate::collector::{Collector, ColorScale, Layout, Sample, check_count};
use crate::error::Result;
use crate::input::Input;
use crate::scalar::{Endian, Scalar};
use crate::seekable::{self, ReadSeek, guarded};
use crate::{Format, Position, RawCloud, ReadOptions, SourceError, SourceErrorKind};
use ::las::{Error, Header, Reader};
use std::io::{ErrorKind, SeekFrom};
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
        splats: None,
        normals: false,
        colors: header
            .point_format()
            .has_color
            .then_some(ColorScale::Integers),
        radii: false,
        wide: true,
    };
    let mut collector = Collector::new(layout, preview.points, options);
    let batch = (BATCH_BYTES / preview.record_length).max(1);
    while collector.count() < preview.points {
        let position = Position::Point(collector.count());
        let points = reader.read_points(batch).map_err(|e| error(e, position))?;
        if points.is_empty() {
            let what = "the points".to_owned();
            return Err(SourceError::new(
                SourceErrorKind::Truncated { what },
                position,
            ));
        }
        let mut colors = points.rgb();
        for ((x, y), z) in points.x().zip(points.y()).zip(points.z()) {
            let mut sample = Sample::EMPTY;
            sample.position = [x, y, z];
            if let Some((red, green, blue)) = colors.as_mut().and_then(Iterator::next) {
                sample.color[..3].copy_from_slice(&[red, green, blue].map(f32::from));
            }
            collector
                .push(&sample)
                .map_err(|kind| SourceError::new(kind, position))?;
        }
        input.points_read = collector.count();
        input.report_share(collector.count(), preview.points);
    }
    Ok(collector.finish()?)
}

/// What a header says about sizes, checked against the length of the file.
struct Preview {
    length: u64,
    offset_to_points: u64,
    record_length: u64,
    points: u64,
}

impl Preview {
    fn read(source: &mut dyn ReadSeek, length: u64) -> Result<Self> {
        /// Size of the header of version 1.0 to 1.2, the shortest.
        const SHORTEST: usize = 227;
        /// Size of that of version 1.4.
        const EXTENDED: usize = 375;
        /// Size of the head of an extended variable-length record.
        const EVLR_HEAD: u64 = 60;

        let header = bytes(source, 0, SHORTEST, length)?;
        let is_extended = (header[24], header[25]) >= (1, 4);
        let header = if is_extended {
            bytes(source, 0, EXTENDED, length)?
        } else {
            header
        };
        let u64_at = |at: usize| unsigned(Scalar::U64, &header[at..]);
        let u32_at = |at: usize| unsigned(Scalar::U32, &header[at..]);
        let legacy_points = u32_at(107);
        let preview = Self {
            length,
            offset_to_points: u32_at(96),
            record_length: unsigned(Scalar::U16, &header[105..]).max(1),
            points: if is_extended && legacy_points == 0 {
                u64_at(247)
            } else {
                legacy_points
            },
        };
        if preview.offset_to_points > length {
            return Err(truncated("the header", length));
        }
        // The crate seeks there, also in packed files.
        if preview.points > u64::from(u32::MAX) * 16 {
            let limit = u64::from(u32::MAX) * 16;
            return Err(SourceErrorKind::TooManyPoints { limit }.into());
        }
        if is_extended && u32_at(243) > 0 {
            let start = u64_at(235);
            let head = bytes(source, start, EVLR_HEAD as usize, length)?;
            let size = unsigned(Scalar::U64, &head[20..]);
            if size > length - start - EVLR_HEAD {
                return Err(truncated("an extended variable-length record", length));
            }
        }
        Ok(preview)
    }

    /// Where uncompressed points end.
    fn end_of_points(&self) -> u64 {
        // No overflow: at most 2³² + 2³⁶ × 2¹⁶.
        self.offset_to_points + self.points * self.record_length
    }
}

/// The unsigned integer at the start of `bytes`.
fn unsigned(scalar: Scalar, bytes: &[u8]) -> u64 {
    match scalar {
        Scalar::U64 => {
            let low = Scalar::U32.decode(bytes, Endian::Little) as u64;
            let high = Scalar::U32.decode(&bytes[4..], Endian::Little) as u64;
            high << 32 | low
        }
        // At most 32 bits: exact.
        _ => scalar.decode(bytes, Endian::Little) as u64,
    }
}

/// `count` bytes at `start`, if the file of `length` bytes has them.
fn bytes(source: &mut dyn ReadSeek, start: u64, count: usize, length: u64) -> Result<Vec<u8>> {
    if start
        .checked_add(count as u64)
        .is_none_or(|end| end > length)
    {
        return Err(truncated("the header", length));
    }
    seek(source, start)?;
    let mut found = vec![0; count];
    source.read_exact(&mut found).map_err(io_error)?;
    Ok(found)
}

fn seek(source: &mut dyn ReadSeek, to: u64) -> Result<()> {
    source.seek(SeekFrom::Start(to)).map_err(io_error)?;
    Ok(())
}

fn io_error(error: std::io::Error) -> SourceError {
    SourceErrorKind::Io(error).into()
}

fn truncated(what: &str, length: u64) -> SourceError {
    let what = what.to_owned();
    SourceError::new(SourceErrorKind::Truncated { what }, Position::Byte(length))
}

fn bad_header(reason: String) -> SourceError {
    let format = Format::Las;
    SourceErrorKind::Header { format, reason }.into()
}

fn error(error: Error, position: Position) -> SourceError {
    let kind = match error {
        Error::Io(e) if e.kind() == ErrorKind::UnexpectedEof => SourceErrorKind::Truncated {
            what: "the points".to_owned(),
        },
        Error::Io(e) if e.kind() != ErrorKind::Other => SourceErrorKind::Io(e),
        other => SourceErrorKind::Header {
            format: Format::Las,
            reason: other.to_string(),
        },
    };
    SourceError::new(kind, position)
}
