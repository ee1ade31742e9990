//! A generated depth sequence: a camera over a low table, across which a ball is moved.

use super::pinhole::{self, SIZE, ray};
use crate::random;
use crate::rays::{distance_to_box, distance_to_ground};
use crate::spots::Spot;
use fastrand::Rng;
use rayon::prelude::*;
use tldi::Aabb;
use tldi::glamx::{Pose3, Vec3};
use tldi_sources::depth::{Intrinsics, SensorModel};

/// Where the camera is and what it looks at, metres; z is up.
const EYE: Vec3 = Vec3::new(0.25, -1.35, 1.35);
const TARGET: Vec3 = Vec3::new(0.0, 0.05, 0.25);
/// Half the size of the table, its top at twice its half height.
const TABLE: Vec3 = Vec3::new(0.55, 0.4, 0.15);
/// The ball that moves, and how far to each side it goes.
const BALL_RADIUS: f32 = 0.11;
const SWING: f32 = 0.8;
/// Part of the sequence in which nothing moves, so that bodies come to rest.
const STILL: f32 = 0.4;

/// The camera of the generated sequence.
#[derive(Clone, Copy, Debug)]
pub struct GeneratedCamera {
    /// Number of frames.
    pub frames: usize,
    /// Seed of the noise.
    pub seed: u64,
}

impl GeneratedCamera {
    /// Places on the table, in the ball's way and beside it.
    pub fn spots() -> Vec<Spot> {
        [
            [-0.2, 0.02],
            [0.12, -0.05],
            [0.3, 0.05],
            [0.0, 0.25],
            [-0.3, -0.25],
            [0.3, -0.25],
        ]
        .iter()
        .map(|[x, y]| Spot {
            surface: Vec3::new(*x, *y, 2.0 * TABLE.z),
            level: 0,
        })
        .collect()
    }

    /// Geometry of the camera.
    pub fn intrinsics(&self) -> Intrinsics {
        pinhole::intrinsics(0.001)
    }

    /// From the frame of the camera into that of the world.
    pub fn world_from_camera() -> Pose3 {
        pinhole::world_from_camera(EYE, TARGET, Vec3::Z)
    }

    /// Where the ball is in a frame: it waits beside the table, then goes across it and back.
    pub fn ball(&self, frame: usize) -> Vec3 {
        let t = frame as f32 / self.frames.max(1) as f32;
        let phase = ((t - STILL) / (1.0 - STILL)).max(0.0);
        let x = -SWING * (std::f32::consts::TAU * phase).cos();
        Vec3::new(x, 0.0, 2.0 * TABLE.z + BALL_RADIUS - 0.01)
    }

    /// The depth image of a frame, with the noise of [`SensorModel`] and rounded to millimetres.
    pub fn depths(&self, frame: usize) -> Vec<u16> {
        let pose = Self::world_from_camera();
        let ball = self.ball(frame);
        let model = SensorModel::default();
        let row = |v: usize| {
            let mut rng = Rng::with_seed(self.seed ^ ((frame * SIZE[1] + v) as u64) << 8);
            (0..SIZE[0])
                .map(|u| {
                    let direction = ray([u, v], &pose);
                    let depth = nearest(pose.translation, direction, ball);
                    let seen = depth + random::normal(&mut rng) * model.deviation(depth);
                    if seen < model.range[1] {
                        (1e3 * seen).round() as u16
                    } else {
                        0
                    }
                })
                .collect::<Vec<u16>>()
        };
        (0..SIZE[1]).into_par_iter().flat_map_iter(row).collect()
    }
}

/// Where a ray first meets floor, table or ball.
fn nearest(origin: Vec3, direction: Vec3, ball: Vec3) -> f32 {
    let table = Aabb {
        min: TABLE * Vec3::new(-1.0, -1.0, 0.0),
        max: TABLE * Vec3::new(1.0, 1.0, 2.0),
    };
    let to_table = distance_to_box(&table, origin, direction);
    let best = distance_to_ground(origin, direction).min(to_table);
    let to = origin - ball;
    let (a, b) = (direction.length_squared(), to.dot(direction));
    let under_root = b * b - a * (to.length_squared() - BALL_RADIUS * BALL_RADIUS);
    if under_root > 0.0 {
        best.min((-b - under_root.sqrt()) / a)
    } else {
        best
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tldi_sources::depth::DepthCamera;

    /// What the frames show is where it was put: every point is on floor, table or ball.
    #[test]
    fn frames_show_the_scene() {
        let camera = GeneratedCamera {
            frames: 10,
            seed: 1,
        };
        let mut unprojected = DepthCamera::new(camera.intrinsics(), SensorModel::default());
        for frame in [0, 7] {
            let ball = camera.ball(frame);
            let depths = camera.depths(frame);
            let cloud = unprojected.points(&depths, &GeneratedCamera::world_from_camera());
            let cloud = cloud.expect("a depth for each pixel");
            assert!(cloud.points.len() > 280_000, "{}", cloud.points.len());
            let mut on_ball = 0;
            for p in &cloud.points {
                let from_box = (p.abs() - TABLE).with_z((p.z - TABLE.z).abs() - TABLE.z);
                let to_box = from_box.max(Vec3::ZERO).length() + from_box.max_element().min(0.0);
                let to_ball = p.distance(ball) - BALL_RADIUS;
                let off = p.z.abs().min(to_box.abs()).min(to_ball.abs());
                // Four deviations at 3 m, the farthest of the floor in view.
                assert!(off < 0.06, "{p} is {off} off");
                on_ball += usize::from(to_ball.abs() < 0.005);
            }
            // Beside the table the ball is in view as well.
            assert!(on_ball > 1000, "{frame}: {on_ball}");
        }
    }
}
