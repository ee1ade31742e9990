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
        (nearest.distance_squared(place), indices(block, count))
    })
}

/// The indices of the points of the blocks whose bounds meet `place`.
pub(super) fn meeting(
    blocks: &[Aabb],
    count: usize,
    place: Aabb,
) -> impl Iterator<Item = Range<usize>> {
    let found = blocks.iter().enumerate();
    (found.filter(move |(_, bounds)| bounds.intersects(&place)))
        .map(move |(block, _)| indices(block, count))
}

/// The points of a block.
fn indices(block: usize, count: usize) -> Range<usize> {
    let first = block * BLOCK;
    first..(first + BLOCK).min(count)
}
