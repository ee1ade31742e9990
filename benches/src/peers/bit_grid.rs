//! One bit per cell that holds a point, then ball tests on what is left: the simple rival to beat.

use super::grid::{Cells, Grid};
use super::{Found, Frame, Peer};
use std::time::Instant;
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
        let start = Instant::now();
        let reach = 2.0 * frame.radius;
        let cells = Cells::new(frame.a, reach);
        self.mark(frame.a.iter().copied(), &cells);
        let near_b: Vec<Vec3> = (frame.b.iter().copied())
            .filter(|p| self.is_marked(*p, &cells))
            .collect();
        self.near_b = near_b;
        let mut near_a = std::mem::take(&mut self.near_a);
        near_a.clear();
        if !self.near_b.is_empty() {
            let marked = std::mem::take(&mut self.near_b);
            self.mark(marked.iter().copied(), &cells);
            self.near_b = marked;
            near_a.extend(frame.a.iter().filter(|p| self.is_marked(**p, &cells)));
        }
        self.near_a = near_a;
        let built = start.elapsed().as_secs_f64();
        let mut contacts = 0;
        if !self.near_a.is_empty() {
            let cells = Cells::new(&self.near_a, reach);
            self.grid.sort(&self.near_a, &cells);
            let near = |p: &Vec3| self.grid.near(*p, &cells, reach);
            contacts = self.near_b.iter().map(near).sum();
        }
        Found {
            build_seconds: built,
            query_seconds: start.elapsed().as_secs_f64() - built,
            collides: contacts > 0,
            contacts,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::peers::{BvhRebuild, BvhRefit, Culled};
    use rapier3d::parry::partitioning::BvhBuildStrategy;

    /// Every peer that tests balls finds the pairs that brute force finds.
    #[test]
    fn peers_find_what_brute_force_finds() {
        for seed in 0..30 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let shift = 0.8 + 0.4 * rng.f32();
            let mut points = |x: f32| -> Vec<Vec3> {
                let at = |_| Vec3::new(x + rng.f32(), rng.f32(), rng.f32());
                (0..300).map(at).collect()
            };
            let (a, b) = (points(0.0), points(shift));
            let frame = Frame {
                a: &a,
                b: &b,
                radius: 0.03,
            };
            let reach = 2.0 * frame.radius;
            let near = |p: &&Vec3| b.iter().filter(|q| p.distance(**q) <= reach).count();
            let expected: usize = a.iter().map(|p| near(&p)).sum();
            let bvh = |strategy| BvhRebuild { strategy };
            let peers: Vec<Box<dyn Peer>> = vec![
                Box::new(BitGrid::default()),
                Box::new(Grid::default()),
                Box::new(bvh(BvhBuildStrategy::Binned)),
                Box::new(bvh(BvhBuildStrategy::Ploc)),
                Box::new(BvhRefit::default()),
                Box::new(Culled::new(BitGrid::default())),
                Box::new(Culled::new(Grid::default())),
            ];
            for mut peer in peers {
                for _ in 0..2 {
                    let found = peer.compare(&frame);
                    assert_eq!(found.contacts, expected, "seed {seed}: {}", peer.name());
                }
            }
        }
    }
}
