//! What the headers of PLY and PCD have in common: lines of text until one of them is the last.

use crate::error::Result;
use crate::input::Input;
use crate::scalar::excerpt;
use crate::{Format, SourceErrorKind};

/// Most lines that a header may have.
const MAX_LINES: usize = 10_000;

/// Hands lines to `take` until that has the whole header, or says what is wrong with the line.
pub(crate) fn read<H>(
    input: &mut Input<'_>,
    format: Format,
    mut take: impl FnMut(&[u8]) -> std::result::Result<Option<H>, String>,
) -> Result<H> {
    for _ in 0..MAX_LINES {
        let Some(line) = input.line()? else {
            return Err(input.error_at_line(SourceErrorKind::truncated("the header")));
        };
        match take(line) {
            Ok(None) => {}
            Ok(Some(header)) => return Ok(header),
            Err(reason) => return Err(input.error_at_line(SourceErrorKind::header(format, reason))),
        }
    }
    let reason = format!("it has more than {MAX_LINES} lines");
    Err(input.error_at_line(SourceErrorKind::header(format, reason)))
}

/// A line of a header as text, or what is wrong with it.
pub(crate) fn text(line: &[u8]) -> std::result::Result<&str, String> {
    std::str::from_utf8(line).map_err(|_| format!("expected text, found `{}`", excerpt(line)))
}
