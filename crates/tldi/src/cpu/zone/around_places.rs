//! The points around some places.

use crate::Aabb;
use crate::cpu::cull::Survivors;
use crate::cpu::zone::grid::{ZoneGrid, locate, select};
use glamx::Vec3;

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
