//! A uniform grid by counting sort, rebuilt in every frame.

use super::{Deepest, Found, Frame, Peer};
use crate::placements::bounds;
use crate::stopwatch::Stopwatch;
use tldi::glamx::{UVec3, Vec3};

/// Most cells: larger grids get larger cells.
const MAX_CELLS: f32 = (1 << 24) as f32;

/// The first body's points in cells as large as a pair of balls reaches; the second's look around.
#[derive(Default)]
pub struct Grid {
    cells: Vec<u32>,
    starts: Vec<u32>,
    cursors: Vec<u32>,
    sorted: Vec<Vec3>,
    tells_deepest: bool,
}

/// Cells over the points of a body, and a rim of two: what is near it has neighbours as well.
pub(super) struct Cells {
    min: Vec3,
    inv_cell: f32,
    pub(super) dims: UVec3,
}

impl Cells {
    pub(super) fn new(points: &[Vec3], edge: f32) -> Self {
        let bounds = bounds(points);
        let dims = |edge: f32| (bounds.extents() / edge).floor() + Vec3::splat(5.0);
        let mut edge = edge;
        while dims(edge).element_product() > MAX_CELLS {
            edge *= 1.26; // twice fewer cells
        }
        Self {
            min: bounds.min - Vec3::splat(2.0 * edge),
            inv_cell: 1.0 / edge,
            dims: dims(edge).as_uvec3(),
        }
    }

    pub(super) fn count(&self) -> usize {
        self.dims.element_product() as usize
    }

    /// Cell of a point, if its neighbours are cells too.
    pub(super) fn of(&self, p: Vec3) -> Option<u32> {
        let at = (p - self.min) * self.inv_cell;
        let last = (self.dims - UVec3::ONE).as_vec3();
        let is_inside = at.cmpge(Vec3::ONE).all() && at.cmplt(last).all();
        is_inside.then(|| {
            let c = at.as_uvec3();
            (c.z * self.dims.y + c.y) * self.dims.x + c.x
        })
    }

    /// Cell of a point, or the nearest one whose neighbours are cells.
    pub(super) fn nearest(&self, p: Vec3) -> u32 {
        let at = ((p - self.min) * self.inv_cell).max(Vec3::ONE);
        let c = at.as_uvec3().min(self.dims - UVec3::splat(2));
        (c.z * self.dims.y + c.y) * self.dims.x + c.x
    }

    /// First cells of the nine rows of three around a cell.
    pub(super) fn rows(&self, cell: u32) -> impl Iterator<Item = u32> {
        let (row, slice) = (self.dims.x, self.dims.x * self.dims.y);
        (0..9).map(move |k| cell + k / 3 * slice + k % 3 * row - slice - row - 1)
    }
}

impl Grid {
    /// One that also tells the deepest pair of balls.
    pub fn telling_deepest() -> Self {
        Self {
            tells_deepest: true,
            ..Self::default()
        }
    }

    /// Sorts the points into cells.
    pub(super) fn sort(&mut self, points: &[Vec3], cells: &Cells) {
        self.starts.clear();
        self.starts.resize(cells.count() + 1, 0);
        self.cells.clear();
        self.cells.extend(points.iter().map(|p| cells.nearest(*p)));
        for cell in &self.cells {
            self.starts[*cell as usize + 1] += 1;
        }
        for k in 1..self.starts.len() {
            self.starts[k] += self.starts[k - 1];
        }
        self.sorted.resize(points.len(), Vec3::ZERO);
        self.cursors.clone_from(&self.starts);
        for (p, cell) in points.iter().zip(&self.cells) {
            let cursor = &mut self.cursors[*cell as usize];
            self.sorted[*cursor as usize] = *p;
            *cursor += 1;
        }
    }

    /// Points within the balls' reach of `p`.
    pub(super) fn near(&self, p: Vec3, cells: &Cells, reach: f32) -> usize {
        let Some(cell) = cells.of(p) else {
            return 0;
        };
        let in_row = |first: u32| {
            let range =
                self.starts[first as usize] as usize..self.starts[first as usize + 3] as usize;
            let row = self.sorted[range].iter();
            row.filter(|q| p.distance_squared(**q) <= reach * reach)
                .count()
        };
        cells.rows(cell).map(in_row).sum()
    }

    /// Points within the balls' reach of the points of `b`, and the nearest pair of all.
    fn nearest(&self, b: &[Vec3], cells: &Cells, reach: f32) -> (usize, Option<Deepest>) {
        let mut count = 0;
        let mut least = f32::INFINITY;
        let mut way = Vec3::ZERO;
        for p in b {
            let Some(cell) = cells.of(*p) else {
                continue;
            };
            for first in cells.rows(cell) {
                let first = first as usize;
                let row = self.starts[first] as usize..self.starts[first + 3] as usize;
                for q in &self.sorted[row] {
                    let squared = p.distance_squared(*q);
                    count += usize::from(squared <= reach * reach);
                    if squared < least {
                        (least, way) = (squared, *p - *q);
                    }
                }
            }
        }
        let deepest = Deepest {
            // Of balls in one place as rapier has it.
            normal: way.normalize_or(Vec3::Y),
            depth: reach - least.sqrt(),
        };
        (count, (count > 0).then_some(deepest))
    }
}

impl Peer for Grid {
    fn name(&self) -> String {
        "grid (counting sort)".to_owned()
    }

    fn compare(&mut self, frame: &Frame) -> Found {
        let start = Stopwatch::of_thread();
        let reach = 2.0 * frame.radius;
        let cells = Cells::new(frame.a, reach);
        self.sort(frame.a, &cells);
        let built = start.seconds();
        let (contacts, deepest) = match self.tells_deepest {
            true => self.nearest(frame.b, &cells, reach),
            false => {
                let near = frame.b.iter().map(|p| self.near(*p, &cells, reach));
                (near.sum(), None)
            }
        };
        Found {
            deepest,
            ..Found::new(&start, built, contacts)
        }
    }
}
