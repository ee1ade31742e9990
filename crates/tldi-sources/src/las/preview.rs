//! What a header says about sizes, read before anything trusts it.

use crate::error::Result;
use crate::scalar::unsigned;
use crate::seekable::ReadSeek;
use crate::{Format, Position, SourceError, SourceErrorKind};
use std::io::SeekFrom;

/// What a header says about sizes, checked against the length of the file.
pub(super) struct Preview {
    pub(super) length: u64,
    pub(super) offset_to_points: u64,
    pub(super) record_length: u64,
    pub(super) points: u64,
}

impl Preview {
    pub(super) fn read(source: &mut dyn ReadSeek, length: u64) -> Result<Self> {
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
        let u64_at = |at: usize| unsigned(&header[at..at + 8]);
        let u32_at = |at: usize| unsigned(&header[at..at + 4]);
        let legacy_points = u32_at(107);
        let preview = Self {
            length,
            offset_to_points: u32_at(96),
            record_length: unsigned(&header[105..107]).max(1),
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
            let points = preview.points;
            return Err(bad_header(format!(
                "it tells of {points} points: it is damaged, or the file must be split"
            )));
        }
        if is_extended && u32_at(243) > 0 {
            let start = u64_at(235);
            let head = bytes(source, start, EVLR_HEAD as usize, length)?;
            let size = unsigned(&head[20..28]);
            if size > length - start - EVLR_HEAD {
                return Err(truncated("an extended variable-length record", length));
            }
        }
        Ok(preview)
    }

    /// Where uncompressed points end.
    pub(super) fn end_of_points(&self) -> u64 {
        // No overflow: at most 2³² + 2³⁶ × 2¹⁶.
        self.offset_to_points + self.points * self.record_length
    }
}

/// `count` bytes at `start`, if the file of `length` bytes has them.
pub(super) fn bytes(
    source: &mut dyn ReadSeek,
    start: u64,
    count: usize,
    length: u64,
) -> Result<Vec<u8>> {
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

pub(super) fn seek(source: &mut dyn ReadSeek, to: u64) -> Result<()> {
    source.seek(SeekFrom::Start(to)).map_err(io_error)?;
    Ok(())
}

fn io_error(error: std::io::Error) -> SourceError {
    SourceErrorKind::Io(error).into()
}

pub(super) fn truncated(what: &str, length: u64) -> SourceError {
    SourceErrorKind::truncated(what).at(Position::Byte(length))
}

pub(super) fn bad_header(reason: impl Into<String>) -> SourceError {
    SourceErrorKind::header(Format::Las, reason).into()
}
