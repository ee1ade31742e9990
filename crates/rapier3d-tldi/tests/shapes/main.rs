//! Clouds as shapes of rapier: their mass, their samples, and rapier's own shapes as surfaces.

mod exact;
mod mass;
mod sampling;
mod shape;
