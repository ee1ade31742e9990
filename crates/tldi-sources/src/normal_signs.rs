//! Whether normals agree about the side that is outside.

use rayon::prelude::*;
use tldi::glamx::Vec3;
use tldi::{KdTree, PointCloud};

/// Neighbours that a normal is compared with: some of them lie along the surface, whatever its noise. Half or twice: no test
/// changes.
const NEIGHBORS: usize = 8;
/// Share of normals that must be turned, from which on they are taken for normals without a side. Where signs come from
/// a solver of eigenvalues, it is about a half of a closed surface. A sheet that is far thinner than its points are apart
/// looks like one surface with both signs: a flag or an ear may be that much of a body. Half or twice: no test changes.
const TURNED_SHARE: f64 = 0.05;
/// Least improvement by turning them: what contradicts the turned normals, as a share of what contradicts those of the file.
/// If signs of the file are right, but a neighbour misled, turning makes it worse. Half or twice: no test changes.
const REST_SHARE: f64 = 0.5;

/// Two points, and what they say about their normals.
struct Pair {
    points: [u32; 2],
    /// Whether one of the normals must be turned.
    oppose: bool,
    /// 0 to 1.
    certainty: f32,
}

/// Whether many normals point to the other side than those around them: the signs then say nothing.
pub(crate) fn are_mixed(points: &[Vec3], normals: &[Vec3]) -> bool {
    let usable = points.iter().zip(normals).filter_map(|(point, normal)| {
        let normal = normal.try_normalize().filter(|_| point.is_finite())?;
        Some((*point, normal))
    });
    let (points, normals): (Vec<Vec3>, Vec<Vec3>) = usable.unzip();
    // Of fewer points than are compared, or of points without extent, nothing can be said.
    let cloud = PointCloud::builder(&points)
        .knn_radii(NEIGHBORS, 1.0)
        .build();
    let Some(cloud) = cloud.ok().filter(|cloud| cloud.len() > NEIGHBORS) else {
        return false;
    };
    let mut pairs = pairs(&KdTree::new(&cloud), &points, &normals);
    pairs.par_sort_by(|a, b| b.certainty.total_cmp(&a.certainty));
    let mut sides = Sides::new(points.len());
    for pair in &pairs {
        sides.join(pair);
    }
    let contradiction = |is_against: &dyn Fn(&Pair) -> bool| -> f64 {
        let against = pairs.iter().filter(|pair| is_against(pair));
        against.map(|pair| f64::from(pair.certainty)).sum()
    };
    let of_file = contradiction(&|pair| pair.oppose);
    let turned: Vec<bool> = (0..points.len() as u32)
        .map(|k| sides.root_of(k).1)
        .collect();
    let of_turned = contradiction(&|pair| {
        let [a, b] = pair.points.map(|k| turned[k as usize]);
        pair.oppose != (a != b)
    });
    sides.minority() as f64 > TURNED_SHARE * points.len() as f64 && of_turned < REST_SHARE * of_file
}

/// The pairs of near points.
fn pairs(tree: &KdTree, points: &[Vec3], normals: &[Vec3]) -> Vec<Pair> {
    let of_point = |i: usize| {
        let mut near = Vec::with_capacity(NEIGHBORS + 1);
        // The point itself is one of those nearest to it.
        tree.k_nearest(points[i], NEIGHBORS + 1, &mut near);
        near.into_iter().filter_map(move |neighbor| {
            let j = neighbor.index;
            let [n, m] = [normals[i], normals[j]];
            let way = (points[j] - points[i]).try_normalize()?;
            // On an arc from one point to the other, at an edge, and from one face of a plate to the other, a
            // normal becomes its mirror image across the way. Along a normal, the way tells nothing: it may be noise.
            let agreement = (n - 2.0 * way.dot(n) * way).dot(m);
            let steepness = way.dot(n).abs().max(way.dot(m).abs()).min(1.0);
            Some(Pair {
                points: [i as u32, j as u32],
                oppose: agreement < 0.0,
                certainty: agreement.abs() * (1.0 - steepness),
            })
        })
    };
    (0..points.len())
        .into_par_iter()
        .flat_map_iter(of_point)
        .collect()
}

/// Surfaces, as trees of points: each point is on the side of its parent or on the other.
struct Sides {
    parents: Vec<(u32, bool)>,
    sizes: Vec<u32>,
}

impl Sides {
    fn new(count: usize) -> Self {
        Self {
            parents: (0..count as u32).map(|k| (k, false)).collect(),
            sizes: vec![1; count],
        }
    }

    /// The root of a point, and whether the point is on the other side than it.
    fn root_of(&self, point: u32) -> (u32, bool) {
        let (mut at, mut is_other) = (point, false);
        loop {
            let (parent, is_opposite) = self.parents[at as usize];
            if parent == at {
                return (at, is_other);
            }
            is_other ^= is_opposite;
            at = parent;
        }
    }

    /// Makes the surfaces of two points one, unless they are; the smaller one is put below the larger.
    fn join(&mut self, pair: &Pair) {
        let [(a, a_is_other), (b, b_is_other)] = pair.points.map(|k| self.root_of(k));
        if a == b {
            return;
        }
        let [a_size, b_size] = [a, b].map(|root| self.sizes[root as usize]);
        let (low, high) = if a_size < b_size { (a, b) } else { (b, a) };
        self.parents[low as usize] = (high, pair.oppose ^ a_is_other ^ b_is_other);
        self.sizes[high as usize] = a_size + b_size;
    }

    /// Points on the side of their surface that has fewer, of all surfaces together.
    fn minority(&self) -> usize {
        let mut others = vec![0u32; self.parents.len()];
        for point in 0..self.parents.len() as u32 {
            let (root, is_other) = self.root_of(point);
            others[root as usize] += u32::from(is_other);
        }
        let roots = (0..self.parents.len()).filter(|k| self.parents[*k].0 == *k as u32);
        roots
            .map(|root| others[root].min(self.sizes[root] - others[root]) as usize)
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;
    use std::f32::consts::PI;

    type Surface = (Vec<Vec3>, Vec<Vec3>);

    fn ball(count: usize) -> Surface {
        let points: Vec<Vec3> = (0..count)
            .map(|k| {
                let z = 1.0 - (2 * k + 1) as f32 / count as f32;
                let (y, x) = (k as f32 * PI * (3.0 - 5f32.sqrt())).sin_cos();
                let ring = (1.0 - z * z).sqrt();
                Vec3::new(ring * x, ring * y, z)
            })
            .collect();
        (points.clone(), points)
    }

    /// The faces of a box with these half extents, points `step` apart, turned so that no face is level.
    fn plate(half: Vec3, step: f32) -> Surface {
        let turn = tldi::glamx::Quat::from_scaled_axis(Vec3::new(0.4, 0.3, -0.6));
        let axes = [Vec3::X, Vec3::Y, Vec3::Z];
        let (mut points, mut normals) = (Vec::new(), Vec::new());
        for k in 0..3 {
            let (u, v, n) = (axes[(k + 1) % 3], axes[(k + 2) % 3], axes[k]);
            let count = |axis: Vec3| (2.0 * axis.dot(half) / step).ceil().max(1.0) as i32;
            let at = |i: i32, axis: Vec3| {
                ((i as f32 + 0.5) / count(axis) as f32 * 2.0 - 1.0) * axis.dot(half) * axis
            };
            for (i, j) in (0..count(u)).flat_map(|i| (0..count(v)).map(move |j| (i, j))) {
                for n in [n, -n] {
                    points.push(turn * (at(i, u) + at(j, v) + n * half));
                    normals.push(turn * n);
                }
            }
        }
        (points, normals)
    }

    /// The signs that a solver leaves that takes the longest of a matrix' rows' cross products.
    fn as_solved(normals: &[Vec3]) -> Vec<Vec3> {
        let solved = |n: &Vec3| {
            let wanted = [Vec3::X, -Vec3::Y, Vec3::Z];
            let axis = wanted.into_iter().max_by(|a, b| {
                let [a, b] = [a, b].map(|axis| axis.dot(*n).abs());
                a.total_cmp(&b)
            });
            *n * axis.unwrap().dot(*n).signum()
        };
        normals.iter().map(solved).collect()
    }

    #[test]
    fn signs_of_chance_and_of_solvers_are_mixed_and_those_of_surfaces_are_not() {
        let mut rng = Rng::with_seed(5);
        let step = 0.05;
        for (name, (points, normals)) in [
            ("few", ball(300)),
            ("many", ball(20_000)),
            ("box", plate(Vec3::new(1.0, 0.8, 0.6), step)),
            ("thick plate", plate(Vec3::new(1.0, 0.8, 2.0 * step), step)),
            ("thin plate", plate(Vec3::new(1.0, 0.8, 0.5 * step), step)),
        ] {
            let inward: Vec<Vec3> = normals.iter().map(|n| -*n).collect();
            let random: Vec<Vec3> = (normals.iter())
                .map(|n| if rng.bool() { *n } else { -*n })
                .collect();
            assert!(!are_mixed(&points, &normals), "{name}");
            assert!(!are_mixed(&points, &inward), "{name}");
            assert!(are_mixed(&points, &random), "{name}");
            assert!(are_mixed(&points, &as_solved(&normals)), "{name}");
        }
    }

    /// A scan whose noise is as large as the distance of its points, and whose normals are off by some 30°.
    #[test]
    fn noise_does_not_mix_signs() {
        let mut rng = Rng::with_seed(7);
        let mut random = || Vec3::new(rng.f32(), rng.f32(), rng.f32()) - Vec3::splat(0.5);
        let mut points = Vec::new();
        let mut normals = Vec::new();
        for k in 0..10_000 {
            let noise = random();
            points
                .push(Vec3::new((k % 100) as f32, (k / 100) as f32, 0.0) + 2.0 * noise.z * Vec3::Z);
            normals.push((Vec3::Z + random()).normalize());
        }
        assert!(!are_mixed(&points, &normals));
    }
}
