//! Columns of text: XYZ, TXT, CSV, ASC, PTS, XYZRGB, XYZN. The rules are in the crate's documentation.
//!
//! The parser is our own because the csv crate neither takes runs of blanks as one separator nor
//! bounds the length of a record.

mod triple;

use crate::collector::{Collector, Layout, Sample};
use crate::error::Result;
use crate::input::Input;
use crate::scalar::{Scalar, excerpt, parse_number};
use crate::slot::{Column, Columns, Slot};
use crate::{Format, RawCloud, ReadOptions, SourceErrorKind};
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
    /// Names of the columns.
    header: Option<Vec<String>>,
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
            let names = names(comment);
            if self.table.is_none() && is_header(&names) {
                self.header = Some(names);
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
            return self.take_header(line);
        }
        // CloudCompare writes the count behind the names.
        if fields == 1 && !self.counted {
            self.counted = true;
            return Ok(());
        }
        let mut table = match &self.header {
            Some(names) => Table::named(separator, names, self.options),
            None if self.assumed.is_empty() => Table::unnamed(separator, fields, self.options)?,
            None => Table::assumed(separator, self.assumed, self.options),
        };
        table.line(line)?;
        self.table = Some(table);
        Ok(())
    }

    fn take_header(&mut self, line: &[u8]) -> Outcome<()> {
        let names = names(line);
        if self.header.is_some() || !is_header(&names) {
            return Err(SourceErrorKind::Header {
                format: Format::Text,
                reason: format!(
                    "expected numbers, or the names of columns with x, y and z among them, found `{}`",
                    excerpt(line)
                ),
            });
        }
        self.header = Some(names);
        Ok(())
    }
}

/// The words of a header line, without quotes. Between tabs, a name may have blanks.
fn names(line: &[u8]) -> Vec<String> {
    let separator = Separator::of(line);
    if separator == Separator::Blanks && line.contains(&b'\t') {
        let names: Vec<String> = line.split(|b| *b == b'\t').map(name).collect();
        if is_header(&names) {
            return names;
        }
    }
    separator.fields(line).map(name).collect()
}

fn name(field: &[u8]) -> String {
    let name = String::from_utf8_lossy(field);
    name.trim_matches(|c: char| c == '"' || c == '\'' || c.is_whitespace())
        .to_owned()
}

fn is_header(names: &[String]) -> bool {
    named_columns(names).has_position()
}

fn named_columns(names: &[String]) -> Columns {
    Columns::new(names.iter().enumerate().filter_map(|(place, name)| {
        let slot = Slot::from_name(name)?;
        let packed = matches!(slot, Slot::PackedRgb | Slot::PackedRgba);
        (!packed).then_some(Column {
            slot,
            scalar: Scalar::F64,
            place,
        })
    }))
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
        if self == Self::Semicolon && field.contains(&b',') {
            let mut with_point = field.to_vec();
            for byte in with_point.iter_mut().filter(|b| **b == b',') {
                *byte = b'.';
            }
            return parse_number(&with_point);
        }
        parse_number(field)
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
        let columns = named_columns(&["x", "y", "z"].map(str::to_owned));
        Ok(Self {
            separator,
            width,
            exact: true,
            triples,
            collector: Collector::new(Layout::of(&columns, options), 0, options),
            columns,
            fields: Vec::new(),
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
            return Err(SourceErrorKind::Value { reason });
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
        match (triples.next(), triples.next()) {
            (None, _) => {}
            (Some(only), None) if only.is_color() => cloud.colors = Some(only.into_colors()),
            (Some(only), None) if width == 6 && only.is_normal() => {
                cloud.normals = Some(only.into_normals());
            }
            (Some(_), None) if width == 6 => {
                return Err(unclear(
                    "the last three of six columns without names are neither colours (whole numbers from 0 to 255) nor normals (of length 1)",
                ));
            }
            (Some(_), None) => {
                return Err(unclear(
                    "the last three of seven columns without names are no colours (whole numbers from 0 to 255)",
                ));
            }
            (Some(first), Some(second)) => {
                let fit = |color: &Triple, normal: &Triple| {
                    color.is_color() && (normal.is_normal() || normal.is_missing())
                };
                let (color, normal) = if fit(&first, &second) {
                    (first, second)
                } else if fit(&second, &first) {
                    (second, first)
                } else {
                    return Err(unclear(
                        "the last six of nine columns without names are not colours (whole numbers from 0 to 255) and normals (of length 1)",
                    ));
                };
                cloud.colors = Some(color.into_colors());
                cloud.normals = Some(normal.into_normals());
            }
        }
        Ok(cloud)
    }
}

fn unclear(what: &str) -> SourceErrorKind {
    let what = what.to_owned();
    SourceErrorKind::UnnamedColumns { what }
}
