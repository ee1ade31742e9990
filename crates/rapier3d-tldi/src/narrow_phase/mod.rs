//! What rapier's narrow phase and queries ask about clouds, and the answers.

pub(crate) mod dispatcher;
pub(crate) mod manifolds;
pub(crate) mod moving;
mod part_patch;
pub(crate) mod parts;
pub(crate) mod passing;
pub(crate) mod queries;
pub(crate) mod shape_casts;
mod steady_gaps;
pub(crate) mod straight_way;
pub(crate) mod turning;
