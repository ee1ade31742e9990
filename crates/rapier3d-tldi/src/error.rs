//! What can go wrong between the clouds and rapier.

use rapier3d::geometry::ColliderHandle;
use thiserror::Error;
use tldi::{BackendError, CloudError};

/// Why a step of a [`TldiPipeline`](crate::TldiPipeline) failed.
///
/// Rapier drops errors of its narrow phase, and the bodies concerned fall through each other. Here
/// such errors are kept, and the [`finish`](crate::TldiPipeline::finish) of that step returns them. What failed
/// outside of a step, such as a cast of your own, goes to the [`log`] when the next step is prepared.
///
/// ```
/// use rapier3d::prelude::*;
/// use rapier3d_tldi::prelude::*;
/// let mut world = PhysicsWorld::default();
/// let mut tldi = TldiPipeline::new(TldiConfig::default())?;
/// assert_eq!(tldi.step(&mut world), Err(TldiError::NotAttached));
/// tldi.attach(&mut world);
/// assert!(tldi.step(&mut world).is_ok());
/// # Ok::<(), TldiError>(())
/// ```
#[derive(Debug, Clone, PartialEq, Error)]
#[non_exhaustive]
pub enum TldiError {
    /// The narrow phase does not ask this pipeline.
    #[error(
        "the narrow phase is not attached to this pipeline: call `attach` once after creating or deserialising the world"
    )]
    NotAttached,
    /// The backend that was asked for is not there.
    #[error(transparent)]
    NoBackend(BackendError),
    /// The backend could not compare two colliders of the batch. No step was taken.
    #[error("colliders {collider1:?} and {collider2:?} cannot be compared: {source}")]
    Pair {
        /// The collider with the lower index.
        collider1: ColliderHandle,
        /// The other collider.
        collider2: ColliderHandle,
        /// What the backend says.
        source: BackendError,
    },
    /// The backend failed for the batch as a whole. No step was taken.
    #[error("the batch of {pairs} pairs cannot be compared: {source}")]
    Batch {
        /// Pairs in the batch.
        pairs: usize,
        /// What the backend says.
        source: BackendError,
    },
    /// Pairs that were compared on the spot, inside rapier's step, failed: they had no contacts in
    /// that step.
    #[error("{count} comparisons or casts inside the last step failed; the first: {first}")]
    OnTheSpot {
        /// How many failed since the step was prepared.
        count: usize,
        /// The error of one of them.
        first: BackendError,
    },
    /// A collider whose kind clouds cannot meet is near one and passes through it. The step was taken. Said
    /// once for each such collider, of one in a step.
    #[error("collider {collider:?} passes through the cloud of collider {cloud:?}: {reason}")]
    PassesThrough {
        /// What passes.
        collider: ColliderHandle,
        /// The collider with the cloud.
        cloud: ColliderHandle,
        /// Why.
        reason: Passes,
    },
    /// The new points of a collider are not a valid cloud. It keeps the old ones.
    #[error("the new points of collider {collider:?}: {source}")]
    Cloud {
        /// The collider.
        collider: ColliderHandle,
        /// What is wrong with the points.
        source: CloudError,
    },
    /// A deforming cloud was given another number of points than before.
    #[error(
        "collider {collider:?} was given {expected} points before and {found} now: a surface that deforms keeps its points; use `set_points` for new ones"
    )]
    OtherPoints {
        /// The collider.
        collider: ColliderHandle,
        /// Points given before, with those that are not finite.
        expected: usize,
        /// Points given.
        found: usize,
    },
    /// The collider does not exist (any more).
    #[error("collider {0:?} does not exist: was it removed?")]
    NoSuchCollider(ColliderHandle),
    /// The collider's shape is not a cloud.
    #[error(
        "the shape of collider {0:?} is not a PointCloudShape: give the cloud a collider of its own (not a part of a compound)"
    )]
    NotACloud(ColliderHandle),
    /// A setting is outside its range. Nothing was done.
    #[error("{setting} is {value}: {expected}")]
    BadConfig {
        /// Name of the field of [`TldiConfig`](crate::TldiConfig), or `dt`, the seconds of a step.
        setting: &'static str,
        /// The value given.
        value: f32,
        /// What is allowed.
        expected: &'static str,
    },
}

impl TldiError {
    /// An error unless a step can take `dt` seconds.
    pub(crate) fn check_dt(dt: f32) -> Result<(), Self> {
        match dt.is_finite() && dt >= 0.0 {
            true => Ok(()),
            false => Err(Self::BadConfig {
                setting: "dt",
                value: dt,
                expected: "the seconds of a step must be finite and not negative",
            }),
        }
    }
}

/// Why a collider passes through clouds.
///
/// ```
#[doc = example_world!()]
/// // A segment has no surface: `step` says so once.
/// use rapier3d_tldi::Passes;
/// let body = RigidBodyBuilder::dynamic().translation(Vector::new(1.0, 0.01, 0.5));
/// world.insert(body, ColliderBuilder::segment(-Vector::X, Vector::X));
/// let error = tldi.step(&mut world).unwrap_err();
/// assert!(matches!(error, TldiError::PassesThrough { reason: Passes::Line, .. }));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Passes {
    /// Its shape, or a part of its compound, is a line or a point: a segment, a polyline, or a shape without width.
    Line,
    /// It is the skin of one of rapier's soft bodies, whose particles rapier holds up by its own tests.
    SoftBody,
}

impl std::fmt::Display for Passes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Self::Line => {
                "its shape has a part without a surface (a segment, a polyline or what has no width): \
                 give it a width, as a capsule has"
            }
            Self::SoftBody => {
                "rapier's soft bodies do not collide with clouds: take a rigid body, or give the cloud's \
                 ground a shape of rapier's for it to rest on"
            }
        })
    }
}
