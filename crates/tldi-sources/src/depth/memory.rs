//! What a depth camera saw and does not see any more.

use super::{DepthCamera, DepthCloud};
use std::collections::VecDeque;
use tldi::glamx::Pose3;

/// Remembers the points of the last frames where the present one does not see: what is hidden by something nearer, or out
/// of view. What the present frame sees through is gone, and what it sees is taken from it; flying pixels see nothing.
///
/// ```
/// use tldi::glamx::Pose3;
/// use tldi_sources::depth::{DepthCamera, DepthMemory, Intrinsics, SensorModel};
///
/// let intrinsics = Intrinsics { size: [32, 32], focal: [32.0, 32.0], center: [15.5, 15.5], depth_unit: 1e-3 };
/// let mut camera = DepthCamera::new(intrinsics, SensorModel::default());
/// let mut memory = DepthMemory::new(30);
/// // A wall at 2 m; then a plate at 1 m hides half of it; then it is gone.
/// let (wall, half) = (vec![2000; 1024], [[1000; 512], [2000; 512]].concat());
/// let mut look = |depths: &[u16]| {
///     let seen = camera.points(depths, &Pose3::IDENTITY).expect("a depth for each pixel");
///     memory.complete(seen, &camera, &Pose3::IDENTITY).points
/// };
/// let far = |points: &[tldi::glamx::Vec3]| points.iter().filter(|p| p.z > 1.5).count();
/// let all = far(&look(&wall));
/// let covered = look(&half);
/// assert!(far(&covered) == all && covered.len() > all * 5 / 4);
/// assert!(look(&wall).iter().all(|p| p.z > 1.5));
/// ```
#[derive(Clone, Debug)]
pub struct DepthMemory {
    frames: usize,
    remembered: VecDeque<DepthCloud>,
}

impl DepthMemory {
    /// Of so many frames before the present one; of none, frames stay as they are.
    pub fn new(frames: usize) -> Self {
        Self {
            frames,
            remembered: VecDeque::new(),
        }
    }

    /// A frame, and what earlier ones saw where it does not. `camera` has just taken the frame, in the world, from
    /// `world_from_camera`.
    ///
    /// Cost: linear in the points that are remembered.
    pub fn complete(
        &mut self,
        frame: DepthCloud,
        camera: &DepthCamera,
        world_from_camera: &Pose3,
    ) -> DepthCloud {
        if self.frames == 0 {
            return frame;
        }
        let camera_from_world = world_from_camera.inverse();
        let mut whole = frame.clone();
        for old in &mut self.remembered {
            old.retain(|point| {
                !camera.sees_through(point, &camera_from_world)
                    && !camera.sees(point, &camera_from_world)
            });
            whole.append(old);
        }
        self.remembered.push_back(frame);
        if self.remembered.len() > self.frames {
            self.remembered.pop_front();
        }
        whole
    }
}
