//! Pass `counter`: how far a layer extends.

/// Number of filled depth segments from the front on, before the first empty one: the extent of
/// the layer. At least 1, for the frontmost cylinder is always in the first segment.
pub(super) fn counter(mask: u128) -> u32 {
    mask.trailing_ones()
}
