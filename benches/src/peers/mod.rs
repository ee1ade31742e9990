//! What a user would pick instead, each in its own file behind one small trait.
//!
//! Peers answer whether balls of the points overlap, and how many pairs of them. All get points that
//! are new in every frame, and build what they need anew.

mod bit_grid;
mod bvh;
mod culled;
mod grid;
mod refit;
mod voxels;

pub use bit_grid::BitGrid;
pub use bvh::BvhRebuild;
pub use culled::Culled;
pub use grid::Grid;
pub use refit::BvhRefit;
pub use voxels::VoxelsRebuild;

use tldi::glamx::Vec3;

/// Points of both bodies in one frame, metres.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// Of the first body.
    pub a: &'a [Vec3],
    /// Of the second body.
    pub b: &'a [Vec3],
    /// Radius of all balls.
    pub radius: f32,
}

/// What a peer found, and how long it took.
#[derive(Clone, Copy, Debug, Default)]
pub struct Found {
    /// Seconds until queries could begin.
    pub build_seconds: f64,
    /// Seconds of the queries.
    pub query_seconds: f64,
    /// Whether anything touches.
    pub collides: bool,
    /// Pairs of balls, or contact points, that were found.
    pub contacts: usize,
}

/// A method that a user would pick.
pub trait Peer {
    /// Name in tables.
    fn name(&self) -> String;

    /// One frame.
    fn compare(&mut self, frame: &Frame) -> Found;
}
