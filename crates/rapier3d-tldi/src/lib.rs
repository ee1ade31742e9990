//! Dynamic point clouds as rapier bodies: rapier3d's narrow phase for pairs of colliders of which
//! at least one is a point cloud, by thickened layered depth images ([`tldi`]).
//!
//! A cloud is a collider like any other: fixed (a scan), dynamic (a scanned object), kinematic (a
//! robot's link), with points that stay or that are new in every step. It collides with other
//! clouds and with all of rapier's shapes.
//!
//! ```
//! use rapier3d::{glamx::Vec3Swizzles, prelude::*};
//! use rapier3d_tldi::prelude::*;
//!
//! // A square of 2 m with a point every 5 cm, and the surface of a cube of 40 cm.
//! let grid = |n: i32, y: f32| {
//!     (-n..=n).flat_map(move |i| (-n..=n).map(move |j| Vector::new(i as f32, y, j as f32) * 0.05))
//! };
//! let square: Vec<Vector> = grid(20, 0.0).collect();
//! let cube: Vec<Vector> = grid(4, 4.0)
//!     .flat_map(|p| [p, -p, p.yzx(), -p.yzx(), p.zxy(), -p.zxy()])
//!     .collect();
//!
//! let mut world = PhysicsWorld::default();
//! let mut tldi = TldiPipeline::new(TldiConfig::default())?;
//! tldi.attach(&mut world);
//!
//! let scan = PointCloud::builder(&square).radius(0.05).build()?.into_owned();
//! let body = PointCloud::builder(&cube).radius(0.05).build()?.into_owned();
//! let (_, floor) = world.insert(RigidBodyBuilder::fixed(), tldi.collider(scan));
//! let (cube, _) = world.insert(
//!     RigidBodyBuilder::dynamic().translation(Vector::Y * 0.3),
//!     tldi.collider(body).density(500.0),
//! );
//!
//! for _ in 0..60 {
//!     let report = tldi.step(&mut world)?; // compares all pairs in one batch, then rapier's step
//!     assert_eq!(report.pairs_missed, 0);
//! }
//! assert!((world.bodies[cube].translation().y - 0.2).abs() < 0.02);
//!
//! let sunk: Vec<Vector> = square.iter().map(|p| *p - Vector::Y).collect();
//! tldi.set_points(&mut world, floor, &sunk, None)?; // new points, this step
//! tldi.step(&mut world)?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # What does not work
//! - Sweeps of fast bodies (continuous collision detection) take the shapes as they are at the
//!   beginning of the step: what a surface does that deforms comes after.
//! - Rapier's character controller asks its own dispatcher and passes through clouds.
//! - A body wholly inside a cloud's volume, surfaces apart, is not in contact.
//! - Rapier cannot serialise custom shapes, nor the state of pairs with clouds.

mod batching;
mod candidates;
mod collider;
mod config;
mod debug_render;
mod dispatcher;
mod error;
mod exact;
mod impulses;
mod manifolds;
mod mass;
mod measured;
mod own_points;
mod parts;
mod pipeline;
mod planes;
pub mod prelude;
mod prepared;
mod queries;
mod report;
mod resolution;
mod rolling;
mod sampled_motion;
mod sampling;
mod shape;
mod shape_casts;
mod stream;
mod surface_motion;
mod surface_push;
mod sweeps;

pub use collider::cloud_collider;
pub use config::TldiConfig;
pub use debug_render::{DEBUG_POINT_LIMIT, TldiDebugRenderMode};
pub use dispatcher::TldiDispatcher;
pub use error::TldiError;
pub use exact::ExactShape;
pub use mass::{MassModel, unit_mass_properties};
pub use own_points::points_on;
pub use pipeline::TldiPipeline;
pub use report::{Contact, StepReport};
pub use resolution::Resolution;
pub use sampling::{SampleError, sample_shape};
pub use shape::PointCloudShape;
pub use stream::{CloudStream, StreamFrame};
pub use surface_motion::TldiHooks;
pub use tldi::{
    self, CameraPolicy, CloudError, CloudRecipe, NonFinite, PointCloud, RadiusRule, RayHit,
    RaySurface,
};
