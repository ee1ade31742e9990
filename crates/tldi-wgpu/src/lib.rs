//! The GPU backend of [`tldi`]: the TLDIs of all pairs of a step are built, compared and reduced to
//! contact pixels on the GPU, in one submission and one readback; further views of pairs that need them take a second.
//!
//! Stages have the names of the CPU backend's, which is the reference: integers are equal, floats
//! within what rounding of products and sums makes of them. Clouds stay on the device until their
//! points change; a rigid motion is a pose and no upload.

mod answer;
mod auto;
mod backend;
mod batch_buffers;
mod buffers;
mod choice;
mod counters;
mod crossover;
mod device;
mod division;
mod error;
mod layout;
mod measure;
mod pipelines;
mod prediction;
mod readback;
mod resident;
mod sources;
#[cfg(test)]
mod testing;
mod upload;

pub use auto::AutoBackend;
pub use backend::{InFlight, WgpuBackend};
pub use choice::{BACKEND_VARIABLE, BackendChoice};
pub use device::{AdapterChoice, Gpu};
pub use error::GpuError;
pub use measure::timer::StageTime;
pub use measure::traffic::Traffic;
pub use sources::DepthCamera;
pub use wgpu;
