//! What the stages need so that compilers turn their loops into SIMD instructions.

/// Compiles a function for several instruction sets. The call chooses the best that the machine has. Results are equal:
/// the compiler does not fuse a multiplication and an addition.
///
/// A loop can be SIMD with one set and scalar with another. Two things prevent SIMD most often: a branch in a lane (take `max`,
/// `min`, or one of two computed values), and adding up lanes in the same function (give out all of them). `perf
/// annotate` shows it: the loop then has `ss` instructions or `vinsertps`.
macro_rules! multiversioned {
    ($function:item) => {
        #[multiversion::multiversion(targets(
            "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl",
            "x86_64+avx2+fma",
            "aarch64+neon"
        ))]
        $function
    };
}
pub(super) use multiversioned;

/// Lanes of [`bounds`].
const LANES: usize = 16;

/// Least and greatest value; infinite of none.
pub(super) fn bounds(values: &[f32]) -> (f32, f32) {
    let (mut least, mut greatest) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]);
    let (chunks, rest) = values.as_chunks();
    lane_bounds(chunks, &mut least, &mut greatest);
    let all = |of: [f32; LANES], op: fn(f32, f32) -> f32| {
        let values = of[1..].iter().chain(rest);
        values.fold(of[0], |m, &v| op(m, v))
    };
    (all(least, f32::min), all(greatest, f32::max))
}

multiversioned! {
/// The same of each lane, for chunks of values.
fn lane_bounds(chunks: &[[f32; LANES]], least: &mut [f32; LANES], greatest: &mut [f32; LANES]) {
    let (mut lo, mut hi) = (*least, *greatest);
    for chunk in chunks {
        for l in 0..LANES {
            lo[l] = if chunk[l] < lo[l] { chunk[l] } else { lo[l] };
            hi[l] = if chunk[l] > hi[l] { chunk[l] } else { hi[l] };
        }
    }
    (*least, *greatest) = (lo, hi);
}
}

/// Largest bound of [`truncated`], the largest `f32` below 2³¹.
const MOST: f32 = 2_147_483_520.0;

/// The integer part of `value`, clamped to 0 to `most`. `most` is at least 0. 0 if `value` is not a number.
///
/// `as` does the same, but handles each number for itself: its conversions do not become SIMD
/// instructions.
#[inline(always)]
pub(super) fn truncated(value: f32, most: f32) -> u32 {
    debug_assert!(most.is_nan() || most >= 0.0);
    let value = if value > 0.0 { value } else { 0.0 };
    let most = if most < MOST { most } else { MOST };
    let value = if value < most { value } else { most };
    // SAFETY: `value` is neither NaN nor below 0 after the first line nor above 2³¹ after the
    // third; `most` is not NaN after the second.
    let truncated: i32 = unsafe { value.to_int_unchecked() };
    truncated as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn truncates_as_casts_do() {
        for value in [
            f32::NAN,
            f32::NEG_INFINITY,
            f32::INFINITY,
            -1e-30,
            -0.0,
            0.0,
            0.999_999,
            1.0,
            16_777_217.3,
            3e9,
        ] {
            for most in [0.0, 1.0, 1000.5, 1e9, f32::INFINITY, f32::NAN] {
                let bound = if most.is_nan() { MOST } else { most.min(MOST) };
                let expected = value.max(0.0).min(bound) as u32;
                assert_eq!(truncated(value, most), expected, "{value} {most}");
            }
        }
    }
}
