//! Spatial order of points along a Morton (Z-order) curve.

use crate::Aabb;
use glamx::Vec3;
use rayon::prelude::*;

/// Bits per coordinate of a Morton code.
const BITS: u32 = 21;

/// The indices of the points in the order of a Morton curve through `bounds`; points of the same
/// cell (2⁻²¹ of the longest edge) keep their order.
pub(crate) fn morton_order(points: &[Vec3], bounds: Aabb) -> Vec<u32> {
    let origin = bounds.min.as_dvec3();
    let edge = (bounds.max.as_dvec3() - origin).max_element();
    let cells = f64::from((1u32 << BITS) - 1);
    let scale = if edge > 0.0 { cells / edge } else { 0.0 };
    let mut keys: Vec<(u64, u32)> = points
        .par_iter()
        .enumerate()
        .map(|(i, point)| {
            let cell = (point.as_dvec3() - origin) * scale;
            let code =
                spread(cell.x as u64) << 2 | spread(cell.y as u64) << 1 | spread(cell.z as u64);
            (code, i as u32)
        })
        .collect();
    keys.par_sort_unstable();
    keys.into_iter().map(|(_, i)| i).collect()
}

/// Puts two zero bits between the lowest [`BITS`] bits.
fn spread(bits: u64) -> u64 {
    let mut b = bits & ((1 << BITS) - 1);
    b = (b | b << 32) & 0x001f_0000_0000_ffff;
    b = (b | b << 16) & 0x001f_0000_ff00_00ff;
    b = (b | b << 8) & 0x100f_00f0_0f00_f00f;
    b = (b | b << 4) & 0x10c3_0c30_c30c_30c3;
    (b | b << 2) & 0x1249_2492_4924_9249
}

/// `values[order[0]], values[order[1]], …`
pub(crate) fn permuted<T: Copy>(values: &[T], order: &[u32]) -> Vec<T> {
    order.iter().map(|&i| values[i as usize]).collect()
}
