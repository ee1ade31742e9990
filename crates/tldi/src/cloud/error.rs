//! What can be wrong with a cloud, and what to do about it.

use thiserror::Error;

/// Why a [`PointCloud`](crate::PointCloud) could not be built or changed. Indices are those of the
/// data given by the caller.
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum CloudError {
    /// No point is left (after non-finite ones were dropped).
    #[error(
        "the cloud has no points ({dropped} non-finite ones were dropped): give at least one finite point"
    )]
    Empty {
        /// Points dropped because a coordinate was NaN or infinite.
        dropped: usize,
    },
    /// A coordinate is NaN or infinite and the builder was told to refuse such points.
    #[error(
        "point {index} has a NaN or infinite coordinate ({count} such points): filter them, or build with NonFinite::Drop"
    )]
    NonFinite {
        /// The first such point.
        index: usize,
        /// How many there are.
        count: usize,
    },
    /// A radius is zero, negative, NaN, infinite, or so extreme that `f32` cannot hold the volumes
    /// made from it.
    #[error(
        "the radius of point {index} is {radius}: radii must be between 1e-12 and 1e12; choose another, or another unit of length"
    )]
    BadRadius {
        /// The first such point (0 for a global radius).
        index: usize,
        /// Its radius in metres.
        radius: f32,
    },
    /// An attribute has another number of entries than there are points.
    #[error("{attribute} has {actual} entries for {expected} points: give one per point")]
    LengthMismatch {
        /// The attribute: "radii", "normals" or "colors".
        attribute: &'static str,
        /// Number of points.
        expected: usize,
        /// Number of entries.
        actual: usize,
    },
    /// More points than the limit: 67,108,863, which is u32::MAX / 64.
    #[error("{count} points are more than the limit of {limit}: split or thin the cloud")]
    TooManyPoints {
        /// Points given.
        count: usize,
        /// Most points that one cloud can have.
        limit: usize,
    },
    /// A coordinate exceeds 2¹⁹ (524,288) times the point's radius: there, a step of `f32` may be
    /// more than a sixteenth of the radius.
    #[error(
        "point {index} has coordinate {coordinate}, where f32 steps are too coarse for its radius {radius}: move the cloud's origin nearer and put the offset into the body's pose"
    )]
    CoordinateTooLarge {
        /// The first such point.
        index: usize,
        /// The coordinate in metres.
        coordinate: f32,
        /// The point's radius in metres.
        radius: f32,
    },
    /// A parameter is outside its range.
    #[error("{parameter} is {value}: {expected}")]
    BadParameter {
        /// Name of the parameter.
        parameter: &'static str,
        /// The value given.
        value: f32,
        /// What is allowed.
        expected: &'static str,
    },
    /// Radii cannot be made from nearest neighbours, since all points are at one position.
    #[error(
        "all {count} points are at one position, so that neighbours give no radius: give one with CloudBuilder::radius; \
         if they were apart before they became f32, move their origin nearer"
    )]
    NoSpacing {
        /// Number of points.
        count: usize,
    },
    /// Normals were given, but all are zero or not finite.
    #[error(
        "none of the {count} normals is finite and other than zero: leave them out, or use CloudBuilder::pca_normals"
    )]
    NoUsableNormal {
        /// Number of normals.
        count: usize,
    },
}
