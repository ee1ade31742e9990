//! What the narrow phase is told: contacts, pairs, and what is drawn of them.

#[path = "../common/mod.rs"]
mod common;

mod debug_render;
mod dispatcher;
mod edges;
mod manifolds;
mod resolution;
mod shallow;
mod shared_shapes;
mod small_bodies;
mod thin_shapes;
mod uneven;
