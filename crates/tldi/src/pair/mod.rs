//! Pairs: what a backend is asked about two surfaces, and what it answers.

pub(crate) mod backend;
pub(crate) mod impact_query;
pub(crate) mod params;
pub mod plan;
pub(crate) mod supported;
pub(crate) mod surface;
pub(crate) mod work;
