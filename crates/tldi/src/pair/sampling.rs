//! Which points of a cloud are taken, where fewer than all are enough.

use crate::BLOCK;

/// Points that are kept per pixel of a surface seen face on: enough for the mean of a layer. With 1, coarse pixels cost
/// a tenth, but bodies fall asleep later on scans. Half or twice: no change.
const POINTS_PER_PIXEL: f32 = 8.0;

/// About the most near points of a cloud whose normals aim the camera, or that are projected onto an exact
/// surface to aim it; more do not sharpen the mean of their normals.
pub const AIM_SAMPLES: usize = 512;

/// Whether the normal at a near point is one of those that aim the camera. About every `step`-th
/// is. The point's index in its cloud decides, so the order in which points are found does not
/// matter.
pub fn is_aim_sample(index: u32, step: u32) -> bool {
    hash(index).is_multiple_of(step.max(1))
}

/// Every how many points of a cloud of this mean radius are enough for pixels of this size, metres.
///
/// With radii of 0.65 × the distance of the 7th neighbour there are 0.94 (pixel / r̄)² points to a
/// pixel.
pub fn stride(mean_radius: f32, pixel_size: f32) -> usize {
    stride_for(POINTS_PER_PIXEL, mean_radius, pixel_size)
}

/// The same where so many points are enough for a pixel of a surface seen face on.
pub(crate) fn stride_for(points_per_pixel: f32, mean_radius: f32, pixel_size: f32) -> usize {
    let per_pixel = 0.94 * (pixel_size / mean_radius).powi(2);
    ((per_pixel / points_per_pixel) as usize).clamp(1, BLOCK)
}

/// The first point that is taken of a cloud's `block`-th block, less than `stride`. It differs from
/// block to block. Otherwise only some columns would remain of a depth image, whose rows may fill
/// whole blocks.
pub fn first_taken(block: usize, stride: usize) -> usize {
    hash(block as u32) as usize % stride.max(1)
}

/// Mixes the bits of an index, so that the choice shows no pattern on points in rows.
fn hash(index: u32) -> u32 {
    let mut hash = (index ^ (index >> 16)).wrapping_mul(0x7feb_352d);
    hash = (hash ^ (hash >> 15)).wrapping_mul(0x846c_a68b);
    hash ^ (hash >> 16)
}
