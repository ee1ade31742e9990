//! Random access to a file, for the formats that need it.

use crate::error::Result;
use crate::input::Input;
use crate::{Format, SourceError, SourceErrorKind};
use std::any::Any;
use std::fs::File;
use std::io::{BufReader, Cursor, Read, Seek};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

/// Most bytes of a stream that are held in memory.
const MAX_HELD: u64 = 1 << 30;

/// Bytes that can be read in any order.
pub(crate) trait ReadSeek: Read + Seek + Send + Sync {}
impl<T: Read + Seek + Send + Sync> ReadSeek for T {}

/// Opens `path` anew, or holds all of the stream in memory if it has no path or is packed. Also
/// tells the number of bytes.
pub(crate) fn open(
    input: &mut Input<'_>,
    path: Option<&Path>,
    format: Format,
) -> Result<(Box<dyn ReadSeek>, u64)> {
    if let Some(path) = path.filter(|_| !input.is_gzip()) {
        let io_error = |error| SourceError::from(SourceErrorKind::Io(error));
        let file = File::open(path).map_err(io_error)?;
        let metadata = file.metadata().map_err(io_error)?;
        if metadata.is_file() {
            return Ok((Box::new(BufReader::new(file)), metadata.len()));
        }
    }
    let limit = MAX_HELD;
    let held = input
        .rest(limit)?
        .ok_or(SourceErrorKind::StreamTooLarge { format, limit })?;
    let length = held.len() as u64;
    Ok((Box::new(Cursor::new(held)), length))
}

/// Runs a parser that is not ours: should damaged data make it panic, that becomes an error.
///
/// The process' panic hook still runs, and where panics abort the process, they still do.
pub(crate) fn guarded<T>(format: Format, parse: impl FnOnce() -> Result<T>) -> Result<T> {
    // Whatever `parse` was in the middle of is dropped with it.
    catch_unwind(AssertUnwindSafe(parse)).unwrap_or_else(|panic| {
        let reason = format!("its parser gave up: {}", message(panic.as_ref()));
        Err(SourceErrorKind::header(format, reason).into())
    })
}

fn message(panic: &(dyn Any + Send)) -> &str {
    panic
        .downcast_ref::<&str>()
        .copied()
        .or_else(|| panic.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no reason given")
}
