//! The header: fields, number of points, encoding.

use crate::error::Result;
use crate::input::{BUFFER_SIZE, Input};
use crate::scalar::{Scalar, excerpt};
use crate::slot::{Column, Columns, Slot};
use crate::{Format, header};
use tldi::glamx::DVec3;

/// How the data after the header is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Binary,
    BinaryCompressed,
}

/// One or several values of a point.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) name: String,
    pub(super) scalar: Scalar,
    /// Number of values.
    pub(super) count: usize,
}

impl Field {
    /// Size in bytes.
    pub(super) fn size(&self) -> usize {
        self.scalar.size() * self.count
    }
}

/// All that the header says.
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) fields: Vec<Field>,
    pub(super) points: u64,
    /// Where the sensor was. Unless it is turned, only of points in rows and columns: CloudCompare writes its
    /// global shift as the viewpoint of all others. Never the default, which most files have whatever the truth.
    pub(super) viewpoint: Option<DVec3>,
    /// Columns and rows, where there are several rows.
    pub(super) size: Option<[usize; 2]>,
}

impl Header {
    pub(super) fn read(input: &mut Input<'_>) -> Result<Self> {
        let mut parser = Parser::default();
        header::read(input, Format::Pcd, |line| {
            let encoding = parser.line(line)?;
            encoding
                .map(|encoding| std::mem::take(&mut parser).finish(encoding))
                .transpose()
        })
    }

    /// The fields that are kept: with byte offsets, or with indices into the line in text.
    pub(super) fn columns(&self) -> Columns {
        let mut place = 0;
        let mut kept = Vec::new();
        for field in &self.fields {
            if field.count == 1
                && let Some(slot) = Slot::from_name(&field.name)
                && (field.scalar.size() == 4 || !slot.is_packed())
            {
                // In text, a coordinate may have more digits than its type.
                let is_wide_text =
                    self.encoding == Encoding::Ascii && matches!(slot, Slot::Position(_));
                kept.push(Column {
                    slot,
                    scalar: match field.scalar {
                        Scalar::F32 if is_wide_text => Scalar::F64,
                        scalar => scalar,
                    },
                    place,
                });
            }
            place += match self.encoding {
                Encoding::Ascii => field.count,
                Encoding::Binary | Encoding::BinaryCompressed => field.size(),
            };
        }
        Columns::new(kept)
    }

    /// Size of one point in bytes.
    pub(super) fn record_size(&self) -> usize {
        self.fields.iter().map(Field::size).sum()
    }
}

/// The header so far.
#[derive(Default)]
struct Parser {
    names: Vec<String>,
    sizes: Vec<String>,
    types: Vec<String>,
    counts: Option<Vec<String>>,
    width: Option<u64>,
    height: Option<u64>,
    points: Option<u64>,
    viewpoint: Option<Viewpoint>,
}

impl Parser {
    /// Takes one line; the encoding if it was the last, or what is wrong with it.
    fn line(&mut self, line: &[u8]) -> std::result::Result<Option<Encoding>, String> {
        let line = line.trim_ascii();
        if line.is_empty() || line.starts_with(b"#") {
            return Ok(None);
        }
        let mut words = header::text(line)?.split_ascii_whitespace();
        let key = words.next().unwrap_or_default();
        let mut strings = || words.by_ref().map(str::to_owned).collect::<Vec<_>>();
        match key {
            "VERSION" => {}
            "FIELDS" | "COLUMNS" => self.names = strings(),
            "SIZE" => self.sizes = strings(),
            "TYPE" => self.types = strings(),
            "COUNT" => self.counts = Some(strings()),
            "WIDTH" => self.width = Some(number(key, &strings())?),
            "HEIGHT" => self.height = Some(number(key, &strings())?),
            "POINTS" => self.points = Some(number(key, &strings())?),
            "VIEWPOINT" => self.viewpoint = viewpoint(&strings())?,
            "DATA" => {
                return match strings().join(" ").as_str() {
                    "ascii" => Ok(Some(Encoding::Ascii)),
                    "binary" => Ok(Some(Encoding::Binary)),
                    "binary_compressed" => Ok(Some(Encoding::BinaryCompressed)),
                    other => Err(format!("unknown DATA `{}`", excerpt(other.as_bytes()))),
                };
            }
            _ => return Err(format!("cannot understand `{}`", excerpt(line))),
        }
        Ok(None)
    }

    fn finish(mut self, encoding: Encoding) -> std::result::Result<Header, String> {
        let fields = self.names.len();
        // Old files have neither line: all numbers are floats.
        if self.sizes.is_empty() && self.types.is_empty() {
            self.sizes = vec!["4".to_owned(); fields];
            self.types = vec!["F".to_owned(); fields];
        }
        let same = |lengths: usize| lengths == fields;
        if !same(self.sizes.len())
            || !same(self.types.len())
            || !self.counts.as_ref().is_none_or(|c| same(c.len()))
        {
            return Err("FIELDS, SIZE, TYPE and COUNT differ in length".to_owned());
        }
        let mut header = Header {
            encoding,
            fields: Vec::new(),
            points: self.points()?,
            viewpoint: (self.viewpoint.as_ref())
                .filter(|viewpoint| viewpoint.is_turned || self.size().is_some())
                .map(|viewpoint| viewpoint.position),
            size: self.size(),
        };
        // Together less than this, a record fits into the buffer.
        let mut left = BUFFER_SIZE;
        for (index, name) in self.names.into_iter().enumerate() {
            let scalar = scalar(&self.types[index], &self.sizes[index])?;
            let count = match &self.counts {
                None => 1,
                Some(counts) => number("COUNT", &counts[index..=index])?,
            };
            let count = usize::try_from(count).unwrap_or(usize::MAX);
            left = count
                .checked_mul(scalar.size())
                .and_then(|size| left.checked_sub(size))
                .ok_or_else(|| format!("a point has more than {BUFFER_SIZE} bytes"))?;
            header.fields.push(Field {
                name,
                scalar,
                count,
            });
        }
        Ok(header)
    }

    fn size(&self) -> Option<[usize; 2]> {
        let [width, height] = [self.width?, self.height?].map(usize::try_from);
        height
            .ok()
            .filter(|height| *height > 1)
            .zip(width.ok())
            .map(|(height, width)| [width, height])
    }

    fn points(&self) -> std::result::Result<u64, String> {
        let product = match (self.width, self.height) {
            (Some(width), Some(height)) => {
                let product = width.checked_mul(height);
                Some(product.ok_or("WIDTH × HEIGHT is too large")?)
            }
            (Some(width), None) => Some(width),
            (None, _) => None,
        };
        match (self.points, product) {
            (Some(points), Some(product)) if points != product => Err(format!(
                "POINTS is {points}, but WIDTH × HEIGHT is {product}"
            )),
            (Some(points), _) | (None, Some(points)) => Ok(points),
            (None, None) => Err("there is neither POINTS nor WIDTH".to_owned()),
        }
    }
}

fn number(key: &str, words: &[String]) -> std::result::Result<u64, String> {
    let text = words.first().map_or("", String::as_str);
    text.parse()
        .map_err(|_| format!("{key} `{}` is no count", excerpt(text.as_bytes())))
}

/// The pose of the sensor.
struct Viewpoint {
    position: DVec3,
    is_turned: bool,
}

/// From translation and quaternion (w first); none if it is the default, or not finite.
fn viewpoint(words: &[String]) -> std::result::Result<Option<Viewpoint>, String> {
    let values: Option<Vec<f64>> = words.iter().map(|w| w.parse().ok()).collect();
    let Some([x, y, z, _, turn @ ..]) = values.as_deref().filter(|v| v.len() == 7) else {
        return Err("VIEWPOINT needs seven numbers".to_owned());
    };
    let position = DVec3::new(*x, *y, *z);
    let is_turned = turn != [0.0; 3];
    let is_default = position == DVec3::ZERO && !is_turned;
    Ok((position.is_finite() && !is_default).then_some(Viewpoint {
        position,
        is_turned,
    }))
}

fn scalar(kind: &str, size: &str) -> std::result::Result<Scalar, String> {
    // PCL takes letters of either case; `B` is its bool.
    Ok(match (kind.to_ascii_uppercase().as_str(), size) {
        ("I", "1") => Scalar::I8,
        ("U" | "B", "1") => Scalar::U8,
        ("I", "2") => Scalar::I16,
        ("U", "2") => Scalar::U16,
        ("I", "4") => Scalar::I32,
        ("U", "4") => Scalar::U32,
        ("I", "8") => Scalar::I64,
        ("U", "8") => Scalar::U64,
        ("F", "4") => Scalar::F32,
        ("F", "8") => Scalar::F64,
        _ => {
            let kind = excerpt(kind.as_bytes());
            let size = excerpt(size.as_bytes());
            return Err(format!("unknown TYPE `{kind}` of SIZE `{size}`"));
        }
    })
}
