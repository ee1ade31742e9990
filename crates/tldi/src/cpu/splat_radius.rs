//! How large a point is drawn.

/// Least radius of a splat in pixels: half a pixel's diagonal and a bit. A smaller disc may reach no pixel's centre but
/// its own, and each pixel of a fine cloud would then show a single point. A larger one blurs edges. Half: no change;
/// twice: 20 of 636 stability rows fail instead of 3, and the suite takes a third longer.
pub(super) const LEAST_RADIUS_PX: f32 = 0.75;

/// Radius of a point's splat in metres.
pub(crate) fn splat_radius(radius: f32, pixel_size: f32) -> f32 {
    radius.max(LEAST_RADIUS_PX * pixel_size)
}
