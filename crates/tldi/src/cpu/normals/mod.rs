//! Unit normals of the points that are modelled: estimated, then sharpened beside edges.

pub(crate) mod estimate;
mod gathered;
pub(crate) mod kept;
pub(crate) mod planes;
pub(crate) mod sharpen;
pub(crate) mod sorted;

pub(crate) use estimate::{NormalScratch, estimate};
pub(crate) use planes::Neighborhood;
pub use planes::SUPPORT;
