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

/// The points of a cloud nearest to a place: squares of their distances in metres, and indices.
type Nearest = [(f32, usize); NEIGHBORS];

/// The points of `cloud` nearest to `place` and at least `beyond` metres away, in ascending order.
fn nearest(cloud: &PointCloud, place: Vec3, beyond: f32) -> Nearest {
    let [x, y, z] = cloud.coordinates();
    let away = |bounds: &Aabb| place.clamp(bounds.min, bounds.max).distance_squared(place);
    let mut best: Nearest = [(f32::INFINITY, 0); NEIGHBORS];
    let mut visit = |block: usize| {
        let first = block * BLOCK;
        for i in first..(first + BLOCK).min(cloud.len()) {
            let squared = Vec3::new(x[i], y[i], z[i]).distance_squared(place);
            if squared >= beyond * beyond && squared < best[NEIGHBORS - 1].0 {
                let at = best.partition_point(|near| near.0 <= squared);
                best.copy_within(at..NEIGHBORS - 1, at + 1);
                best[at] = (squared, i);
            }
        }
        best[NEIGHBORS - 1].0
    };
    // The block that is nearest first: it spares most of the others.
    let blocks = cloud.blocks();
    let by_distance = |k: &usize, l: &usize| away(&blocks[*k]).total_cmp(&away(&blocks[*l]));
    let first = (0..blocks.len()).min_by(by_distance).unwrap_or(0);
    let mut limit = visit(first);
    for (block, bounds) in blocks.iter().enumerate() {
        if block != first && away(bounds) < limit {
            limit = visit(block);
        }
    }
    best
}

/// Whether the point of `cloud` nearest to `place` stands alone. Cost: up to six passes over the
/// bounds of its blocks.
pub(crate) fn is_alone(cloud: &PointCloud, place: Vec3) -> bool {
    let same = SAME_POINT * cloud.mean_radius();
    let [(_, point), ..] = nearest(cloud, place, 0.0);
    let neighbors = nearest(cloud, cloud.point(point), same);
    let (apart, _) = neighbors[NEIGHBORS - 1];
    if !apart.is_finite() {
        return false;
    }
    // The nearest ones may stand alone as well.
    neighbors.iter().any(|&(_, neighbor)| {
        let [.., (usual, _)] = nearest(cloud, cloud.point(neighbor), same);
        apart > ALONE * ALONE * usual
    })
}

/// Removes the components of linked contact pixels that points standing alone make.
#[derive(Debug, Default)]
pub(crate) struct LonePoints {
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
        let b_from_a = query.a_from_b.inverse();
        for component in self
            .members
            .chunk_by(|&k, &l| group[k as usize] == group[l as usize])
        {
            let is_lone = |surface: &Surface, at: &dyn Fn(&ContactPixel) -> Vec3| match surface {
                Surface::Cloud(cloud) => made_by_lone_point(cloud, component, contacts, at),
                Surface::Exact(_) | Surface::Device(_) => false,
            };
            if is_lone(&query.a, &|c| c.point_a) || is_lone(&query.b, &|c| b_from_a * c.point_b) {
                for &m in component {
                    self.is_dropped[m as usize] = true;
                }
            }
        }
        let mut is_dropped = self.is_dropped.iter();
        result
            .contacts
            .retain(|_| is_dropped.next().is_some_and(|dropped| !dropped));
    }
}

/// Whether the middle of a component belongs to a point that stands alone, and so do most of its
/// pixels. At the rim of a large splat, or where fine points border on coarse ones, some do not, or
/// do.
fn made_by_lone_point(
    cloud: &PointCloud,
    component: &[u32],
    contacts: &[ContactPixel],
    at: &dyn Fn(&ContactPixel) -> Vec3,
) -> bool {
    let places = || component.iter().map(|&m| at(&contacts[m as usize]));
    let mean = places().sum::<Vec3>() / component.len() as f32;
    let middle = places().min_by(|p, q| {
        let squared = |place: &Vec3| place.distance_squared(mean);
        squared(p).total_cmp(&squared(q))
    });
    if !middle.is_some_and(|middle| is_alone(cloud, middle)) {
        return false;
    }
    let step = component.len().div_ceil(SAMPLES);
    let sampled = || places().step_by(step);
    let alone = sampled().filter(|&place| is_alone(cloud, place)).count();
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
