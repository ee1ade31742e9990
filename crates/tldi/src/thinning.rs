//! Which points of a cloud much finer than the pixels are left: more would not be seen.

use crate::{BLOCK, plan};

/// Points that are left per pixel of a surface seen face on: as many as where pixels are as large as
/// the points' radii. Three or eight cost as many times as much, and err as much.
const POINTS_PER_PIXEL: f32 = 1.0;

/// Every how many points of a cloud are left, and the radii with which they cover what all did. Points
/// that are so far apart that their radii cover it already all stay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thinning {
    /// Of how many points of a block one is left.
    pub stride: usize,
    /// By which the radii grow.
    pub scale: f32,
    /// Mean radius of what is left, metres; points of at least this radius all stay, as they are.
    pub mean_radius: f32,
}

impl Default for Thinning {
    /// All points are left.
    fn default() -> Self {
        Self::every(1, f32::INFINITY)
    }
}

impl Thinning {
    /// For a cloud of this mean radius and pixels of this edge, metres.
    ///
    /// With radii of 0.65 × the distance of the 7th neighbour there are 0.94 (pixel / r̄)² points to a
    /// pixel.
    ///
    /// ```
    /// use tldi::thinning::Thinning;
    /// assert_eq!(Thinning::new(0.01, 0.01).stride, 1);
    /// // 15 points to a pixel.
    /// let thinning = Thinning::new(0.01, 0.04);
    /// assert_eq!(thinning.stride, 15);
    /// assert!((thinning.radius(0.01) - 0.0387).abs() < 1e-4);
    /// assert_eq!(thinning.radius(0.05), 0.05);
    /// ```
    pub fn new(mean_radius: f32, pixel_size: f32) -> Self {
        let per_pixel = 0.94 * (pixel_size / mean_radius).powi(2);
        let stride = ((per_pixel / POINTS_PER_PIXEL) as usize).clamp(1, BLOCK);
        Self::every(stride, mean_radius)
    }

    fn every(stride: usize, mean_radius: f32) -> Self {
        let scale = (stride as f32).sqrt();
        Self {
            stride,
            scale,
            mean_radius: scale * mean_radius,
        }
    }

    /// The first point that is left of a cloud's `block`-th block: another one in each, or of the rows
    /// of an image, which a whole number of blocks may be long, only some columns would be left.
    pub fn first(&self, block: usize) -> usize {
        plan::hash(block as u32) as usize % self.stride
    }

    /// Radius of a point that is left, metres.
    #[inline(always)]
    pub fn radius(&self, radius: f32) -> f32 {
        match radius < self.mean_radius {
            true => self.scale * radius,
            false => radius,
        }
    }

    /// At least the radius of all that is left of a cloud whose largest is `max_radius`, metres.
    pub fn max_radius(&self, max_radius: f32) -> f32 {
        (self.scale * self.mean_radius.min(max_radius)).max(max_radius)
    }
}
