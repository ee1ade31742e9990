//! Points that stand alone beside a surface: flying pixels, dust.
//!
//! Splats around a few points are no surface. A point stands alone if its fourth nearest neighbour
//! is much farther away than the fourth neighbour of one of these four is from that one. By this
//! rule, the points of a wire, of a coarse part of a scan and of a body of few points do not stand
//! alone.

use crate::contact::links::{Groups, Links};
use crate::contact::retain_by_index;
use crate::cpu::cull::{CullScratch, Region, Survivors, cull};
use crate::cpu::normals::sorted::{Grid, Sorted};
use crate::cpu::zone::AroundPlaces;
use crate::{Aabb, BLOCK, ContactPixel, PairQuery, PairResult, PointCloud, Surface};
use glamx::{Mat3, Pose3, Vec3};
use std::ops::Range;

/// Neighbours that tell how dense points are. Clouds of fewer have no lone points.
const NEIGHBORS: usize = 4;

/// A point stands alone if its fourth neighbour is at least this many times as far away as the fourth neighbour of one
/// of its neighbours. At the corner of a grid it is twice as far. Half or twice: no change.
const ALONE: f32 = 2.5;

/// Points closer to each other than this share of the mean radius are the same point. Half or twice: no row changes.
pub(crate) const SAME_POINT: f32 = 1e-3;

/// Contact pixels of one component that are looked at. Half or twice: no row changes.
const SAMPLES: usize = 9;

/// How far neighbours are looked for, in mean radii of the cloud. What has none within that is not known to stand
/// alone. Half or twice: no row changes.
const REACH: f32 = 32.0;

/// How far neighbours are looked for first, in a grid of the points around, in mean radii. With the paper's radii (0.65 of
/// the distance to the seventh neighbour) the fourth is at about a third of it. Only speed depends on it.
const CELL: f32 = 4.0;

/// The points nearest to a place: squares of their distances in metres, and where they are.
type Nearest = [(f32, Vec3); NEIGHBORS];

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
struct Surroundings {
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
}

impl Surroundings {
    /// Finds those around `places` among the `culled` ones or, without these, in `cloud`. Cost: a pass over these, or
    /// over the points of the blocks around; and a counting sort of what is found.
    fn find(
        &mut self,
        cloud: &PointCloud,
        frame_from_cloud: &Pose3,
        culled: Option<&Culled>,
        places: &[Vec3],
    ) {
        self.cell = CELL * cloud.mean_radius();
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

    /// The points of `cloud` nearest to `place`, from `beyond` to `reach` metres away, in ascending
    /// order. Cost: the points of 27 cells; of all blocks in reach, where these have too few.
    fn nearest(&self, cloud: &PointCloud, place: Vec3, beyond: f32, reach: f32) -> Nearest {
        let mut best: Nearest = [(f32::INFINITY, place); NEIGHBORS];
        let limits = beyond * beyond..=reach * reach;
        let known = self.known(place);
        if known > 0.0 {
            for k in (self.sorted.rows(self.grid.cell_of(place)))
                .into_iter()
                .flatten()
            {
                let point = self.sorted.position(k);
                let squared = point.distance_squared(place);
                if limits.contains(&squared) {
                    offer(&mut best, squared, point);
                }
            }
            if reach.min(best[NEIGHBORS - 1].0.sqrt()) <= known {
                return best;
            }
            best = [(f32::INFINITY, place); NEIGHBORS];
        }
        let frame_from_cloud = &self.frame_from_cloud;
        let own = frame_from_cloud.inverse_transform_point(place);
        let rotation = Mat3::from_quat(frame_from_cloud.rotation);
        for (block, bounds) in cloud.blocks().iter().enumerate() {
            let least = own.clamp(bounds.min, bounds.max).distance_squared(own);
            if least <= *limits.end() && least < best[NEIGHBORS - 1].0 {
                for i in block * BLOCK..((block + 1) * BLOCK).min(cloud.len()) {
                    // Moved as the cull moves points, to the bit: a point is not its own neighbour.
                    let point = rotation * cloud.point(i) + frame_from_cloud.translation;
                    let squared = point.distance_squared(place);
                    if limits.contains(&squared) {
                        offer(&mut best, squared, point);
                    }
                }
            }
        }
        best
    }

    /// Whether `cloud` has as many neighbours of `place` from `beyond` to `reach` metres away as tell how dense points are.
    fn has_neighbors(&self, cloud: &PointCloud, place: Vec3, beyond: f32, reach: f32) -> bool {
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

    /// The point of `cloud` nearest to `place`, if it stands alone.
    fn lone_point(&self, cloud: &PointCloud, place: Vec3) -> Option<Vec3> {
        let [same, reach] = [SAME_POINT, REACH].map(|radii| radii * cloud.mean_radius());
        let [(_, point), ..] = self.nearest(cloud, place, 0.0, reach);
        let neighbors = self.nearest(cloud, point, same, reach);
        let (apart, _) = neighbors[NEIGHBORS - 1];
        // The nearest ones may stand alone as well.
        let usual = apart.sqrt() / ALONE;
        let is_alone = apart.is_finite()
            && (neighbors.iter())
                .any(|&(_, neighbor)| self.has_neighbors(cloud, neighbor, same, usual));
        is_alone.then_some(point)
    }
}

/// Removes the components of linked contact pixels that points standing alone make.
#[derive(Debug, Default)]
pub(crate) struct LonePoints {
    around: Surroundings,
    roots: Vec<u32>,
    components: Groups,
    /// Of the small components.
    middles: Vec<Vec3>,
    is_dropped: Vec<bool>,
    /// The lone points that were found, of each side, in the frame of the query; ascending in x.
    pub(crate) found: [Vec<Vec3>; 2],
}

impl LonePoints {
    /// Whether the point of `cloud` nearest to `place`, in its frame, stands alone. Cost: a pass over its blocks.
    pub(crate) fn is_alone(&mut self, cloud: &PointCloud, place: Vec3) -> bool {
        (self.around).find(cloud, &Pose3::IDENTITY, None, &[place]);
        self.around.lone_point(cloud, place).is_some()
    }

    /// Removes them from the contact pixels of `result`, which `links` joins; `false` where there are
    /// none. `culled` are all points of each cloud where the surfaces can touch, if they are at hand.
    pub(crate) fn drop(
        &mut self,
        result: &mut PairResult,
        links: &Links,
        query: &PairQuery,
        culled: [Option<Culled>; 2],
    ) -> bool {
        let contacts = &result.contacts;
        links.components(contacts.len(), &mut self.roots);
        self.components.sort(&self.roots);
        self.is_dropped.clear();
        self.found.iter_mut().for_each(Vec::clear);
        for side in [0, 1] {
            let Surface::Cloud(cloud) = [query.a, query.b][side] else {
                continue;
            };
            let at = |c: &ContactPixel| match side {
                0 => c.point_a,
                _ => c.point_b,
            };
            let frame_from_cloud = [&Pose3::IDENTITY, &query.a_from_b][side];
            let most = most_pixels(cloud, query.params.pixel_size);
            let small = || {
                let components = self.components.iter(&self.roots);
                components.filter(|component| component.len() <= most)
            };
            self.middles.clear();
            (self.middles).extend(small().map(|component| middle(component, contacts, at)));
            if self.middles.is_empty() {
                continue;
            }
            let culled = culled[side].as_ref();
            (self.around).find(cloud, frame_from_cloud, culled, &self.middles);
            for (component, &middle) in small().zip(&self.middles) {
                let places = component.iter().map(|&m| at(&contacts[m as usize]));
                if made_by_lone_points(&self.around, cloud, middle, places, &mut self.found[side]) {
                    self.is_dropped.resize(contacts.len(), false);
                    for &m in component {
                        self.is_dropped[m as usize] = true;
                    }
                }
            }
        }
        for found in &mut self.found {
            found.sort_unstable_by(|p, q| p.x.total_cmp(&q.x));
            found.dedup();
        }
        if self.is_dropped.is_empty() {
            return false;
        }
        retain_by_index(&mut result.contacts, |k, _| !self.is_dropped[k]);
        true
    }
}

/// Most contact pixels that points of `cloud` make which stand alone: the splats of as many as can do
/// so together. A larger component is a surface.
fn most_pixels(cloud: &PointCloud, pixel_size: f32) -> usize {
    // Where points are finer than pixels, splats are as large as these.
    let radius = cloud.max_radius().max(pixel_size) / pixel_size;
    NEIGHBORS * (2.0 * radius + 1.0).powi(2) as usize
}

/// The place of a component that is nearest to the mean of all its places.
fn middle(
    component: &[u32],
    contacts: &[ContactPixel],
    at: impl Fn(&ContactPixel) -> Vec3 + Copy,
) -> Vec3 {
    let places = || component.iter().map(|&m| at(&contacts[m as usize]));
    let mean = places().sum::<Vec3>() / component.len() as f32;
    let squared = |place: &Vec3| place.distance_squared(mean);
    let nearest = places().min_by(|p, q| squared(p).total_cmp(&squared(q)));
    nearest.unwrap_or(mean)
}

/// Whether the middle of a component belongs to a point that stands alone, and so do most of its
/// pixels. At the rim of a large splat, or where fine points border on coarse ones, some do not, or
/// do. If so, `found` gets these points.
fn made_by_lone_points(
    around: &Surroundings,
    cloud: &PointCloud,
    middle: Vec3,
    places: impl ExactSizeIterator<Item = Vec3> + Clone,
    found: &mut Vec<Vec3>,
) -> bool {
    let Some(point) = around.lone_point(cloud, middle) else {
        return false;
    };
    let step = places.len().div_ceil(SAMPLES);
    let sampled = places.step_by(step);
    let (count, before) = (sampled.len(), found.len());
    found.extend(sampled.filter_map(|place| around.lone_point(cloud, place)));
    let are_most = 2 * (found.len() - before) > count;
    if are_most {
        found.push(point);
    } else {
        found.truncate(before);
    }
    are_most
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cloud(points: Vec<Vec3>) -> PointCloud<'static> {
        PointCloud::builder(points)
            .radius(0.02)
            .build()
            .expect("a valid cloud")
    }

    fn grid(spacing: f32, offset: Vec3) -> Vec<Vec3> {
        (0..400)
            .map(|k| spacing * Vec3::new((k % 20) as f32, 0.0, (k / 20) as f32) + offset)
            .collect()
    }

    /// Whether the grid knows the answer or all blocks must be asked; of many points and few; and where the points at hand
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
            let cloud = cloud(own);
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

    fn is_alone(cloud: &PointCloud, place: Vec3) -> bool {
        LonePoints::default().is_alone(cloud, place)
    }

    #[test]
    fn a_point_over_a_sheet_is_alone_and_the_sheet_is_not() {
        let lone = Vec3::new(0.2, 0.12, 0.2);
        let flying = cloud([grid(0.02, Vec3::ZERO), vec![lone]].concat());
        assert!(is_alone(&flying, lone));
        assert!(!is_alone(&flying, Vec3::new(0.2, 0.0, 0.2)));
        // The same point twice is one point.
        let twice = cloud([grid(0.02, Vec3::ZERO), vec![lone, lone]].concat());
        assert!(is_alone(&twice, lone));
    }

    /// Wherever the cloud is, its lone point is found where a cull has it, to the bit: it is taken out of what was culled by
    /// its place.
    #[test]
    fn a_lone_point_far_from_the_origin_is_the_culled_one() {
        let turn = Vec3::new(0.3, 0.7, -0.4);
        for far in [0.0, 10.0, 100.0, 1000.0] {
            let pose = Pose3::new(far * Vec3::new(1.0, 0.3, -0.8), turn);
            let lone = Vec3::new(0.2, 0.12, 0.2);
            let points = grid(0.02, Vec3::ZERO).into_iter().chain([lone]);
            let own = points.map(|p| pose.inverse_transform_point(p));
            let cloud = cloud(own.collect());
            let everything = cloud.bounds().transformed(&pose).loosened(1.0);
            let region = Region::of_box(everything);
            let (mut culled, mut scratch) = (Survivors::default(), CullScratch::default());
            cull(&cloud, &pose, &region, 1, &mut scratch, &mut culled);
            let mut around = Surroundings::default();
            around.find(&cloud, &pose, None, &[lone]);
            let found = around.lone_point(&cloud, lone).expect("it stands alone");
            assert!(culled.points().any(|point| point == found), "{far} m");
        }
    }

    /// Wires, coarse parts of a scan and bodies of few points.
    #[test]
    fn what_is_thin_or_coarse_is_not_alone() {
        let wire: Vec<Vec3> = (0..30).map(|k| 0.03 * k as f32 * Vec3::X).collect();
        assert!(!is_alone(&cloud(wire), 0.3 * Vec3::X));
        let coarse = grid(0.02, 0.02 * Vec3::X);
        let fine = grid(0.002, -0.04 * Vec3::X);
        let both = cloud([fine, coarse].concat());
        assert!(!is_alone(&both, Vec3::new(0.3, 0.0, 0.2)));
        assert!(!is_alone(&cloud(vec![Vec3::ZERO]), Vec3::ZERO));
        assert!(!is_alone(&cloud(vec![Vec3::ZERO, Vec3::X]), Vec3::X));
    }
}
