//! Where depth frames come from: a folder or a generated scene.

use super::generated::GeneratedCamera;
use anyhow::Context;
use std::time::Instant;
use tldi::glamx::{DVec3, Pose3};
use tldi_sources::depth::{DepthSequence, Intrinsics};

/// Frames in order.
pub enum FrameSource {
    /// Of a folder.
    Folder(DepthSequence),
    /// Computed.
    Generated(GeneratedCamera),
}

/// A frame, and how long it took to get.
pub struct TimedFrame {
    /// What it is called.
    pub name: String,
    /// Depths, row by row.
    pub depths: Vec<u16>,
    /// From the frame of the camera into that of the world, less [the origin](FrameSource::origin), metres.
    pub world_from_camera: Pose3,
    /// Seconds of reading and decoding; 0 for a generated one.
    pub decode_seconds: f64,
}

impl FrameSource {
    /// Number of frames.
    pub fn count(&self) -> usize {
        match self {
            Self::Folder(sequence) => sequence.frames.len(),
            Self::Generated(camera) => camera.frames,
        }
    }

    /// Where all places count from in the world, metres.
    pub fn origin(&self) -> DVec3 {
        match self {
            Self::Folder(sequence) => sequence.origin,
            Self::Generated(_) => DVec3::ZERO,
        }
    }

    /// The camera.
    pub fn intrinsics(&self) -> Intrinsics {
        match self {
            Self::Folder(sequence) => sequence.intrinsics,
            Self::Generated(camera) => camera.intrinsics(),
        }
    }

    /// Gets a frame.
    ///
    /// # Errors
    /// Those of reading a file.
    pub fn frame(&self, index: usize) -> anyhow::Result<TimedFrame> {
        match self {
            Self::Folder(sequence) => {
                let frame = &sequence.frames[index];
                let start = Instant::now();
                let depths = sequence.read(frame).context("cannot read a depth frame")?;
                let name = frame.path.file_name().unwrap_or_default();
                Ok(TimedFrame {
                    name: name.to_string_lossy().into_owned(),
                    depths,
                    world_from_camera: frame.world_from_camera,
                    decode_seconds: start.elapsed().as_secs_f64(),
                })
            }
            Self::Generated(camera) => Ok(TimedFrame {
                name: format!("frame {index}"),
                depths: camera.depths(index),
                world_from_camera: GeneratedCamera::world_from_camera(),
                decode_seconds: 0.0,
            }),
        }
    }
}
