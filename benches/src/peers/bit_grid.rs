//! One bit per cell that holds a point, then ball tests on what is left: the simple rival to beat.

use super::grid::{Cells, Grid};
use super::{Found, Frame, Peer};
use crate::stopwatch::Stopwatch;
use tldi::glamx::Vec3;

/// Bits of the cells around the points of the first body select the points of the second, and bits of
/// these those of the first; only then are balls tested.
#[derive(Default)]
pub struct BitGrid {
    bits: Vec<u64>,
    near_a: Vec<Vec3>,
    near_b: Vec<Vec3>,
    grid: Grid,
}

impl BitGrid {
    fn mark(&mut self, points: impl Iterator<Item = Vec3>, cells: &Cells) {
        self.bits.clear();
        self.bits.resize(cells.count().div_ceil(64), 0);
        for p in points {
            // Three cells in a row are three bits, of one word or of two.
            for first in cells.rows(cells.nearest(p)) {
                let mask = 7u128 << (first % 64);
                self.bits[first as usize / 64] |= mask as u64;
                if mask >> 64 != 0 {
                    self.bits[first as usize / 64 + 1] |= (mask >> 64) as u64;
                }
            }
        }
    }

    fn is_marked(&self, p: Vec3, cells: &Cells) -> bool {
        cells
            .of(p)
            .is_some_and(|cell| self.bits[cell as usize / 64] >> (cell % 64) & 1 != 0)
    }
}

impl Peer for BitGrid {
    fn name(&self) -> String {
        "bit grid".to_owned()
    }

    fn compare(&mut self, frame: &Frame) -> Found {
        let start = Stopwatch::of_thread();
        let reach = 2.0 * frame.radius;
        let cells = Cells::new(frame.a, reach);
        self.mark(frame.a.iter().copied(), &cells);
        let [mut near_a, mut near_b] = [&mut self.near_a, &mut self.near_b].map(std::mem::take);
        near_a.clear();
        near_b.clear();
        near_b.extend(frame.b.iter().filter(|p| self.is_marked(**p, &cells)));
        if !near_b.is_empty() {
            self.mark(near_b.iter().copied(), &cells);
            near_a.extend(frame.a.iter().filter(|p| self.is_marked(**p, &cells)));
        }
        (self.near_a, self.near_b) = (near_a, near_b);
        let built = start.seconds();
        let mut contacts = 0;
        if !self.near_a.is_empty() {
            let cells = Cells::new(&self.near_a, reach);
            self.grid.sort(&self.near_a, &cells);
            let near = |p: &Vec3| self.grid.near(*p, &cells, reach);
            contacts = self.near_b.iter().map(near).sum();
        }
        Found::new(&start, built, contacts)
    }
}
