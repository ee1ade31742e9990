//! Which points of a cloud much finer than the pixels are left: more would not be seen.

use crate::{BLOCK, Params, plan};

/// Which points of a cloud are left, and the radii with which they cover what all did: about
/// [`Params::points_per_pixel`], chosen by hashes of their indices, so that no order of the points leaves
/// stripes. Where points are so far apart that less than every second would be left all stay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Thinning {
    /// Of a cloud with one radius for all: of how many points of a block one is left.
    pub stride: usize,
    /// Square metres that hold one point with a radius of 1 m; 0 where all points are left.
    pub area: f32,
}

impl Default for Thinning {
    /// All points are left.
    fn default() -> Self {
        Self {
            stride: 1,
            area: 0.0,
        }
    }
}

impl Thinning {
    /// For a cloud of this mean radius, metres.
    ///
    /// With radii of 0.65 × the distance of the 7th neighbour there are 0.94 (pixel / radius)² points
    /// to a pixel.
    ///
    /// ```
    /// use tldi::{Params, thinning::Thinning};
    /// assert_eq!(Thinning::new(0.01, &Params::for_radius(0.01)), Thinning::default());
    /// // 94 points to a pixel, of which 8 are left.
    /// let thinning = Thinning::new(0.01, &Params::for_radius(0.1));
    /// assert_eq!(thinning.stride, 11);
    /// assert!((thinning.radius(0.01) - 0.0332).abs() < 1e-4);
    /// assert_eq!(thinning.radius(0.05), 0.05);
    /// ```
    pub fn new(mean_radius: f32, params: &Params) -> Self {
        let area = 0.94 * params.pixel_size * params.pixel_size / params.points_per_pixel;
        let per_pixel = area / (mean_radius * mean_radius);
        // What is no cloud has no radius.
        match per_pixel >= 2.0 && mean_radius > 0.0 {
            true => Self {
                stride: (per_pixel as usize).min(BLOCK),
                area,
            },
            false => Self::default(),
        }
    }

    /// Points with this radius, in metres, of which one is left.
    #[inline(always)]
    fn per_point(&self, radius: f32) -> f32 {
        let count = self.area / (radius * radius);
        if count >= 2.0 { count.floor() } else { 1.0 }
    }

    /// Radius of a point that is left, metres.
    #[inline(always)]
    pub fn radius(&self, radius: f32) -> f32 {
        self.per_point(radius).sqrt() * radius
    }

    /// At least the radius of all that is left of a cloud whose largest is `max_radius`, metres.
    pub fn max_radius(&self, max_radius: f32) -> f32 {
        self.area.sqrt().max(max_radius)
    }

    /// Of a cloud with one radius for all: the first point that is left of its `block`-th block.
    pub fn first(&self, block: usize) -> usize {
        plan::hash(block as u32) as usize % self.stride
    }

    /// Of a cloud with a radius for each point: whether the one of this index and radius is left.
    #[inline(always)]
    pub fn is_left(&self, index: u32, radius: f32) -> bool {
        let drawn = (plan::hash(index) >> 8) as f32 / (1 << 24) as f32;
        drawn * self.per_point(radius) < 1.0
    }
}
