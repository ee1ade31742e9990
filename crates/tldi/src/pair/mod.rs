//! Pairs: what a backend is asked about two surfaces, and what it answers.

pub(crate) mod backend;
pub(crate) mod further_views;
pub(crate) mod impact_query;
pub(crate) mod params;
pub(crate) mod pixels;
pub mod plan;
pub(crate) mod sampling;
pub(crate) mod stage_constants;
pub(crate) mod supported;
pub(crate) mod surface;
pub(crate) mod work;
