//! Dynamic point clouds as rapier bodies. The crate is rapier3d's narrow phase for pairs of
//! colliders with at least one point cloud, by thickened layered depth images ([`tldi`]).
//!
//! A cloud is a collider like any other: fixed (a scan), dynamic (a scanned object) or kinematic (a
//! robot's link). Its points may stay, or be new in every step. It collides with other clouds and
//! with all of rapier's shapes that have a surface.
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
//! - Segments, polylines and shapes without width have no surface, and pass through clouds; so do rapier's
//!   soft bodies. The pipeline says so once for each such collider ([`TldiError::PassesThrough`]).
//! - In a world that no pipeline is attached to, everything passes through clouds. The crate sees neither collider nor
//!   step then, only that it is not asked: it warns once in the [`log`].
//! - Rapier's `KinematicCharacterController` walks on clouds, but asks rapier's own dispatcher whether it is grounded: never
//!   (`docs/in_your_app.md` shows what to do). The same warning says so.
//! - A body wholly inside a cloud's volume, surfaces apart, is not in contact.
//! - Rapier cannot serialise custom shapes, nor the state of pairs with clouds.

#[macro_use]
mod example_setup;

mod config;
mod corrections;
mod debug_render;
#[cfg(doctest)]
mod doc_examples;
mod error;
mod narrow_phase;
pub mod prelude;
mod shape;
mod step;
mod stream;

pub use config::TldiConfig;
pub use corrections::surface_motion::TldiHooks;
pub use debug_render::{DEBUG_POINT_LIMIT, TldiDebugRenderMode};
pub use error::{Passes, TldiError};
pub use narrow_phase::dispatcher::TldiDispatcher;
pub use shape::cloud_shape::PointCloudShape;
pub use shape::collider::cloud_collider;
pub use shape::exact::ExactShape;
pub use shape::mass::{MassModel, unit_mass_properties};
pub use shape::sampling::{SampleError, sample_shape};
pub use step::pipeline::TldiPipeline;
pub use step::report::{Contact, StepReport};
pub use step::resolution::Resolution;
pub use stream::cloud_stream::{CloudStream, SeenPoints, StreamFrame};
pub use stream::own_points::points_on;
pub use tldi::{
    self, CameraPolicy, CloudError, CloudRecipe, NonFinite, PointCloud, RadiusRule, RayHit,
    RaySurface,
};
