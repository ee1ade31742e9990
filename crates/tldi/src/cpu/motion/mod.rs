//! Motions along the view: where a moving surface meets another first.

pub(super) mod core;
pub(super) mod impact;
pub(super) mod meeting;
