//! A step of the pipeline: candidate pairs, the batch, and what the step reports.

pub(crate) mod batching;
pub(crate) mod candidates;
pub(crate) mod measured;
pub(crate) mod pair_memory;
pub(crate) mod pipeline;
pub(crate) mod prepared;
pub(crate) mod report;
pub(crate) mod resolution;
