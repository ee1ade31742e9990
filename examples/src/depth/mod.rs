//! Depth frames as a collider that is new in every frame.

mod camera_up;
mod generated;
mod pinhole;
mod placing;
mod registered;
mod report;
mod simulation;
mod source;

pub use camera_up::{CameraUp, UnclearUp, camera_up};
pub use generated::GeneratedCamera;
pub use placing::WantedBodies;
pub use registered::{RegisteredFrames, TruePixel};
pub use report::{DepthReport, FrameReport};
pub use simulation::{DepthScene, DepthSimulation, DepthSnapshot, FRAME_SECONDS};
pub use source::{FirstSeen, FrameSource, NothingSeen, TimedFrame};
