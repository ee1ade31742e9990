//! Which pairs can be compared, and why others cannot.

use crate::{PairQuery, Params, Projection, Surface, Variant, View, paper};

/// Why the CPU does not compare what lives on a device.
const ON_A_DEVICE: &str = "the points live on a device: only its backend compares them, with clouds, \
                           oriented splats and an orthographic view";

impl PairQuery<'_> {
    /// Whether the CPU can compare the pair, and with it every backend; if not, why, and what to do
    /// instead.
    pub fn check(&self) -> Result<(), &'static str> {
        supported_surfaces(self.a, self.b)?;
        self.params.check()?;
        let exact = matches!(self.a, Surface::Exact(_)) || matches!(self.b, Surface::Exact(_));
        if exact && self.params.variant() == Variant::Paper {
            return Err("the paper's variant compares clouds only: use Variant::Oriented");
        }
        if let View::Fixed(camera) = self.view
            && exact
            && matches!(camera.projection, Projection::Perspective { .. })
        {
            return Err("exact surfaces need an orthographic camera");
        }
        if let View::Fixed(camera) = self.view
            && camera.size.is_none()
            && matches!(camera.projection, Projection::Perspective { .. })
        {
            return Err("a perspective camera needs an image of fixed size");
        }
        if self.params.variant() == Variant::Paper && most_pixels(self) > paper::MAX_PIXELS as f64 {
            return Err(
                "the paper's image may have more than 2^28 pixels: use a larger pixel_size, \
             a smaller image or smaller clouds",
            );
        }
        Ok(())
    }
}

pub(crate) fn supported_surfaces(a: Surface, b: Surface) -> Result<(), &'static str> {
    match (a, b) {
        (Surface::Device(_), _) | (_, Surface::Device(_)) => Err(ON_A_DEVICE),
        (Surface::Exact(_), Surface::Exact(_)) => {
            Err("both surfaces are exact: leave this pair to the physics engine")
        }
        _ => Ok(()),
    }
}

impl Params {
    /// Whether a backend can use them; if not, why.
    pub fn check(&self) -> Result<(), &'static str> {
        if self.pixel_size > 0.0
            && self.merge_gap > 0.0
            && self.thickness > 0.0
            && self.prediction >= 0.0
        {
            Ok(())
        } else {
            Err("pixel_size, merge_gap and thickness must be positive, prediction not negative")
        }
    }
}

/// At least the number of pixels that the paper's image of either cloud has.
fn most_pixels(query: &PairQuery) -> f64 {
    let fixed = match query.view {
        View::Fixed(camera) => camera.size,
        View::Aim { .. } => None,
    };
    if let Some([width, height]) = fixed {
        return f64::from(width) * f64::from(height);
    }
    let pixel_size = match query.view {
        View::Fixed(camera) => camera.pixel_size_at(0.0),
        View::Aim { .. } => query.params.pixel_size,
    };
    let pixels = |surface: &Surface| match surface {
        // As seen from any side, and two pixels for rounding outward.
        Surface::Cloud(cloud) => {
            let size = cloud.bounds().extents().length() + 2.0 * cloud.max_radius();
            (f64::from(size) / f64::from(pixel_size) + 2.0).powi(2)
        }
        Surface::Exact(_) | Surface::Device(_) => 0.0,
    };
    pixels(&query.a).max(pixels(&query.b))
}
