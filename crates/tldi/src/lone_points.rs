//! Points that stand alone beside a surface: flying pixels, dust.
//!
//! A splat around a few points is no surface. A point stands alone if its fourth nearest neighbour is
//! much farther away than that of one of these four is from it. So the points of a wire, of a coarse
//! part of a scan and of a body that consists of a few points do not.

use crate::links::Links;
use crate::{Aabb, BLOCK, ContactPixel, PairQuery, PairResult, PointCloud, Surface};
use glamx::Vec3;

/// Neighbours that tell how dense points are. Clouds of fewer have no lone points.
const NEIGHBORS: usize = 4;

/// Times the distance of a neighbour's fourth neighbour beyond which that of a point makes it stand
/// alone. At the corner of a grid it is twice as far.
const ALONE: f32 = 2.5;

/// Points closer to each other than this share of the mean radius are the same point.
const SAME_POINT: f32 = 1e-3;

/// Contact pixels of one component that are looked at.
const SAMPLES: usize = 9;

/// How far neighbours are looked for, in mean radii of the cloud. What has none within that is not
/// known to stand alone.
const REACH: f32 = 32.0;

/// Distances that are compared side by side.
const LANES: usize = 16;

/// The points nearest to a place: squares of their distances in metres, and where they are.
type Nearest = [(f32, Vec3); NEIGHBORS];

/// The blocks of a cloud around some places; kept from call to call.
#[derive(Debug, Default)]
struct Surroundings {
    blocks: Vec<usize>,
    /// Of one question: squares of the distances of blocks, and which.
    near: Vec<(f32, usize)>,
}

impl Surroundings {
    /// Finds those around `places`. Cost: a pass over the blocks.
    fn find(&mut self, cloud: &PointCloud, places: impl Iterator<Item = Vec3>) {
        let bounds = places.fold(Aabb::EMPTY, |all, p| all.including(p));
        // From a place to its point, to a neighbour, and to one of that.
        let region = bounds.loosened(3.0 * REACH * cloud.mean_radius());
        let blocks = cloud.blocks().iter().enumerate();
        self.blocks.clear();
        self.blocks
            .extend(blocks.filter_map(|(k, block)| block.intersects(&region).then_some(k)));
    }

    /// The points of `cloud` nearest to `place`, from `beyond` to `reach` metres away, in ascending
    /// order. Cost: linear in the blocks around, and the points of the nearest few.
    fn nearest(&mut self, cloud: &PointCloud, place: Vec3, beyond: f32, reach: f32) -> Nearest {
        let mut best: Nearest = [(f32::INFINITY, place); NEIGHBORS];
        let [x, y, z] = cloud.coordinates();
        self.near.clear();
        self.near.extend(self.blocks.iter().filter_map(|&block| {
            let bounds = &cloud.blocks()[block];
            let squared = place.clamp(bounds.min, bounds.max).distance_squared(place);
            (squared <= reach * reach).then_some((squared, block))
        }));
        // The nearest block first: it leaves little to look for in the others.
        let nearest = self.near.iter().enumerate();
        if let Some((first, _)) = nearest.min_by(|(_, p), (_, q)| p.0.total_cmp(&q.0)) {
            self.near.swap(0, first);
        }
        for &(squared, block) in &self.near {
            if squared >= best[NEIGHBORS - 1].0 {
                continue;
            }
            let members = block * BLOCK..((block + 1) * BLOCK).min(cloud.len());
            let [x, y, z] = [x, y, z].map(|c| &c[members.clone()]);
            // All distances side by side; few of them are among the least.
            let mut distances = [f32::INFINITY; BLOCK];
            for (squared, ((x, y), z)) in distances.iter_mut().zip(x.iter().zip(y).zip(z)) {
                let found = (x - place.x).powi(2) + (y - place.y).powi(2) + (z - place.z).powi(2);
                let is_asked = (found >= beyond * beyond) & (found <= reach * reach);
                *squared = if is_asked { found } else { f32::INFINITY };
            }
            for (first, some) in members.step_by(LANES).zip(distances.as_chunks::<LANES>().0) {
                let least = |least: f32, d: &f32| if *d < least { *d } else { least };
                if some.iter().fold(f32::INFINITY, least) >= best[NEIGHBORS - 1].0 {
                    continue;
                }
                for (i, &squared) in (first..).zip(some) {
                    if squared < best[NEIGHBORS - 1].0 {
                        let at = best.partition_point(|near| near.0 <= squared);
                        best.copy_within(at..NEIGHBORS - 1, at + 1);
                        best[at] = (squared, cloud.point(i));
                    }
                }
            }
        }
        best
    }

    /// Whether the point of `cloud` nearest to `place` stands alone.
    fn is_alone(&mut self, cloud: &PointCloud, place: Vec3) -> bool {
        let [same, reach] = [SAME_POINT, REACH].map(|radii| radii * cloud.mean_radius());
        let [(_, point), ..] = self.nearest(cloud, place, 0.0, reach);
        let neighbors = self.nearest(cloud, point, same, reach);
        let (apart, _) = neighbors[NEIGHBORS - 1];
        if !apart.is_finite() {
            return false;
        }
        // The nearest ones may stand alone as well.
        let usual = apart.sqrt() / ALONE;
        neighbors.iter().any(|&(_, neighbor)| {
            let [.., (fourth, _)] = self.nearest(cloud, neighbor, same, usual);
            fourth.is_finite()
        })
    }
}

/// Whether the point of `cloud` nearest to `place` stands alone. Cost: a pass over its blocks.
pub(crate) fn is_alone(cloud: &PointCloud, place: Vec3) -> bool {
    let mut around = Surroundings::default();
    around.find(cloud, std::iter::once(place));
    around.is_alone(cloud, place)
}

/// Removes the components of linked contact pixels that points standing alone make.
#[derive(Debug, Default)]
pub(crate) struct LonePoints {
    around: Surroundings,
    links: Links,
    group: Vec<u32>,
    members: Vec<u32>,
    is_dropped: Vec<bool>,
}

impl LonePoints {
    /// Removes them from the contact pixels of `result`, ordered by view, row and column.
    pub(crate) fn drop(&mut self, result: &mut PairResult, query: &PairQuery) {
        let contacts = &result.contacts;
        self.links.find(contacts, &query.params);
        self.links.components(contacts.len(), &mut self.group);
        let group = &self.group;
        self.members.clear();
        self.members.extend(0..contacts.len() as u32);
        self.members
            .sort_unstable_by_key(|&m| (group[m as usize], m));
        self.is_dropped.clear();
        self.is_dropped.resize(contacts.len(), false);
        if contacts.is_empty() {
            return;
        }
        let b_from_a = query.a_from_b.inverse();
        for side in [0, 1] {
            let Surface::Cloud(cloud) = [query.a, query.b][side] else {
                continue;
            };
            let at = |c: &ContactPixel| match side {
                0 => c.point_a,
                _ => b_from_a * c.point_b,
            };
            let same_group = |k: &u32, l: &u32| group[*k as usize] == group[*l as usize];
            let components = || self.members.chunk_by(same_group);
            let middles = components().map(|component| middle(component, contacts, at));
            self.around.find(cloud, middles);
            for component in components() {
                if made_by_lone_point(&mut self.around, cloud, component, contacts, at) {
                    for &m in component {
                        self.is_dropped[m as usize] = true;
                    }
                }
            }
        }
        let mut is_dropped = self.is_dropped.iter();
        result
            .contacts
            .retain(|_| is_dropped.next().is_some_and(|dropped| !dropped));
    }
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
/// do.
fn made_by_lone_point(
    around: &mut Surroundings,
    cloud: &PointCloud,
    component: &[u32],
    contacts: &[ContactPixel],
    at: impl Fn(&ContactPixel) -> Vec3 + Copy,
) -> bool {
    if !around.is_alone(cloud, middle(component, contacts, at)) {
        return false;
    }
    let step = component.len().div_ceil(SAMPLES);
    let places = component.iter().map(|&m| at(&contacts[m as usize]));
    let sampled = || places.clone().step_by(step);
    let alone = sampled()
        .filter(|&place| around.is_alone(cloud, place))
        .count();
    2 * alone > sampled().count()
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
