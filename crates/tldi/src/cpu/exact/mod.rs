//! Exact surfaces beside clouds: rays through them, and what is near them.

pub(super) mod cast;
pub(super) mod near;
pub(super) mod placed;
