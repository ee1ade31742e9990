//! Generated rooms for robots that walk: rough ground as a scanner in the room sees it, with all that is
//! wrong with such scans, and the truth about the ground.

use crate::random::{self, between};
use crate::scene::rounded_block;
use crate::surface_sampling::{SampledSurface, sample_surface};
use fastrand::Rng;
use std::f32::consts::TAU;
use tldi::Aabb;
use tldi::glamx::{Quat, Vec2, Vec3};

/// What the ground is like, in front of a level place to stand on.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ground {
    /// A ramp, 5 to 9° steep.
    Ramp,
    /// Steps up, each 1 to 2 cm high.
    Steps,
    /// Scattered slabs and stones, up to 2 cm high.
    Rubble,
}

impl Ground {
    /// All kinds.
    pub const ALL: [Self; 3] = [Self::Ramp, Self::Steps, Self::Rubble];
}

/// Bounds of the room in metres, z up; the robot stands over the origin and walks along x.
const ROOM: Aabb = Aabb {
    min: Vec3::new(-0.9, -0.9, -0.05),
    max: Vec3::new(2.4, 0.9, 0.8),
};
/// Where the ground begins to be rough, metres along x: just before the front feet.
const ROUGH_FROM: f32 = 0.34;
/// Distance of neighbouring points in metres near the scanner, and the range up to which it is that;
/// beyond, it grows with the range.
const SPACING: f32 = 0.012;
const NEAR: f32 = 1.7;
/// Where the scanner stands, metres.
const SCANNER: Vec3 = Vec3::new(-0.7, 0.7, 1.5);
/// Standard deviation in metres of ranges.
const NOISE: f32 = 0.002;
/// Shares of the points that are seen twice, a little apart, and that lie anywhere in the room.
const TWICE: f32 = 0.05;
const TWICE_APART: f32 = 3e-4;
const OUTLIERS: f32 = 0.003;
/// Holes in the floor, and their radii in metres: a foot of 3.5 cm that steps on the largest sinks 4 mm
/// in, to where it lies on the rim.
const HOLES: usize = 60;
const HOLE_RADII: [f32; 2] = [0.006, 0.016];

/// Ground whose surface is known.
pub struct Terrain {
    solids: Vec<Box<dyn Fn(Vec3) -> f32 + Send + Sync>>,
    seed: u64,
}

impl Terrain {
    /// The ground of a room.
    pub fn new(ground: Ground, seed: u64) -> Self {
        let mut rng = Rng::with_seed(seed ^ 0x7465_7272);
        let mut terrain = Self {
            solids: vec![Box::new(|p| p.z)],
            seed,
        };
        match ground {
            Ground::Ramp => {
                let slope = between(&mut rng, [5.0, 9.0]).to_radians();
                let across = Vec3::new(-slope.sin(), 0.0, slope.cos());
                terrain.add(move |p| (p - Vec3::X * ROUGH_FROM).dot(across));
            }
            Ground::Steps => {
                let (mut from, mut height) = (ROUGH_FROM, 0.0);
                while from < ROOM.max.x {
                    height += between(&mut rng, [0.01, 0.02]);
                    terrain.add_block(Vec3::new(from + 2.0, 0.0, 0.0), [2.0, 2.0, height], 0.0);
                    from += between(&mut rng, [0.3, 0.45]);
                }
            }
            Ground::Rubble => {
                for _ in 0..60 {
                    let half = [
                        between(&mut rng, [0.06, 0.15]),
                        between(&mut rng, [0.06, 0.15]),
                        between(&mut rng, [0.01, 0.02]),
                    ];
                    let reach = half[0].hypot(half[1]);
                    let place = Vec3::new(
                        between(&mut rng, [ROUGH_FROM + reach, ROOM.max.x]),
                        between(&mut rng, [ROOM.min.y, ROOM.max.y]),
                        0.0,
                    );
                    terrain.add_block(place, half, TAU * rng.f32());
                }
            }
        }
        terrain
    }

    fn add(&mut self, distance: impl Fn(Vec3) -> f32 + Send + Sync + 'static) {
        self.solids.push(Box::new(distance));
    }

    /// A block with rounded edges, turned by `yaw` about z.
    fn add_block(&mut self, center: Vec3, half: [f32; 3], yaw: f32) {
        let turn = Quat::from_rotation_z(-yaw);
        self.add(move |p| rounded_block(turn * (p - center), Vec3::from(half), 0.01));
    }

    /// Signed distance to the ground in metres, negative below it. Where solids overlap, the true depth
    /// is at least that.
    pub fn distance(&self, point: Vec3) -> f32 {
        let distances = self.solids.iter().map(|distance| distance(point));
        distances.fold(f32::MAX, f32::min)
    }

    /// Height of the ground in metres at a place.
    pub fn height(&self, place: Vec2) -> f32 {
        let mut z = ROOM.max.z;
        for _ in 0..64 {
            z -= self.distance(place.extend(z));
        }
        z
    }

    /// The room as a scanner sees it: the ground and two walls, denser near the scanner, with noise,
    /// holes, points that are seen twice, and points that lie on nothing.
    pub fn scan(&self) -> SampledSurface {
        let mut rng = Rng::with_seed(self.seed ^ 0x7363_616e);
        let distance = |p: Vec3| self.distance(p).min(walls(p));
        let exact = sample_surface(distance, ROOM, SPACING, self.seed);
        let holes: Vec<(Vec2, f32)> = (0..HOLES)
            .map(|_| {
                let place = Vec2::new(
                    between(&mut rng, [ROOM.min.x, ROOM.max.x]),
                    between(&mut rng, [ROOM.min.y, ROOM.max.y]),
                );
                (place, between(&mut rng, HOLE_RADII))
            })
            .collect();
        let mut seen = SampledSurface::default();
        for (point, normal) in exact.points.iter().zip(&exact.normals) {
            let range = point.distance(SCANNER);
            let in_hole =
                (holes.iter()).any(|(place, radius)| point.truncate().distance(*place) < *radius);
            if in_hole || rng.f32() > (NEAR / range).powi(2) {
                continue;
            }
            let times = 1 + usize::from(rng.f32() < TWICE);
            let ray = (*point - SCANNER) / range;
            let error = NOISE * random::normal(&mut rng);
            for time in 0..times {
                seen.points
                    .push(*point + error * ray + time as f32 * TWICE_APART * Vec3::X);
                seen.normals.push(*normal);
                seen.colors.push(color(*point));
            }
        }
        for _ in 0..(OUTLIERS * seen.points.len() as f32) as usize {
            let share = Vec3::new(rng.f32(), rng.f32(), rng.f32());
            seen.points.push(ROOM.min + share * ROOM.extents());
            seen.normals.push(Vec3::Z);
            seen.colors.push([200, 60, 200, 255]);
        }
        seen
    }
}

/// Distance to the two walls in metres, inside the room.
fn walls(point: Vec3) -> f32 {
    (point.x - ROOM.min.x - 0.01).min(ROOM.max.y - 0.01 - point.y)
}

fn color(point: Vec3) -> [u8; 4] {
    if walls(point) < 0.01 {
        return [206, 200, 188, 255];
    }
    // The higher, the lighter: steps and stones can be told apart.
    let shade = (0.75 + 2.5 * point.z).clamp(0.6, 1.3);
    let [r, g, b] = [146.0, 132.0, 112.0].map(|c: f32| (c * shade) as u8);
    [r, g, b, 255]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The height is where the distance vanishes, and the place to stand on is level.
    #[test]
    fn heights_and_distances_agree() {
        for ground in Ground::ALL {
            let terrain = Terrain::new(ground, 3);
            let mut highest = 0.0f32;
            for i in 0..300 {
                let place = Vec2::new(-0.8 + 0.01 * i as f32, 0.7 * (i as f32).sin());
                let height = terrain.height(place);
                assert!(
                    terrain.distance(place.extend(height)).abs() < 2e-3,
                    "{ground:?} {place}"
                );
                assert!(terrain.distance(place.extend(height + 0.05)) > 0.0);
                if place.x < 0.3 {
                    assert!(height.abs() < 1e-4, "{ground:?} {place} {height}");
                }
                highest = highest.max(height);
            }
            assert!((0.015..0.4).contains(&highest), "{ground:?} {highest}");
        }
    }

    /// Every fault is in the scan: outliers, twins, noise, and fewer points far away.
    #[test]
    fn the_scan_has_its_faults() {
        let terrain = Terrain::new(Ground::Ramp, 1);
        let scan = terrain.scan();
        let off = |p: &Vec3| terrain.distance(*p).min(walls(*p)).abs();
        let share = |is: &dyn Fn(&Vec3) -> bool| {
            scan.points.iter().filter(|p| is(p)).count() as f32 / scan.points.len() as f32
        };
        assert!((0.001..0.004).contains(&share(&|p| off(p) > 0.02)));
        assert!((0.01..0.5).contains(&share(&|p| (0.001..0.01).contains(&off(p)))));
        let twins = (scan.points.windows(2))
            .filter(|pair| pair[0].distance(pair[1]) < 2.0 * TWICE_APART)
            .count();
        assert!(twins as f32 > 0.03 * scan.points.len() as f32, "{twins}");
        let within = |from: f32| share(&|p| (from..from + 0.3).contains(&p.x) && p.y < 0.5);
        assert!(within(1.8) < 0.6 * within(0.0));
    }
}
