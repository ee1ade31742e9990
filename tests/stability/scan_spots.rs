//! Nearly flat, evenly covered places of a real scan, as surfaces; or bumpy terrain in their place.

use super::surface::{Normals, Radius, Surface};
use fastrand::Rng;
use std::sync::LazyLock;
use tldi::PointCloud;
use tldi::glamx::{Mat3, Quat, SymmetricEigen3, Vec2, Vec3};
use tldi_sources::{ReadOptions, read};
use tldi_tests::{Samples, data_file, standard_normal};

/// A Kinect scan of a kitchen, 300,000 points.
const KITCHEN: &str = "kitchen_scan_300k.ply.gz";
/// Radius of a spot in the scan, metres.
const SPOT_RADIUS: f32 = 0.25;
/// How many spots are looked for.
const SPOTS: usize = 24;

/// A place of a scan: its mean plane is y = 0, its middle the origin.
#[derive(Clone, Debug)]
pub(crate) struct Spot {
    points: Vec<Vec3>,
    /// Mean point radius (0.65 × distance to the 7th neighbour), metres.
    pub(crate) mean_radius: f32,
    /// Radius of the spot, metres.
    pub(crate) radius: f32,
}

impl Spot {
    /// The spot scaled by `scale`, without normals.
    pub(crate) fn surface(&self, scale: f32) -> Surface {
        let points: Vec<Vec3> = self.points.iter().map(|p| *p * scale).collect();
        Surface {
            samples: Samples {
                normals: vec![Vec3::Y; points.len()],
                points,
            },
            radius: Radius::Neighbors,
            normals: Normals::Absent,
            voxel_shift: 0.5,
            voxel_edge: 2.0 * self.mean_radius * scale,
            mesh: Err("a scan has no faces"),
            primitive: Err("no primitive is known for a scan"),
            mass: None,
        }
    }
}

/// The spots of the kitchen, or of generated terrain (said) where the data is absent.
pub(crate) fn spots() -> &'static [Spot] {
    static FOUND: LazyLock<Vec<Spot>> = LazyLock::new(|| {
        let points = data_file(KITCHEN).map_or_else(terrain_points, |path| {
            let raw = read(&path, &ReadOptions::default()).expect("the test data can be read");
            raw.points
        });
        find(&points)
    });
    &FOUND
}

/// Smooth bumps with range noise, in place of a scan.
#[allow(clippy::print_stderr, reason = "a stand-in must not pass unnoticed")]
fn terrain_points() -> Vec<Vec3> {
    eprintln!("STAND-IN: generated terrain takes the place of the kitchen scan");
    let mut rng = Rng::with_seed(7);
    let mut point = || {
        let p = Vec2::new(rng.f32(), rng.f32()) * 3.0;
        let bumps =
            0.02 * (4.0 * p.x).sin() * (5.0 * p.y).cos() + 0.01 * (9.0 * p.x + 7.0 * p.y).sin();
        Vec3::new(p.x, bumps + 0.004 * standard_normal(&mut rng), p.y)
    };
    (0..120_000).map(|_| point()).collect()
}

fn find(points: &[Vec3]) -> Vec<Spot> {
    let cloud = PointCloud::builder(points)
        .build()
        .expect("a scan is a valid cloud");
    let mut rng = Rng::with_seed(11);
    let mut spots = Vec::new();
    for _ in 0..400 {
        if spots.len() == SPOTS {
            break;
        }
        let middle = points[rng.usize(..points.len())];
        let near: Vec<Vec3> = (points.iter())
            .map(|p| *p - middle)
            .filter(|p| p.length() < SPOT_RADIUS)
            .collect();
        spots.extend(spot_of(&near, cloud.mean_radius()));
    }
    assert!(!spots.is_empty(), "the scan has no flat place");
    spots
}

/// A spot of these points, if they are flat to 2 mean radii and cover a disc without large holes.
fn spot_of(near: &[Vec3], scan_radius: f32) -> Option<Spot> {
    if near.len() < 500 {
        return None;
    }
    let middle = near.iter().sum::<Vec3>() / near.len() as f32;
    let mut covariance = Mat3::ZERO;
    for p in near {
        let d = *p - middle;
        covariance += Mat3::from_cols(d * d.x, d * d.y, d * d.z);
    }
    let eigen = SymmetricEigen3::new(covariance);
    let least = eigen.eigenvalues.min_position();
    let upright = Quat::from_rotation_arc(eigen.eigenvectors.col(least), Vec3::Y);
    let (flat, off): (Vec<Vec3>, Vec<Vec3>) = near
        .iter()
        .map(|p| upright * (*p - middle))
        .partition(|p| p.y.abs() < 4.0 * scan_radius);
    let square: f32 = flat.iter().map(|p| p.y * p.y).sum();
    let is_flat = (square / flat.len() as f32).sqrt() < scan_radius;
    if !is_flat || off.len() * 50 > near.len() || !is_covered(&flat, 3.0 * scan_radius) {
        return None;
    }
    let cloud = PointCloud::builder(&flat).build().ok()?;
    Some(Spot {
        mean_radius: cloud.mean_radius(),
        radius: 0.9 * SPOT_RADIUS,
        points: flat.clone(),
    })
}

/// Whether no place of the disc is farther than `most` metres from a point.
fn is_covered(points: &[Vec3], most: f32) -> bool {
    let in_plane: Vec<Vec3> = points.iter().map(|p| p.with_y(0.0)).collect();
    let steps = (SPOT_RADIUS / most).ceil() as i32;
    let places = (-steps..=steps).flat_map(|i| (-steps..=steps).map(move |j| (i, j)));
    places
        .map(|(i, j)| Vec3::new(i as f32, 0.0, j as f32) * most)
        .filter(|place| place.length() < 0.85 * SPOT_RADIUS)
        .all(|place| {
            in_plane
                .iter()
                .any(|p| p.distance_squared(place) < most * most)
        })
}
