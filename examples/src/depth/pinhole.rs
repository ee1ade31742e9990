//! The camera that generated frames are seen with.

use tldi::VirtualCamera;
use tldi::glamx::{Pose3, Vec3};
use tldi_sources::depth::Intrinsics;

/// Columns and rows, focal length in pixels.
pub(super) const SIZE: [usize; 2] = [640, 480];
const FOCAL: f32 = 560.0;

/// Its geometry, for depths in this unit, metres.
pub(super) fn intrinsics(depth_unit: f32) -> Intrinsics {
    Intrinsics {
        size: SIZE,
        focal: [FOCAL; 2],
        center: SIZE.map(|n| 0.5 * n as f32 - 0.5),
        depth_unit,
    }
}

/// Its pose, where its image is upright if `upper` is up.
pub(super) fn world_from_camera(eye: Vec3, target: Vec3, upper: Vec3) -> Pose3 {
    let size = SIZE.map(|n| n as u32);
    let camera = VirtualCamera::perspective(eye, target, upper, 1.0, size, 0.1, 10.0);
    camera.view_from_frame.inverse()
}

/// The direction of a pixel's ray in the world, 1 long along the optical axis: lengths of it are depths.
pub(super) fn ray(pixel: [usize; 2], world_from_camera: &Pose3) -> Vec3 {
    let [x, y] = [0, 1].map(|k| (pixel[k] as f32 - (0.5 * SIZE[k] as f32 - 0.5)) / FOCAL);
    world_from_camera.rotation * Vec3::new(x, y, 1.0)
}
