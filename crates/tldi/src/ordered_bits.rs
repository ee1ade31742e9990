//! Floats as integers in the same order.

/// Bits that sort as unsigned integers like the numbers sort. −0 comes before 0.
pub(crate) fn ordered_bits(number: f32) -> u32 {
    let bits = number.to_bits();
    if bits >> 31 == 0 {
        bits | 1 << 31
    } else {
        !bits
    }
}
