//! Names of the columns of text.

use super::Separator;
use crate::scalar::Scalar;
use crate::slot::{Column, Columns, Slot};

/// A line that names columns.
pub(super) struct Header {
    pub(super) names: Vec<String>,
    pub(super) is_comment: bool,
    /// Whether nothing but blanks is between the names: then a name of two words counts twice.
    of_words: bool,
}

impl Header {
    /// The names in a line, without quotes, if x, y and z are among them. What ends in a colon before them is no name.
    /// Between tabs, a name may have blanks.
    pub(super) fn of(line: &[u8], is_comment: bool) -> Option<Self> {
        let label = line.iter().position(|b| *b == b':');
        let labelled = label.and_then(|at| Self::in_line(&line[at + 1..], is_comment));
        labelled.or_else(|| Self::in_line(line, is_comment))
    }

    fn in_line(line: &[u8], is_comment: bool) -> Option<Self> {
        let line = line.trim_ascii();
        let separator = Separator::of(line);
        let of_words = separator == Separator::Blanks;
        let between_tabs = || line.split(|b| *b == b'\t').map(name).collect();
        let between_separators = || separator.fields(line).map(name).collect();
        let header = |names, of_words| Self {
            names,
            is_comment,
            of_words,
        };
        let names_position = |header: &Self| named_columns(&header.names).has_position();
        (of_words && line.contains(&b'\t'))
            .then(|| header(between_tabs(), false))
            .filter(names_position)
            .or_else(|| Some(header(between_separators(), of_words)).filter(names_position))
    }

    /// Whether each of so many columns of a line has a name. Columns at its end may be empty.
    pub(super) fn names_all(&self, columns: usize) -> bool {
        let names = self.names.len();
        names == columns || names > columns && !self.of_words
    }
}

fn name(field: &[u8]) -> String {
    let name = String::from_utf8_lossy(field);
    name.trim_matches(|c: char| c == '"' || c == '\'' || c.is_whitespace())
        .to_owned()
}

/// The columns with these names that are kept.
pub(super) fn named_columns(names: &[String]) -> Columns {
    Columns::new(names.iter().enumerate().filter_map(|(place, name)| {
        let slot = Slot::from_name(name)?;
        (!slot.is_packed()).then_some(Column {
            slot,
            scalar: Scalar::F64,
            place,
        })
    }))
}
