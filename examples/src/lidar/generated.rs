//! A street as a laser scanner on a car sees it.

use crate::rays::{distance_to_box, distance_to_ground};
use fastrand::Rng;
use std::f32::consts::TAU;
use tldi::Aabb;
use tldi::glamx::{Pose3, Vec3};

/// Rings, and their lowest and highest elevation in degrees: those of a Velodyne HDL-64E.
const RINGS: usize = 64;
const ELEVATIONS: [f32; 2] = [-24.8, 2.0];
/// Points of a ring.
const AZIMUTHS: usize = 1800;
/// Height of the scanner over the street, metres.
const HEIGHT: f32 = 1.73;
/// Farthest return, metres.
const RANGE: f32 = 80.0;
/// Largest error of a range, metres, evenly distributed.
const ERROR: f32 = 0.017;
/// Way of the car from sweep to sweep, metres: 1 m/s.
const WAY: f32 = 0.1;

/// A scanner that drives along x through a street with boxes beside it; z is up, the ground is z = 0.
#[derive(Clone, Debug)]
pub struct Scanner {
    boxes: Vec<Aabb>,
    seed: u64,
    sweeps: usize,
}

impl Scanner {
    /// A drive of so many sweeps.
    pub fn new(sweeps: usize, seed: u64) -> Self {
        let mut rng = Rng::with_seed(seed);
        let boxes = (0..24)
            .map(|k| {
                let side = if k % 2 == 0 { 1.0 } else { -1.0 };
                let middle = Vec3::new(
                    3.0 * (k / 2) as f32 - 15.0,
                    side * (6.0 + 3.0 * rng.f32()),
                    0.0,
                );
                let half = Vec3::new(0.6 + rng.f32(), 0.5 + 0.5 * rng.f32(), 0.0);
                let top = Vec3::Z * (0.5 + 3.0 * rng.f32());
                Aabb {
                    min: middle - half,
                    max: middle + half + top,
                }
            })
            .collect();
        Self {
            boxes,
            seed,
            sweeps,
        }
    }

    /// Number of sweeps.
    pub fn count(&self) -> usize {
        self.sweeps
    }

    /// From the frame of the scanner into that of the world.
    pub fn world_from_scanner(&self, sweep: usize) -> Pose3 {
        Pose3::from_translation(Vec3::new(WAY * sweep as f32, 0.0, HEIGHT))
    }

    /// Columns and rows of a sweep: places of a ring, and rings, the lowest first.
    pub const SIZE: [usize; 2] = [AZIMUTHS, RINGS];

    /// The points of a sweep, row by row, in the frame of the scanner, metres; NaN where there is no return.
    pub fn points(&self, sweep: usize) -> Vec<Vec3> {
        let mut rng = Rng::with_seed(self.seed ^ (sweep as u64 + 1) << 20);
        let origin = self.world_from_scanner(sweep).translation;
        let mut points = Vec::with_capacity(RINGS * AZIMUTHS);
        for ring in 0..RINGS {
            let share = ring as f32 / (RINGS - 1) as f32;
            let [low, high] = ELEVATIONS.map(f32::to_radians);
            let (sin, cos) = (low + share * (high - low)).sin_cos();
            // Rings are below each other up to the part of a column.
            let start = rng.f32();
            for step in 0..AZIMUTHS {
                let (y, x) = (TAU * (start + step as f32) / AZIMUTHS as f32).sin_cos();
                let direction = Vec3::new(cos * x, cos * y, sin);
                let range = self.range(origin, direction);
                let seen = range + ERROR * (2.0 * rng.f32() - 1.0);
                points.push(if range < RANGE {
                    direction * seen
                } else {
                    Vec3::NAN
                });
            }
        }
        points
    }

    /// Distance to the ground or a box, metres; infinite if there is neither.
    fn range(&self, origin: Vec3, direction: Vec3) -> f32 {
        let boxes = self.boxes.iter();
        let to_boxes = boxes.map(|bounds| distance_to_box(bounds, origin, direction));
        to_boxes.fold(distance_to_ground(origin, direction), f32::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every point is on the ground or a side of a box, up to the error of its range.
    #[test]
    fn points_are_on_what_is_there() {
        let scanner = Scanner::new(3, 5);
        let pose = scanner.world_from_scanner(2);
        let points = scanner.points(2);
        assert_eq!(points.len(), RINGS * AZIMUTHS);
        let seen = points.into_iter().filter(|p| p.is_finite());
        let mut on_boxes = 0;
        for p in seen {
            let p = pose * p;
            let off_box = |bounds: &Aabb| {
                let [center, half] = [bounds.center(), 0.5 * bounds.extents()];
                ((p - center).abs() - half).max_element().abs()
            };
            let on_box = scanner
                .boxes
                .iter()
                .any(|bounds| off_box(bounds) < 1.1 * ERROR);
            on_boxes += usize::from(on_box);
            assert!(on_box || p.z.abs() < ERROR, "{p}");
        }
        assert!(on_boxes > 1000, "{on_boxes}");
    }
}
