//! Exact surfaces beside clouds: rays through them, and what is near them.

pub(super) mod cast;
pub(super) mod cell_distances;
pub(super) mod near;
pub(super) mod placed;
#[cfg(test)]
mod test_surface;
