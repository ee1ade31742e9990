//! Sweeps of a laser scanner as a streaming collider.

mod generated;
mod report;
mod simulation;
mod source;

pub use generated::Scanner;
pub use report::{LidarBody, LidarReport, SweepReport};
pub use simulation::LidarSimulation;
pub use source::{NothingSeen, SeenSweep, Sweep, SweepSource, recipe};
