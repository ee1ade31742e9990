//! Points that stand alone beside a surface: flying pixels, dust.
//!
//! Splats around a few points are no surface. For each point, take the distance to its fourth nearest
//! neighbour. A point stands alone if its own distance is much larger than that of one of its four
//! neighbours. So the points of a wire, of a coarse part of a scan and of a body of few points do not
//! stand alone.

use crate::contact::links::{Groups, Links};
use crate::contact::neighbors::{Culled, NEIGHBORS, REACH, Surroundings};
use crate::contact::retain_by_index;
use crate::{ContactPixel, PairQuery, PairResult, PointCloud, Surface};
use glamx::{Pose3, Vec3};

/// A point stands alone if the distance to its fourth neighbour is at least this many times that of one of its
/// neighbours. At the corner of a grid it is twice as large. Half or twice: no change.
const ALONE: f32 = 2.5;

/// Points closer to each other than this share of the mean radius are the same point. Half or twice: no row changes.
pub(crate) const SAME_POINT: f32 = 1e-3;

/// Contact pixels of one component that are looked at. Half or twice: no row changes.
const SAMPLES: usize = 9;

/// The point of `cloud` nearest to `place`, if it stands alone.
fn lone_point(around: &mut Surroundings, cloud: &PointCloud, place: Vec3) -> Option<Vec3> {
    let [same, reach] = [SAME_POINT, REACH].map(|radii| radii * cloud.mean_radius());
    let [(_, point), ..] = around.nearest(cloud, place, 0.0, reach);
    let neighbors = around.nearest(cloud, point, same, reach);
    let (apart, _) = neighbors[NEIGHBORS - 1];
    // The nearest ones may stand alone as well.
    let usual = apart.sqrt() / ALONE;
    let is_alone = apart.is_finite()
        && (neighbors.iter())
            .any(|&(_, neighbor)| around.has_neighbors(cloud, neighbor, same, usual));
    is_alone.then_some(point)
}

/// Removes the components of linked contact pixels that points standing alone make.
#[derive(Debug, Default)]
pub(crate) struct LonePoints {
    /// Around places of each side.
    around: [Surroundings; 2],
    /// Of each side, whether the surroundings are those of the motion that [`begin`](Self::begin) began.
    is_begun: [bool; 2],
    roots: Vec<u32>,
    components: Groups,
    /// Of the small components.
    middles: Vec<Vec3>,
    is_dropped: Vec<bool>,
    /// The lone points that were found, of each side, in the frame of the query; ascending in x.
    pub(crate) found: [Vec<Vec3>; 2],
}

impl LonePoints {
    /// Before the clouds of a pair are asked for points that stand alone.
    pub(crate) fn begin(&mut self) {
        self.is_begun = [false; 2];
    }

    /// Whether the point nearest to `place`, in the frame of `cloud`, stands alone. It is the cloud of this side in all
    /// questions since [`begin`](Self::begin). Cost of the first one: a pass over its blocks.
    pub(crate) fn is_alone(&mut self, side: usize, cloud: &PointCloud, place: Vec3) -> bool {
        let around = &mut self.around[side];
        if !std::mem::replace(&mut self.is_begun[side], true) {
            around.find(cloud, &Pose3::IDENTITY, None, &[place]);
        }
        lone_point(around, cloud, place).is_some()
    }

    /// Removes the contact pixels that lone points make from `result`, which `links` joins. Returns whether there were any.
    /// `culled` are all points of each cloud where the surfaces can touch, if they are at hand.
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
            let around = &mut self.around[side];
            around.find(cloud, frame_from_cloud, culled, &self.middles);
            for (component, &middle) in small().zip(&self.middles) {
                let places = component.iter().map(|&m| at(&contacts[m as usize]));
                if made_by_lone_points(around, cloud, middle, places, &mut self.found[side]) {
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

/// Whether the middle of a component and most of its pixels belong to points that stand alone. (At the rim of a large splat,
/// or where fine points border on coarse ones, single pixels tell nothing.) If so, `found` gets these points.
fn made_by_lone_points(
    around: &mut Surroundings,
    cloud: &PointCloud,
    middle: Vec3,
    places: impl ExactSizeIterator<Item = Vec3> + Clone,
    found: &mut Vec<Vec3>,
) -> bool {
    let Some(point) = lone_point(around, cloud, middle) else {
        return false;
    };
    let step = places.len().div_ceil(SAMPLES);
    let sampled = places.step_by(step);
    let (count, before) = (sampled.len(), found.len());
    found.extend(sampled.filter_map(|place| lone_point(around, cloud, place)));
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
    use crate::cpu::cull::{CullScratch, Region, Survivors, cull};

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

    fn is_alone(cloud: &PointCloud, place: Vec3) -> bool {
        LonePoints::default().is_alone(0, cloud, place)
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
            let found = lone_point(&mut around, &cloud, lone).expect("it stands alone");
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
