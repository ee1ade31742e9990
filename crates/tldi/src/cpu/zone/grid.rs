//! A grid with one bit per cell: marks, and their growth.

use crate::Aabb;
use crate::cpu::cull::Survivors;
use crate::cpu::lanes::{multiversioned, truncated};
use crate::cpu::normals::sorted::most_cells;
use glamx::Vec3;

/// Most cells of the grid. 4 Mi bits are 512 KiB, which stays in a core's cache; twice as many do not. Larger overlaps
/// get larger cells, and the stage then keeps more points.
const MAX_CELLS: f32 = (1 << 22) as f32;

/// Edge in metres and numbers of the cells of a grid over `extents`, with `rim` more along each axis: of at least `edge`
/// metres, and larger where there would be more than `most`.
pub(crate) fn cells_over(extents: Vec3, mut edge: f32, rim: f32, most: f32) -> (f32, [usize; 3]) {
    let dims = |edge: f32| (extents / edge).floor() + Vec3::splat(1.0 + rim);
    while dims(edge).element_product() > most {
        edge *= 1.26; // the cube root of 2: half as many cells
    }
    (edge, dims(edge).to_array().map(|n| n as usize))
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
    /// Cells of `reach` metres. They are larger if `bounds`, which are finite, would hold too many.
    pub fn new(bounds: &Aabb, reach: f32) -> Self {
        Self::with_cells(bounds, reach, MAX_CELLS)
    }

    /// The same with at most `most` cells, and at least one.
    pub(crate) fn with_cells(bounds: &Aabb, reach: f32, most: f32) -> Self {
        let extents = bounds.extents().max(Vec3::ZERO);
        let (cell, dims) = cells_over(extents, reach.max(f32::MIN_POSITIVE), 0.0, most);
        Self {
            min: bounds.min,
            inv_cell: 1.0 / cell,
            dims,
        }
    }

    /// The grid over `bounds`, in cells of at least `radius` metres, in which the neighbours within `radius` of so many
    /// points are looked for.
    pub fn of_neighbors(bounds: &Aabb, radius: f32, points: usize) -> Self {
        Self::with_cells(bounds, radius, most_cells(points))
    }

    /// Bits from a cell to the next one along x, y and z. An empty cell after each row and an empty row after each plane
    /// keep marks from growing into the next ones.
    fn strides(&self) -> [usize; 3] {
        let row = self.dims[0] + 1;
        [1, row, row * (self.dims[1] + 1)]
    }

    pub(super) fn words(&self) -> usize {
        (self.strides()[2] * self.dims[2]).div_ceil(64)
    }

    /// Column, row and plane of the cell that holds `point`; `None` outside.
    #[inline]
    pub(crate) fn cell(&self, point: Vec3) -> Option<[usize; 3]> {
        let at = (point - self.min) * self.inv_cell;
        // By way of `i32`, which takes one instruction each.
        let dims = Vec3::from_array(self.dims.map(|n| n as i32 as f32));
        let is_inside = at.cmpge(Vec3::ZERO).all() && at.cmplt(dims).all();
        is_inside.then(|| at.to_array().map(|c| c as i32 as usize))
    }

    pub(crate) fn cells(&self) -> usize {
        self.dims.iter().product()
    }

    /// A cell's place in a list of all.
    #[inline]
    pub(crate) fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.dims[1] + y) * self.dims[0] + x
    }

    /// Of a cell, metres.
    pub(crate) fn middle(&self, at: [usize; 3]) -> Vec3 {
        let at = Vec3::from_array(at.map(|c| c as f32));
        self.min + (at + 0.5) / self.inv_cell
    }

    /// Bit of the cell that holds `point`; `None` outside.
    pub(super) fn bit(&self, point: Vec3) -> Option<usize> {
        let [_, row, plane] = self.strides();
        self.cell(point).map(|[x, y, z]| z * plane + y * row + x)
    }

    pub(super) fn mark<'c>(&self, cells: impl Iterator<Item = &'c u32>, bits: &mut Vec<u64>) {
        bits.clear();
        bits.resize(self.words(), 0);
        for cell in cells {
            bits[*cell as usize / 64] |= 1 << (cell % 64);
        }
    }

    /// Grows the marked cells by one cell in all 26 directions. `spare` is overwritten.
    pub(super) fn dilate(&self, bits: &mut Vec<u64>, spare: &mut Vec<u64>) {
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
    // In two steps, because no word can be shifted by 64 bits: that is what a shift of 0 asks of the carry.
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
pub(super) fn select(cells: &[u32], bits: &[u64], near: &mut Vec<u32>) {
    near.resize(cells.len(), 0);
    let mut count = 0;
    for (i, cell) in cells.iter().enumerate() {
        near[count] = i as u32;
        count += (bits[*cell as usize / 64] >> (cell % 64) & 1) as usize;
    }
    near.truncate(count);
}

pub(super) fn locate(points: &Survivors, grid: &ZoneGrid, cells: &mut Vec<u32>) {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Of random grids, the marked cells and their neighbours are marked, and no others.
    #[test]
    fn marks_grow_by_a_cell() {
        let mut rng = fastrand::Rng::with_seed(5);
        for _ in 0..200 {
            let dims = [(); 3].map(|()| {
                let most = [3, 20, 90][rng.usize(0..3)];
                rng.usize(1..most)
            });
            let extents = Vec3::from_array(dims.map(|n| n as f32 - 0.5));
            let bounds = Aabb {
                min: Vec3::ZERO,
                max: extents,
            };
            let grid = ZoneGrid::new(&bounds, 1.0);
            assert_eq!(grid.dims, dims);
            let mut cell = || dims.map(|n| rng.usize(0..n));
            let bit = |cell: [usize; 3]| {
                let middle = Vec3::from_array(cell.map(|c| c as f32)) + 0.25;
                grid.bit(middle).expect("is inside")
            };
            let marked = [cell(), cell(), cell()];
            let mut bits = vec![];
            grid.mark(marked.map(|cell| bit(cell) as u32).iter(), &mut bits);
            grid.dilate(&mut bits, &mut vec![]);
            for _ in 0..50 {
                // Beside a marked one, and anywhere.
                let aside = marked[0].map(|c| c.saturating_sub(2) + rng.usize(0..5));
                let anywhere = dims.map(|n| rng.usize(0..n));
                for cell in [[0, 1, 2].map(|k| aside[k].min(dims[k] - 1)), anywhere] {
                    let is_near = |m: &[usize; 3]| (0..3).all(|k| m[k].abs_diff(cell[k]) <= 1);
                    let bit = bit(cell);
                    let is_marked = bits[bit / 64] >> (bit % 64) & 1 > 0;
                    assert_eq!(is_marked, marked.iter().any(is_near), "{dims:?} {cell:?}");
                }
            }
        }
    }
}
