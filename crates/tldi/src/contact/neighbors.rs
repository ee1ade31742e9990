//! The points of a cloud that are nearest to a place.

use crate::cpu::cull::{CullScratch, Region, Survivors, cull};
use crate::cpu::normals::sorted::{Grid, Sorted};
use crate::cpu::zone::AroundPlaces;
use crate::{Aabb, PointCloud};
use glamx::{Pose3, Vec3};
use std::ops::Range;

/// Neighbours that tell how dense points are. Clouds of fewer have no lone points.
pub(crate) const NEIGHBORS: usize = 4;

/// How far neighbours are looked for, in mean radii of the cloud. A point with fewer than [`NEIGHBORS`] within this is not
/// taken to stand alone. Half or twice: no row changes.
pub(crate) const REACH: f32 = 32.0;

/// Edge of a grid cell in which neighbours are looked for first, in mean radii. With the paper's radii (0.65 of the distance
/// to the seventh neighbour) the fourth neighbour is at about a third of it. Only speed depends on it.
const CELL: f32 = 4.0;

/// The points nearest to a place: squares of their distances in metres, and where they are.
pub(crate) type Nearest = [(f32, Vec3); NEIGHBORS];

/// Keeps the nearest of what it is offered.
fn offer(best: &mut Nearest, squared: f32, point: Vec3) {
    if squared < best[NEIGHBORS - 1].0 {
        let at = best.partition_point(|near| near.0 <= squared);
        best.copy_within(at..NEIGHBORS - 1, at + 1);
        best[at] = (squared, point);
    }
}

/// The points of a cloud in a region, in the frame of the query.
#[derive(Clone, Copy)]
pub(crate) struct Culled<'a> {
    pub(crate) points: &'a Survivors,
    pub(crate) region: &'a Region,
}

/// The points of a cloud around some places, in a grid; kept from call to call.
#[derive(Debug, Default)]
pub(crate) struct Surroundings {
    frame_from_cloud: Pose3,
    /// Where points are known, around the places.
    region: Region,
    around: AroundPlaces,
    /// [`CELL`], metres, and the points sorted into cells as large or larger.
    cell: f32,
    grid: Grid,
    sorted: Sorted,
    /// Points that were not culled before.
    culled: Survivors,
    scratch: CullScratch,
    wide: Wide,
}

/// All points of the cloud in a wider box. It is asked where the grid around the places holds too few neighbours, as around
/// points that stand alone.
#[derive(Debug)]
struct Wide {
    /// Where points are known; empty until it is asked.
    bounds: Aabb,
    culled: Survivors,
    ids: Vec<u32>,
    grid: Grid,
    sorted: Sorted,
}

impl Default for Wide {
    fn default() -> Self {
        Self {
            bounds: Aabb::EMPTY,
            culled: Survivors::default(),
            ids: Vec::new(),
            grid: Grid::default(),
            sorted: Sorted::default(),
        }
    }
}

impl Surroundings {
    /// Finds the points around `places`, among the `culled` ones or else in `cloud`. Cost: a pass over the culled points, or
    /// over the points of the blocks around the places; and a counting sort of the points that are found.
    pub(crate) fn find(
        &mut self,
        cloud: &PointCloud,
        frame_from_cloud: &Pose3,
        culled: Option<&Culled>,
        places: &[Vec3],
    ) {
        self.cell = CELL * cloud.mean_radius();
        self.wide.bounds = Aabb::EMPTY;
        self.frame_from_cloud = *frame_from_cloud;
        let mut own = std::mem::take(&mut self.culled);
        let points = if let Some(culled) = culled {
            self.region = culled.region.clone();
            culled.points
        } else {
            let bounds = (places.iter().copied()).fold(Aabb::EMPTY, Aabb::including);
            let bounds = bounds.loosened(2.0 * self.cell);
            self.region = Region::of_box(bounds);
            let (region, scratch) = (&self.region, &mut self.scratch);
            cull(cloud, frame_from_cloud, region, 1, scratch, &mut own);
            &own
        };
        self.around.find(points, places, self.cell);
        let found = &self.around.found;
        (self.sorted).put(found.iter().map(|&k| points.point(k as usize)));
        self.grid = self.sorted.grid(self.cell);
        self.sorted.sort(found, |_| false, &self.grid);
        self.culled = own;
    }

    /// Distance from `place`, metres, within which all points are in the grid: the edge of a cell at most.
    fn known(&self, place: Vec3) -> f32 {
        if self.around.found.is_empty() || !self.around.knows(place) {
            return 0.0;
        }
        let depth =
            |place: Vec3, bounds: &Aabb| (place - bounds.min).min(bounds.max - place).min_element();
        let Region {
            overlap,
            other_from_frame,
            other_bounds,
            ..
        } = &self.region;
        self.cell
            .min(depth(place, overlap))
            .min(depth(*other_from_frame * place, other_bounds))
    }

    /// The points of `cloud` nearest to `place`, from `beyond` to `reach` metres away, in ascending order. Cost: the points of
    /// 27 cells. Where these hold too few, all points within a few [`REACH`] are sorted into cells once, and cells are visited
    /// outwards.
    pub(crate) fn nearest(
        &mut self,
        cloud: &PointCloud,
        place: Vec3,
        beyond: f32,
        reach: f32,
    ) -> Nearest {
        let mut best: Nearest = [(f32::INFINITY, place); NEIGHBORS];
        let limits = beyond * beyond..=reach * reach;
        let offer_all = |best: &mut Nearest, sorted: &Sorted, points: Range<usize>| {
            for point in points.map(|k| sorted.position(k)) {
                let squared = point.distance_squared(place);
                if limits.contains(&squared) {
                    offer(best, squared, point);
                }
            }
        };
        let known = self.known(place);
        if known > 0.0 {
            for row in self.sorted.rows(self.grid.cell_of(place)) {
                offer_all(&mut best, &self.sorted, row);
            }
            if reach.min(best[NEIGHBORS - 1].0.sqrt()) <= known {
                return best;
            }
            best = [(f32::INFINITY, place); NEIGHBORS];
        }
        self.widen(cloud, place, reach);
        let Wide {
            culled,
            grid,
            sorted,
            ..
        } = &self.wide;
        if culled.is_empty() {
            return best;
        }
        let cell = grid.cell_of(place);
        for ring in 0..=grid.longest() {
            // All points up to there were offered.
            let offered = (ring as f32 - 1.0) * grid.cell();
            if reach.min(best[NEIGHBORS - 1].0.sqrt()) <= offered {
                break;
            }
            sorted.shell(grid, cell, ring, |row| offer_all(&mut best, sorted, row));
        }
        best
    }

    /// Makes [`Wide`] know all points of `cloud` within `reach` metres of `place`.
    fn widen(&mut self, cloud: &PointCloud, place: Vec3, reach: f32) {
        let Wide {
            bounds,
            culled,
            ids,
            grid,
            sorted,
        } = &mut self.wide;
        let needed = Aabb::EMPTY.including(place).loosened(reach);
        if bounds.contains(needed.min) && bounds.contains(needed.max) {
            return;
        }
        // Beside the other places, which are near, and with their neighbours and those of these.
        *bounds = bounds
            .merged(needed)
            .loosened(2.0 * REACH * cloud.mean_radius());
        let region = Region::of_box(*bounds);
        cull(
            cloud,
            &self.frame_from_cloud,
            &region,
            1,
            &mut self.scratch,
            culled,
        );
        sorted.put(culled.points());
        *grid = sorted.grid(self.cell);
        ids.clear();
        ids.extend(0..culled.len() as u32);
        sorted.sort(ids, |_| false, grid);
    }

    /// Whether `cloud` has as many neighbours of `place` from `beyond` to `reach` metres away as tell how dense points are.
    pub(crate) fn has_neighbors(
        &mut self,
        cloud: &PointCloud,
        place: Vec3,
        beyond: f32,
        reach: f32,
    ) -> bool {
        if reach > self.known(place) {
            let [.., (farthest, _)] = self.nearest(cloud, place, beyond, reach);
            return farthest.is_finite();
        }
        let [x, y, z] = &self.sorted.coordinates;
        let in_row = |row: Range<usize>| {
            let points = x[row.clone()].iter().zip(&y[row.clone()]).zip(&z[row]);
            let squared = points.map(|((x, y), z)| Vec3::new(*x, *y, *z).distance_squared(place));
            let are_near = squared.map(|d| (d >= beyond * beyond) & (d <= reach * reach));
            are_near.map(u32::from).sum::<u32>()
        };
        let rows = self.sorted.rows(self.grid.cell_of(place));
        rows.map(in_row).into_iter().sum::<u32>() >= NEIGHBORS as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether the grid knows the answer or the wide one must be asked; of many points and few; and where the points at hand
    /// are those of a region.
    #[test]
    fn the_nearest_points_are_those_of_brute_force() {
        let mut rng = fastrand::Rng::with_seed(3);
        let mut random = |size: f32| size * Vec3::from_array(std::array::from_fn(|_| rng.f32()));
        let pose = Pose3::new(Vec3::new(0.3, -0.2, 0.1), Vec3::new(0.5, 1.0, -0.7));
        for (count, size, is_culled) in [
            (2000, 0.4, false),
            (2000, 0.4, true),
            (40, 0.1, false),
            (40, 0.1, true),
        ] {
            let points: Vec<Vec3> = (0..count).map(|_| random(size)).collect();
            let own: Vec<Vec3> = (points.iter())
                .map(|p| pose.inverse_transform_point(*p))
                .collect();
            let cloud = PointCloud::builder(own).radius(0.02).build();
            let cloud = cloud.expect("a valid cloud");
            let up_to = |edge: f32| Aabb {
                min: Vec3::ZERO,
                max: Vec3::splat(edge),
            };
            let region = Region {
                other_from_frame: Pose3::translation(-0.02, 0.0, 0.0),
                other_bounds: up_to(1.0),
                ..Region::of_box(up_to(0.32))
            };
            let (mut culled, mut scratch) = (Survivors::default(), CullScratch::default());
            cull(&cloud, &pose, &region, 1, &mut scratch, &mut culled);
            let culled = is_culled.then_some(Culled {
                points: &culled,
                region: &region,
            });
            let mut around = Surroundings::default();
            // Around a part of the larger cloud only.
            let places = [0.1, 0.2].map(Vec3::splat);
            around.find(&cloud, &pose, culled.as_ref(), &places);
            assert!((20..1900).contains(&around.around.found.len()));
            let mut known = 0;
            for k in 0..300 {
                let place = random(1.2 * size);
                let beyond = [0.0, 0.01, 0.03][k % 3];
                let reach = [0.02, 0.04, 0.06, 1.0][k / 3 % 4];
                let squares = points.iter().map(|p| p.distance_squared(place));
                let limits = beyond * beyond..=reach * reach;
                let mut expected: Vec<f32> = squares.filter(|s| limits.contains(s)).collect();
                expected.sort_by(f32::total_cmp);
                expected.resize(NEIGHBORS.max(expected.len()), f32::INFINITY);
                known += usize::from(around.known(place) > 0.0);
                let found = around.nearest(&cloud, place, beyond, reach);
                for ((found, _), expected) in found.iter().zip(expected) {
                    // Points were moved there and back.
                    let is_alike = (found - expected).abs() <= 1e-6 || *found == expected;
                    assert!(is_alike, "{found} {expected}: {place} {beyond} {reach}");
                }
            }
            assert!(known >= 3 && (known < 290 || !is_culled), "{known}");
        }
    }
}
