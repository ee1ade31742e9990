//! Turns a cloud into small flat patches.

use super::orient::orient;
use super::outer;
use super::surfel::{NEIGHBORS, Surfel};
use rapier3d::glamx::{DMat3, DSymmetricEigen3, DVec2, DVec3, Vec3};
use rayon::prelude::*;
use tldi::{KdTree, Neighbor, PointCloud};

/// Most points, about, whose patches are computed. Half or twice: no test of masses fails.
const MAX_SAMPLES: usize = 100_000;

/// Points, with the point itself, that a normal is fitted to. Half: tests of solids without normals and of thin
/// walls fail; twice: that of thin walls does.
const FITTED_POINTS: usize = 13;

/// Cosine of the angle between two normals at which the surface has an edge between their points:
/// 37°. Half: tests of grids, scanned bodies and thin walls fail.
const CREASE: f64 = 0.8;

/// Radii within which a patch lies: balls of one radius leave about 5 % of a randomly sampled
/// surface uncovered, of 1.5 radii 0.1 %. Half or twice: most tests of masses fail.
const REACH: f64 = 1.5;

/// Corners of the polygon that stands for the disc of `REACH` radii.
const CORNERS: usize = 16;

/// Indices of at most about [`MAX_SAMPLES`] points at distinct positions.
fn thinned(cloud: &PointCloud<'_>) -> Vec<usize> {
    let keep = thinning(cloud.len());
    let mut indices: Vec<usize> = (0..cloud.len())
        .filter(|&i| {
            // A hash spreads the choice evenly, however the points are ordered.
            let hash = (i as u64)
                .wrapping_mul(0x9E37_79B9_7F4A_7C15)
                .rotate_left(29);
            let hash = hash.wrapping_mul(0xBF58_476D_1CE4_E5B9) >> 11;
            (hash as f64) * 2f64.powi(-53) < keep
        })
        .collect();
    if indices.is_empty() {
        indices.push(0);
    }
    let key = |i: usize| cloud.point(i).to_array().map(f32::to_bits);
    indices.sort_unstable_by_key(|&i| (key(i), i));
    indices.dedup_by_key(|i| key(*i));
    indices
}

/// Share of the points that is used.
fn thinning(count: usize) -> f64 {
    (MAX_SAMPLES as f64 / count as f64).min(1.0)
}

/// The patches of a cloud, with outward normals as far as [`orient`] can tell.
pub(super) fn surfels(cloud: &PointCloud<'_>) -> Vec<Surfel> {
    let indices = thinned(cloud);
    let points: Vec<Vec3> = indices.iter().map(|&i| cloud.point(i)).collect();
    let Ok(samples) = PointCloud::builder(&points)
        .radius(cloud.max_radius())
        .build()
    else {
        // The points come from a cloud that was validated with these radii.
        return Vec::new();
    };
    let tree = KdTree::new(&samples);
    // Distances grow as points are left out.
    let reach = REACH / thinning(cloud.len()).sqrt();
    let mut surfels: Vec<Surfel> = indices
        .par_iter()
        .map_init(Vec::new, |found, &index| {
            tree.k_nearest(cloud.point(index), NEIGHBORS + 1, found);
            let reach = reach * f64::from(cloud.radius(index));
            Surfel {
                position: cloud.point(index).as_dvec3(),
                normal: match cloud.normals() {
                    Some(normals) => normals[index].as_dvec3(),
                    None => fitted_normal(&points, &found[..found.len().min(FITTED_POINTS)]),
                },
                reach,
                area: std::f64::consts::PI * reach * reach,
                // The first is the point itself.
                neighbors: found[1..].iter().map(|n| n.index as u32).collect(),
            }
        })
        .collect();
    if !cloud.normals_oriented() {
        orient(&mut surfels);
    }
    let areas: Vec<f64> = surfels
        .par_iter()
        .map_init(Cell::default, |cell, surfel| {
            cell.start(surfel.normal, surfel.reach);
            for &neighbor in &surfel.neighbors {
                let other = &surfels[neighbor as usize];
                let offset = other.position - surfel.position;
                if surfel.normal.dot(other.normal) < CREASE {
                    cell.keep_side_of_plane(offset, other.normal);
                } else {
                    cell.keep_nearer_than(offset);
                }
            }
            cell.area()
        })
        .collect();
    for (surfel, area) in surfels.iter_mut().zip(areas) {
        surfel.area = area;
    }
    surfels
}

/// Normal of the plane that fits the neighbours best.
fn fitted_normal(points: &[Vec3], neighbors: &[Neighbor]) -> DVec3 {
    let positions = || neighbors.iter().map(|n| points[n.index].as_dvec3());
    let mean = positions().sum::<DVec3>() / neighbors.len() as f64;
    let mut covariance = DMat3::ZERO;
    for position in positions() {
        let d = position - mean;
        covariance += outer(d, d);
    }
    let eigen = DSymmetricEigen3::new(covariance);
    let least = eigen.eigenvalues.min_position();
    eigen.eigenvectors.col(least).normalize_or(DVec3::Z)
}

/// A convex polygon in a tangent plane, about the point where the plane touches.
#[derive(Default)]
struct Cell {
    /// Axes of the plane.
    axes: [DVec3; 2],
    corners: Vec<DVec2>,
    clipped: Vec<DVec2>,
}

impl Cell {
    /// A regular polygon with the area of a disc.
    fn start(&mut self, normal: DVec3, radius: f64) {
        self.axes = normal.any_orthonormal_pair().into();
        let step = std::f64::consts::TAU / CORNERS as f64;
        let corner_radius = radius * (step / step.sin()).sqrt();
        self.corners.clear();
        self.corners
            .extend((0..CORNERS).map(|k| corner_radius * DVec2::from_angle(step * k as f64)));
    }

    /// Keeps the part that is nearer to the point than to the neighbour at `offset` from it.
    fn keep_nearer_than(&mut self, offset: DVec3) {
        let half = 0.5 * offset.length_squared();
        if half > 0.0 {
            self.clip(offset, half);
        }
    }

    /// Keeps the point's side of the tangent plane of the neighbour at `offset`: beyond it, around
    /// an edge of the surface, the neighbour's own cell goes on.
    fn keep_side_of_plane(&mut self, offset: DVec3, normal: DVec3) {
        let limit = offset.dot(normal);
        if limit >= 0.0 {
            self.clip(normal, limit);
        } else {
            self.clip(-normal, -limit);
        }
    }

    /// Keeps `direction · x ≤ limit`, where `limit` is not negative.
    fn clip(&mut self, direction: DVec3, limit: f64) {
        let direction = DVec2::from_array(self.axes.map(|axis| axis.dot(direction)));
        let beyond = |corner: DVec2| direction.dot(corner) - limit;
        self.clipped.clear();
        for (k, &corner) in self.corners.iter().enumerate() {
            let next = self.corners[(k + 1) % self.corners.len()];
            let (a, b) = (beyond(corner), beyond(next));
            if a <= 0.0 {
                self.clipped.push(corner);
            }
            if (a < 0.0 && b > 0.0) || (a > 0.0 && b < 0.0) {
                self.clipped.push(corner.lerp(next, a / (a - b)));
            }
        }
        std::mem::swap(&mut self.corners, &mut self.clipped);
    }

    fn area(&self) -> f64 {
        let count = self.corners.len();
        let twice: f64 = (0..count)
            .map(|k| self.corners[k].perp_dot(self.corners[(k + 1) % count]))
            .sum();
        0.5 * twice
    }
}
