//! Builds the k-d tree over the distinct positions of a cloud.

use crate::cloud::knn::{Split, leaf_start};
use crate::ordered_bits::ordered_bits;
use crate::{KdTree, PointCloud};
use glamx::Vec3;
use rayon::prelude::*;

/// Most positions in a leaf. Half or twice: no row changes.
const LEAF: usize = 16;
/// Subtrees with at least this many positions are built in parallel.
const PARALLEL: usize = 4096;
/// A distinct position while the tree is built, with its rank in the sorted sequence.
#[derive(Clone, Copy)]
struct TreeEntry {
    position: [f32; 3],
    rank: u32,
}

impl KdTree {
    /// Builds the tree of a cloud.
    pub fn new(cloud: &PointCloud<'_>) -> Self {
        Self::from_points(cloud.points())
    }

    /// Builds the tree of at least one finite point, fewer than 2³².
    pub(crate) fn from_points(points: &[Vec3]) -> Self {
        // Equal positions become neighbours, ordered by index.
        let mut keys: Vec<u128> = points
            .par_iter()
            .enumerate()
            .map(|(i, point)| {
                // −0 and 0 are the same: their sum with 0 is 0.
                let [x, y, z] = point.to_array().map(|c| ordered_bits(c + 0.0));
                [x, y, z, i as u32]
                    .into_iter()
                    .fold(0, |key, part| key << 32 | u128::from(part))
            })
            .collect();
        keys.par_sort_unstable();
        let mut entries = Vec::with_capacity(keys.len());
        let mut sorted_starts = Vec::with_capacity(keys.len() + 1);
        for (start, key) in keys.iter().enumerate() {
            if start == 0 || keys[start - 1] >> 32 != key >> 32 {
                let i = *key as u32 as usize;
                entries.push(TreeEntry {
                    position: points[i].to_array(),
                    rank: entries.len() as u32,
                });
                sorted_starts.push(start as u32);
            }
        }
        sorted_starts.push(keys.len() as u32);

        let count = entries.len();
        let leaves = count.div_ceil(LEAF).next_power_of_two();
        let mut splits = vec![Split::default(); leaves - 1];
        build(&mut entries, &mut splits, 0, leaves, &|leaf| {
            leaf_start(leaf, leaves, count)
        });

        let mut starts = Vec::with_capacity(count + 1);
        let mut indices = Vec::with_capacity(keys.len());
        for entry in &entries {
            starts.push(indices.len() as u32);
            let rank = entry.rank as usize;
            let run = sorted_starts[rank] as usize..sorted_starts[rank + 1] as usize;
            indices.extend(keys[run].iter().map(|key| *key as u32));
        }
        starts.push(indices.len() as u32);
        Self {
            positions: entries.into_iter().map(|e| e.position).collect(),
            splits,
            leaves,
            starts,
            indices,
        }
    }
}

/// Sorts `entries` into `leaves` leaves, the first of which has the number `first_leaf`.
fn build(
    entries: &mut [TreeEntry],
    splits: &mut [Split],
    first_leaf: usize,
    leaves: usize,
    start: &(impl Fn(usize) -> usize + Sync),
) {
    let Some((split, splits)) = splits.split_first_mut() else {
        return;
    };
    let half = leaves / 2;
    let middle = start(first_leaf + half) - start(first_leaf);
    let axis = widest_axis(entries);
    let (_, pivot, _) = entries
        .select_nth_unstable_by(middle, |a, b| a.position[axis].total_cmp(&b.position[axis]));
    *split = Split {
        value: pivot.position[axis],
        axis: axis as u32,
    };
    let parallel = entries.len() >= PARALLEL;
    let (left, right) = entries.split_at_mut(middle);
    let (left_splits, right_splits) = splits.split_at_mut(half - 1);
    let mut build_left = || build(left, left_splits, first_leaf, half, start);
    let mut build_right = || build(right, right_splits, first_leaf + half, half, start);
    if parallel {
        rayon::join(build_left, build_right);
    } else {
        build_left();
        build_right();
    }
}

/// The axis along which the positions extend farthest.
fn widest_axis(entries: &[TreeEntry]) -> usize {
    let mut min = Vec3::INFINITY;
    let mut max = Vec3::NEG_INFINITY;
    for entry in entries {
        let position = Vec3::from_array(entry.position);
        min = min.min(position);
        max = max.max(position);
    }
    (max.as_dvec3() - min.as_dvec3()).max_position()
}
