//! Where depth frames come from: a folder or a generated scene.

use super::generated::GeneratedCamera;
use anyhow::Context;
use std::time::Instant;
use thiserror::Error;
use tldi::glamx::{DVec3, Pose3};
use tldi_sources::depth::{DepthCamera, DepthCloud, DepthSequence, Intrinsics};

/// Frames in order.
pub enum FrameSource {
    /// Of a folder.
    Folder(DepthSequence),
    /// Computed.
    Generated(GeneratedCamera),
}

/// No frame shows a surface.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error(
    "none of the {frames} frames has a point between {} and {} m: is the depth unit right? Else give a --range",
    .range[0], .range[1]
)]
pub struct NothingSeen {
    /// Number of frames.
    pub frames: usize,
    /// Nearest and farthest depth that is believed, metres.
    pub range: [f32; 2],
}

/// The first frame that shows a surface.
pub struct FirstSeen {
    /// Its index.
    pub index: usize,
    /// The frame.
    pub frame: TimedFrame,
    /// Its points in the world, metres.
    pub cloud: DepthCloud,
    /// Names of the frames before it, which have no points.
    pub empty: Vec<String>,
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

    /// The first frame in which the camera sees points.
    ///
    /// # Errors
    /// [`NothingSeen`] if there is none, and those of reading a file.
    pub fn first_seen(&self, camera: &mut DepthCamera) -> anyhow::Result<FirstSeen> {
        let mut empty = Vec::new();
        for index in 0..self.count() {
            let frame = self.frame(index)?;
            let cloud = camera.points(&frame.depths, &frame.world_from_camera)?;
            if !cloud.points.is_empty() {
                return Ok(FirstSeen {
                    index,
                    frame,
                    cloud,
                    empty,
                });
            }
            empty.push(frame.name);
        }
        Err(NothingSeen {
            frames: self.count(),
            range: camera.model.range,
        }
        .into())
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
