//! The byte stream that the parsers read: buffered, bounded, with position and progress.

use crate::error::Result;
use crate::{Position, Progress, SourceError, SourceErrorKind};
use std::cell::Cell;
use std::io::{self, ErrorKind, Read};
use std::rc::Rc;

/// Bytes fetched at once, and the most that [`Input::bytes`] can give.
pub(crate) const BUFFER_SIZE: usize = 1 << 17;

/// Bytes of a stream that tell whether it is packed.
pub(crate) const GZIP_START: usize = 4;

/// Whether a stream that starts so is packed with gzip (RFC 1952): its mark, the only method there is, and flags whose
/// reserved bits are zero. As an `f32`, which files without a header start with, this is less than 10⁻¹⁹.
pub(crate) fn is_gzip(start: &[u8]) -> bool {
    const RESERVED: u8 = 0b1110_0000;
    matches!(start, [0x1f, 0x8b, 8, flags, ..] if flags & RESERVED == 0)
}

/// Longest line in bytes: a face with some ten thousand corners fits.
pub(crate) const MAX_LINE: usize = BUFFER_SIZE;

/// Counts the bytes that are read from a source, before decompression.
pub(crate) struct Counted<R> {
    source: R,
    count: Rc<Cell<u64>>,
}

impl<R> Counted<R> {
    pub(crate) fn new(source: R) -> Self {
        Self {
            source,
            count: Rc::default(),
        }
    }

    pub(crate) fn counter(&self) -> Rc<Cell<u64>> {
        Rc::clone(&self.count)
    }
}

impl<R: Read> Read for Counted<R> {
    fn read(&mut self, target: &mut [u8]) -> io::Result<usize> {
        let count = self.source.read(target)?;
        self.count.set(self.count.get() + count as u64);
        Ok(count)
    }
}

/// A stream of uncompressed bytes.
pub(crate) struct Input<'a> {
    source: Box<dyn Read + 'a>,
    buffer: Box<[u8]>,
    /// The unread part of `buffer`.
    start: usize,
    end: usize,
    at_end: bool,
    /// Bytes of the stream up to `buffer[start]`.
    offset: u64,
    /// Lines read so far.
    lines: u64,
    gzip: bool,
    /// Points read so far, for progress.
    pub(crate) points_read: u64,
    bytes_read: Rc<Cell<u64>>,
    total_bytes: Option<u64>,
    progress: &'a mut dyn FnMut(Progress),
}

impl<'a> Input<'a> {
    pub(crate) fn new(
        source: Box<dyn Read + 'a>,
        gzip: bool,
        bytes_read: Rc<Cell<u64>>,
        total_bytes: Option<u64>,
        progress: &'a mut dyn FnMut(Progress),
    ) -> Self {
        Self {
            source,
            buffer: vec![0; BUFFER_SIZE].into_boxed_slice(),
            start: 0,
            end: 0,
            at_end: false,
            offset: 0,
            lines: 0,
            gzip,
            points_read: 0,
            bytes_read,
            total_bytes,
            progress,
        }
    }

    /// Tells how far reading has come.
    pub(crate) fn report(&mut self) {
        (self.progress)(Progress {
            bytes_read: self.bytes_read.get(),
            total_bytes: self.total_bytes,
            points_read: self.points_read,
        });
    }

    /// Position of the next byte.
    pub(crate) fn byte_position(&self) -> Position {
        Position::Byte(self.offset)
    }

    /// Position of the line read last.
    pub(crate) fn line_position(&self) -> Position {
        Position::Line(self.lines)
    }

    /// An error about the line read last.
    pub(crate) fn error_at_line(&self, kind: SourceErrorKind) -> SourceError {
        kind.at(self.line_position())
    }

    /// An error about the next byte.
    pub(crate) fn error_at_byte(&self, kind: SourceErrorKind) -> SourceError {
        kind.at(self.byte_position())
    }

    fn truncated(&self, what: &str) -> SourceError {
        let end = self.offset + (self.end - self.start) as u64;
        SourceErrorKind::truncated(what).at(Position::Byte(end))
    }

    /// Fetches more bytes behind the unread ones; there must be room, or none unread.
    fn fetch(&mut self) -> Result<()> {
        self.buffer.copy_within(self.start..self.end, 0);
        self.end -= self.start;
        self.start = 0;
        while self.end < self.buffer.len() && !self.at_end {
            match self.source.read(&mut self.buffer[self.end..]) {
                Ok(0) => self.at_end = true,
                Ok(count) => {
                    self.end += count;
                    break;
                }
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(self.source_error(error)),
            }
        }
        self.report();
        Ok(())
    }

    fn source_error(&self, error: io::Error) -> SourceError {
        let compressed = matches!(
            error.kind(),
            ErrorKind::InvalidInput | ErrorKind::InvalidData | ErrorKind::UnexpectedEof
        );
        let kind = if self.gzip && compressed {
            SourceErrorKind::Compression {
                reason: format!("gzip: {error}"),
            }
        } else {
            SourceErrorKind::Io(error)
        };
        self.error_at_byte(kind)
    }

    fn advance(&mut self, count: usize) {
        self.start += count;
        self.offset += count as u64;
    }

    /// The next up to `count` bytes, without reading past them; fewer only at the end.
    pub(crate) fn peek(&mut self, count: usize) -> Result<&[u8]> {
        let count = count.min(BUFFER_SIZE);
        while self.end - self.start < count && !self.at_end {
            self.fetch()?;
        }
        Ok(&self.buffer[self.start..self.end.min(self.start + count)])
    }

    /// The next `count` bytes (at most [`BUFFER_SIZE`]) of `what`.
    #[inline]
    pub(crate) fn bytes(&mut self, count: usize, what: &str) -> Result<&[u8]> {
        if self.end - self.start < count && self.peek(count)?.len() < count {
            return Err(self.truncated(what));
        }
        let start = self.start;
        self.advance(count);
        Ok(&self.buffer[start..start + count])
    }

    /// As many whole records of `size` bytes as are at hand: at least 1, at most `count`.
    pub(crate) fn records(&mut self, size: usize, count: u64, what: &str) -> Result<&[u8]> {
        if self.end - self.start < size && self.peek(size)?.len() < size {
            return Err(self.truncated(what));
        }
        let at_hand = ((self.end - self.start) / size) as u64;
        // Fits: no more than the buffer holds.
        let length = at_hand.min(count) as usize * size;
        self.bytes(length, what)
    }

    /// Passes over `count` bytes of `what`.
    pub(crate) fn skip(&mut self, mut count: u64, what: &str) -> Result<()> {
        while count > 0 {
            let at_hand = self.peek(1)?.len();
            if at_hand == 0 {
                return Err(self.truncated(what));
            }
            let step = ((self.end - self.start) as u64).min(count);
            self.advance(step as usize);
            count -= step;
        }
        Ok(())
    }

    /// All `count` bytes of `what`; memory grows with the data that really comes.
    pub(crate) fn gather(&mut self, count: u64, what: &str) -> Result<Vec<u8>> {
        let mut gathered = Vec::new();
        while (gathered.len() as u64) < count {
            let left = count - gathered.len() as u64;
            let step = left.min(BUFFER_SIZE as u64 / 2) as usize;
            gathered.extend_from_slice(self.bytes(step, what)?);
        }
        Ok(gathered)
    }

    /// The next line without its end (`\n` or `\r\n`), or `None` at the end of the stream.
    pub(crate) fn line(&mut self) -> Result<Option<&[u8]>> {
        let mut searched = 0;
        let (length, line_end) = loop {
            let unread = &self.buffer[self.start..self.end];
            if let Some(i) = unread[searched..].iter().position(|b| *b == b'\n') {
                break (searched + i, 1);
            }
            if self.at_end {
                break (unread.len(), 0);
            }
            searched = unread.len();
            if searched >= MAX_LINE {
                self.lines += 1;
                let kind = SourceErrorKind::LineTooLong { limit: MAX_LINE };
                return Err(self.error_at_line(kind));
            }
            self.fetch()?;
        };
        if length == 0 && line_end == 0 {
            return Ok(None);
        }
        self.lines += 1;
        let start = self.start;
        self.advance(length + line_end);
        let line = &self.buffer[start..start + length];
        Ok(Some(line.strip_suffix(b"\r").unwrap_or(line)))
    }

    /// After the last datum: if the stream is packed, reads on to its checksum, unless too far.
    pub(crate) fn finish(&mut self) -> Result<()> {
        const MAX_TRAILING: u64 = 1 << 20;
        if self.gzip {
            let limit = self.offset + MAX_TRAILING;
            while self.offset < limit && !self.peek(1)?.is_empty() {
                self.advance(self.end - self.start);
            }
        }
        self.report();
        Ok(())
    }
}

/// For formats that need random access.
#[cfg(any(feature = "las", feature = "e57"))]
impl Input<'_> {
    /// Whether the stream is decompressed on the way.
    pub(crate) fn is_gzip(&self) -> bool {
        self.gzip
    }

    /// Tells how far reading has come past this stream: `done` of `total` records.
    pub(crate) fn report_share(&mut self, done: u64, total: u64) {
        if let Some(total_bytes) = self.total_bytes {
            let share = done as f64 / total.max(1) as f64;
            let bytes = (total_bytes as f64 * share) as u64;
            self.bytes_read.set(self.bytes_read.get().max(bytes));
        }
        self.report();
    }

    /// All that is left, or `None` if it is more than `limit` bytes.
    pub(crate) fn rest(&mut self, limit: u64) -> Result<Option<Vec<u8>>> {
        let mut gathered = Vec::new();
        while !self.peek(1)?.is_empty() {
            if gathered.len() as u64 + (self.end - self.start) as u64 > limit {
                return Ok(None);
            }
            gathered.extend_from_slice(&self.buffer[self.start..self.end]);
            self.advance(self.end - self.start);
        }
        Ok(Some(gathered))
    }
}
