//! Poses of a sensor that moves.

use crate::origin;
use thiserror::Error;
use tldi::glamx::{DMat3, DPose3, DQuat, DVec3, Pose3};

/// Largest deviation of a pose's rotation from an orthonormal matrix: files round.
const ROUNDING: f64 = 0.01;

/// Why a text tells no pose.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum PoseError {
    /// One of its words is no number.
    #[error("`{0}` is not a number")]
    NoNumber(String),
    /// One of its numbers is infinite or NaN, or too large for `f32`: some write this where they lost track of the sensor.
    #[error("`{0}` is not a finite number")]
    NotFinite(String),
    /// It has another count of numbers.
    #[error("{0} numbers where 12 or 16 belong, a matrix of 3 × 4 or 4 × 4")]
    Count(usize),
    /// The matrix scales, skews or mirrors.
    #[error(
        "the matrix is no pose: its left part must be a rotation, and its last row, if there is one, 0 0 0 1"
    )]
    NoRotation,
}

/// Reads a pose from its matrix, row by row: 4 × 4, or the upper three rows of it.
///
/// # Errors
/// [`PoseError`].
///
/// ```
/// use tldi_sources::parse_pose;
/// let world_from_camera = parse_pose("0 -1 0 5  1 0 0 6  0 0 1 7")?;
/// assert_eq!(world_from_camera.translation.to_array(), [5.0, 6.0, 7.0]);
/// # Ok::<(), tldi_sources::PoseError>(())
/// ```
pub fn parse_pose(text: &str) -> Result<DPose3, PoseError> {
    let m = (text.split_whitespace())
        .map(|word| match word.parse::<f64>() {
            Ok(number) if (number as f32).is_finite() => Ok(number),
            Ok(_) => Err(PoseError::NotFinite(word.to_owned())),
            Err(_) => Err(PoseError::NoNumber(word.to_owned())),
        })
        .collect::<Result<Vec<_>, _>>()?;
    if !matches!(m.len(), 12 | 16) {
        return Err(PoseError::Count(m.len()));
    }
    let column = |k: usize| DVec3::new(m[k], m[4 + k], m[8 + k]);
    let rotation = DMat3::from_cols(column(0), column(1), column(2));
    let skew = rotation.transpose() * rotation - DMat3::IDENTITY;
    let is_rotation =
        skew.to_cols_array().iter().all(|s| s.abs() < ROUNDING) && rotation.determinant() > 0.0;
    if !is_rotation || !matches!(m[12..], [] | [0.0, 0.0, 0.0, 1.0]) {
        return Err(PoseError::NoRotation);
    }
    let rotation = DQuat::from_mat3(&rotation).normalize();
    Ok(DPose3::from_parts(column(3), rotation))
}

/// Poses that fit into `f32`, and the origin that they count from: place in the world = origin + place. Coordinates of a
/// map are too large for `f32`.
///
/// The origin is chosen as [`RawCloud::origin`](crate::RawCloud::origin) is, from the places of the poses.
///
/// ```
/// use tldi_sources::{near_origin, parse_pose};
/// let on_map = parse_pose("1 0 0 654321.25  0 1 0 0  0 0 1 7")?;
/// let (poses, origin) = near_origin(&[on_map]);
/// assert_eq!(origin.to_array(), [654_321.0, 0.0, 0.0]);
/// assert_eq!(poses[0].translation.to_array(), [0.25, 0.0, 7.0]);
/// # Ok::<(), tldi_sources::PoseError>(())
/// ```
pub fn near_origin(poses: &[DPose3]) -> (Vec<Pose3>, DVec3) {
    let places: Vec<DVec3> = poses.iter().map(|pose| pose.translation).collect();
    let origin = origin::near(&places);
    let near =
        |pose: &DPose3| Pose3::from(DPose3::from_parts(pose.translation - origin, pose.rotation));
    (poses.iter().map(near).collect(), origin)
}
