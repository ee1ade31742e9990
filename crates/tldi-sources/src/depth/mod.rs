//! Depth cameras: folders of frames, and points from depth images.

mod camera;
mod cloud;
mod frame_size;
mod memory;
mod organized;
mod ray_window;
mod sensor;
mod sequence;
mod tile;

pub use camera::DepthCamera;
pub use cloud::DepthCloud;
pub use frame_size::FrameSizeError;
pub use memory::DepthMemory;
pub use organized::OrganizedCloud;
pub use sensor::{Intrinsics, SensorModel};
pub use sequence::{DepthError, DepthFrame, DepthSequence};
