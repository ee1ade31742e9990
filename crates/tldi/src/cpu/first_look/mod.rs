//! The first look at a pair: large pixels, which settle what is deep.

mod cell_plane;
pub(super) mod cells;
pub(super) mod settle;
pub(super) mod window;
