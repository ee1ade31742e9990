//! Normals of unknown sign turned outward.

use super::surfel::Surfel;
use rapier3d::glamx::DVec3;

/// Neighbours that a normal is compared with. Half or twice: no test of masses fails.
const LINKS: usize = 8;

/// Turns the normals outward: neighbours are made to agree, surest pairs first (Hoppe et al. 1992,
/// "Surface reconstruction from unorganized points", doi:10.1145/133994.134011), and what hangs
/// together is then given the sign that makes its enclosed volume positive.
///
/// Areas need only be rough. Cost: a sort of the pairs of neighbours.
pub(super) fn orient(surfels: &mut [Surfel]) {
    let mut pairs: Vec<(f64, u32, u32)> = Vec::new();
    for (i, surfel) in surfels.iter().enumerate() {
        pairs.extend(surfel.neighbors.iter().take(LINKS).map(|&j| {
            let agreement = agreement(surfel, &surfels[j as usize]);
            (agreement, i as u32, j)
        }));
    }
    // A stable sort: equally certain edges keep the order of the points.
    pairs.sort_by(|a, b| b.0.abs().total_cmp(&a.0.abs()));
    let mut forest = SignedForest::new(surfels.len());
    for (agreement, i, j) in pairs {
        forest.join(i, j, agreement.is_sign_negative());
    }

    let mut centers = vec![(DVec3::ZERO, 0.0); surfels.len()];
    for (i, surfel) in surfels.iter_mut().enumerate() {
        let (root, flipped) = forest.find(i as u32);
        if flipped {
            surfel.normal = -surfel.normal;
        }
        let (sum, count) = &mut centers[root as usize];
        *sum += surfel.position;
        *count += 1.0;
    }
    let mut volumes = vec![0.0; surfels.len()];
    for (i, surfel) in surfels.iter().enumerate() {
        let root = forest.find(i as u32).0 as usize;
        let (sum, count) = centers[root];
        volumes[root] += surfel.area * surfel.normal.dot(surfel.position - sum / count);
    }
    for (i, surfel) in surfels.iter_mut().enumerate() {
        if volumes[forest.find(i as u32).0 as usize] < 0.0 {
            surfel.normal = -surfel.normal;
        }
    }
}

/// Positive if the normals have the same sign; the larger, the surer.
///
/// One normal is mirrored in the plane between the points, as the normals of an arc from one to
/// the other are (König, Gumhold 2009, "Consistent propagation of normal orientations in point
/// clouds"): that also tells the normals at a sharp edge and on both sides of a thin wall.
fn agreement(a: &Surfel, b: &Surfel) -> f64 {
    let along = (b.position - a.position).normalize_or_zero();
    let mirrored = b.normal - 2.0 * b.normal.dot(along) * along;
    a.normal.dot(mirrored)
}

/// Disjoint sets whose members have a sign against their root.
struct SignedForest {
    /// Parent, and whether the sign against it is negative.
    parents: Vec<(u32, bool)>,
    sizes: Vec<u32>,
}

impl SignedForest {
    fn new(count: usize) -> Self {
        Self {
            parents: (0..count as u32).map(|i| (i, false)).collect(),
            sizes: vec![1; count],
        }
    }

    /// Root of a member, and whether the sign against it is negative.
    fn find(&mut self, member: u32) -> (u32, bool) {
        let (mut node, mut flipped) = (member, false);
        loop {
            let (parent, flip) = self.parents[node as usize];
            if parent == node {
                return (node, flipped);
            }
            // Halve the path for the next time.
            let (grandparent, parent_flip) = self.parents[parent as usize];
            self.parents[node as usize] = (grandparent, flip ^ parent_flip);
            flipped ^= flip ^ parent_flip;
            node = grandparent;
        }
    }

    /// Joins the sets of `a` and `b`, whose signs differ if `flip`; keeps them as they are if they
    /// are joined already.
    fn join(&mut self, a: u32, b: u32, flip: bool) {
        let ((root_a, flip_a), (root_b, flip_b)) = (self.find(a), self.find(b));
        if root_a == root_b {
            return;
        }
        let (small, large) = if self.sizes[root_a as usize] < self.sizes[root_b as usize] {
            (root_a, root_b)
        } else {
            (root_b, root_a)
        };
        self.parents[small as usize] = (large, flip ^ flip_a ^ flip_b);
        self.sizes[large as usize] += self.sizes[small as usize];
    }
}
