//! Shapes: clouds as shapes and colliders of rapier, their mass, and rapier's own shapes as surfaces.

mod cloud_discs;
pub(crate) mod cloud_shape;
pub(crate) mod collider;
pub(crate) mod exact;
pub(crate) mod mass;
pub(crate) mod sampling;
