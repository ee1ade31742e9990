//! Pass `stacking`: which depth segments behind the front hold a cylinder.

use super::fragments::Fragment;
use super::visibility::Front;

/// Most depth segments of one layer: the bits of the occupancy mask.
pub(super) const MAX_SEGMENTS: u32 = u128::BITS;

/// The occupancy mask of the first `segments` (1 to [`MAX_SEGMENTS`]) depth segments behind the
/// front: bit `k` is set where a cylinder reaches into segment `k`. `rest` is in order of front
/// depth.
///
/// A segment that stays empty ends the layer, so that what lies behind the first one is not looked
/// at and stays unset: every cylinder is visited by one layer, and once more by the layer before.
pub(super) fn stacking(rest: &[Fragment], front: &Front, segments: u32) -> u128 {
    let mut mask = 0;
    let mut filled = 0;
    for fragment in rest {
        let first = front.first_segment(fragment);
        if first > filled {
            break;
        }
        let last = front.last_segment(fragment).min(segments - 1);
        if last >= filled {
            filled = last + 1;
            mask |= bits(first, last);
        }
    }
    mask
}

/// Bits `first` to `last`, both included.
fn bits(first: u32, last: u32) -> u128 {
    (u128::MAX >> (u128::BITS - 1 - last)) & (u128::MAX << first)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::paper::counter::counter;
    use crate::paper::visibility::visibility;

    fn cylinder(near: f32, far: f32) -> Fragment {
        Fragment {
            near,
            far,
            weight: 1.0,
            point: 0,
        }
    }

    #[test]
    fn bits_are_an_inclusive_range() {
        assert_eq!(bits(0, 0), 1);
        assert_eq!(bits(2, 4), 0b11100);
        assert_eq!(bits(0, 127), u128::MAX);
        assert_eq!(bits(127, 127), 1 << 127);
    }

    #[test]
    fn the_mask_ends_at_the_first_empty_segment() {
        // Segments of height 1 from depth 2: 0, then 1 and 2, then a hole at 3 (depth 5 to 6).
        let rest = [cylinder(2.0, 3.0), cylinder(3.5, 4.5), cylinder(6.5, 7.5)];
        let front = visibility(&rest);
        let mask = stacking(&rest, &front, MAX_SEGMENTS);
        assert_eq!(mask, 0b111);
        assert_eq!(counter(mask), 3);
    }

    #[test]
    fn the_mask_is_cut_at_its_last_segment() {
        let rest = [cylinder(0.0, 1.0), cylinder(0.5, 1000.0)];
        let front = visibility(&rest);
        assert_eq!(stacking(&rest, &front, MAX_SEGMENTS), u128::MAX);
        assert_eq!(stacking(&rest, &front, 5), 0b11111);
    }
}
