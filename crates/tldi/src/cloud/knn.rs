//! Nearest neighbours: a k-d tree over the distinct positions of a cloud.

use crate::PointCloud;
use crate::cloud::radii::COORDINATE_PER_RADIUS;
use arrayvec::ArrayVec;
use glamx::Vec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicBool, Ordering};

/// Most positions in a leaf.
const LEAF: usize = 16;
/// Subtrees with at least this many positions are built in parallel.
const PARALLEL: usize = 4096;
/// Most levels of the tree: 2³² points in leaves of at least `LEAF / 2`.
const LEVELS: usize = 32;

/// A point found near a query.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Neighbor {
    /// Index of the point in its cloud.
    pub index: usize,
    /// Square of the distance between the point and the query, in square metres.
    pub distance_squared: f64,
}

impl Neighbor {
    /// Distance between the point and the query, in metres.
    pub fn distance(&self) -> f32 {
        self.distance_squared.sqrt() as f32
    }

    /// Whether this one is nearer, or as near with a smaller index.
    fn precedes(&self, other: &Self) -> bool {
        (self.distance_squared, self.index) < (other.distance_squared, other.index)
    }
}

/// A k-d tree (Bentley 1975, doi:10.1145/361002.361007) over the points of a cloud, for nearest
/// neighbours and for all points within a radius.
///
/// The tree is balanced and implicit: the positions are sorted leaf by leaf, each split halves its
/// share at the median of the widest axis. Points at the same position are one entry, so that any
/// number of duplicates costs no more than listing them. Distances are computed in `f64`; equal
/// ones are ordered by index. The results do not depend on the number of threads.
///
/// Cost: building is O(n log n), in parallel; a query for k neighbours is O(k + log n) for points
/// of a surface. Memory: 24 bytes a point. The tree copies the positions: it does not follow later
/// changes of the cloud.
///
/// ```
/// use tldi::{KdTree, PointCloud, glamx::Vec3};
/// let points = [Vec3::ZERO, Vec3::X, 3.0 * Vec3::X];
/// let cloud = PointCloud::builder(&points[..]).radius(1.0).build()?;
/// let tree = KdTree::new(&cloud);
///
/// let nearest = tree.nearest(2.5 * Vec3::X, f32::INFINITY).expect("no limit of distance");
/// assert_eq!((nearest.index, nearest.distance()), (2, 0.5));
///
/// let mut found = Vec::new();
/// tree.k_nearest(Vec3::ZERO, 2, &mut found);
/// assert_eq!(found.iter().map(|n| n.index).collect::<Vec<_>>(), [0, 1]);
/// tree.within(2.0 * Vec3::X, 1.0, &mut found);
/// assert_eq!(found.iter().map(|n| n.index).collect::<Vec<_>>(), [1, 2]);
/// # Ok::<(), tldi::CloudError>(())
/// ```
#[derive(Clone, Debug)]
pub struct KdTree {
    /// Distinct positions, leaf by leaf.
    positions: Vec<[f32; 3]>,
    /// Inner nodes in pre-order.
    splits: Vec<Split>,
    /// Number of leaves, a power of two.
    leaves: usize,
    /// The points at `positions[i]` are `indices[starts[i]..starts[i + 1]]`, ascending.
    starts: Vec<u32>,
    indices: Vec<u32>,
}

/// An inner node: coordinates of the left half are at most `value`, of the right half at least.
#[derive(Clone, Copy, Debug, Default)]
struct Split {
    value: f32,
    axis: u32,
}

/// A distinct position while the tree is built, with its rank in the sorted sequence.
#[derive(Clone, Copy)]
struct Entry {
    position: [f32; 3],
    rank: u32,
}

/// A subtree still to be visited.
#[derive(Clone, Copy)]
struct Subtree {
    /// Its first split, in pre-order.
    split: usize,
    first_leaf: usize,
    leaves: usize,
    /// Vector from the query to the subtree's cell; 0 along axes where the query is within it.
    offset: [f64; 3],
}

impl KdTree {
    /// Builds the tree of a cloud.
    pub fn new(cloud: &PointCloud<'_>) -> Self {
        Self::from_coordinates(cloud.coordinates())
    }

    /// Builds the tree of at least one finite point, fewer than 2³².
    pub(crate) fn from_coordinates([x, y, z]: [&[f32]; 3]) -> Self {
        // Equal positions become neighbours, ordered by index.
        let mut keys: Vec<u128> = (0..x.len())
            .into_par_iter()
            .map(|i| {
                [sort_key(x[i]), sort_key(y[i]), sort_key(z[i]), i as u32]
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
                entries.push(Entry {
                    position: [x[i], y[i], z[i]],
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

    /// Number of points (at least one).
    #[allow(
        clippy::len_without_is_empty,
        reason = "a tree is never empty: no cloud is"
    )]
    pub fn len(&self) -> usize {
        self.indices.len()
    }

    /// Number of distinct positions.
    pub(crate) fn distinct(&self) -> usize {
        self.positions.len()
    }

    /// The point nearest to `query`, if it is no farther than `max_distance` metres (which may be
    /// infinite); among several the one with the least index. `None` also where an argument is
    /// NaN, or the query infinite.
    pub fn nearest(&self, query: Vec3, max_distance: f32) -> Option<Neighbor> {
        let mut best: Option<Neighbor> = None;
        self.search(query, max_distance, |entry, distance_squared| {
            let found = Neighbor {
                index: self.points_at(entry)[0] as usize,
                distance_squared,
            };
            if best.is_none_or(|best| found.precedes(&best)) {
                best = Some(found);
            }
            distance_squared
        });
        best
    }

    /// Replaces `found` by the `k` points nearest to `query` (all points, if there are fewer), in
    /// order of distance, then index. Empty if the query is not finite. Does not allocate once
    /// `found` has the capacity.
    pub fn k_nearest(&self, query: Vec3, k: usize, found: &mut Vec<Neighbor>) {
        found.clear();
        if k == 0 {
            return;
        }
        self.search(query, f32::INFINITY, |entry, distance_squared| {
            for &index in self.points_at(entry) {
                let candidate = Neighbor {
                    index: index as usize,
                    distance_squared,
                };
                if !insert(found, k, candidate) {
                    break;
                }
            }
            reach(found, k)
        });
    }

    /// Replaces `found` by all points no farther than `radius` metres from `query`, in order of
    /// distance, then index. Empty if an argument is NaN or the query infinite. Does not allocate
    /// once `found` has the capacity.
    pub fn within(&self, query: Vec3, radius: f32, found: &mut Vec<Neighbor>) {
        found.clear();
        let limit = f64::from(radius).powi(2);
        self.search(query, radius, |entry, distance_squared| {
            found.extend(self.points_at(entry).iter().map(|&index| Neighbor {
                index: index as usize,
                distance_squared,
            }));
            limit
        });
        found.sort_unstable_by(|a, b| {
            a.distance_squared
                .total_cmp(&b.distance_squared)
                .then(a.index.cmp(&b.index))
        });
    }

    /// For each distinct position, in parallel: `f` of a tree, its position and its `k` nearest other positions in that
    /// tree (all others, if there are fewer) in order of distance. `k` is at least 1. The neighbours'
    /// indices are those of positions, for [`KdTree::position`].
    ///
    /// Positions no farther apart than [`twin_distance`] count as one, in the tree that `f` is given: copies of a
    /// point that were rounded differently are not its neighbours. Where there are such, all is done twice.
    pub(crate) fn map_positions<T: Send + Copy>(
        &self,
        k: usize,
        f: impl Fn(&Self, Vec3, &[Neighbor]) -> T + Sync,
    ) -> Vec<T> {
        let has_twins = AtomicBool::new(false);
        let values = self.map_entries(k, |position, neighbors| {
            let is_twin = |n: &Neighbor| n.distance_squared <= twin_distance(position).powi(2);
            if neighbors.first().is_some_and(is_twin) {
                has_twins.store(true, Ordering::Relaxed);
            }
            f(self, position, neighbors)
        });
        if !has_twins.into_inner() {
            return values;
        }
        let (merged, first) = self.merged();
        let values = merged.map_entries(k, |position, neighbors| f(&merged, position, neighbors));
        let values = merged.spread(&values);
        first.into_iter().map(|point| values[point]).collect()
    }

    fn map_entries<T: Send>(&self, k: usize, f: impl Fn(Vec3, &[Neighbor]) -> T + Sync) -> Vec<T> {
        let k = k.min(self.distinct() - 1) + 1;
        (0..self.distinct())
            .into_par_iter()
            .with_min_len(256)
            .map_init(
                || Vec::with_capacity(k),
                |found, entry| {
                    let position = self.position(entry);
                    found.clear();
                    self.search(position, f32::INFINITY, |index, distance_squared| {
                        insert(
                            found,
                            k,
                            Neighbor {
                                index,
                                distance_squared,
                            },
                        );
                        reach(found, k)
                    });
                    // The first is the position itself, the only one at distance zero.
                    f(position, &found[1..])
                },
            )
            .collect()
    }

    /// A tree without positions that are within [`twin_distance`] of one of a lesser index, and for each position of
    /// this one the point of that tree which stands for it. Cost: a search for each position, one after the other.
    fn merged(&self) -> (Self, Vec<usize>) {
        let mut entries: Vec<usize> = (0..self.distinct()).collect();
        entries.sort_unstable_by_key(|&entry| self.points_at(entry)[0]);
        let mut stands_for = vec![usize::MAX; entries.len()];
        let mut kept = [vec![], vec![], vec![]];
        for entry in entries {
            if stands_for[entry] < usize::MAX {
                continue;
            }
            let position = self.position(entry);
            let point = kept[0].len();
            let limit = twin_distance(position).powi(2);
            self.search(position, limit.sqrt() as f32, |twin, distance_squared| {
                if distance_squared <= limit {
                    stands_for[twin] = stands_for[twin].min(point);
                }
                limit
            });
            for (kept, coordinate) in kept.iter_mut().zip(position.to_array()) {
                kept.push(coordinate);
            }
        }
        let [x, y, z] = &kept;
        (Self::from_coordinates([x, y, z]), stands_for)
    }

    /// A distinct position.
    pub(crate) fn position(&self, entry: usize) -> Vec3 {
        Vec3::from_array(self.positions[entry])
    }

    /// Hands each point the value of its position.
    pub(crate) fn spread<T: Copy>(&self, values: &[T]) -> Vec<T> {
        let mut spread = vec![values[0]; self.len()];
        for (entry, value) in values.iter().enumerate() {
            for &index in self.points_at(entry) {
                spread[index as usize] = *value;
            }
        }
        spread
    }

    /// The points at a distinct position, ascending.
    fn points_at(&self, entry: usize) -> &[u32] {
        &self.indices[self.starts[entry] as usize..self.starts[entry + 1] as usize]
    }

    /// Calls `visit(entry, distance_squared)` for positions no farther from `query` than the
    /// bound, subtrees near the query first. Each call returns the new bound, as a squared
    /// distance; the first one is `radius`.
    ///
    /// Rounding is monotonic and both distances are summed in the same order, so a cell is never
    /// farther than a position in it: nothing is missed.
    fn search(&self, query: Vec3, radius: f32, mut visit: impl FnMut(usize, f64) -> f64) {
        if !query.is_finite() || radius.is_nan() || radius < 0.0 {
            return;
        }
        let query = query.to_array().map(f64::from);
        let mut bound = f64::from(radius).powi(2);
        let mut pending = ArrayVec::<Subtree, LEVELS>::new();
        let mut at = Subtree {
            split: 0,
            first_leaf: 0,
            leaves: self.leaves,
            offset: [0.0; 3],
        };
        loop {
            while at.leaves > 1 {
                let Split { value, axis } = self.splits[at.split];
                let axis = axis as usize;
                let offset = f64::from(value) - query[axis];
                let half = at.leaves / 2;
                let left = Subtree {
                    split: at.split + 1,
                    leaves: half,
                    ..at
                };
                let right = Subtree {
                    split: at.split + half,
                    first_leaf: at.first_leaf + half,
                    leaves: half,
                    ..at
                };
                let (near, mut far) = if offset > 0.0 {
                    (left, right)
                } else {
                    (right, left)
                };
                far.offset[axis] = offset;
                if length_squared(far.offset) <= bound {
                    pending.push(far);
                }
                at = near;
            }
            let leaf = |leaf| leaf_start(leaf, self.leaves, self.positions.len());
            for entry in leaf(at.first_leaf)..leaf(at.first_leaf + 1) {
                let position = self.positions[entry];
                let distance_squared =
                    length_squared([0, 1, 2].map(|axis| f64::from(position[axis]) - query[axis]));
                if distance_squared <= bound {
                    bound = visit(entry, distance_squared);
                }
            }
            loop {
                match pending.pop() {
                    None => return,
                    Some(subtree) if length_squared(subtree.offset) <= bound => {
                        at = subtree;
                        break;
                    }
                    Some(_) => {}
                }
            }
        }
    }
}

/// Distance in metres within which two points are the same one, rounded differently, as when a scan is moved and
/// merged with itself: half of the least radius that a cloud accepts there, eight steps of `f32` at most. With half as
/// much, copies that a rotation rounded may count as neighbours; with twice as much, points that a cloud can tell apart
/// may count as one.
fn twin_distance(position: Vec3) -> f64 {
    f64::from(position.abs().max_element()) * (0.5 / f64::from(COORDINATE_PER_RADIUS))
}

/// Sorts `entries` into `leaves` leaves, the first of which has the number `first_leaf`.
fn build(
    entries: &mut [Entry],
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
fn widest_axis(entries: &[Entry]) -> usize {
    let mut min = Vec3::INFINITY;
    let mut max = Vec3::NEG_INFINITY;
    for entry in entries {
        let position = Vec3::from_array(entry.position);
        min = min.min(position);
        max = max.max(position);
    }
    (max.as_dvec3() - min.as_dvec3()).max_position()
}

/// First position of a leaf (one past the last position, for `leaf == leaves`).
fn leaf_start(leaf: usize, leaves: usize, count: usize) -> usize {
    (leaf as u64 * count as u64 / leaves as u64) as usize
}

/// Integers in the order of the floats; −0 and 0 are the same.
fn sort_key(value: f32) -> u32 {
    let bits = (value + 0.0).to_bits();
    if bits >> 31 == 0 {
        bits | 1 << 31
    } else {
        !bits
    }
}

fn length_squared([x, y, z]: [f64; 3]) -> f64 {
    x * x + y * y + z * z
}

/// Inserts into the sorted `found`, which holds at most `k`; whether there was room.
fn insert(found: &mut Vec<Neighbor>, k: usize, candidate: Neighbor) -> bool {
    if found.len() == k {
        if !candidate.precedes(&found[k - 1]) {
            return false;
        }
        found.pop();
    }
    let mut at = found.len();
    found.push(candidate);
    while at > 0 && candidate.precedes(&found[at - 1]) {
        found[at] = found[at - 1];
        at -= 1;
    }
    found[at] = candidate;
    true
}

/// The squared distance beyond which nothing can enter the `k` nearest.
fn reach(found: &[Neighbor], k: usize) -> f64 {
    if found.len() == k {
        found[k - 1].distance_squared
    } else {
        f64::INFINITY
    }
}
