//! What can be wrong with a file, where in it, and what to do about it.

use crate::Format;
use crate::options::MOST_POINTS;
use std::fmt;
use std::io;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// Why a point cloud could not be read: what is wrong, in which file and where in it.
#[derive(Debug, Error)]
#[error("{}{position}{kind}", file_prefix(.file.as_deref()))]
pub struct SourceError {
    /// What is wrong, and what to do.
    pub kind: SourceErrorKind,
    /// The file, if it was read by path.
    pub file: Option<PathBuf>,
    /// Where in the file.
    pub position: Position,
}

impl SourceError {
    pub(crate) fn in_file(mut self, path: &Path) -> Self {
        self.file = Some(path.to_owned());
        self
    }
}

impl From<SourceErrorKind> for SourceError {
    fn from(kind: SourceErrorKind) -> Self {
        kind.at(Position::Unknown)
    }
}

fn file_prefix(file: Option<&Path>) -> String {
    file.map_or_else(String::new, |file| format!("{}: ", file.display()))
}

/// A place in a file; after gunzip, if it is compressed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Position {
    /// Not known, or the file as a whole.
    #[default]
    Unknown,
    /// A line of text, counted from 1.
    Line(u64),
    /// A byte, counted from 0.
    Byte(u64),
    /// A point record, counted from 0.
    Point(u64),
}

impl fmt::Display for Position {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unknown => Ok(()),
            Self::Line(line) => write!(f, "line {line}: "),
            Self::Byte(offset) => write!(f, "byte {offset}: "),
            Self::Point(index) => write!(f, "point {index}: "),
        }
    }
}

/// What is wrong with a file.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SourceErrorKind {
    /// The operating system could not open or read the file.
    #[error("cannot be read ({0}): check the path and its permissions")]
    Io(io::Error),
    /// Neither the content nor the file's extension tells the format.
    #[error(
        "unknown format: name it .ply, .pcd, .xyz, .xyzrgb, .xyzn, .txt, .csv, .asc, .pts, .bin, .pcd.bin, .las, .laz or .e57 (each may be followed by .gz), or name the format in the call"
    )]
    UnknownFormat,
    /// The extension is that of a mesh that is not PLY.
    #[error(
        "a .{extension} file is no cloud, and of meshes only PLY is read as one: convert it to PLY, whose vertices become the points, or sample points on its faces and write these as PLY"
    )]
    Mesh {
        /// The file's extension, in lower case.
        extension: String,
    },
    /// Support for this format was not compiled in.
    #[error("{format} is not compiled in: enable the feature `{feature}` of tldi-sources")]
    FormatDisabled {
        /// The file's format.
        format: Format,
        /// The feature that adds it.
        feature: &'static str,
    },
    /// The file ends before its header says.
    #[error("the file ends in the middle of {what}: it is truncated, get it again")]
    Truncated {
        /// What was being read.
        what: String,
    },
    /// The compressed data does not decompress.
    #[error("the compressed data is damaged ({reason}): get the file again")]
    Compression {
        /// What the decompressor says.
        reason: String,
    },
    /// The header breaks the rules of the format.
    #[error("bad {format} header: {reason}")]
    Header {
        /// The file's format.
        format: Format,
        /// Which rule.
        reason: String,
    },
    /// Columns of text have no names, and neither their number nor their values tell what they mean.
    #[error(
        "{what}: name the columns in a first line such as `x y z r g b` or `x y z nx ny nz`; of files named .xyzrgb and .xyzn these are known"
    )]
    UnnamedColumns {
        /// Which columns, and what was expected of them.
        what: String,
    },
    /// The file is sound as far as known, but needs what this reader does not have.
    #[error("{what} is not supported: convert the file, for example to binary PLY")]
    Unsupported {
        /// What the file needs.
        what: String,
    },
    /// A value is not what its column or property may hold.
    #[error("bad value: {reason}")]
    Value {
        /// What was found and what was expected.
        reason: String,
    },
    /// A face refers to a vertex that does not exist.
    #[error("a face refers to vertex {index}, but there are only {points}: the file is damaged")]
    FaceIndex {
        /// The index in the file.
        index: i64,
        /// Number of vertices.
        points: u64,
    },
    /// A line is longer than any sound file's.
    #[error("a line is longer than {limit} bytes: this is not a text file of this format")]
    LineTooLong {
        /// Most bytes that a line may have.
        limit: usize,
    },
    /// There are more points than asked for.
    #[error("more than {limit} points{}", advice(*limit))]
    TooManyPoints {
        /// [`ReadOptions::max_points`](crate::ReadOptions::max_points).
        limit: u64,
    },
    /// There are more triangles than plausible for the points that are allowed.
    #[error("more than {limit} triangles: simplify the mesh, or raise ReadOptions::max_points")]
    TooManyTriangles {
        /// The limit, a multiple of [`ReadOptions::max_points`](crate::ReadOptions::max_points).
        limit: u64,
    },
    /// A format that needs random access came from a stream or from gzip, and is too large to hold.
    #[error(
        "more than {limit} bytes from a stream, but {format} needs random access: unpack it to a file and read that"
    )]
    StreamTooLarge {
        /// The file's format.
        format: Format,
        /// Most bytes that are held in memory.
        limit: u64,
    },
    /// A message breaks the rules of its type.
    #[error("bad PointCloud2: {reason}")]
    Message {
        /// Which rule.
        reason: String,
    },
    /// There are Gaussian splats, but all are too faint, or have no extent.
    #[error(
        "none of the {count} splats is opaque enough to be a point: lower ReadOptions::least_opacity"
    )]
    TooFaint {
        /// Number of splats.
        count: u64,
    },
    /// The file is sound but has no points.
    #[error("there are no points in it: give a file with at least one")]
    NoPoints,
}

impl SourceErrorKind {
    /// Something wrong at a place of the file.
    pub(crate) fn at(self, position: Position) -> SourceError {
        SourceError {
            kind: self,
            file: None,
            position,
        }
    }

    pub(crate) fn truncated(what: impl Into<String>) -> Self {
        let what = what.into();
        Self::Truncated { what }
    }

    pub(crate) fn value(reason: impl Into<String>) -> Self {
        let reason = reason.into();
        Self::Value { reason }
    }

    pub(crate) fn header(format: Format, reason: impl Into<String>) -> Self {
        let reason = reason.into();
        Self::Header { format, reason }
    }
}

/// What helps against more points than `limit`.
fn advice(limit: u64) -> String {
    if limit < MOST_POINTS {
        return ": thin the cloud, or raise ReadOptions::max_points".to_owned();
    }
    format!(
        " (a cloud can have {MOST_POINTS}): thin it, or raise ReadOptions::max_points and thin what is read"
    )
}

/// Result of reading.
pub(crate) type Result<T> = std::result::Result<T, SourceError>;
