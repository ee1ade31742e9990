//! Nearest neighbours: a k-d tree over the distinct positions of a cloud.

use arrayvec::ArrayVec;
use glamx::Vec3;

/// Most levels of the tree: 2³² points in leaves of at least eight.
pub(super) const LEVELS: usize = 32;

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
    pub(super) positions: Vec<[f32; 3]>,
    /// Inner nodes in pre-order.
    pub(super) splits: Vec<Split>,
    /// Number of leaves, a power of two.
    pub(super) leaves: usize,
    /// The points at `positions[i]` are `indices[starts[i]..starts[i + 1]]`, ascending.
    pub(super) starts: Vec<u32>,
    pub(super) indices: Vec<u32>,
}

/// An inner node: coordinates of the left half are at most `value`, of the right half at least.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Split {
    pub(super) value: f32,
    pub(super) axis: u32,
}

/// A subtree still to be visited.
#[derive(Clone, Copy)]
pub(super) struct Subtree {
    /// Its first split, in pre-order.
    pub(super) split: usize,
    pub(super) first_leaf: usize,
    pub(super) leaves: usize,
    /// Vector from the query, a point or the bounds of a leaf, to the subtree's cell; 0 along axes where they overlap.
    pub(super) offset: [f64; 3],
}

impl KdTree {
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

    /// A distinct position.
    pub(crate) fn position(&self, entry: usize) -> Vec3 {
        Vec3::from_array(self.positions[entry])
    }

    /// The points at a distinct position, ascending.
    pub(super) fn points_at(&self, entry: usize) -> &[u32] {
        &self.indices[self.starts[entry] as usize..self.starts[entry + 1] as usize]
    }

    /// Calls `visit(entry, distance_squared)` for positions no farther from `query` than the
    /// bound, subtrees near the query first. Each call returns the new bound, as a squared
    /// distance; the first one is `radius`.
    ///
    /// Rounding is monotonic and both distances are summed in the same order, so a cell is never
    /// farther than a position in it: nothing is missed.
    pub(super) fn search(
        &self,
        query: Vec3,
        radius: f32,
        mut visit: impl FnMut(usize, f64) -> f64,
    ) {
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

/// First position of a leaf (one past the last position, for `leaf == leaves`).
pub(super) fn leaf_start(leaf: usize, leaves: usize, count: usize) -> usize {
    (leaf as u64 * count as u64 / leaves as u64) as usize
}

pub(super) fn length_squared([x, y, z]: [f64; 3]) -> f64 {
    x * x + y * y + z * z
}

/// Inserts into the sorted `found`, which holds at most `k`; whether there was room.
pub(super) fn insert(found: &mut Vec<Neighbor>, k: usize, candidate: Neighbor) -> bool {
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
pub(super) fn reach(found: &[Neighbor], k: usize) -> f64 {
    if found.len() == k {
        found[k - 1].distance_squared
    } else {
        f64::INFINITY
    }
}
