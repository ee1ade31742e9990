//! How many depths an image must have.

use thiserror::Error;

/// A depth image has more or fewer depths than its camera has pixels.
///
/// ```
/// use tldi::glamx::Pose3;
/// use tldi_sources::depth::{DepthCamera, FrameSizeError, Intrinsics, SensorModel};
///
/// let intrinsics = Intrinsics { size: [40, 30], focal: [40.0; 2], center: [19.5, 14.5], depth_unit: 1e-3 };
/// let mut camera = DepthCamera::new(intrinsics, SensorModel::default());
/// let padded = vec![1000; 48 * 30]; // rows of 40 depths and 8 of padding
/// let error = camera.points(&padded, &Pose3::IDENTITY).expect_err("too many");
/// assert_eq!(error, FrameSizeError { size: [40, 30], found: 1440 });
/// let rows: Vec<u16> = padded.chunks(48).flat_map(|row| &row[..40]).copied().collect();
/// assert!(camera.points(&rows, &Pose3::IDENTITY).is_ok());
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq, Error)]
#[error(
    "the depth image has {found} depths, but the camera has {} × {} pixels: give one depth for each pixel, row by row, \
     without padding at the ends of rows",
    .size[0], .size[1]
)]
pub struct FrameSizeError {
    /// Columns and rows of the camera.
    pub size: [usize; 2],
    /// Depths in the image.
    pub found: usize,
}

impl FrameSizeError {
    /// Fails unless there is a depth for each pixel.
    pub(super) fn check(size: [usize; 2], found: usize) -> Result<(), Self> {
        match size[0].checked_mul(size[1]) == Some(found) {
            true => Ok(()),
            false => Err(Self { size, found }),
        }
    }
}
