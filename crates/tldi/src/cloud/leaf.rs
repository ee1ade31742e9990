//! The nearest neighbours of all positions of a leaf at once.

use crate::KdTree;
use crate::cloud::knn::{LEVELS, Neighbor, Subtree, insert, leaf_start, length_squared, reach};
use arrayvec::ArrayVec;
use glamx::DVec3;
use multiversion::multiversion;

/// How far beyond the leaf's bounds its positions look together, in the distance from their middle to as many
/// neighbours as are asked for. Half of it leaves many positions to be searched for alone, twice of it makes four
/// times as many distances.
const REACH: f64 = 1.5;
/// Where the neighbours of a position are expected, in the distance to the last neighbour of the position before. With
/// 1 half of them are looked for twice; with 2 four times as many are sorted.
const EXPECTED: f64 = 1.2;
/// Most positions that a leaf looks at, for each neighbour asked for: beside something denser it would look at
/// all of it. On an even surface they are some six; twice as many cost as much as separate searches.
const MOST_PER_NEIGHBOR: usize = 24;

/// Searches for the `k` positions nearest to each position of a leaf, itself included.
///
/// One descent of the tree collects what is near the leaf; distances to that are in a row, and vectorised. What the
/// leaf did not look far enough for is searched for alone. Distances, their order, and so results are to the bit
/// those of [`KdTree::search`].
pub(super) struct LeafSearch<'a> {
    tree: &'a KdTree,
    k: usize,
    /// Positions near the leaf, and their entries.
    near: [Vec<f64>; 3],
    entries: Vec<u32>,
    distances: Vec<f64>,
    keys: Vec<u128>,
    found: Vec<Neighbor>,
}

impl<'a> LeafSearch<'a> {
    /// `k` is at least 1 and at most the number of positions.
    pub(super) fn new(tree: &'a KdTree, k: usize) -> Self {
        Self {
            tree,
            k,
            near: [vec![], vec![], vec![]],
            entries: Vec::new(),
            distances: Vec::new(),
            keys: Vec::new(),
            found: Vec::with_capacity(k),
        }
    }

    /// Calls `visit` for each entry of a leaf, with its neighbours in order of distance, then entry.
    pub(super) fn visit(&mut self, leaf: usize, mut visit: impl FnMut(usize, &[Neighbor])) {
        let tree = self.tree;
        let start = |leaf| leaf_start(leaf, tree.leaves, tree.positions.len());
        let entries = start(leaf)..start(leaf + 1);
        let (mut min, mut max) = (DVec3::INFINITY, DVec3::NEG_INFINITY);
        for entry in entries.clone() {
            let position = tree.position(entry).as_dvec3();
            (min, max) = (min.min(position), max.max(position));
        }
        self.search((0.5 * (min + max)).as_vec3());
        let mut expected = reach(&self.found, self.k);
        let farthest = REACH * REACH * expected;
        let is_together = self.collect(min.to_array(), max.to_array(), farthest);
        for entry in entries {
            let position = tree.position(entry);
            let is_found = is_together
                && [(EXPECTED * EXPECTED * expected).min(farthest), farthest]
                    .into_iter()
                    .any(|limit| self.select(position.to_array().map(f64::from), limit));
            if !is_found {
                self.search(position);
            }
            expected = reach(&self.found, self.k);
            visit(entry, &self.found);
        }
    }

    /// Finds the positions nearest to a point by a search of the tree.
    fn search(&mut self, point: glamx::Vec3) {
        let (found, k) = (&mut self.found, self.k);
        found.clear();
        self.tree
            .search(point, f32::INFINITY, |index, distance_squared| {
                let candidate = Neighbor {
                    index,
                    distance_squared,
                };
                insert(found, k, candidate);
                reach(found, k)
            });
    }

    /// Collects the positions whose squared distance from the bounds is at most `limit`; whether they are few enough.
    fn collect(&mut self, min: [f64; 3], max: [f64; 3], limit: f64) -> bool {
        let tree = self.tree;
        let most = MOST_PER_NEIGHBOR * self.k;
        let leaf = |leaf| leaf_start(leaf, tree.leaves, tree.positions.len());
        self.near.iter_mut().for_each(Vec::clear);
        self.entries.clear();
        let mut pending = ArrayVec::<Subtree, { LEVELS + 1 }>::new();
        pending.push(Subtree {
            split: 0,
            first_leaf: 0,
            leaves: tree.leaves,
            offset: [0.0; 3],
        });
        while let Some(at) = pending.pop() {
            if at.leaves > 1 {
                let split = tree.splits[at.split];
                let (axis, value, half) =
                    (split.axis as usize, f64::from(split.value), at.leaves / 2);
                let (mut left, mut right) = (at, at);
                (left.split, left.leaves) = (at.split + 1, half);
                (right.split, right.leaves) = (at.split + half, half);
                right.first_leaf += half;
                left.offset[axis] = left.offset[axis].max(min[axis] - value);
                right.offset[axis] = right.offset[axis].max(value - max[axis]);
                pending.extend(
                    [right, left]
                        .into_iter()
                        .filter(|part| length_squared(part.offset) <= limit),
                );
                continue;
            }
            for entry in leaf(at.first_leaf)..leaf(at.first_leaf + 1) {
                let position = tree.positions[entry].map(f64::from);
                let offset = [0, 1, 2].map(|axis| {
                    (min[axis] - position[axis])
                        .max(position[axis] - max[axis])
                        .max(0.0)
                });
                if length_squared(offset) <= limit {
                    for (near, coordinate) in self.near.iter_mut().zip(position) {
                        near.push(coordinate);
                    }
                    self.entries.push(entry as u32);
                }
            }
            if self.entries.len() > most {
                return false;
            }
        }
        true
    }

    /// Finds the positions nearest to a point among the collected ones whose squared distance is at most `limit`;
    /// whether these are enough.
    fn select(&mut self, point: [f64; 3], limit: f64) -> bool {
        let [x, y, z] = &self.near;
        self.distances.resize(x.len(), 0.0);
        squared_distances(point, [x, y, z], &mut self.distances);
        self.keys.resize(x.len(), 0);
        let mut count = 0;
        for (distance, entry) in self.distances.iter().zip(&self.entries) {
            // Distances are not negative: their bits are in their order.
            self.keys[count] = u128::from(distance.to_bits()) << 32 | u128::from(*entry);
            count += usize::from(*distance <= limit);
        }
        if count < self.k {
            return false;
        }
        let mut keys = &mut self.keys[..count];
        if count > self.k {
            keys.select_nth_unstable(self.k);
            keys = &mut keys[..self.k];
        }
        keys.sort_unstable();
        self.found.clear();
        self.found.extend(keys.iter().map(|key| Neighbor {
            index: *key as u32 as usize,
            distance_squared: f64::from_bits((*key >> 32) as u64),
        }));
        true
    }
}

/// Squared distances from a point to others, summed as in [`length_squared`].
#[multiversion(targets("x86_64+avx2", "aarch64+neon"))]
fn squared_distances(point: [f64; 3], [x, y, z]: [&[f64]; 3], distances: &mut [f64]) {
    let n = distances.len();
    let (x, y, z) = (&x[..n], &y[..n], &z[..n]);
    for i in 0..n {
        let [x, y, z] = [x[i] - point[0], y[i] - point[1], z[i] - point[2]];
        distances[i] = x * x + y * y + z * z;
    }
}
