//! Pictures of point clouds, drawn from the layers that also find their collisions: [`Scene::draw`] is the
//! renderer, [`viewpoint`] chooses where to look from, [`sheet`] puts panels and a legend on one picture,
//! [`animation`] makes a file that moves.
//!
//! It knows [`tldi`] alone: no physics, and none of the stories that it illustrates.

pub mod animation;
mod camera;
mod clouds;
mod front_layers;
mod picture;
mod render;
mod scene;
mod shading;
pub mod sheet;
pub mod viewpoint;

pub use clouds::{painted, thinned};
pub use picture::Picture;
pub use scene::{BODY_COLORS, Item, Paint, Scene, pixels_of};
