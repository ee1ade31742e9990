//! Bounds of the distance from an exact surface, by grids of cells.
//!
//! To ask a surface for a distance is expensive. The distance at the middle of a cell bounds all others in it: it differs
//! by no more than a place is away from the middle. So coarse cells are asked first, and finer ones only where
//! the surface may be near. Each cell is asked once.

use crate::Aabb;
use crate::cpu::exact::placed::Placed;
use crate::cpu::fold::{SpaceFold, is_coarse};
use crate::cpu::zone::ZoneGrid;
use glamx::Vec3;

/// Finer cells along an edge of a coarser one: a power of two.
const FINER: usize = 4;

/// Memory of one cloud, kept from call to call.
#[derive(Default)]
pub(crate) struct CellDistances {
    /// Of the places, before they are in cells.
    fold: SpaceFold,
    /// The finest first.
    levels: Vec<Level>,
    /// How many of them are in use.
    count: usize,
}

#[derive(Default)]
struct Level {
    grid: ZoneGrid,
    half_diagonal: f32,
    cells: Vec<Cell>,
}

#[derive(Clone, Copy)]
struct Cell {
    /// Infinite until the cell is asked for.
    middle: Vec3,
    /// From there to the surface, metres.
    distance: f32,
}

impl CellDistances {
    /// Makes cells over `points`, the finest of `reach` metres or larger, and no more of these than points.
    pub(crate) fn begin(
        &mut self,
        points: impl ExactSizeIterator<Item = Vec3> + Clone,
        reach: f32,
    ) {
        let most = points.len().max(1) as f32;
        let bounds = points.clone().fold(Aabb::EMPTY, Aabb::including);
        self.fold.clear();
        let mut grid = ZoneGrid::with_cells(&bounds, reach, most);
        if is_coarse(grid.inv_cell, reach) {
            self.fold.find(reach, points.clone());
            let folded = points.map(|point| self.fold.folded(point));
            let bounds = folded.fold(Aabb::EMPTY, Aabb::including);
            grid = ZoneGrid::with_cells(&bounds, reach, most);
        }
        self.count = 0;
        loop {
            if self.count == self.levels.len() {
                self.levels.push(Level::default());
            }
            self.levels[self.count].begin(grid);
            self.count += 1;
            if grid.dims.iter().all(|n| *n <= FINER) {
                break;
            }
            grid.inv_cell /= FINER as f32;
            grid.dims = grid.dims.map(|n| n.div_ceil(FINER));
        }
    }

    /// How far the surface is from a place, metres, at least and at most: by the first cells that say more than `enough`, or
    /// by the finest ones. Nothing is known beside all cells.
    pub(crate) fn bounds(&mut self, exact: &Placed, place: Vec3, enough: f32) -> [f32; 2] {
        let folded = self.fold.folded(place);
        let mut bounds = [f32::NEG_INFINITY, f32::INFINITY];
        let levels = &mut self.levels[..self.count];
        let Some(finest) = (levels.first()).and_then(|level| level.grid.cell(folded)) else {
            return bounds;
        };
        for (k, level) in levels.iter_mut().enumerate().rev() {
            let at = finest.map(|c| c >> (k as u32 * FINER.ilog2()));
            let [x, y, _] = level.grid.dims;
            let cell = &mut level.cells[(at[2] * y + at[1]) * x + at[0]];
            let mut away = cell.middle.distance(place);
            // After folding, one cell may hold places on both sides of a gap. The distance that it keeps is of one side.
            if away > level.half_diagonal {
                let middle = Vec3::from_array(at.map(|c| c as f32 + 0.5));
                cell.middle = level.grid.min + middle / level.grid.inv_cell + (place - folded);
                cell.distance = exact.project(cell.middle).0;
                away = cell.middle.distance(place);
            }
            bounds = [cell.distance - away, cell.distance + away];
            if bounds[0] > enough {
                break;
            }
        }
        bounds
    }
}

impl Level {
    fn begin(&mut self, grid: ZoneGrid) {
        self.grid = grid;
        // A place in a corner is rounded.
        self.half_diagonal = 1.001 * 0.5 * 3.0f32.sqrt() / grid.inv_cell;
        let unasked = Cell {
            middle: Vec3::INFINITY,
            distance: 0.0,
        };
        self.cells.clear();
        self.cells.resize(grid.dims.iter().product(), unasked);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::exact::test_surface::TestSurface;
    use fastrand::Rng;

    const REACH: f32 = 0.02;

    /// Of points around a ball, and between them, with and without a point far away: no bound is more than the distance,
    /// and where the surface may be near, none is less by more than a cell is wide.
    #[test]
    fn bounds_are_tight_where_it_matters() {
        let mut rng = Rng::with_seed(31);
        let mut random = || 3.0 * Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5);
        let mut points: Vec<Vec3> = (0..20_000).map(|_| random()).collect();
        let mut cells = CellDistances::default();
        for is_far in [false, true] {
            if is_far {
                points.push(Vec3::new(9e3, -8e3, 7e3));
            }
            let ball = TestSurface::ball();
            let exact = ball.here();
            cells.begin(points.iter().copied(), REACH);
            let between: Vec<Vec3> = (0..2000).map(|_| random()).collect();
            let mut bound = |place: &Vec3| {
                let (least, distance) =
                    (cells.at_least(&exact, *place, REACH), place.length() - 1.0);
                let rounding = 1e-6 * place.length();
                assert!(
                    least <= distance + rounding,
                    "{least} of {distance} at {place}"
                );
                assert!(
                    most >= distance - rounding,
                    "{most} of {distance} at {place}"
                );
                [least, distance]
            };
            between.iter().map(&mut bound).for_each(drop);
            for [least, distance] in points.iter().map(bound) {
                // No more cells than points: the finest have an edge of up to 0.14 m, and a bound is off by up to their diagonal.
                assert!(
                    least > REACH || least > distance - 0.25,
                    "{least} of {distance}"
                );
            }
        }
    }

    /// A surface in a corner of many cells is asked a few times for what is far from it.
    #[test]
    fn coarse_cells_spare_fine_ones() {
        let at = |k: usize| Vec3::new((k % 40) as f32, (k / 40 % 40) as f32, (k / 1600) as f32);
        let points: Vec<Vec3> = (0..64_000).map(|k| at(k) + 0.8).collect();
        let ball = TestSurface::ball();
        let exact = ball.here();
        let mut cells = CellDistances::default();
        cells.begin(points.iter().copied(), 1.0);
        let near = |place: &&Vec3| cells.bounds(&exact, **place, 1.0)[0] <= 1.0;
        let near = points.iter().filter(near).count();
        let asked = ball.asked();
        assert!((1..200).contains(&near), "{near}");
        assert!(asked < 500, "{asked} of {}", points.len());
    }

    #[test]
    fn beside_all_cells_nothing_is_known() {
        let ball = TestSurface::ball();
        let exact = ball.here();
        let mut cells = CellDistances::default();
        let unknown = [f32::NEG_INFINITY, f32::INFINITY];
        assert_eq!(cells.bounds(&exact, Vec3::ZERO, 1.0), unknown);
        cells.begin([Vec3::ZERO, Vec3::ONE].into_iter(), REACH);
        let beside = Vec3::new(0.5, 0.5, 1.5);
        assert_eq!(cells.bounds(&exact, beside, 1.0), unknown);
    }
}
