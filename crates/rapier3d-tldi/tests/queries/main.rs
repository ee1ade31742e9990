//! Distances, closest points and casts.

#[path = "../common/mod.rs"]
mod common;

mod cases;
mod distances;
mod fast_casts;
mod shape_casts;
