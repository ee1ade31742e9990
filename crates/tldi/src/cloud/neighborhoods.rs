//! Radii and normals of points from the neighbours of their positions.

use crate::cloud::knn::{Neighbor, leaf_start};
use crate::cloud::leaf::LeafSearch;
use crate::cloud::point_normals::plane_normal;
use crate::cloud::radii::{COORDINATE_PER_RADIUS, covering_radii};
use crate::{CloudError, KdTree};
use glamx::Vec3;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};

/// Leaves that are searched one after the other: some 700 positions, for a memory of their own.
const SERIAL_LEAVES: usize = 64;

/// What is made of neighbours.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Neighborhoods {
    /// Which neighbour tells radii, counted from 1, and radii in units of the distance to it.
    pub(crate) radii: Option<(usize, f32)>,
    /// How many, at least 2, tell the plane that normals are taken of.
    pub(crate) normals: Option<usize>,
    /// The side to which normals point.
    pub(crate) viewpoint: Option<Vec3>,
}

/// What was asked for, one for each point; nothing of what was not.
#[derive(Debug, Default)]
pub(crate) struct Found {
    /// In metres.
    pub(crate) radii: Vec<f32>,
    pub(crate) normals: Vec<Vec3>,
}

impl Neighborhoods {
    /// Finds radii and normals of points in one search: see [`covering_radii`] and [`plane_normal`].
    pub(crate) fn of(self, points: &[Vec3]) -> Result<Found, CloudError> {
        let radius_neighbors = self.radii.map_or(0, |(k, _)| k);
        let most = radius_neighbors.max(self.normals.unwrap_or(0));
        if most == 0 {
            return Ok(Found::default());
        }
        let tree = KdTree::from_points(points);
        let values = tree.map_positions(most, |tree, position, neighbors| {
            let radius_neighbors = &neighbors[..radius_neighbors.min(neighbors.len())];
            let normal = self.normals.map_or(Vec3::ZERO, |k| {
                let neighbors = neighbors[..k.min(neighbors.len())].iter();
                plane_normal(
                    position,
                    neighbors.map(|n| tree.position(n.index)),
                    self.viewpoint,
                )
            });
            let squared = radius_neighbors.last().map_or(0.0, |n| n.distance_squared);
            (squared, normal)
        });
        let mut found = Found::default();
        if let Some((_, scale)) = self.radii {
            let radii = values
                .iter()
                .map(|(squared, _)| (f64::from(scale) * squared.sqrt()) as f32);
            found.radii = tree.spread(&covering_radii(&tree, radii.collect())?);
        }
        if self.normals.is_some() {
            let normals: Vec<Vec3> = values.iter().map(|(_, normal)| *normal).collect();
            found.normals = tree.spread(&normals);
        }
        Ok(found)
    }
}

impl KdTree {
    /// For each distinct position, in parallel: `f` of a tree, its position and its `k` nearest other positions in that
    /// tree (all others, if there are fewer) in order of distance. `k` is at least 1. The neighbours'
    /// indices are those of positions, for [`KdTree::position`].
    ///
    /// Positions no farther apart than [`twin_distance`] count as one, in the tree that `f` is given: copies of a
    /// point that were rounded differently are not its neighbours. Where there are such, all is done twice.
    fn map_positions<T: Send + Copy + Default>(
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

    /// The same for the positions of this tree, all of them.
    fn map_entries<T: Send + Copy + Default>(
        &self,
        k: usize,
        f: impl Fn(Vec3, &[Neighbor]) -> T + Sync,
    ) -> Vec<T> {
        let k = k.min(self.distinct() - 1) + 1;
        let mut values = vec![T::default(); self.distinct()];
        self.map_leaves(0..self.leaves, k, &f, &mut values);
        values
    }

    fn map_leaves<T: Send>(
        &self,
        leaves: Range<usize>,
        k: usize,
        f: &(impl Fn(Vec3, &[Neighbor]) -> T + Sync),
        values: &mut [T],
    ) {
        let start = |leaf| leaf_start(leaf, self.leaves, self.distinct());
        let first = start(leaves.start);
        if leaves.len() > SERIAL_LEAVES {
            let middle = leaves.start.midpoint(leaves.end);
            let (left, right) = values.split_at_mut(start(middle) - first);
            rayon::join(
                || self.map_leaves(leaves.start..middle, k, f, left),
                || self.map_leaves(middle..leaves.end, k, f, right),
            );
            return;
        }
        let mut search = LeafSearch::new(self, k);
        for leaf in leaves {
            search.visit(leaf, |entry, neighbors| {
                // The first is the position itself, the only one at distance zero.
                values[entry - first] = f(self.position(entry), &neighbors[1..]);
            });
        }
    }

    /// A tree without positions that are within [`twin_distance`] of one of a lesser index, and for each position of
    /// this one the point of that tree which stands for it. Cost: a search for each position, one after the other.
    fn merged(&self) -> (Self, Vec<usize>) {
        let mut entries: Vec<usize> = (0..self.distinct()).collect();
        entries.sort_unstable_by_key(|&entry| self.points_at(entry)[0]);
        let mut stands_for = vec![usize::MAX; entries.len()];
        let mut kept = vec![];
        for entry in entries {
            if stands_for[entry] < usize::MAX {
                continue;
            }
            let position = self.position(entry);
            let point = kept.len();
            let limit = twin_distance(position).powi(2);
            self.search(position, limit.sqrt() as f32, |twin, distance_squared| {
                if distance_squared <= limit {
                    stands_for[twin] = stands_for[twin].min(point);
                }
                limit
            });
            kept.push(position);
        }
        (Self::from_points(&kept), stands_for)
    }

    /// Hands each point the value of its position.
    fn spread<T: Copy>(&self, values: &[T]) -> Vec<T> {
        let mut spread = vec![values[0]; self.len()];
        for (entry, value) in values.iter().enumerate() {
            for &index in self.points_at(entry) {
                spread[index as usize] = *value;
            }
        }
        spread
    }
}

/// Distance in metres within which two points are the same one, rounded differently, as when a scan is moved and
/// merged with itself: half of the least radius that a cloud accepts there, eight steps of `f32` at most. With half as
/// much, copies that a rotation rounded may count as neighbours; with twice as much, points that a cloud can tell apart
/// may count as one.
fn twin_distance(position: Vec3) -> f64 {
    f64::from(position.abs().max_element()) * (0.5 / f64::from(COORDINATE_PER_RADIUS))
}
