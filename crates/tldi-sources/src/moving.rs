//! Points that move: a deforming mesh as a NumPy array or as a folder of clouds.

use crate::input::is_gzip;
use crate::scalar::{Endian, Scalar, unsigned};
use crate::{ReadOptions, SourceError, numbered_order, origin};
use flate2::read::MultiGzDecoder;
use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use thiserror::Error;
use tldi::glamx::{DVec3, Vec3};

/// Most numbers of an array: 2³¹ bytes of them are more than fits a story.
const MAX_NUMBERS: u64 = 1 << 29;

/// Positions of the same points in frames at equal distances of time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct MovingPoints {
    /// Frames, all of one length; at least one, none of them empty.
    frames: Vec<Vec<Vec3>>,
}

/// Why moving points cannot be read.
#[derive(Debug, Error)]
pub enum MovingError {
    /// A file or folder cannot be read.
    #[error("{path} cannot be read: {source}")]
    Io {
        /// The file or folder.
        path: PathBuf,
        /// What the operating system says.
        source: std::io::Error,
    },
    /// A file is no array of positions.
    #[error(
        "{path}: {reason}; an array of frames × points × 3 is needed, 32- or 64-bit floats in C order, as numpy.save writes it"
    )]
    Array {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A cloud of a folder cannot be read.
    #[error(transparent)]
    Cloud(#[from] SourceError),
    /// A folder has no clouds.
    #[error(
        "there is no cloud in {0}: it needs one file for each frame, in order of the numbers in their names (PLY, PCD, XYZ, also as .gz)"
    )]
    NoClouds(PathBuf),
    /// Frames have different numbers of points.
    #[error(
        "frame {index} has {found} points, the first one {expected}: the frames must show the same points"
    )]
    OtherPoints {
        /// Which frame, from 0.
        index: usize,
        /// Points of the first.
        expected: usize,
        /// Points of this one.
        found: usize,
    },
    /// There is nothing in it.
    #[error("there are no frames, or no points in them")]
    Empty,
    /// A coordinate is not finite.
    #[error("point {point} of frame {frame} is not finite")]
    NotFinite {
        /// Which frame, from 0.
        frame: usize,
        /// Which point, from 0.
        point: usize,
    },
}

impl MovingPoints {
    /// Frames that are at hand.
    ///
    /// # Errors
    /// [`MovingError::Empty`], [`MovingError::OtherPoints`], [`MovingError::NotFinite`].
    pub fn new(frames: Vec<Vec<Vec3>>) -> Result<Self, MovingError> {
        let expected = frames.first().map_or(0, Vec::len);
        if expected == 0 {
            return Err(MovingError::Empty);
        }
        for (index, frame) in frames.iter().enumerate() {
            if frame.len() != expected {
                return Err(MovingError::OtherPoints {
                    index,
                    expected,
                    found: frame.len(),
                });
            }
            if let Some(point) = frame.iter().position(|p| !p.is_finite()) {
                return Err(MovingError::NotFinite {
                    frame: index,
                    point,
                });
            }
        }
        Ok(Self { frames })
    }

    /// Reads a NumPy file (`.npy`, also packed with gzip) or a folder with a cloud for each frame, in
    /// [the order of their numbers](numbered_order). Coordinates of a map count from an origin that is chosen for the first
    /// frame as [`RawCloud::origin`](crate::RawCloud::origin) is.
    ///
    /// # Errors
    /// [`MovingError`].
    pub fn read(path: impl AsRef<Path>) -> Result<Self, MovingError> {
        let path = path.as_ref();
        if path.is_dir() {
            read_folder(path)
        } else {
            read_npy(path)
        }
    }

    /// The frames.
    pub fn frames(&self) -> &[Vec<Vec3>] {
        &self.frames
    }

    /// Number of points.
    pub fn points(&self) -> usize {
        self.frames[0].len()
    }

    /// The frames with every position moved.
    pub fn map(&mut self, place: impl Fn(Vec3) -> Vec3) {
        for point in self.frames.iter_mut().flatten() {
            *point = place(*point);
        }
    }

    /// Where the points are at `phase`, of which a whole number is the first frame again: the last
    /// frame leads into the first. Through four frames around the phase by Catmull–Rom splines, so
    /// that velocities have no jumps.
    ///
    /// ```
    /// use tldi_sources::MovingPoints;
    /// use tldi::glamx::Vec3;
    /// let round = [Vec3::X, Vec3::Y, -Vec3::X, -Vec3::Y].map(|p| vec![p]).to_vec();
    /// let round = MovingPoints::new(round)?;
    /// assert_eq!(round.at(0.25)[0], Vec3::Y);
    /// assert!((round.at(1.125)[0].length() - 1.0).abs() < 0.15);
    /// # Ok::<(), tldi_sources::MovingError>(())
    /// ```
    pub fn at(&self, phase: f32) -> Vec<Vec3> {
        let count = self.frames.len();
        let place = phase.rem_euclid(1.0) * count as f32;
        let first = (place.floor() as usize).min(count - 1);
        let t = place - first as f32;
        let frame = |offset: usize| &self.frames[(first + count - 1 + offset) % count];
        let [before, from, to, after] = [frame(0), frame(1), frame(2), frame(3)];
        (0..from.len())
            .map(|i| {
                let [a, b, c, d] = [before[i], from[i], to[i], after[i]];
                let slope = 0.5 * (c - a);
                let next_slope = 0.5 * (d - b);
                let rest = c - b;
                b + t
                    * (slope
                        + t * ((3.0 * rest - 2.0 * slope - next_slope)
                            + t * (slope + next_slope - 2.0 * rest)))
            })
            .collect()
    }
}

fn read_folder(folder: &Path) -> Result<MovingPoints, MovingError> {
    let io = |source| MovingError::Io {
        path: folder.to_owned(),
        source,
    };
    let mut files = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(io)? {
        let path = entry.map_err(io)?.path();
        if path.is_file() && crate::Format::from_extension(&path).is_some() {
            files.push(path);
        }
    }
    files.sort_by(numbered_order);
    if files.is_empty() {
        return Err(MovingError::NoClouds(folder.to_owned()));
    }
    let mut frames = Vec::new();
    let mut origin = None;
    for file in files {
        let options = ReadOptions {
            origin,
            ..ReadOptions::default()
        };
        let cloud = crate::read(file, &options)?;
        origin = Some(cloud.origin);
        frames.push(cloud.points);
    }
    MovingPoints::new(frames)
}

fn read_npy(path: &Path) -> Result<MovingPoints, MovingError> {
    let io = |source| MovingError::Io {
        path: path.to_owned(),
        source,
    };
    let mut raw = BufReader::new(File::open(path).map_err(io)?);
    let is_packed = is_gzip(raw.fill_buf().map_err(io)?);
    let frames = if is_packed {
        npy_frames(MultiGzDecoder::new(raw))
    } else {
        npy_frames(raw)
    };
    MovingPoints::new(frames.map_err(|reason| MovingError::Array {
        path: path.to_owned(),
        reason,
    })?)
}

/// The frames of an unpacked NumPy file, or what is wrong with it.
fn npy_frames(mut source: impl Read) -> Result<Vec<Vec<Vec3>>, String> {
    let header = npy_header(&mut source)?;
    let (scalar, [frames, points]) = parse_header(&String::from_utf8_lossy(&header))?;
    if frames == 0 || points == 0 {
        return Err(format!(
            "its shape is ({frames}, {points}, 3): there are no frames, or no points in them"
        ));
    }
    let numbers = frames.checked_mul(points).and_then(|n| n.checked_mul(3));
    if numbers.is_none_or(|n| n > MAX_NUMBERS) {
        return Err("it is too large".to_owned());
    }
    let size = scalar.size();
    let mut found = Vec::new();
    let mut origin = None;
    for index in 0..frames {
        let what = format!("frame {index} of {frames}");
        let bytes = exactly(&mut source, 3 * points * size as u64, &what)?;
        let numbers = bytes.chunks_exact(size);
        let numbers: Vec<f64> = numbers.map(|b| scalar.decode(b, Endian::Little)).collect();
        let points: Vec<DVec3> = numbers.chunks_exact(3).map(DVec3::from_slice).collect();
        let origin = *origin.get_or_insert_with(|| origin::near(&points));
        found.push(points.iter().map(|p| (*p - origin).as_vec3()).collect());
    }
    Ok(found)
}

/// The next `length` bytes. No more memory is taken than really comes, whatever the header says.
fn exactly(source: &mut impl Read, length: u64, what: &str) -> Result<Vec<u8>, String> {
    let mut bytes = Vec::new();
    match source.take(length).read_to_end(&mut bytes) {
        Ok(found) if found as u64 == length => Ok(bytes),
        Ok(found) => Err(format!(
            "the {what} ends early, after {found} of {length} bytes"
        )),
        Err(error) => Err(format!("the {what} ends early ({error})")),
    }
}

/// The text of the header.
fn npy_header(source: &mut impl Read) -> Result<Vec<u8>, String> {
    let start = exactly(source, 8, "header")?;
    if !start.starts_with(b"\x93NUMPY") {
        return Err("it is no NumPy file".to_owned());
    }
    // Version 1 has two bytes of length, later ones four.
    let length = unsigned(&exactly(
        source,
        if start[6] == 1 { 2 } else { 4 },
        "header",
    )?);
    if length > 1 << 16 {
        return Err("its header is too long".to_owned());
    }
    exactly(source, length, "header")
}

/// Reads `{'descr': '<f4', 'fortran_order': False, 'shape': (24, 8431, 3), }`: the type of the numbers, and how many
/// frames and points there are.
fn parse_header(header: &str) -> Result<(Scalar, [u64; 2]), String> {
    let after = |key: &str| {
        let rest = header.split_once(&format!("'{key}':"));
        rest.map(|(_, rest)| rest.trim_start())
            .ok_or_else(|| format!("its header has no {key}"))
    };
    let kind: String = (after("descr")?.chars().skip(1))
        .take_while(|c| *c != '\'')
        .collect();
    let scalar = match kind.as_str() {
        "<f4" => Scalar::F32,
        "<f8" => Scalar::F64,
        _ => return Err(format!("its numbers are {kind}, not <f4 or <f8")),
    };
    if !after("fortran_order")?.starts_with("False") {
        return Err("it is in Fortran order".to_owned());
    }
    let shape = after("shape")?;
    let inside = shape.split(['(', ')']).nth(1).unwrap_or_default();
    let sizes: Vec<u64> = (inside.split(',').map(str::trim).filter(|s| !s.is_empty()))
        .map(|size| size.parse().map_err(|_| format!("its shape is ({inside})")))
        .collect::<Result<_, _>>()?;
    match sizes[..] {
        [frames, points, 3] => Ok((scalar, [frames, points])),
        _ => Err(format!("its shape is ({inside})")),
    }
}
