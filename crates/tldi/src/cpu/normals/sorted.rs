//! Points in a grid of cells, so that each finds its neighbours in 27 of them.

use crate::counting_sort::sort_by_bin;
use crate::cpu::lanes::{bounds, multiversioned, truncated};
use crate::cpu::zone::cells_over;
use glamx::Vec3;
use std::ops::Range;

/// Most cells per point: on a surface of 4 million points there are as many. Sparser ones get
/// larger cells, which only makes for more candidates.
const CELLS_PER_POINT: usize = 16;

/// Most cells of a grid of so many points.
pub(crate) fn most_cells(points: usize) -> f32 {
    (CELLS_PER_POINT * points + 4096) as f32
}

/// Empty cells along each axis, one on either side.
const RIM_CELLS: f32 = 2.0;

/// Most candidates whose distances are looked at, for all points of a cell: five times what a
/// surface has. Of more, an even selection represents them.
pub(crate) const MAX_CANDIDATES: usize = 512;

/// Coordinates that are copied at once, needed or not: as many as a row of cells has on a surface, or half of them.
pub(crate) const RUN: usize = 16;

/// For [`stage_constants`](crate::pair::plan::stage_constants).
pub(crate) const CONSTANTS: [(&str, f64); 1] = [("MAX_CANDIDATES", MAX_CANDIDATES as f64)];

/// Points in the order of their cells.
#[derive(Debug, Default)]
pub(crate) struct Sorted {
    /// Coordinates of the points in the order in which they came, and their cells.
    points: [Vec<f32>; 3],
    cells: Vec<u32>,
    /// What follows is in the order of the cells.
    pub(crate) entries: Vec<Entry>,
    /// Coordinates, and [`RUN`] more of no meaning.
    pub(crate) coordinates: [Vec<f32>; 3],
    /// First point of each cell; one entry more than cells.
    offsets: Vec<u32>,
    /// Numbers of cells along x and y.
    dims: [usize; 2],
}

/// A point in the order of the cells.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Entry {
    pub(crate) id: u32,
    pub(crate) cell: u32,
    pub(super) wanted: bool,
}

/// Cells of the neighbourhood's size; a rim of empty cells spares bounds checks.
#[derive(Debug, Default)]
pub(crate) struct Grid {
    min: Vec3,
    pub(super) inv_cell: f32,
    dims: [usize; 3],
}

impl Grid {
    fn new(min: Vec3, max: Vec3, support: f32, points: usize) -> Self {
        let (cell, dims) = cells_over(max - min, support, RIM_CELLS, most_cells(points));
        Self {
            min,
            inv_cell: 1.0 / cell,
            dims,
        }
    }

    /// Edge of a cell, metres.
    pub(crate) fn cell(&self) -> f32 {
        1.0 / self.inv_cell
    }

    /// Most cells in a row.
    pub(crate) fn longest(&self) -> usize {
        self.dims.into_iter().fold(0, usize::max)
    }

    fn cells(&self) -> usize {
        self.dims.iter().product()
    }

    /// The cell of a place; of one beside the points, the nearest of theirs.
    pub(crate) fn cell_of(&self, place: Vec3) -> usize {
        self.cell_at(place.to_array()) as usize
    }

    #[inline(always)]
    fn cell_at(&self, [x, y, z]: [f32; 3]) -> u32 {
        let most = self.dims.map(|d| d as f32 - (1.0 + RIM_CELLS));
        let [width, height] = [self.dims[0] as u32, self.dims[1] as u32];
        let x = 1 + truncated((x - self.min.x) * self.inv_cell, most[0]);
        let y = 1 + truncated((y - self.min.y) * self.inv_cell, most[1]);
        let z = 1 + truncated((z - self.min.z) * self.inv_cell, most[2]);
        (z * height + y) * width + x
    }
}

impl Sorted {
    /// Takes the coordinates of points.
    pub(crate) fn put(&mut self, points: impl ExactSizeIterator<Item = Vec3>) {
        let [x, y, z] = &mut self.points;
        for coordinate in [&mut *x, &mut *y, &mut *z] {
            coordinate.resize(points.len(), 0.0);
        }
        for (((x, y), z), point) in x.iter_mut().zip(y).zip(z).zip(points) {
            (*x, *y, *z) = (point.x, point.y, point.z);
        }
    }

    /// Cells of `support` metres over the points. Larger ones if there would be too many.
    pub(crate) fn grid(&self, support: f32) -> Grid {
        let [x, y, z] = self.points.each_ref().map(|c| bounds(c));
        let (min, max) = (Vec3::new(x.0, y.0, z.0), Vec3::new(x.1, y.1, z.1));
        Grid::new(min, max, support, self.points[0].len())
    }

    /// Counting sort of the points by cell.
    pub(crate) fn sort(&mut self, support: &[u32], wanted: impl Fn(usize) -> bool, grid: &Grid) {
        let Self {
            points,
            cells,
            entries,
            coordinates,
            offsets,
            dims,
        } = self;
        *dims = [grid.dims[0], grid.dims[1]];
        cells.resize(support.len(), 0);
        locate(grid, points, cells);
        entries.resize(support.len(), Entry::default());
        for coordinate in &mut *coordinates {
            coordinate.resize(support.len() + RUN, 0.0);
        }
        let in_cells = support.iter().zip(&*cells).enumerate().rev();
        let items = in_cells.map(|(k, (&id, &cell))| (cell, (k, id, cell)));
        sort_by_bin(items, grid.cells(), offsets, |place, (k, id, cell)| {
            entries[place] = Entry {
                id,
                cell,
                wanted: wanted(k),
            };
            for (to, from) in coordinates.iter_mut().zip(&*points) {
                to[place] = from[k];
            }
        });
    }

    /// Of the `k`-th point.
    pub(crate) fn position(&self, k: usize) -> Vec3 {
        Vec3::from_array(self.coordinates.each_ref().map(|c| c[k]))
    }

    /// The points whose normals are wanted.
    pub(crate) fn wanted(&self) -> impl Iterator<Item = u32> {
        let all = self.entries.iter().zip(0..);
        all.filter(|(entry, _)| entry.wanted).map(|(_, k)| k)
    }

    /// The points in a cell and its neighbours: three cells in a row along x are consecutive.
    #[inline(always)]
    pub(crate) fn rows(&self, cell: usize) -> [Range<usize>; 9] {
        let [row, slice] = [self.dims[0], self.dims[0] * self.dims[1]];
        std::array::from_fn(|k| {
            let first = cell + k / 3 * slice + k % 3 * row - slice - row - 1;
            self.offsets[first] as usize..self.offsets[first + 3] as usize
        })
    }
}

impl Sorted {
    /// Hands the points of the cells that are `ring` cells from one of `grid` to `take`, in rows.
    pub(crate) fn shell(
        &self,
        grid: &Grid,
        cell: usize,
        ring: usize,
        mut take: impl FnMut(Range<usize>),
    ) {
        let [width, height, depth] = grid.dims;
        let [x, y, z] = [cell % width, cell / width % height, cell / (width * height)];
        let span = |c: usize, cells: usize| c.saturating_sub(ring)..(c + ring + 1).min(cells);
        for k in span(z, depth) {
            for j in span(y, height) {
                let row = (k * height + j) * width;
                let mut take_cells = |cells: Range<usize>| {
                    let [first, end] = [cells.start, cells.end].map(|c| self.offsets[row + c]);
                    take(first as usize..end as usize);
                };
                let cells = span(x, width);
                if z.abs_diff(k) == ring || y.abs_diff(j) == ring {
                    take_cells(cells);
                    continue;
                }
                for end in [x.checked_sub(ring), Some(x + ring)] {
                    if let Some(end) = end.filter(|end| cells.contains(end)) {
                        take_cells(end..end + 1);
                    }
                }
            }
        }
    }
}

multiversioned! {
/// Finds the cells of points.
fn locate(grid: &Grid, [x, y, z]: &[Vec<f32>; 3], cells: &mut [u32]) {
    for (((x, y), z), cell) in x.iter().zip(y).zip(z).zip(cells) {
        *cell = grid.cell_at([*x, *y, *z]);
    }
}
}
