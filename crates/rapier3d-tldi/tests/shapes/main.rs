//! Clouds as shapes of rapier: their mass, their samples, and rapier's own shapes as surfaces.

mod exact;
mod mass;
mod sampling;
mod shape;
#[allow(
    dead_code,
    unreachable_pub,
    reason = "a part of another package, of which this one uses a part"
)]
#[path = "../../../../tests/testkit/skip.rs"]
mod skip;
