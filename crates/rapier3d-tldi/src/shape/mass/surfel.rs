//! A small flat patch of a cloud: position, area, outward normal.

use arrayvec::ArrayVec;
use rapier3d::glamx::DVec3;

/// Neighbours that bound a Voronoi cell. A cell in the plane has 6 on average; twice that many
/// neighbours miss none on an even sample, and few on a random one.
pub(super) const NEIGHBORS: usize = 16;

/// A patch of the surface around a point.
pub(super) struct Surfel {
    /// In metres, in the cloud's frame.
    pub(super) position: DVec3,
    /// Outward unit normal.
    pub(super) normal: DVec3,
    /// How far the patch reaches at most, in metres.
    pub(super) reach: f64,
    /// In square metres.
    pub(super) area: f64,
    /// Indices of the nearest patches, nearest first.
    pub(super) neighbors: ArrayVec<u32, NEIGHBORS>,
}
