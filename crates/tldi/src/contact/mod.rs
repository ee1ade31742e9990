//! Contacts: from contact pixels to the few points that a solver takes. On the CPU for every backend.

pub(crate) mod beyond;
pub(crate) mod bowl;
pub(crate) mod crease;
pub(crate) mod gap_fit;
pub(crate) mod links;
pub(crate) mod lone_points;
pub(crate) mod main_plane;
pub(crate) mod neighbors;
pub(crate) mod noise;
pub(crate) mod part_shape;
pub(crate) mod patch_types;
pub(crate) mod patches;
mod point_axes;
pub(crate) mod smooth;
pub(crate) mod supports;
pub(crate) mod way_out;

use crate::ContactPixel;

/// Keeps the contact pixels that `is_kept` says, by their indices.
fn retain_by_index(
    contacts: &mut Vec<ContactPixel>,
    mut is_kept: impl FnMut(usize, &ContactPixel) -> bool,
) {
    let mut count = 0;
    contacts.retain(|contact| {
        count += 1;
        is_kept(count - 1, contact)
    });
}
