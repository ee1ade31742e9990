//! Stage `zone`: which of the culled points are near the other cloud.
//!
//! A coarse grid over the overlap has one bit per cell. Each cloud marks its cells, and the marks grow by one cell.
//! The other cloud's points in marked cells are near: none within one cell edge is missed. The cost is linear in points
//! and cells. If nothing is near, the pair is rejected before any image is built.
//!
//! An uneven cloud is split into octaves of its radii ([`reach`](crate::reach)). Each pair of octaves has its own grid,
//! with cells as large as the points of both reach. So two points are near by their own radii.

use super::cull::Survivors;
use super::fold::{SpaceFold, is_coarse};
use super::lanes::{multiversioned, truncated};
use super::normals::sorted::{RUN, Sorted};
use crate::Aabb;
use crate::cloud::reach::{Class, classes};
use crate::stage::stage;
use glamx::Vec3;
use std::ops::Range;

/// Most cells of the grid. 4 Mi bits are 512 KiB, which stays in a core's cache; twice as many do not. Larger overlaps
/// get larger cells, and the stage then keeps more points.
const MAX_CELLS: f32 = (1 << 22) as f32;

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

/// Cells of at least the zone's reach over the overlap of both bounds.
#[derive(Clone, Copy, Debug, Default)]
pub struct ZoneGrid {
    /// Corner of the first cell, metres.
    pub min: Vec3,
    /// Cells per metre.
    pub inv_cell: f32,
    /// Cells along x, y, z.
    pub dims: [usize; 3],
}

impl ZoneGrid {
    /// Cells of `reach` metres. They are larger if `bounds` would hold too many.
    pub fn new(bounds: &Aabb, reach: f32) -> Self {
        Self::with_cells(bounds, reach, MAX_CELLS)
    }

    /// The same with at most `most` cells, and at least one.
    pub(super) fn with_cells(bounds: &Aabb, reach: f32, most: f32) -> Self {
        let extents = bounds.extents().max(Vec3::ZERO);
        let mut cell = reach;
        let count = |cell: f32| {
            let n = (extents / cell).floor() + Vec3::ONE;
            n.x * n.y * n.z
        };
        while count(cell) > most {
            cell *= 1.26; // the cube root of 2: half as many cells
        }
        let dims = (extents / cell).floor() + Vec3::ONE;
        let dims = [dims.x as usize, dims.y as usize, dims.z as usize];
        Self {
            min: bounds.min,
            inv_cell: 1.0 / cell,
            dims,
        }
    }

    /// Bits from a cell to the next one along x, y and z. An empty cell after each row and an empty row after each plane
    /// keep marks from growing into the next ones.
    fn strides(&self) -> [usize; 3] {
        let row = self.dims[0] + 1;
        [1, row, row * (self.dims[1] + 1)]
    }

    fn words(&self) -> usize {
        (self.strides()[2] * self.dims[2]).div_ceil(64)
    }

    /// Bit of the cell that holds `point`; `None` outside.
    fn bit(&self, point: Vec3) -> Option<usize> {
        let cell = ((point - self.min) * self.inv_cell).floor();
        let [lx, ly, lz] = self.dims.map(|n| n as f32);
        let is_inside = cell.cmpge(Vec3::ZERO).all() && cell.cmplt(Vec3::new(lx, ly, lz)).all();
        let [x, y, z] = cell.to_array().map(|c| c as usize);
        let [_, row, plane] = self.strides();
        is_inside.then(|| z * plane + y * row + x)
    }

    fn mark<'c>(&self, cells: impl Iterator<Item = &'c u32>, bits: &mut Vec<u64>) {
        bits.clear();
        bits.resize(self.words(), 0);
        for cell in cells {
            bits[*cell as usize / 64] |= 1 << (cell % 64);
        }
    }

    /// Grows the marked cells by one cell in all 26 directions. `spare` is overwritten.
    fn dilate(&self, bits: &mut Vec<u64>, spare: &mut Vec<u64>) {
        for stride in self.strides() {
            spare.clone_from(bits);
            grow(bits, stride, spare);
            std::mem::swap(bits, spare);
        }
    }
}

/// Sets the bits of `to` that are `stride` bits above or below one of `from`.
fn grow(from: &[u64], stride: usize, to: &mut [u64]) {
    let (words, shift) = (stride / 64, stride % 64);
    let Some(rest) = from.len().checked_sub(words).filter(|rest| *rest > 0) else {
        return;
    };
    // Two steps where a word gives its neighbour nothing: a shift by 64 bits is none.
    let carry_up = |word: u64| word >> 1 >> (63 - shift);
    let carry_down = |word: u64| word << 1 << (63 - shift);
    let up = &mut to[words..];
    up[0] |= from[0] << shift;
    for (to, pair) in up[1..].iter_mut().zip(from.windows(2)) {
        *to |= pair[1] << shift | carry_up(pair[0]);
    }
    let above = &from[words..];
    to[rest - 1] |= above[rest - 1] >> shift;
    for (to, pair) in to.iter_mut().zip(above.windows(2)) {
        *to |= pair[0] >> shift | carry_down(pair[1]);
    }
}

/// Fills `near` with the indices of the points whose cells are marked.
fn select(cells: &[u32], bits: &[u64], near: &mut Vec<u32>) {
    near.resize(cells.len(), 0);
    let mut count = 0;
    for (i, cell) in cells.iter().enumerate() {
        near[count] = i as u32;
        count += (bits[*cell as usize / 64] >> (cell % 64) & 1) as usize;
    }
    near.truncate(count);
}

fn locate(points: &Survivors, grid: &ZoneGrid, cells: &mut Vec<u32>) {
    cells.resize(points.len(), 0);
    locate_cells(grid, &points.x, &points.y, &points.z, cells);
}

multiversioned! {
/// Bit of the cell of each point; points outside the grid count to the nearest cell.
fn locate_cells(grid: &ZoneGrid, x: &[f32], y: &[f32], z: &[f32], cells: &mut [u32]) {
    let n = x.len().min(y.len()).min(z.len()).min(cells.len());
    let (x, y, z, cells) = (&x[..n], &y[..n], &z[..n], &mut cells[..n]);
    let [lx, ly, lz] = grid.dims.map(|n| (n - 1) as f32);
    let [_, row, plane] = grid.strides().map(|stride| stride as u32);
    let (min, inv) = (grid.min, grid.inv_cell);
    for i in 0..n {
        let cx = truncated((x[i] - min.x) * inv, lx);
        let cy = truncated((y[i] - min.y) * inv, ly);
        let cz = truncated((z[i] - min.z) * inv, lz);
        cells[i] = cz * plane + cy * row + cx;
    }
}
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

/// Points around some places, kept from call to call.
#[derive(Debug, Default)]
pub(crate) struct AroundPlaces {
    grid: ZoneGrid,
    /// The cells of the places with their neighbours, and the same grown by one more cell.
    near: Vec<u64>,
    around: Vec<u64>,
    spare: Vec<u64>,
    cells: Vec<u32>,
    /// Indices of the points in the second.
    pub(crate) found: Vec<u32>,
}

impl AroundPlaces {
    /// Finds at least the points within `2 · reach` metres of `places`. Cost: linear in points.
    pub(crate) fn find(&mut self, points: &Survivors, places: &[Vec3], reach: f32) {
        let bounds = (places.iter().copied()).fold(Aabb::EMPTY, Aabb::including);
        // Points outside count to the outermost cells. No place is near these.
        self.grid = ZoneGrid::new(&bounds.loosened(3.0 * reach), reach);
        self.near.clear();
        self.near.resize(self.grid.words(), 0);
        for bit in places.iter().filter_map(|place| self.grid.bit(*place)) {
            self.near[bit / 64] |= 1 << (bit % 64);
        }
        self.grid.dilate(&mut self.near, &mut self.spare);
        self.around.clone_from(&self.near);
        self.grid.dilate(&mut self.around, &mut self.spare);
        locate(points, &self.grid, &mut self.cells);
        select(&self.cells, &self.around, &mut self.found);
    }

    /// Whether all points within `reach` metres of `place` were found. They were if it is itself within `reach` of one
    /// of the places.
    pub(crate) fn knows(&self, place: Vec3) -> bool {
        let bit = self.grid.bit(place);
        bit.is_some_and(|bit| self.near[bit / 64] >> (bit % 64) & 1 > 0)
    }
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
            is_near[i] = u8::from(is_in_reach(point, reach, &rows, sorted, further));
        }
    }
}

/// Points that are tested at once, [`RUN`] at most.
const LANES: usize = 8;

multiversioned! {
/// Whether one of the points in `rows`, or of those right behind a row, is in reach of `point`. These reach `further` than
/// the `reach`.
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
