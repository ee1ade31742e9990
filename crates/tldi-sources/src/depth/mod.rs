//! Depth cameras: folders of frames, and points from depth images.

mod camera;
mod organized;
mod sequence;
mod tile;

pub use camera::{DepthCamera, DepthCloud, Intrinsics, SensorModel};
pub use organized::OrganizedCloud;
pub use sequence::{DepthError, DepthFrame, DepthSequence};
