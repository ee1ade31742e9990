//! The one pass over raw points: whether they are finite, and the bounds of their blocks.

use crate::Aabb;
use glamx::Vec3;
use multiversion::multiversion;

/// Points per block: [`PointCloud::blocks`](crate::PointCloud::blocks) bounds that many consecutive points each.
pub const BLOCK: usize = 256;

/// Copies of finite points, with what was learnt while reading them. All buffers keep their memory from one
/// [`Gathered::refill`] to the next.
#[derive(Debug, Default)]
pub(crate) struct Gathered {
    pub(crate) points: Vec<Vec3>,
    /// Bounds of each run of [`BLOCK`] points.
    pub(crate) blocks: Vec<Aabb>,
    /// Indices, among the points given, of those left out because they are not finite; ascending.
    pub(crate) dropped: Vec<u32>,
}

impl Gathered {
    /// Replaces the content by `points`, in the order of their indices `order` where that is given,
    /// leaving out the non-finite ones.
    pub(crate) fn refill(&mut self, points: &[Vec3], order: Option<&[u32]>) {
        self.points.clear();
        self.blocks.clear();
        self.dropped.clear();
        match order {
            Some(order) => {
                let ordered = order.iter().map(|&i| points[i as usize]);
                self.points.extend(ordered);
                self.blocks.extend(bounds_of_blocks(&self.points));
            }
            // Block by block, so that the points are still in the core's cache when they are copied.
            None => {
                self.points.reserve(points.len());
                for block in points.chunks(BLOCK) {
                    self.blocks.push(bounds_of(block));
                    self.points.extend_from_slice(block);
                }
            }
        }
        if !are_finite(&self.blocks) {
            self.dropped
                .extend(non_finite_indices(&self.points, &self.blocks));
            self.points.retain(|point| point.is_finite());
            self.blocks.clear();
            self.blocks.extend(bounds_of_blocks(&self.points));
        }
    }
}

/// Whether all points of some blocks are finite.
fn are_finite(blocks: &[Aabb]) -> bool {
    blocks.iter().all(is_finite)
}

fn is_finite(block: &Aabb) -> bool {
    block.min.is_finite() && block.max.is_finite()
}

/// Indices of the points with a non-finite coordinate, ascending. `blocks` are their bounds.
pub(crate) fn non_finite_indices<'a>(
    points: &'a [Vec3],
    blocks: &'a [Aabb],
) -> impl Iterator<Item = u32> + 'a {
    let bad_blocks = points.chunks(BLOCK).zip(blocks).enumerate();
    let bad_blocks = bad_blocks.filter(|(_, (_, bounds))| !is_finite(bounds));
    bad_blocks.flat_map(|(block, (points, _))| {
        let indices = (BLOCK as u32 * block as u32..).zip(points);
        let bad_points = indices.filter(|(_, point)| !point.is_finite());
        bad_points.map(|(index, _)| index)
    })
}

/// Bounds of each run of [`BLOCK`] points; not finite where one of them is not.
pub(crate) fn bounds_of_blocks(points: &[Vec3]) -> impl Iterator<Item = Aabb> + '_ {
    points.chunks(BLOCK).map(bounds_of)
}

/// Bounds of points; not finite where one of them is not.
fn bounds_of(points: &[Vec3]) -> Aabb {
    let [min, max] = extremes_of_thirds(bytemuck::cast_slice(points)).map(Vec3::from);
    Aabb { min, max }
}

/// Least and greatest of values, in the total order of `f32`.
pub(crate) fn extremes(values: &[f32]) -> [f32; 2] {
    let [mut least, mut greatest] = extremes_of_thirds(values);
    least.sort_unstable_by(f32::total_cmp);
    greatest.sort_unstable_by(f32::total_cmp);
    [least[0], greatest[2]]
}

/// Values that are compared at once.
const LANES: usize = 3 * 16;

/// Least and greatest of every third value, from the first, the second and the third on: of coordinates, those of the
/// axes. The order is the total one of `f32`, where −NaN < −∞ and ∞ < NaN.
///
/// Values are compared as integers: folds of these are vectorised, folds of floats, which must not be reordered, not.
#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2", "aarch64+neon"))]
fn extremes_of_thirds(values: &[f32]) -> [[f32; 3]; 2] {
    // Flips the magnitude of negative values, as `f32::total_cmp` does; its own inverse.
    let key = |bits: i32| bits ^ ((bits >> 31) & i32::MAX);
    let (mut least, mut greatest) = ([i32::MAX; LANES], [i32::MIN; LANES]);
    let (chunks, rest) = values.as_chunks::<LANES>();
    for chunk in chunks {
        for l in 0..LANES {
            let key = key(chunk[l].to_bits() as i32);
            least[l] = least[l].min(key);
            greatest[l] = greatest[l].max(key);
        }
    }
    for (l, value) in rest.iter().enumerate() {
        let key = key(value.to_bits() as i32);
        least[l] = least[l].min(key);
        greatest[l] = greatest[l].max(key);
    }
    let mut lanes = LANES;
    while lanes > 3 {
        lanes /= 2;
        for l in 0..lanes {
            least[l] = least[l].min(least[l + lanes]);
            greatest[l] = greatest[l].max(greatest[l + lanes]);
        }
    }
    let value = |l: usize, keys: &[i32; LANES]| f32::from_bits(key(keys[l]) as u32);
    let of_thirds = |keys| [value(0, keys), value(1, keys), value(2, keys)];
    [of_thirds(&least), of_thirds(&greatest)]
}

/// The index, among the points given, of the one with index `kept` among those not dropped. `dropped` is ascending.
pub(crate) fn index_before_drop(kept: usize, dropped: &[u32]) -> usize {
    // Of those before a dropped one, all were kept but the ones dropped before it.
    let (mut before, mut end) = (0, dropped.len());
    while before < end {
        let middle = before.midpoint(end);
        if dropped[middle] as usize - middle <= kept {
            before = middle + 1;
        } else {
            end = middle;
        }
    }
    kept + before
}

/// `values` without the entries at the ascending indices `dropped`.
pub(crate) fn without<T: Copy>(values: &[T], dropped: &[u32]) -> Vec<T> {
    let mut kept = Vec::with_capacity(values.len() - dropped.len());
    extend_without(&mut kept, values.iter().copied(), dropped);
    kept
}

/// Appends `values` without the entries at the ascending indices `dropped`.
pub(crate) fn extend_without<T>(
    kept: &mut Vec<T>,
    values: impl Iterator<Item = T>,
    dropped: &[u32],
) {
    if dropped.is_empty() {
        kept.extend(values);
        return;
    }
    let mut dropped = dropped.iter().copied().peekable();
    for (i, value) in values.enumerate() {
        if dropped.next_if_eq(&(i as u32)).is_none() {
            kept.push(value);
        }
    }
}

/// The union of all blocks.
pub(crate) fn merged(blocks: &[Aabb]) -> Aabb {
    blocks.iter().copied().fold(Aabb::EMPTY, Aabb::merged)
}
