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

/// How far neighbours are looked for at least, in mean radii of the cloud. What has none within that
/// is not known to stand alone.
const REACH: f32 = 32.0;

/// Most cells around the places that are asked about.
const MAX_CELLS: f32 = 4096.0;

/// The points nearest to a place: squares of their distances in metres, and where they are.
type Nearest = [(f32, Vec3); NEIGHBORS];

/// The points of a cloud around some places, sorted into cells; kept from call to call.
#[derive(Debug, Default)]
struct Surroundings {
    min: Vec3,
    inv_cell: f32,
    dims: [usize; 3],
    /// First point of each cell; one entry more than cells.
    starts: Vec<u32>,
    points: Vec<Vec3>,
    same: f32,
    is_asked: Vec<bool>,
    found: Vec<(usize, Vec3)>,
}

impl Surroundings {
    /// Finds those around `places`. Cost: a pass over the points of the blocks there.
    fn find(&mut self, cloud: &PointCloud, places: impl Iterator<Item = Vec3> + Clone) {
        let bounds = places.clone().fold(Aabb::EMPTY, |all, p| all.including(p));
        let mut cell = REACH * cloud.mean_radius();
        let dims = |cell: f32| (bounds.extents() / cell).floor() + Vec3::splat(3.0);
        while dims(cell).element_product() > MAX_CELLS {
            cell *= 1.26; // a third of an octave: twice fewer cells
        }
        self.min = bounds.min - Vec3::splat(cell);
        self.inv_cell = 1.0 / cell;
        self.dims = dims(cell).to_array().map(|n| n as usize);
        self.same = SAME_POINT * cloud.mean_radius();
        let count = self.dims.iter().product();
        let mut is_asked = std::mem::take(&mut self.is_asked);
        is_asked.clear();
        is_asked.resize(count, false);
        for place in places {
            for cell in self.cell(place).into_iter().flat_map(|c| self.around(c)) {
                is_asked[cell] = true;
            }
        }
        self.is_asked = is_asked;
        let region = bounds.loosened(cell);
        self.found.clear();
        for (block, block_bounds) in cloud.blocks().iter().enumerate() {
            if !block_bounds.intersects(&region) {
                continue;
            }
            for i in block * BLOCK..((block + 1) * BLOCK).min(cloud.len()) {
                let point = cloud.point(i);
                let cell = self.cell(point).map(|c| self.index(c));
                if let Some(cell) = cell.filter(|&c| self.is_asked[c]) {
                    self.found.push((cell, point));
                }
            }
        }
        // Counts go one further, so that after the sums an entry is its cell's cursor, and after the
        // sort its end: the next cell's first point.
        self.starts.clear();
        self.starts.resize(count + 2, 0);
        for (cell, _) in &self.found {
            self.starts[cell + 2] += 1;
        }
        for k in 2..count + 2 {
            self.starts[k] += self.starts[k - 1];
        }
        self.points.resize(self.found.len(), Vec3::ZERO);
        for &(cell, point) in &self.found {
            self.points[self.starts[cell + 1] as usize] = point;
            self.starts[cell + 1] += 1;
        }
    }

    /// The cell of a place, if it is one.
    fn cell(&self, place: Vec3) -> Option<[usize; 3]> {
        let at = ((place - self.min) * self.inv_cell).to_array();
        let is_inside = (0..3).all(|k| at[k] >= 0.0 && at[k] < self.dims[k] as f32);
        is_inside.then(|| at.map(|c| c as usize))
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.dims[1] + y) * self.dims[0] + x
    }

    /// Indices of a cell and of those around it.
    fn around(&self, cell: [usize; 3]) -> impl Iterator<Item = usize> {
        let [xs, ys, zs] =
            [0, 1, 2].map(|k| cell[k].saturating_sub(1)..(cell[k] + 2).min(self.dims[k]));
        zs.flat_map(move |z| {
            let xs = xs.clone();
            ys.clone()
                .flat_map(move |y| xs.clone().map(move |x| self.index([x, y, z])))
        })
    }

    /// The points nearest to `place` and at least `beyond` metres away, in ascending order.
    fn nearest(&self, place: Vec3, beyond: f32) -> Nearest {
        let mut best: Nearest = [(f32::INFINITY, place); NEIGHBORS];
        let cells = self.cell(place).into_iter().flat_map(|c| self.around(c));
        for cell in cells {
            for &point in &self.points[self.starts[cell] as usize..self.starts[cell + 1] as usize] {
                let squared = point.distance_squared(place);
                if squared >= beyond * beyond && squared < best[NEIGHBORS - 1].0 {
                    let at = best.partition_point(|near| near.0 <= squared);
                    best.copy_within(at..NEIGHBORS - 1, at + 1);
                    best[at] = (squared, point);
                }
            }
        }
        best
    }

    /// Whether the point nearest to `place` stands alone.
    fn is_alone(&self, place: Vec3) -> bool {
        let [(_, point), ..] = self.nearest(place, 0.0);
        let neighbors = self.nearest(point, self.same);
        let (apart, _) = neighbors[NEIGHBORS - 1];
        if !apart.is_finite() {
            return false;
        }
        // The nearest ones may stand alone as well.
        neighbors.iter().any(|&(_, neighbor)| {
            let [.., (usual, _)] = self.nearest(neighbor, self.same);
            apart > ALONE * ALONE * usual
        })
    }
}

/// Whether the point of `cloud` nearest to `place` stands alone. Cost: a pass over the points of the
/// blocks around it.
pub(crate) fn is_alone(cloud: &PointCloud, place: Vec3) -> bool {
    let mut around = Surroundings::default();
    around.find(cloud, std::iter::once(place));
    around.is_alone(place)
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
                if made_by_lone_point(&self.around, component, contacts, at) {
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
    around: &Surroundings,
    component: &[u32],
    contacts: &[ContactPixel],
    at: impl Fn(&ContactPixel) -> Vec3 + Copy,
) -> bool {
    if !around.is_alone(middle(component, contacts, at)) {
        return false;
    }
    let step = component.len().div_ceil(SAMPLES);
    let places = component.iter().map(|&m| at(&contacts[m as usize]));
    let sampled = || places.clone().step_by(step);
    let alone = sampled().filter(|&place| around.is_alone(place)).count();
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
