//! A deforming cloud runs over ground that deforms as well.

mod creature;
mod ground;
mod report;
mod runner;
mod simulation;
mod truth;

pub use creature::creature;
pub use ground::WavyGround;
pub use report::{GallopFrame, GallopReport};
pub use runner::Runner;
pub use simulation::{GallopScene, GallopSimulation, GallopSnapshot};
pub use truth::{Comparisons, TrueDepth};
