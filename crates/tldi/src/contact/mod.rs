//! Contacts: from contact pixels to the few points that a solver takes. On the CPU for every backend.

pub(crate) mod bowl;
pub(crate) mod crease;
pub(crate) mod gap_fit;
pub(crate) mod links;
pub(crate) mod lone_points;
pub(crate) mod main_plane;
pub(crate) mod noise;
pub(crate) mod part_shape;
pub(crate) mod patch_types;
pub(crate) mod patches;
pub(crate) mod ramp;
pub(crate) mod smooth;
pub(crate) mod supports;
pub(crate) mod way_out;
