//! Bodies fall onto a scan.

mod report;
mod simulation;

pub use report::{DropBody, DropReport};
pub use simulation::{DropSimulation, Snapshot};
