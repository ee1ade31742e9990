//! Generated depth frames with all that is wrong with real ones, and the truth: a room with a table and
//! boxes, seen by a camera whose frames are registered to another one.

use super::pinhole::{self, SIZE, ray};
use crate::random::between;
use crate::rays::crossing;
use fastrand::Rng;
use tldi::Aabb;
use tldi::glamx::{Pose3, Vec3};
use tldi_sources::depth::{Intrinsics, SensorModel};

/// Half the width and depth of the room, its height, metres; z is up.
const ROOM: Vec3 = Vec3::new(2.2, 1.9, 2.5);
/// Difference of depth, metres, from which on a pixel may mix what is before and behind.
const JUMP: f32 = 0.05;
/// Radius of a hole, pixels, and how many there are.
const HOLE: i32 = 12;
const HOLES: usize = 60;

/// What a pixel really sees.
#[derive(Clone, Copy, Debug)]
pub struct TruePixel {
    /// Depth along the optical axis, metres.
    pub depth: f32,
    /// Unit normal of the surface, towards the camera, in the world.
    pub normal: Vec3,
}

/// The frames of one scene. The camera and all things stand still; the noise is new in every frame.
#[derive(Clone, Debug)]
pub struct RegisteredFrames {
    /// From the frame of the camera into that of the world, whose z is up.
    pub world_from_camera: Pose3,
    /// How the sensor errs.
    pub model: SensorModel,
    seed: u64,
    /// Columns and rows that are empty: every so manieth.
    periods: [usize; 2],
    /// Share of the pixels that are empty at random, on top of grid and holes.
    dropped: f32,
    truth: Vec<TruePixel>,
}

impl RegisteredFrames {
    /// A scene of its own for every seed.
    pub fn new(seed: u64) -> Self {
        let mut rng = Rng::with_seed(seed);
        let blocks = table_and_boxes(&mut rng);
        let (eye, world_from_camera) = before(&blocks[0], &mut rng);
        let periods = [rng.usize(4..9), rng.usize(4..9)];
        let dropped = 0.3 * rng.f32();
        let truth = (0..SIZE[0] * SIZE[1])
            .map(|k| {
                let direction = ray([k % SIZE[0], k / SIZE[0]], &world_from_camera);
                nearest(&blocks, eye, direction)
            })
            .collect();
        Self {
            world_from_camera,
            model: SensorModel::default(),
            seed,
            periods,
            dropped,
            truth,
        }
    }

    /// The same with that share of empty pixels in all, holes not counted: at least what the grid leaves out.
    pub fn with_empty(seed: u64, share: f32) -> Self {
        let frames = Self::new(seed);
        let kept = frames.periods.map(|every| 1.0 - 1.0 / every as f32);
        Self {
            dropped: 1.0 - (1.0 - share) / (kept[0] * kept[1]),
            ..frames
        }
    }

    /// Geometry of the camera.
    pub fn intrinsics(&self) -> Intrinsics {
        pinhole::intrinsics(self.model.step)
    }

    /// What the pixels really see, row by row.
    pub fn truth(&self) -> &[TruePixel] {
        &self.truth
    }

    /// A frame as the sensor gives it, row by row, in units of
    /// [`Intrinsics::depth_unit`]; 0 is no measurement.
    pub fn depths(&self, frame: usize) -> Vec<u16> {
        let mut rng = Rng::with_seed(self.seed ^ (frame as u64 + 1) << 16);
        let [width, height] = SIZE;
        let mut depths: Vec<u16> = (0..width * height)
            .map(|k| {
                let (u, v) = (k % width, k / width);
                let [every_column, every_row] = self.periods;
                // All numbers are drawn for every pixel, so that none changes those of the next.
                let draws = [rng.f32(), rng.f32(), rng.f32()];
                let gauss: f32 = (0..12).map(|_| rng.f32()).sum::<f32>() - 6.0;
                if u % every_column == 1 || v % every_row == 2 || draws[0] < self.dropped {
                    return 0;
                }
                let mut depth = self.truth[k].depth;
                let behind = [k + 1, k + width].into_iter().find_map(|other| {
                    let other = self.truth.get(other)?.depth;
                    ((other - depth).abs() > JUMP).then_some(other)
                });
                if let Some(behind) = behind.filter(|_| draws[1] < 0.5) {
                    depth += draws[2] * (behind - depth);
                }
                // Rounding is a part of the model of its own.
                let z2 = self.model.noise * depth * depth;
                let seen = depth + gauss * z2.hypot(self.model.floor);
                (seen / self.model.step).round() as u16
            })
            .collect();
        for _ in 0..HOLES {
            let [u, v] = SIZE.map(|n| rng.i32(..n as i32));
            for y in (v - HOLE).max(0)..(v + HOLE).min(height as i32) {
                for x in (u - HOLE).max(0)..(u + HOLE).min(width as i32) {
                    if (x - u).pow(2) + (y - v).pow(2) < HOLE * HOLE {
                        depths[y as usize * width + x as usize] = 0;
                    }
                }
            }
        }
        depths
    }
}

/// A table, a box to each side of it, and one on it.
fn table_and_boxes(rng: &mut Rng) -> Vec<Aabb> {
    let mut within = |low: f32, high: f32| between(rng, [low, high]);
    let block = |base: Vec3, half: Vec3, height: f32| Aabb {
        min: base - half,
        max: base + half + height * Vec3::Z,
    };
    let middle = Vec3::new(within(-0.3, 0.3), within(0.1, 0.6), 0.0);
    let half = Vec3::new(within(0.5, 0.8), within(0.35, 0.5), 0.0);
    let table = block(middle, half, within(0.4, 0.75));
    let mut blocks = vec![table];
    for (x, floor) in [(-1.6, 0.0), (1.6, 0.0), (-0.3, table.max.z)] {
        let half = Vec3::new(within(0.08, 0.2), within(0.08, 0.2), 0.0);
        let base = if floor > 0.0 {
            let place = within(0.1, 0.35);
            Vec3::new(table.max.x - place, table.max.y - half.y, floor)
        } else {
            Vec3::new(x, within(-0.2, 0.8), floor)
        };
        blocks.push(block(base, half, within(0.1, 0.4)));
    }
    blocks
}

/// The place and the pose of a camera before a table, held by hand: with a few degrees of roll.
fn before(table: &Aabb, rng: &mut Rng) -> (Vec3, Pose3) {
    let mut within = |low: f32, high: f32| between(rng, [low, high]);
    let eye = Vec3::new(
        within(-0.6, 0.6),
        within(-1.7, -1.2),
        table.max.z + within(0.5, 0.9),
    );
    let target = Vec3::new(0.0, table.min.y + 0.3, table.max.z - within(0.0, 0.2));
    let upper = (Vec3::Z + within(-0.08, 0.08) * Vec3::X).normalize();
    (eye, pinhole::world_from_camera(eye, target, upper))
}

/// Where a ray first meets a block or the room from within.
fn nearest(blocks: &[Aabb], origin: Vec3, direction: Vec3) -> TruePixel {
    let room = Aabb {
        min: ROOM.with_z(0.0) * Vec3::new(-1.0, -1.0, 0.0),
        max: ROOM,
    };
    let wall = crossing(&room, origin, direction);
    let mut best = (wall.leaves, wall.axes[1]);
    for block in blocks {
        let found = crossing(block, origin, direction);
        if found.enters <= found.leaves && found.enters > 0.0 && found.enters < best.0 {
            best = (found.enters, found.axes[0]);
        }
    }
    let axis = Vec3::AXES[best.1];
    TruePixel {
        depth: best.0,
        normal: -axis * axis.dot(direction).signum(),
    }
}
