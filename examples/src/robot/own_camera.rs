//! A robot's own camera, which sees the scan and the robot.

use super::links::LinkCloud;
use crate::random;
use fastrand::Rng;
use tldi::PointCloud;
use tldi::glamx::{Pose3, Vec3};

/// A camera that sees the scan and the robot.
pub(super) struct OwnCamera {
    noise: f32,
    rng: Rng,
}

impl OwnCamera {
    /// A camera whose points are off by `noise` metres (standard deviation).
    pub(super) fn new(noise: f32, seed: u64) -> Self {
        Self {
            noise,
            rng: Rng::with_seed(seed ^ 0x6361_6d65),
        }
    }

    /// A frame: the scan, and the links where they are (by index of the URDF).
    pub(super) fn frame(
        &mut self,
        scan: &PointCloud<'_>,
        links: &[LinkCloud],
        world_from_link: &[Pose3],
    ) -> Vec<Vec3> {
        let mut frame: Vec<Vec3> = scan.points().to_vec();
        for link in links {
            let pose = world_from_link[link.link];
            frame.extend(link.cloud.points().iter().map(|&p| pose * p + self.error()));
        }
        frame
    }

    /// A measuring error.
    fn error(&mut self) -> Vec3 {
        let mut component = || self.noise * random::normal(&mut self.rng);
        Vec3::new(component(), component(), component())
    }
}
