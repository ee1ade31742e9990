//! The blocks of a cloud's points around a place.

use rapier3d::math::Vector;
use std::ops::Range;
use tldi::{Aabb, BLOCK};

/// The blocks of `count` points: the square of how far the bounds of each are from `place`, and the indices of its points.
pub(super) fn by_distance(
    blocks: &[Aabb],
    count: usize,
    place: Vector,
) -> impl Iterator<Item = (f32, Range<usize>)> {
    blocks.iter().enumerate().map(move |(block, bounds)| {
        let nearest = place.clamp(bounds.min, bounds.max);
        let first = block * BLOCK;
        let indices = first..(first + BLOCK).min(count);
        (nearest.distance_squared(place), indices)
    })
}
