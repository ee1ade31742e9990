//! What pictures ask of a camera.

use tldi::glamx::Vec3;
use tldi::{Projection, VirtualCamera};

/// Depth in metres from which the camera sees.
pub(crate) fn near_of(camera: &VirtualCamera) -> f32 {
    match camera.projection {
        Projection::Perspective { near, .. } => near,
        Projection::Orthographic { .. } => f32::NEG_INFINITY,
    }
}

/// Unit direction from a place to the camera, both in the view frame.
pub(crate) fn toward_camera(camera: &VirtualCamera, view: Vec3) -> Vec3 {
    match camera.projection {
        Projection::Perspective { .. } => -view.normalize_or(Vec3::Z),
        Projection::Orthographic { .. } => -Vec3::Z,
    }
}
