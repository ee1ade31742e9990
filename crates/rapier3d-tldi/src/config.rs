//! The settings of a pipeline.

use crate::TldiError;
use crate::parts::cloud_of;
use rapier3d::parry::shape::Shape;
use tldi::{CameraPolicy, Params, Variant};

/// Pixels that the smaller one of a pair is at least across, in its second longest extent: of what
/// is smaller a penetration could not be told from the noise of single rays. Fewer only where its
/// own points are no finer.
const LEAST_PIXELS: f32 = 8.0;

/// Settings of a [`TldiPipeline`](crate::TldiPipeline), the same for all its pairs.
///
/// ```
/// use rapier3d_tldi::prelude::*;
/// let config = TldiConfig { pixel_scale: 2.0, ..TldiConfig::default() }; // a noisy sensor
/// let pipeline = TldiPipeline::new(config)?;
/// # Ok::<(), TldiError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TldiConfig {
    /// Which construction and comparison of the layers to use.
    pub variant: Variant,
    /// From where pairs are looked at.
    pub camera_policy: CameraPolicy,
    /// Edge of a pixel in mean radii of the pair's coarser cloud, greater than 0. 1 resolves the
    /// most that the points tell; 2 averages noise as large as the radii. Bodies that are only a
    /// few pixels in size get finer ones.
    pub pixel_scale: f32,
    /// By how much measured gaps scatter from one comparison to the next, in mean radii of the
    /// pair's coarser cloud. A solver that was fed this noise would keep bodies from coming to
    /// rest. So contacts are kept, riding on their bodies, until the pair has moved by as much
    /// relative to each other; and gaps within the roughness that a contact shows of itself, up to
    /// twice as much, count as touching, be they open or penetrations. 0 measures in every step and
    /// pushes out all of it.
    pub scatter: f32,
}

impl Default for TldiConfig {
    fn default() -> Self {
        Self {
            variant: Variant::default(),
            camera_policy: CameraPolicy::default(),
            pixel_scale: 1.0,
            scatter: 0.1,
        }
    }
}

impl TldiConfig {
    /// Refuses values that no comparison can use.
    pub(crate) fn validated(self) -> Result<Self, TldiError> {
        let check = |setting, value: f32, is_valid: bool, expected| {
            if value.is_finite() && is_valid {
                Ok(())
            } else {
                Err(TldiError::BadConfig {
                    setting,
                    value,
                    expected,
                })
            }
        };
        check(
            "pixel_scale",
            self.pixel_scale,
            self.pixel_scale > 0.0,
            "it must be finite and greater than 0",
        )?;
        check(
            "scatter",
            self.scatter,
            self.scatter >= 0.0,
            "it must be finite and not negative",
        )?;
        Ok(self)
    }

    /// Parameters of a pair of parts for contacts up to a gap of `prediction` metres; none where no
    /// part is a cloud.
    pub(crate) fn params(&self, parts: [&dyn Shape; 2], prediction: f32) -> Option<Params> {
        let radius = |part: &dyn Shape| cloud_of(part).map(|shape| shape.cloud().mean_radius());
        let coarsest = parts.into_iter().filter_map(radius).reduce(f32::max)?;
        let size = |part: &&dyn Shape| part.compute_local_aabb().extents();
        let [first, second] = parts;
        let smaller = match size(&first).length_squared() < size(&second).length_squared() {
            true => first,
            false => second,
        };
        let mut extents = size(&smaller).to_array();
        extents.sort_by(f32::total_cmp);
        let to_resolve = (extents[1] / LEAST_PIXELS).max(radius(smaller).unwrap_or(0.0));
        let params = match self.variant {
            Variant::Paper => Params::paper(coarsest),
            Variant::Oriented => Params::for_radius(coarsest),
        };
        let pixel_size = (self.pixel_scale * coarsest).min(to_resolve);
        Some(
            params
                .with_pixel_size(pixel_size)
                .with_prediction(prediction),
        )
    }
}
