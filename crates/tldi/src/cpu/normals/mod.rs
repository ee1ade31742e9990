//! Unit normals of the points that are modelled: estimated, then sharpened beside edges.

pub(crate) mod estimate;
pub(crate) mod kept;
mod near_values;
pub(crate) mod planes;
pub(crate) mod sharpen;
pub(crate) mod sorted;

pub(crate) use estimate::{NormalScratch, estimate};
pub(crate) use planes::Neighborhood;
pub use planes::SUPPORT;
