//! The cloud as small flat patches: position, area, outward normal.

use rapier3d::glamx::{DMat3, DSymmetricEigen3, DVec2, DVec3, Pose3, Vec3};
use rayon::prelude::*;
use tldi::{KdTree, Neighbor, Params, PointCloud, Tldi, VirtualCamera};

/// Most points, about, whose patches are computed.
const MAX_SAMPLES: usize = 100_000;

/// Neighbours that bound a Voronoi cell. A cell in the plane has 6 on average; twice that many
/// neighbours miss none on an even sample, and few on a random one.
const NEIGHBORS: usize = 16;

/// Neighbours, beside the point itself, that a normal is fitted to.
const FITTED_NEIGHBORS: usize = 12;

/// Cosine of the angle between normals from which on there is an edge of the surface between two
/// points: 37°.
const CREASE: f64 = 0.8;

/// Radii within which a patch lies: balls of one radius leave about 5 % of a randomly sampled
/// surface uncovered, of 1.5 radii 0.1 %.
const REACH: f64 = 1.5;

/// Corners of the polygon that stands for the disc of `REACH` radii.
const CORNERS: usize = 16;

/// Most pixels along an edge of the images that tell inside from outside.
const MAX_PIXELS: f32 = 512.0;

/// A patch of the surface around a point.
pub(super) struct Surfel {
    /// In metres, in the cloud's frame.
    pub(super) position: DVec3,
    /// Unit normal; zero where inside and outside could not be told.
    pub(super) normal: DVec3,
    /// In square metres.
    pub(super) area: f64,
}

/// The patches with normals of any sign.
pub(super) fn areas(cloud: &PointCloud<'_>) -> Vec<Surfel> {
    patches(cloud, &thinned(cloud))
}

/// The patches with outward normals, or `None` if those of more than a fifth of the area could not
/// be told.
pub(super) fn outward(cloud: &PointCloud<'_>) -> Option<Vec<Surfel>> {
    let mut surfels = areas(cloud);
    if cloud.normals().is_none() || !cloud.normals_oriented() {
        orient(cloud, &mut surfels);
    }
    let area = |surfels: &mut dyn Iterator<Item = &Surfel>| surfels.map(|s| s.area).sum::<f64>();
    let all = area(&mut surfels.iter());
    let told = area(&mut surfels.iter().filter(|s| s.normal != DVec3::ZERO));
    if told < 0.8 * all {
        return None;
    }
    // Those that are not told are like the others.
    surfels.retain(|s| s.normal != DVec3::ZERO);
    surfels.iter_mut().for_each(|s| s.area *= all / told);
    Some(surfels)
}

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

fn patches(cloud: &PointCloud<'_>, indices: &[usize]) -> Vec<Surfel> {
    let points: Vec<Vec3> = indices.iter().map(|&i| cloud.point(i)).collect();
    // Distances grow as points are left out.
    let reach = REACH / thinning(cloud.len()).sqrt();
    let Ok(samples) = PointCloud::builder(&points)
        .radius(cloud.max_radius())
        .build()
    else {
        // The points come from a cloud that was validated with these radii.
        return Vec::new();
    };
    let tree = KdTree::new(&samples);
    let normals: Vec<DVec3> = match cloud.normals() {
        Some(normals) => indices.iter().map(|&i| normals[i].as_dvec3()).collect(),
        None => points
            .par_iter()
            .map_init(Vec::new, |neighbors, &point| {
                tree.k_nearest(point, FITTED_NEIGHBORS + 1, neighbors);
                fitted_normal(&points, neighbors)
            })
            .collect(),
    };
    let signed = cloud.normals().is_some() && cloud.normals_oriented();
    (0..points.len())
        .into_par_iter()
        .map_init(
            Default::default,
            |(neighbors, cell): &mut (Vec<_>, Cell), k| {
                let (point, normal) = (points[k].as_dvec3(), normals[k]);
                tree.k_nearest(points[k], NEIGHBORS + 1, neighbors);
                cell.start(normal, reach * f64::from(cloud.radius(indices[k])));
                for neighbor in neighbors.iter() {
                    let other = normals[neighbor.index];
                    let agreement = normal.dot(other);
                    let to_neighbor = points[neighbor.index].as_dvec3() - point;
                    if (if signed { agreement } else { agreement.abs() }) < CREASE {
                        cell.keep_side_of_plane(to_neighbor, other);
                    } else {
                        cell.keep_nearer_than(to_neighbor);
                    }
                }
                Surfel {
                    position: point,
                    normal,
                    area: cell.area(),
                }
            },
        )
        .collect()
}

/// Normal of the plane that fits the neighbours best.
fn fitted_normal(points: &[Vec3], neighbors: &[Neighbor]) -> DVec3 {
    let positions = || neighbors.iter().map(|n| points[n.index].as_dvec3());
    let mean = positions().sum::<DVec3>() / neighbors.len() as f64;
    let mut covariance = DMat3::ZERO;
    for position in positions() {
        let d = position - mean;
        covariance += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
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

    /// Keeps what is nearer to the point than to the neighbour at `offset` from it.
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

/// Turns the normals outward by the parity of the layers along the three axes; zero where all
/// axes are undecided.
fn orient(cloud: &PointCloud<'_>, surfels: &mut [Surfel]) {
    let radius = cloud.mean_radius();
    let pixel_size = radius.max(cloud.bounds().extents().max_element() / MAX_PIXELS);
    let params = Params::paper(radius).with_pixel_size(pixel_size);
    let mut votes = vec![0.0; surfels.len()];
    for axis in Vec3::AXES {
        let camera = VirtualCamera::along(axis, pixel_size);
        let image = tldi::build(cloud, &Pose3::IDENTITY, &camera, &params);
        for (surfel, vote) in surfels.iter().zip(&mut votes) {
            // The ray enters against the outward normal.
            *vote -= match is_entry(&image, surfel.position.as_vec3()) {
                Some(true) => surfel.normal.dot(axis.as_dvec3()),
                Some(false) => -surfel.normal.dot(axis.as_dvec3()),
                None => 0.0,
            };
        }
    }
    for (surfel, vote) in surfels.iter_mut().zip(votes) {
        surfel.normal *= if vote == 0.0 { 0.0 } else { vote.signum() };
    }
}

/// Whether the ray through `point` enters the body there or leaves it; `None` where the number of
/// layers is odd.
fn is_entry(image: &Tldi, point: Vec3) -> Option<bool> {
    let view = image.camera.view_from_point(point);
    let [column, row] = image.camera.pixel_from_view(view).map(|c| c.floor() as i32);
    let (i, j) = (column - image.origin[0], row - image.origin[1]);
    let (i, j) = (u32::try_from(i).ok()?, u32::try_from(j).ok()?);
    if i >= image.size[0] || j >= image.size[1] {
        return None;
    }
    let layers = image.layers_at(i, j);
    if layers.len() % 2 == 1 {
        return None;
    }
    let off = |k: &usize| (layers[*k].depth - view.z).abs();
    let nearest = (0..layers.len()).min_by(|a, b| off(a).total_cmp(&off(b)))?;
    Some(nearest % 2 == 0)
}
