//! Why a shape could not be sampled.

use thiserror::Error;
use tldi::CloudError;

/// Why a shape could not be sampled.
///
/// ```
/// use rapier3d::prelude::SharedShape;
/// use rapier3d_tldi::{SampleError, sample_shape};
/// let error = sample_shape(&*SharedShape::ball(1.0), 0.0).unwrap_err();
/// assert_eq!(error, SampleError::BadSpacing { spacing: 0.0 });
/// ```
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SampleError {
    /// The spacing is no distance.
    #[error("the spacing is {spacing} m: it must be finite and greater than zero")]
    BadSpacing {
        /// The spacing in metres.
        spacing: f32,
    },
    /// There would be too many points.
    #[error(
        "{area} m² with a point every {spacing} m are too many points: use a spacing of at least {least} m"
    )]
    TooFine {
        /// The spacing in metres.
        spacing: f32,
        /// Area of the surface in square metres, or more.
        area: f64,
        /// The smallest spacing that is possible, metres.
        least: f32,
    },
    /// The shape, or a part of the compound, has no surface, an infinite one, or one that is not known.
    #[error(
        "a shape of type {shape} has no bounded surface that can be sampled: use a mesh or a solid of finite size"
    )]
    NoSurface {
        /// Its type, as rapier calls it.
        shape: String,
    },
    /// A corner of a face is NaN or infinite.
    #[error("face {face} has a corner that is not finite: repair the mesh")]
    NotFinite {
        /// Index of the face.
        face: usize,
    },
    /// The points are no valid cloud: the shape is too far from its origin for so fine a spacing.
    #[error(transparent)]
    Cloud(#[from] CloudError),
}
