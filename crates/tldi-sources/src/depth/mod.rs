//! Depth cameras: folders of frames, and points from depth images.

mod camera;
mod sequence;
mod tile;

pub use camera::{DepthCamera, DepthCloud, Intrinsics, SensorModel};
pub use sequence::{DepthError, DepthFrame, DepthSequence};
