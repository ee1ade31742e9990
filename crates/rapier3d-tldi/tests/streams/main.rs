//! Clouds that get new points.

#[path = "../common/mod.rs"]
mod common;

mod own_points;
mod pushing;
mod set_points;
mod stream;
