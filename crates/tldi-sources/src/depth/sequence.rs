//! A folder of depth frames.

use super::sensor::Intrinsics;
use crate::{PoseError, near_origin, parse_pose};
use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use thiserror::Error;
use tldi::glamx::{DPose3, DVec3, Pose3};

/// What a folder must hold, for error messages.
const LAYOUT: &str = "a folder of depth frames holds intrinsics.txt (one line `width height fx fy cx cy depth_unit_metres`), poses.txt (a line for each frame: file name, then the 4×4 camera-to-world matrix or its upper three rows, row by row, metres) and 16-bit grey PNG files";

/// Why depth frames cannot be read.
#[derive(Debug, Error)]
pub enum DepthError {
    /// A file of the folder cannot be read.
    #[error("{path} cannot be read: {source}; {LAYOUT}")]
    Io {
        /// The file.
        path: PathBuf,
        /// What the operating system says.
        source: std::io::Error,
    },
    /// A text file does not say what it should.
    #[error("{path} line {line}: {reason}; {LAYOUT}")]
    Text {
        /// The file.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
        /// What is wrong.
        reason: String,
    },
    /// An image is no depth frame.
    #[error(
        "{path}: {reason}; depth frames are 16-bit grey PNG files of the size in intrinsics.txt"
    )]
    Image {
        /// The file.
        path: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// None of the frames is there.
    #[error("none of the {listed} frames that {path} lists is there; {LAYOUT}")]
    NoFrames {
        /// The list.
        path: PathBuf,
        /// Its entries.
        listed: usize,
    },
}

/// One frame of a sequence.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthFrame {
    /// The image.
    pub path: PathBuf,
    /// From the frame of the camera into that of the world, less [the origin](DepthSequence::origin), metres.
    pub world_from_camera: Pose3,
}

/// A camera's frames, in order.
#[derive(Clone, Debug)]
pub struct DepthSequence {
    /// The camera.
    pub intrinsics: Intrinsics,
    /// Frames whose image and pose are there.
    pub frames: Vec<DepthFrame>,
    /// Where all places count from in the world, metres: zero but for poses on a map, see [`near_origin`].
    pub origin: DVec3,
    /// Names of images that are listed but not there, or whose pose is not finite: the camera's track was lost.
    pub missing: Vec<String>,
}

impl DepthSequence {
    /// Opens a folder: `intrinsics.txt`, `poses.txt` and the 16-bit PNG files that it lists. Lines
    /// that start with `#` are comments.
    ///
    /// # Errors
    /// [`DepthError`]; not for single frames that are missing.
    pub fn open(folder: impl AsRef<Path>) -> Result<Self, DepthError> {
        let folder = folder.as_ref();
        let intrinsics = read_intrinsics(&folder.join("intrinsics.txt"))?;
        let list = folder.join("poses.txt");
        let mut images = Vec::new();
        let mut poses: Vec<DPose3> = Vec::new();
        let mut missing = Vec::new();
        for (line, text) in lines(&list)? {
            let (name, numbers) = text.split_once(char::is_whitespace).unwrap_or((&text, ""));
            let pose = match parse_pose(numbers) {
                Err(PoseError::NotFinite(_)) => None,
                told => Some(told.map_err(|error| DepthError::Text {
                    path: list.clone(),
                    line,
                    reason: error.to_string(),
                })?),
            };
            let path = folder.join(name);
            match pose.filter(|_| path.is_file()) {
                Some(pose) => {
                    images.push(path);
                    poses.push(pose);
                }
                None => missing.push(name.to_owned()),
            }
        }
        if images.is_empty() {
            return Err(DepthError::NoFrames {
                path: list,
                listed: missing.len(),
            });
        }
        let (poses, origin) = near_origin(&poses);
        let frames = images.into_iter().zip(poses);
        Ok(Self {
            intrinsics,
            frames: frames
                .map(|(path, world_from_camera)| DepthFrame {
                    path,
                    world_from_camera,
                })
                .collect(),
            origin,
            missing,
        })
    }

    /// Reads the image of a frame: row by row, in units of
    /// [`Intrinsics::depth_unit`].
    ///
    /// # Errors
    /// [`DepthError::Io`] and [`DepthError::Image`].
    pub fn read(&self, frame: &DepthFrame) -> Result<Vec<u16>, DepthError> {
        let bad = |reason: String| DepthError::Image {
            path: frame.path.clone(),
            reason,
        };
        let file = File::open(&frame.path).map_err(|source| DepthError::Io {
            path: frame.path.clone(),
            source,
        })?;
        let mut reader = png::Decoder::new(BufReader::new(file))
            .read_info()
            .map_err(|error| bad(error.to_string()))?;
        let [width, height] = self.intrinsics.size;
        let info = reader.info();
        let found = [info.width as usize, info.height as usize];
        let (color, depth) = (info.color_type, info.bit_depth);
        if (color, depth) != (png::ColorType::Grayscale, png::BitDepth::Sixteen) {
            return Err(bad(format!("it is {color:?} with {} bits", depth as u8)));
        }
        if found != self.intrinsics.size {
            return Err(bad(format!(
                "it is {} × {} pixels in size, not {width} × {height}",
                found[0], found[1]
            )));
        }
        let mut bytes = vec![0; 2 * width * height];
        reader
            .next_frame(&mut bytes)
            .map_err(|error| bad(error.to_string()))?;
        let pairs = bytes.chunks_exact(2);
        Ok(pairs
            .map(|pair| u16::from_be_bytes([pair[0], pair[1]]))
            .collect())
    }
}

/// The lines of a text file that say something, with their numbers.
fn lines(path: &Path) -> Result<Vec<(usize, String)>, DepthError> {
    let text = std::fs::read_to_string(path).map_err(|source| DepthError::Io {
        path: path.to_owned(),
        source,
    })?;
    // Some editors put a mark in front.
    let text = text.trim_start_matches('\u{feff}');
    let numbered = text
        .lines()
        .enumerate()
        .map(|(k, line)| (k + 1, line.trim().to_owned()));
    Ok(numbered
        .filter(|(_, line)| !line.is_empty() && !line.starts_with('#'))
        .collect())
}

fn numbers<const N: usize>(text: &str) -> Result<[f32; N], String> {
    let found: Vec<f32> = (text.split_whitespace())
        .map(|word| match word.parse::<f32>() {
            Ok(number) if number.is_finite() => Ok(number),
            _ => Err(format!("`{word}` is not a finite number")),
        })
        .collect::<Result<_, _>>()?;
    let count = found.len();
    found
        .try_into()
        .map_err(|_| format!("{count} numbers where {N} belong"))
}

fn read_intrinsics(path: &Path) -> Result<Intrinsics, DepthError> {
    let bad = |line, reason| DepthError::Text {
        path: path.to_owned(),
        line,
        reason,
    };
    let lines = lines(path)?;
    let Some((line, text)) = lines.first() else {
        return Err(bad(1, "there is nothing in it".to_owned()));
    };
    let [width, height, fx, fy, cx, cy, depth_unit] =
        numbers::<7>(text).map_err(|reason| bad(*line, reason))?;
    let is_size = |n: f32| n.fract() == 0.0 && (1.0..=16384.0).contains(&n);
    if !(is_size(width) && is_size(height) && fx > 0.0 && fy > 0.0 && depth_unit > 0.0) {
        let reason = "sizes, focal lengths and the depth unit must be above 0".to_owned();
        return Err(bad(*line, reason));
    }
    Ok(Intrinsics {
        size: [width as usize, height as usize],
        focal: [fx, fy],
        center: [cx, cy],
        depth_unit,
    })
}
