//! The header: encoding, elements and their properties.

use crate::error::Result;
use crate::input::Input;
use crate::scalar::{Endian, Scalar, excerpt};
use crate::{Format, header};

/// How the data after the header is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Encoding {
    Ascii,
    Binary(Endian),
}

/// One or several values of an element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    One(Scalar),
    List { count: Scalar, item: Scalar },
}

/// A property of an element.
#[derive(Clone, Debug)]
pub(super) struct Property {
    pub(super) name: String,
    pub(super) kind: Kind,
}

/// What an element is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Role {
    Vertices,
    Faces,
    Other,
}

/// A run of records of the same kind.
#[derive(Clone, Debug)]
pub(super) struct Element {
    pub(super) name: String,
    pub(super) role: Role,
    pub(super) count: u64,
    pub(super) properties: Vec<Property>,
}

impl Element {
    /// The property with the corners of a face.
    pub(super) fn corner_list(&self) -> Option<usize> {
        if self.role != Role::Faces {
            return None;
        }
        self.properties.iter().position(|p| {
            matches!(p.kind, Kind::List { .. })
                && ["vertex_indices", "vertex_index"].contains(&p.name.as_str())
        })
    }
}

/// All that the header says.
pub(super) struct Header {
    pub(super) encoding: Encoding,
    pub(super) elements: Vec<Element>,
}

impl Header {
    pub(super) fn read(input: &mut Input<'_>) -> Result<Self> {
        let mut parser = Parser::default();
        header::read(input, Format::Ply, |line| {
            let is_last = parser.line(line)?;
            is_last
                .then(|| std::mem::take(&mut parser).finish())
                .transpose()
        })
    }
}

/// The header so far.
#[derive(Default)]
struct Parser {
    begun: bool,
    encoding: Option<Encoding>,
    elements: Vec<Element>,
}

impl Parser {
    /// Takes one line; whether it was the last, or what is wrong with it.
    fn line(&mut self, line: &[u8]) -> std::result::Result<bool, String> {
        if !self.begun {
            self.begun = line.trim_ascii() == b"ply";
            return if self.begun {
                Ok(false)
            } else {
                Err(format!(
                    "the first line must be `ply`, found `{}`",
                    excerpt(line)
                ))
            };
        }
        // Comments may be in any encoding, all else is ASCII.
        let line = line.trim_ascii();
        if line.is_empty() || line.starts_with(b"comment") || line.starts_with(b"obj_info") {
            return Ok(false);
        }
        let words: Vec<&str> = header::text(line)?.split_ascii_whitespace().collect();
        match words[..] {
            ["end_header"] => return Ok(true),
            ["format", encoding, "1.0"] => self.format(encoding)?,
            ["element", name, count] => self.element(name, count)?,
            ["property", kind, name] => {
                let kind = Kind::One(scalar(kind)?);
                self.property(name, kind)?;
            }
            ["property", "list", count, item, name] => {
                let count = scalar(count)?;
                if !count.is_integer() {
                    return Err(format!("the length of the list `{name}` is no integer"));
                }
                let item = scalar(item)?;
                self.property(name, Kind::List { count, item })?;
            }
            _ => return Err(format!("cannot understand `{}`", excerpt(line))),
        }
        Ok(false)
    }

    fn format(&mut self, encoding: &str) -> std::result::Result<(), String> {
        let encoding = match encoding {
            "ascii" => Encoding::Ascii,
            "binary_little_endian" => Encoding::Binary(Endian::Little),
            "binary_big_endian" => Encoding::Binary(Endian::Big),
            _ => return Err(format!("unknown format `{}`", excerpt(encoding.as_bytes()))),
        };
        if self.encoding.replace(encoding).is_some() {
            return Err("there are two format lines".to_owned());
        }
        Ok(())
    }

    fn element(&mut self, name: &str, count: &str) -> std::result::Result<(), String> {
        let count = count.parse().map_err(|_| {
            let count = excerpt(count.as_bytes());
            format!("`{count}` is no count of elements")
        })?;
        if self.elements.iter().any(|e| e.name == name) {
            let name = excerpt(name.as_bytes());
            return Err(format!("there are two elements `{name}`"));
        }
        self.elements.push(Element {
            name: name.to_owned(),
            role: match name {
                "vertex" => Role::Vertices,
                "face" => Role::Faces,
                _ => Role::Other,
            },
            count,
            properties: Vec::new(),
        });
        Ok(())
    }

    fn property(&mut self, name: &str, kind: Kind) -> std::result::Result<(), String> {
        let Some(element) = self.elements.last_mut() else {
            return Err("a property comes before the first element".to_owned());
        };
        element.properties.push(Property {
            name: name.to_owned(),
            kind,
        });
        Ok(())
    }

    fn finish(self) -> std::result::Result<Header, String> {
        let encoding = self.encoding.ok_or("there is no format line")?;
        for element in &self.elements {
            if let Some(list) = element.corner_list()
                && let Kind::List { item, .. } = element.properties[list].kind
                && !item.is_integer()
            {
                return Err("the corners of faces are no integers".to_owned());
            }
        }
        Ok(Header {
            encoding,
            elements: self.elements,
        })
    }
}

fn scalar(name: &str) -> std::result::Result<Scalar, String> {
    Ok(match name {
        "char" | "int8" => Scalar::I8,
        "uchar" | "uint8" => Scalar::U8,
        "short" | "int16" => Scalar::I16,
        "ushort" | "uint16" => Scalar::U16,
        "int" | "int32" => Scalar::I32,
        "uint" | "uint32" => Scalar::U32,
        "int64" => Scalar::I64,
        "uint64" => Scalar::U64,
        "float" | "float32" => Scalar::F32,
        "double" | "float64" => Scalar::F64,
        _ => return Err(format!("unknown type `{}`", excerpt(name.as_bytes()))),
    })
}
