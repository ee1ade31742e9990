//! Bounds of the distance from an exact surface, by grids of cells.
//!
//! To ask a surface for a distance is expensive. The distance at the middle of a cell bounds all others in it: it differs
//! by no more than a place is away from the middle. So coarse cells are asked first, and finer ones only where the
//! surface may be near. Each cell is asked once.

use crate::Aabb;
use crate::cpu::exact::placed::Placed;
use crate::cpu::fold::{SpaceFold, is_coarse};
use crate::cpu::zone::ZoneGrid;
use glamx::Vec3;

/// Finer cells along an edge of a coarser one: a power of two. Of 64,000 cells in a test, 36 are asked; with half 38,
/// with twice 145.
const FINER: usize = 4;

/// Half the diagonal of a cell whose edge is 1, and a little more: places in corners are rounded.
const HALF_DIAGONAL: f32 = 0.8661;

/// Memory of one cloud, kept from call to call.
#[derive(Default)]
pub(crate) struct CellDistances {
    /// Of the places, before they are in cells. Most fold nothing.
    fold: SpaceFold,
    /// The finest cells.
    grid: ZoneGrid,
    cells: Vec<Cell>,
    /// Of each cell before folding, infinite until it is asked for. None where nothing is folded.
    middles: Vec<Vec3>,
    /// Coarser cells, the coarsest last. None where places are folded: what is far apart may be in one cell then.
    levels: Vec<Level>,
    /// How many of them are in use.
    count: usize,
}

#[derive(Clone, Copy)]
struct Cell {
    /// Of the distances in it, metres.
    bounds: [f32; 2],
    /// Whether they are as close as one distance tells.
    is_asked: bool,
}

const UNKNOWN: Cell = Cell {
    bounds: [f32::NEG_INFINITY, f32::INFINITY],
    is_asked: false,
};

#[derive(Default)]
struct Level {
    grid: ZoneGrid,
    /// At the middle of each cell, metres. Not a number until it is asked for.
    distances: Vec<f32>,
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
        self.grid = ZoneGrid::with_cells(&bounds, reach, most);
        self.count = 0;
        self.middles.clear();
        if is_coarse(self.grid.inv_cell, reach) {
            self.fold.find(reach, points.clone());
            let folded = points.map(|point| self.fold.folded(point));
            let bounds = folded.fold(Aabb::EMPTY, Aabb::including);
            self.grid = ZoneGrid::with_cells(&bounds, reach, most);
            self.middles.resize(self.grid.cells(), Vec3::INFINITY);
        } else {
            let mut grid = self.grid;
            while grid.dims.iter().any(|n| *n > 2 * FINER) {
                grid.inv_cell /= FINER as f32;
                grid.dims = grid.dims.map(|n| n.div_ceil(FINER));
                if self.count == self.levels.len() {
                    self.levels.push(Level::default());
                }
                let level = &mut self.levels[self.count];
                level.grid = grid;
                level.distances.clear();
                level.distances.resize(grid.cells(), f32::NAN);
                self.count += 1;
            }
        }
        self.cells.clear();
        self.cells.resize(self.grid.cells(), UNKNOWN);
    }

    /// How far the surface is from a place, metres, at least and at most: by the coarsest cell that says more than `enough`,
    /// or by the finest. Nothing is known beside all cells.
    #[inline]
    pub(crate) fn bounds(&mut self, exact: &Placed, place: Vec3, enough: f32) -> [f32; 2] {
        if !self.middles.is_empty() {
            return self.folded_bounds(exact, place);
        }
        let Some(at) = self.grid.cell(place) else {
            return UNKNOWN.bounds;
        };
        let cell = self.cells[self.grid.index(at)];
        if cell.is_asked || cell.bounds[0] > enough {
            cell.bounds
        } else {
            self.refined_bounds(exact, at, enough)
        }
    }

    /// The same by what is known without asking.
    #[inline]
    pub(crate) fn known_bounds(&self, place: Vec3) -> [f32; 2] {
        match self.grid.cell(place) {
            Some(at) if self.middles.is_empty() && !self.cells.is_empty() => {
                self.cells[self.grid.index(at)].bounds
            }
            _ => UNKNOWN.bounds,
        }
    }

    /// The same by the finest cells. One of them may hold places on both sides of a gap. What it keeps is of one side.
    fn folded_bounds(&mut self, exact: &Placed, place: Vec3) -> [f32; 2] {
        let folded = self.fold.folded(place);
        let Some(at) = self.grid.cell(folded) else {
            return UNKNOWN.bounds;
        };
        let k = self.grid.index(at);
        let half_diagonal = HALF_DIAGONAL / self.grid.inv_cell;
        if self.middles[k].distance(place) > half_diagonal {
            self.middles[k] = self.grid.middle(at) + (place - folded);
            self.cells[k] = Cell::asked(exact, self.middles[k], half_diagonal);
        }
        self.cells[k].bounds
    }

    /// What coarser cells, or else the surface, tell of one of the finest.
    fn refined_bounds(&mut self, exact: &Placed, at: [usize; 3], enough: f32) -> [f32; 2] {
        let middle = self.grid.middle(at);
        let half_diagonal = HALF_DIAGONAL / self.grid.inv_cell;
        let cell = &mut self.cells[self.grid.index(at)];
        for (k, level) in self.levels[..self.count].iter_mut().enumerate().rev() {
            let at = at.map(|c| c >> ((k as u32 + 1) * FINER.ilog2()));
            let asked_at = level.grid.middle(at);
            let distance = &mut level.distances[level.grid.index(at)];
            if distance.is_nan() {
                *distance = exact.project(asked_at).0;
            }
            let away = asked_at.distance(middle) + half_diagonal;
            cell.bounds = [*distance - away, *distance + away];
            if cell.bounds[0] > enough {
                return cell.bounds;
            }
        }
        *cell = Cell::asked(exact, middle, half_diagonal);
        cell.bounds
    }
}

impl Cell {
    fn asked(exact: &Placed, middle: Vec3, half_diagonal: f32) -> Self {
        let (distance, _) = exact.project(middle);
        Self {
            bounds: [distance - half_diagonal, distance + half_diagonal],
            is_asked: true,
        }
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
                let [least, most] = cells.bounds(&exact, *place, REACH);
                let distance = place.length() - 1.0;
                let rounding = 1e-6 * place.length();
                assert!(
                    (least - rounding..=most + rounding).contains(&distance),
                    "{place}"
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
