//! How large and how small pixels may be.

use crate::{Aabb, PointCloud};
use glamx::Vec3;

/// Least number of pixels across the smaller body, in its second longest extent. With fewer, a
/// penetration looks like the noise of single rays. There are fewer only if the body's own points
/// are no finer. Half: 14 % fewer points, but depths of boxes on ramps, exact now, are 0.02 mean radii off; twice:
/// twice as many points and 1.6 times the time (`bvh_vs_tldi`).
const LEAST_PIXELS: f32 = 8.0;

/// Edge in metres of the largest pixels that resolve a body of these extents, metres, whose points have this mean
/// radius, metres: eight across its second longest extent, or as large as its points. Cost: O(1).
///
/// ```
/// use tldi::{glamx::Vec3, plan::largest_pixel};
/// let ruler = Vec3::new(0.3, 0.04, 0.005);
/// assert_eq!(largest_pixel(ruler, 0.001), 0.005);
/// assert_eq!(largest_pixel(ruler, 0.02), 0.02);
/// ```
pub fn largest_pixel(extents: Vec3, radius: f32) -> f32 {
    let mut extents = extents.to_array();
    extents.sort_by(f32::total_cmp);
    (extents[1] / LEAST_PIXELS).max(radius)
}

/// Most pixels from a cloud's origin to a point: an `i32` holds eight times as many. Only pixels far smaller than radii
/// have more, since coordinates have no more than 2¹⁹ radii.
const MOST_PIXELS: f32 = (1 << 28) as f32;

/// The smallest pixels, metres, that can be counted from the cloud's origin to its points. Cost: O(1).
///
/// ```
/// use tldi::{PointCloud, glamx::Vec3, plan::least_pixel};
/// let cloud = PointCloud::builder(vec![127.0 * Vec3::X]).radius(1.0).build()?;
/// assert_eq!(least_pixel(&cloud), 128.0 / 2f32.powi(28));
/// # Ok::<(), tldi::CloudError>(())
/// ```
pub fn least_pixel(cloud: &PointCloud) -> f32 {
    least_pixel_within(cloud.bounds(), cloud.max_radius())
}

/// The same of points within these bounds, of no larger radius, metres.
pub(crate) fn least_pixel_within(bounds: Aabb, max_radius: f32) -> f32 {
    let farthest = bounds.min.abs().max(bounds.max.abs()).max_element();
    (farthest + max_radius) / MOST_PIXELS
}
