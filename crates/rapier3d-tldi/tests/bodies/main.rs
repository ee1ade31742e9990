//! What bodies do on clouds, step by step.

#[path = "../common/mod.rs"]
mod common;

mod ccd;
mod changes;
mod hooks;
mod pipeline;
mod rebounds;
mod refusals;
mod resting;
mod rolling;
mod sides;
mod split_sets;
