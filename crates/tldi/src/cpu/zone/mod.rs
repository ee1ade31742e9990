//! Stage `zone`: which of the culled points are near the other cloud.
//!
//! A coarse grid over the overlap has one bit per cell. Each cloud marks its cells, and the marks grow by one cell.
//! The other cloud's points in marked cells are near: none within one cell edge is missed. The cost is linear in points
//! and cells. If nothing is near, the pair is rejected before any image is built.
//!
//! An uneven cloud is split into octaves of its radii ([`reach`](crate::cloud::reach)). Each pair of octaves has its own grid,
//! with cells as large as the points of both reach. So two points are near by their own radii.

mod around_places;
mod grid;

pub(crate) use around_places::AroundPlaces;
pub use grid::ZoneGrid;
pub(crate) use grid::cells_over;

use super::cull::Survivors;
use super::fold::{SpaceFold, is_coarse};
use super::lanes::multiversioned;
use super::normals::sorted::{RUN, Sorted};
use crate::Aabb;
use crate::cloud::reach::{Class, classes};
use crate::stage::stage;
use glamx::Vec3;
use grid::{locate, select};
use std::ops::Range;

/// Most points around one whose distances to it are measured: about a microsecond. Where coarse points lie more densely than
/// that, cells alone decide, and the point may count as near at up to 3.5 edges of a cell.
const MOST_AROUND: usize = 4096;

/// The grid and its bits, kept from call to call.
#[derive(Default)]
pub(crate) struct ZoneScratch {
    bits: Vec<u64>,
    dilated: Vec<u64>,
    cells_a: Vec<u32>,
    cells_b: Vec<u32>,
    fold: SpaceFold,
    /// Points of both sides, on folded axes.
    folded: [Survivors; 2],
    /// For each point 1 if it is near in some octave, else 0.
    is_near_a: Vec<u8>,
    is_near_b: Vec<u8>,
    /// Points of an octave of one side, and by how much each reaches farther than the mean radius, metres.
    sorted: Sorted,
    further: Vec<f32>,
}

/// The culled points of a side, which is a cloud of this mean radius, metres.
#[derive(Clone, Copy)]
pub(crate) struct ZoneSide<'a> {
    pub(crate) points: &'a Survivors,
    pub(crate) mean_radius: f32,
}

/// Fills `near_a` and `near_b` with the indices of the culled points that are near the other cloud. Two points are near
/// within `reach` metres, and farther by as much as their own reaches exceed those of their clouds' mean radii. No near
/// point is missed. A few farther ones, up to two cell diagonals away, are included. All points lie in `bounds`.
pub(crate) fn zone(
    [a, b]: [ZoneSide; 2],
    bounds: &Aabb,
    reach: f32,
    scratch: &mut ZoneScratch,
    near_a: &mut Vec<u32>,
    near_b: &mut Vec<u32>,
) {
    let _stage = stage!("zone");
    let mut folded = std::mem::take(&mut scratch.folded);
    let (mut sides, mut bounds) = ([a, b], *bounds);
    let farthest = sides.iter().map(|side| side.farthest());
    let widest = farthest.fold(reach, |sum, further| sum + further);
    if is_coarse(ZoneGrid::new(&bounds, widest).inv_cell, widest) {
        let points = sides.into_iter().flat_map(|side| side.points.points());
        scratch.fold.find(widest, points);
        if !scratch.fold.is_identity() {
            for (side, folded) in sides.iter_mut().zip(&mut folded) {
                folded.fold(side.points, &scratch.fold);
                side.points = folded;
            }
            let points = sides.into_iter().flat_map(|side| side.points.points());
            bounds = points.fold(Aabb::EMPTY, Aabb::including);
        }
    }
    if sides.iter().all(|side| side.points.further.is_empty()) {
        let grid = ZoneGrid::new(&bounds, reach);
        let [a, b] = sides.map(|side| side.points);
        of_one_octave(a, b, &grid, scratch, near_a, near_b);
    } else {
        of_all_octaves(sides, &bounds, reach, scratch, near_a, near_b);
    }
    scratch.folded = folded;
}

fn of_one_octave(
    a: &Survivors,
    b: &Survivors,
    grid: &ZoneGrid,
    scratch: &mut ZoneScratch,
    near_a: &mut Vec<u32>,
    near_b: &mut Vec<u32>,
) {
    let ZoneScratch {
        bits,
        dilated,
        cells_a,
        cells_b,
        ..
    } = scratch;
    locate(a, grid, cells_a);
    locate(b, grid, cells_b);
    grid.mark(cells_a.iter(), bits);
    grid.dilate(bits, dilated);
    select(cells_b, bits, near_b);
    if near_b.is_empty() {
        near_a.clear();
        return;
    }
    grid.mark(cells_b.iter(), bits);
    grid.dilate(bits, dilated);
    select(cells_a, bits, near_a);
}

/// Cost: that of [`of_one_octave`] and of two counting sorts, once for each pair of octaves among the culled points.
fn of_all_octaves(
    [a, b]: [ZoneSide; 2],
    bounds: &Aabb,
    reach: f32,
    scratch: &mut ZoneScratch,
    near_a: &mut Vec<u32>,
    near_b: &mut Vec<u32>,
) {
    let ZoneScratch {
        bits,
        dilated,
        cells_a,
        cells_b,
        is_near_a,
        is_near_b,
        sorted,
        further,
        ..
    } = scratch;
    for (side, is_near) in [(a, &mut *is_near_a), (b, &mut *is_near_b)] {
        is_near.clear();
        is_near.resize(side.points.len(), 0);
    }
    for class_a in classes(&a.points.further, a.mean_radius) {
        for class_b in classes(&b.points.further, b.mean_radius) {
            let grid = ZoneGrid::new(bounds, reach + class_a.further + class_b.further);
            locate(a.points, &grid, cells_a);
            locate(b.points, &grid, cells_b);
            grid.mark(a.of_class(class_a).map(|k| &cells_a[k]), bits);
            grid.dilate(bits, dilated);
            b.marked(class_b, cells_b, bits, near_b);
            grid.mark(b.of_class(class_b).map(|k| &cells_b[k]), bits);
            grid.dilate(bits, dilated);
            a.marked(class_a, cells_a, bits, near_a);
            if class_a.further + class_b.further > 0.0 {
                // Coarse cells are wide: a point in the next one may lie far beyond the reach of both.
                let (a, b) = ((a.points, &near_a[..]), (b.points, &near_b[..]));
                mark_in_reach(a, b, reach, &grid, (sorted, further), is_near_a);
                mark_in_reach(b, a, reach, &grid, (sorted, further), is_near_b);
            } else {
                near_a.iter().for_each(|&i| is_near_a[i as usize] = 1);
                near_b.iter().for_each(|&j| is_near_b[j as usize] = 1);
            }
        }
    }
    for (is_near, near) in [(is_near_a, near_a), (is_near_b, near_b)] {
        near.clear();
        near.extend((0..is_near.len() as u32).filter(|&k| is_near[k as usize] > 0));
    }
}

/// Marks those of some points that are in reach of one of `others`. None reaches farther than a cell of `grid`.
fn mark_in_reach(
    (points, some): (&Survivors, &[u32]),
    (other_points, others): (&Survivors, &[u32]),
    reach: f32,
    grid: &ZoneGrid,
    (sorted, further): (&mut Sorted, &mut Vec<f32>),
    is_near: &mut [u8],
) {
    if others.is_empty() {
        return;
    }
    sorted.put(others.iter().map(|&j| other_points.point(j as usize)));
    let grid = sorted.grid(1.0 / grid.inv_cell);
    sorted.sort(others, |_| false, &grid);
    further.clear();
    let ids = sorted.entries.iter().map(|entry| entry.id);
    further.extend(ids.map(|j| other_points.further(j as usize)));
    // Nothing is in reach of what has no meaning.
    further.resize(sorted.entries.len() + RUN, f32::NAN);
    for i in some.iter().map(|&i| i as usize) {
        if is_near[i] == 0 {
            let (point, reach) = (points.point(i), reach + points.further(i));
            let rows = sorted.rows(grid.cell_of(point));
            let around: usize = rows.iter().map(|row| row.len()).sum();
            let is_known = around <= MOST_AROUND;
            is_near[i] = u8::from(!is_known || is_in_reach(point, reach, &rows, sorted, further));
        }
    }
}

/// Points that are tested at once, [`RUN`] at most.
const LANES: usize = 8;

multiversioned! {
/// Whether a point in `rows` is within `reach + further` of `point`. Reads on to full lanes: what follows a row is tested,
/// too.
fn is_in_reach(
    point: Vec3,
    reach: f32,
    rows: &[Range<usize>; 9],
    sorted: &Sorted,
    further: &[f32],
) -> bool {
    let [x, y, z] = sorted.coordinates.each_ref().map(|c| &c[..]);
    for row in rows {
        for first in row.clone().step_by(LANES) {
            let run = first..first + LANES;
            let (x, y, z, further) = (&x[run.clone()], &y[run.clone()], &z[run.clone()], &further[run]);
            let mut found = 0;
            for l in 0..LANES {
                let (dx, dy, dz) = (x[l] - point.x, y[l] - point.y, z[l] - point.z);
                let reach = reach + further[l];
                found |= u32::from(dx * dx + dy * dy + dz * dz <= reach * reach);
            }
            if found > 0 {
                return true;
            }
        }
    }
    false
}
}

impl ZoneSide<'_> {
    /// The most by which a point's reach exceeds that of the mean radius, metres.
    fn farthest(&self) -> f32 {
        self.points.further.iter().fold(0.0, |a: f32, &b| a.max(b))
    }

    /// Indices of the points of a class.
    fn of_class(&self, class: Class) -> impl Iterator<Item = usize> {
        let holds = move |k: &usize| class.holds(self.points.further(*k), self.mean_radius);
        (0..self.points.len()).filter(holds)
    }

    /// Fills `near` with the points of a class whose cells are marked.
    fn marked(&self, class: Class, cells: &[u32], bits: &[u64], near: &mut Vec<u32>) {
        let is_marked = |k: &usize| bits[cells[*k] as usize / 64] >> (cells[*k] % 64) & 1 > 0;
        near.clear();
        near.extend(self.of_class(class).filter(is_marked).map(|k| k as u32));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point in the cell next to coarse points, out of their reach, is far where these are measured, and near where they
    /// are too many.
    #[test]
    fn the_work_of_a_point_is_bounded() {
        for (count, is_near) in [(MOST_AROUND, false), (MOST_AROUND + 1, true)] {
            let (mut coarse, mut fine) = (Survivors::default(), Survivors::default());
            let put = |points: &mut Survivors, x: f32| {
                points.x.push(x);
                points.y.push(0.0);
                points.z.push(0.0);
            };
            for k in 0..count {
                put(&mut coarse, 0.1 * (k % 2) as f32);
                coarse.further.push(0.9);
            }
            put(&mut fine, 1.5);
            let bounds = Aabb {
                min: Vec3::ZERO,
                max: 1.5 * Vec3::X,
            };
            let (mut near_coarse, mut near_fine) = (vec![], vec![]);
            let side = |points| ZoneSide {
                points,
                mean_radius: 0.1,
            };
            zone(
                [side(&coarse), side(&fine)],
                &bounds,
                0.1,
                &mut ZoneScratch::default(),
                &mut near_coarse,
                &mut near_fine,
            );
            assert_eq!(!near_fine.is_empty(), is_near, "{count}");
        }
    }

    /// Brute force says: every pair within reach is found. Nothing is found beyond the grown cells, or beyond the reach
    /// of coarser points.
    #[test]
    fn selects_what_brute_force_selects() {
        for seed in 0..80 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let mean_radius = 0.02;
            let mut random = |n: usize| {
                let mut s = Survivors::default();
                for _ in 0..n {
                    s.x.push(rng.f32() * 9.0);
                    s.y.push(rng.f32());
                    s.z.push(rng.f32() * 2.0);
                    if seed % 2 > 0 {
                        // Two in three, up to eight times as far.
                        let radii = (8.0 * rng.f32() - 2.0).max(0.0);
                        s.further.push(radii * mean_radius);
                    }
                }
                s
            };
            let (a, b) = (random(60), random(50));
            let bounds = Aabb {
                min: Vec3::ZERO,
                max: Vec3::new(9.0, 1.0, 2.0),
            };
            let reach = 2.0 * mean_radius + 0.2 * (seed as f32 / 80.0);
            let (mut near_a, mut near_b) = (vec![], vec![]);
            let side = |points| ZoneSide {
                points,
                mean_radius,
            };
            zone(
                [side(&a), side(&b)],
                &bounds,
                reach,
                &mut ZoneScratch::default(),
                &mut near_a,
                &mut near_b,
            );
            for (p, q, near) in [(&a, &b, &near_a), (&b, &a, &near_b)] {
                for i in 0..p.len() {
                    // How far a point of the other cloud is, in reaches of both.
                    let share = |j: usize| {
                        let reach = reach + p.further(i) + q.further(j);
                        p.point(i).distance(q.point(j)) / reach
                    };
                    let nearest = (0..q.len()).map(share).fold(f32::INFINITY, f32::min);
                    let selected = near.contains(&(i as u32));
                    assert!(
                        selected || nearest > 1.0,
                        "seed {seed}: point {i} at {nearest} missed"
                    );
                    // Coarser points are measured. Of others the cells decide: two neighbouring ones span at most
                    // two diagonals.
                    let farthest = match p.further(i) > 0.0 {
                        true => 1.0001,
                        false => 2.0 * 3.0f32.sqrt() * 1.0001,
                    };
                    assert!(
                        !selected || nearest <= farthest,
                        "seed {seed}: point {i} at {nearest}"
                    );
                }
            }
        }
    }
}
