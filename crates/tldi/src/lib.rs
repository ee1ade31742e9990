//! Thickened layered depth images (TLDI) of point clouds: collision, gap and contacts between
//! unstructured point sets. The points may all be new in every frame.
//!
//! This crate knows nothing of physics engines, GPUs or file formats; `rapier3d-tldi` connects it
//! to rapier.
//!
//! With the feature `tracing`, the stages of the CPU backend are spans of the level "trace". Any
//! subscriber of the crate `tracing` can then show where the time of a step goes.

mod aabb;
mod cloud;
mod contact;
mod counting_sort;
mod cpu;
mod ordered_bits;
mod pair;
pub mod paper;
mod stage;
mod view;

pub use aabb::Aabb;
pub use cloud::builder::CloudBuilder;
pub use cloud::error::CloudError;
pub use cloud::gather::BLOCK;
pub use cloud::knn::{KdTree, Neighbor};
pub use cloud::point_cloud::PointCloud;
pub use cloud::radii::Radii;
pub use cloud::recipe::{CloudRecipe, NonFinite, RadiusRule};
pub use contact::patch_types::{ContactPatch, ContactPixel, ContactPoint, PATCH_POINTS};
pub use contact::patches::{MAX_PATCHES, PatchScratch, SAME_PLANE};
pub use cpu::room::Room;
pub use cpu::{CpuBackend, build};
pub use glamx;
pub use pair::backend::{Backend, BackendError, PairQuery, PairResult, View};
pub use pair::impact_query::{Impact, ImpactQuery, Penetration};
pub use pair::params::{Params, Variant};
pub use pair::plan;
pub use pair::surface::{DeviceCloud, RayHit, RaySurface, Surface};
pub use pair::work::{Looked, Work};
pub use view::camera::{Projection, VirtualCamera};
pub use view::camera_policy::CameraPolicy;
pub use view::tldi::{Facing, Layer, Tldi};

/// A view axis is kept from frame to frame while the normals of the contact zone agree with it within this angle, in
/// radians (10°). Half or twice: no change.
pub const AXIS_HYSTERESIS: f32 = 0.1745;
