//! Rectangles of pixels, and where a cloud is seen.

/// A rectangle of pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Rect {
    pub(crate) origin: [i32; 2],
    pub(crate) size: [u32; 2],
}

impl Rect {
    pub(crate) fn from_corners(min: [i32; 2], max: [i32; 2]) -> Option<Self> {
        if min[0] > max[0] || min[1] > max[1] {
            return None;
        }
        let size = [0, 1].map(|k| (i64::from(max[k]) - i64::from(min[k]) + 1) as u32);
        Some(Self { origin: min, size })
    }

    fn last(&self) -> [i32; 2] {
        [0, 1].map(|k| self.origin[k] + self.size[k] as i32 - 1)
    }

    pub(crate) fn intersection(&self, other: &Self) -> Option<Self> {
        let (a, b) = (self.last(), other.last());
        Self::from_corners(
            [0, 1].map(|k| self.origin[k].max(other.origin[k])),
            [0, 1].map(|k| a[k].min(b[k])),
        )
    }

    /// The rectangle and `border` pixels on all sides of it.
    pub(crate) fn grown(&self, border: i32) -> Self {
        Self {
            origin: self.origin.map(|o| o - border),
            size: self.size.map(|n| n + 2 * border as u32),
        }
    }

    pub(crate) fn pixels(&self) -> usize {
        self.size[0] as usize * self.size[1] as usize
    }
}

/// Where one cloud is seen: pixels and depths, splats included.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Footprint {
    pub(crate) rect: Rect,
    pub(crate) near: f32,
    pub(crate) far: f32,
    /// Largest radius of a splat, pixels.
    pub(crate) reach: f32,
    /// Edge of a pixel in metres where the points are nearest.
    pub(crate) pixel_size: f32,
}

impl Footprint {
    /// Leaves out depths more than `reach` metres from `middle`. So one point far from the others does not decide how
    /// finely depths are told apart. Its fragments count as if they lay at the end of the depths that remain.
    pub(crate) fn limit_depths(&mut self, reach: f32, middle: impl Fn() -> f32) {
        if self.far - self.near > reach {
            let middle = middle();
            self.near = self.near.max(middle - reach);
            self.far = self.far.min(middle + reach);
        }
    }
}
