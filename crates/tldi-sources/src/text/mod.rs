//! Columns of text: XYZ, TXT, CSV, ASC, PTS, XYZRGB, XYZN. The rules are in the crate's documentation.
//!
//! The parser is our own because the csv crate neither takes runs of blanks as one separator nor
//! bounds the length of a record.

mod header;
mod triple;

use crate::collector::{Collector, Layout, Sample};
use crate::error::Result;
use crate::input::Input;
use crate::scalar::{excerpt, parse_number};
use crate::slot::Columns;
use crate::{Format, RawCloud, ReadOptions, SourceErrorKind};
use header::{Header, named_columns};
use triple::Triple;

type Outcome<T> = std::result::Result<T, SourceErrorKind>;

/// Reads all lines. Columns that no line names are `assumed`; if that is empty, their number decides.
pub(crate) fn parse(
    input: &mut Input<'_>,
    options: &ReadOptions,
    assumed: &[&str],
) -> Result<RawCloud> {
    let mut state = State {
        options,
        assumed,
        header: None,
        table: None,
        counted: false,
    };
    while let Some(line) = input.line()? {
        state.line(line).map_err(|kind| input.error_at_line(kind))?;
        if let Some(table) = &state.table {
            input.points_read = table.collector.count();
        }
    }
    let Some(table) = state.table else {
        return Err(SourceErrorKind::NoPoints.into());
    };
    Ok(table.finish()?)
}

/// What has been read.
struct State<'a> {
    options: &'a ReadOptions,
    /// Names of the columns where there is no header.
    assumed: &'a [&'a str],
    header: Option<Header>,
    /// From the first line of data on.
    table: Option<Table>,
    /// Whether a count was passed over.
    counted: bool,
}

impl State<'_> {
    fn line(&mut self, line: &[u8]) -> Outcome<()> {
        const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";
        let line = line.strip_prefix(BYTE_ORDER_MARK).unwrap_or(line);
        let line = line.trim_ascii();
        if line.is_empty() {
            return Ok(());
        }
        let comment = line.strip_prefix(b"#").or(line.strip_prefix(b"//"));
        if let Some(comment) = comment {
            if self.table.is_none()
                && let Some(header) = Header::of(comment, true)
            {
                self.header = Some(header);
            }
            return Ok(());
        }
        if let Some(table) = &mut self.table {
            return table.line(line);
        }
        let separator = Separator::of(line);
        let fields = separator.fields(line).count();
        let first = separator.fields(line).next().unwrap_or_default();
        if separator.number(first).is_err() {
            let is_named = |header: &Header| !header.is_comment;
            match (Header::of(line, false), &self.header) {
                (Some(header), found) if !found.as_ref().is_some_and(is_named) => {
                    self.header = Some(header);
                    return Ok(());
                }
                // The first column has words.
                (None, Some(_)) => {}
                _ => return Err(no_header(line)),
            }
        }
        // CloudCompare writes the count behind the names.
        if fields == 1 && !self.counted {
            self.counted = true;
            return Ok(());
        }
        // A comment with another number of words is a sentence.
        let is_sentence = |header: &Header| header.is_comment && !header.names_all(fields);
        let header = self.header.as_ref().filter(|header| !is_sentence(header));
        let mut table = match header {
            Some(header) => Table::named(separator, &header.names, self.options),
            None if self.assumed.is_empty() => Table::unnamed(separator, fields, self.options)?,
            None => Table::assumed(separator, self.assumed, self.options),
        };
        table.line(line)?;
        if let Some(header) = header.filter(|header| !header.names_all(fields)) {
            let names = header.names.len();
            let what = format!("{names} names stand over {fields} columns");
            return Err(SourceErrorKind::UnnamedColumns { what });
        }
        self.table = Some(table);
        Ok(())
    }
}

fn no_header(line: &[u8]) -> SourceErrorKind {
    let found = excerpt(line);
    let reason = format!(
        "expected numbers, or the names of columns with x, y and z among them, found `{found}`"
    );
    SourceErrorKind::header(Format::Text, reason)
}

/// What is between columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Separator {
    /// Semicolons; a comma is the decimal mark.
    Semicolon,
    Comma,
    Blanks,
}

impl Separator {
    /// The one that a line uses.
    fn of(line: &[u8]) -> Self {
        if line.contains(&b';') {
            Self::Semicolon
        } else if line.contains(&b',') {
            Self::Comma
        } else {
            Self::Blanks
        }
    }

    fn separates(self, byte: u8) -> bool {
        match self {
            Self::Semicolon => byte == b';',
            Self::Comma => byte == b',',
            Self::Blanks => byte.is_ascii_whitespace(),
        }
    }

    /// The fields of a trimmed line. One separator at its end is passed over.
    fn fields(self, line: &[u8]) -> impl Iterator<Item = &[u8]> {
        let line = match line.split_last() {
            Some((last, rest)) if self.separates(*last) => rest,
            _ => line,
        };
        line.split(move |b| self.separates(*b))
            .filter(move |field| self != Self::Blanks || !field.is_empty())
            .map(<[u8]>::trim_ascii)
    }

    fn number(self, field: &[u8]) -> Outcome<f64> {
        if self != Self::Semicolon || !field.contains(&b',') {
            return parse_number(field);
        }
        let point = |byte: &u8| if *byte == b',' { b'.' } else { *byte };
        let with_point: Vec<u8> = field.iter().map(point).collect();
        parse_number(&with_point)
    }
}

/// The data.
struct Table {
    separator: Separator,
    columns: Columns,
    /// Columns in every line if `exact`; else at least those that are kept.
    width: usize,
    exact: bool,
    /// Columns whose meaning shows at the end.
    triples: Vec<Triple>,
    collector: Collector,
    /// The numbers of one line.
    fields: Vec<f64>,
}

impl Table {
    fn named(separator: Separator, names: &[String], options: &ReadOptions) -> Self {
        let columns = named_columns(names);
        let width = columns.0.iter().map(|c| c.place + 1).max().unwrap_or(0);
        Self {
            separator,
            width,
            exact: false,
            triples: Vec::new(),
            collector: Collector::new(Layout::of(&columns, options), 0, options),
            columns,
            fields: Vec::new(),
        }
    }

    /// With these columns and no others.
    fn assumed(separator: Separator, names: &[&str], options: &ReadOptions) -> Self {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        Self {
            exact: true,
            ..Self::named(separator, &names, options)
        }
    }

    fn unnamed(separator: Separator, width: usize, options: &ReadOptions) -> Outcome<Self> {
        let triples = match width {
            3 | 4 => Vec::new(),
            6 => vec![Triple::new(3..6)],
            7 => vec![Triple::new(4..7)],
            9 => vec![Triple::new(3..6), Triple::new(6..9)],
            _ => {
                let what = format!("{width} columns without names could mean anything");
                return Err(SourceErrorKind::UnnamedColumns { what });
            }
        };
        Ok(Self {
            width,
            triples,
            ..Self::assumed(separator, &["x", "y", "z"], options)
        })
    }

    fn line(&mut self, line: &[u8]) -> Outcome<()> {
        self.fields.clear();
        let mut found = 0;
        for field in self.separator.fields(line) {
            found += 1;
            if found > self.width {
                break;
            }
            let place = found - 1;
            let kept = self.columns.0.iter().any(|c| c.place == place)
                || self.triples.iter().any(|t| t.contains(place));
            self.fields.push(if kept {
                self.separator.number(field)?
            } else {
                0.0
            });
        }
        if found < self.width || found > self.width && self.exact {
            let width = self.width;
            let reason = format!("the line does not have the expected {width} columns");
            return Err(SourceErrorKind::value(reason));
        }
        let mut sample = Sample::EMPTY;
        for column in &self.columns.0 {
            sample.set(column.slot, self.fields[column.place]);
        }
        self.collector.push(&sample)?;
        for triple in &mut self.triples {
            triple.push(&self.fields);
        }
        Ok(())
    }

    fn finish(self) -> Outcome<RawCloud> {
        let width = self.width;
        let mut cloud = self.collector.finish()?;
        let mut triples = self.triples.into_iter();
        let (color, normal) = match (triples.next(), triples.next()) {
            (None, _) => (None, None),
            (Some(only), None) if only.is_color() => (Some(only), None),
            (Some(only), None) if width == 6 && only.is_normal() => (None, Some(only)),
            (Some(first), Some(second)) if fit(&first, &second) => (Some(first), Some(second)),
            (Some(first), Some(second)) if fit(&second, &first) => (Some(second), Some(first)),
            _ => {
                let what = match width {
                    6 => "the last three of six columns without names are neither colours (whole numbers from 0 to 255) nor normals (of length 1)",
                    7 => "the last three of seven columns without names are no colours (whole numbers from 0 to 255)",
                    _ => "the last six of nine columns without names are not colours (whole numbers from 0 to 255) and normals (of length 1)",
                }
                .to_owned();
                return Err(SourceErrorKind::UnnamedColumns { what });
            }
        };
        cloud.colors = color.map(Triple::into_colors).or(cloud.colors);
        cloud.normals = normal.map(Triple::into_normals).or(cloud.normals);
        Ok(cloud)
    }
}

/// Whether the columns of one triple are colours, and those of the other normals.
fn fit(color: &Triple, normal: &Triple) -> bool {
    color.is_color() && (normal.is_normal() || normal.is_missing())
}
