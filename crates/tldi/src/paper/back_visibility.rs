//! Pass `back_visibility`: where a layer ends.

use super::fragments::Fragment;

/// Index of the backmost of a layer's cylinders, at least one: that whose back depth is greatest,
/// the first of equals.
pub(super) fn back_visibility(members: &[Fragment]) -> usize {
    let mut backmost = 0;
    for (i, fragment) in members.iter().enumerate() {
        if fragment.far > members[backmost].far {
            backmost = i;
        }
    }
    backmost
}
