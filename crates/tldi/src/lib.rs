//! Thickened layered depth images (TLDI) of point clouds: collision, gap and contacts between
//! unstructured point sets that may be all new in every frame.
//!
//! This crate knows nothing of physics engines, GPUs or file formats; `rapier3d-tldi` connects it
//! to rapier.

mod aabb;
mod approach;
mod backend;
mod bowl;
mod builder;
mod camera;
mod camera_policy;
mod cloud;
mod contacts;
mod cpu;
mod crease;
mod error;
mod gap_fit;
mod gather;
mod impact;
mod knn;
mod links;
mod lone_points;
mod main_plane;
mod morton;
mod noise;
mod normals;
pub mod paper;
mod params;
mod part_shape;
mod patches;
pub mod plan;
mod radii;
mod reach;
mod recipe;
mod supported;
mod supports;
mod surface;
#[allow(clippy::module_inception, reason = "the image is the crate's namesake")]
mod tldi;
mod work;

pub use crate::tldi::{Facing, Layer, Tldi};
pub use aabb::Aabb;
pub use backend::{Backend, BackendError, PairQuery, PairResult, View};
pub use bowl::Lowest;
pub use builder::{CloudBuilder, NonFinite, Positions};
pub use camera::{Projection, VirtualCamera};
pub use camera_policy::CameraPolicy;
pub use cloud::{BLOCK, PointCloud, Radii};
pub use contacts::{ContactPatch, ContactPixel, ContactPoint, PATCH_POINTS};
pub use cpu::{CpuBackend, build};
pub use error::CloudError;
pub use glamx;
pub use impact::{Impact, ImpactQuery, Penetration};
pub use knn::{KdTree, Neighbor};
pub use params::{Params, Variant};
pub use patches::{MAX_PATCHES, PatchScratch, SAME_PLANE};
pub use recipe::{CloudRecipe, RadiusRule};
pub use supports::{Supports, supports};
pub use surface::{DeviceCloud, RayHit, RaySurface, Surface};
pub use work::{Looked, Work};

/// A view axis is kept from frame to frame while the zone's normals agree with it within this
/// angle, in radians (10°).
pub const AXIS_HYSTERESIS: f32 = 0.1745;
