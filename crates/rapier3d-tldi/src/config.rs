//! The settings of a pipeline.

use crate::TldiError;
use tldi::{CameraPolicy, Params, Variant};

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
    /// most that the points tell; 2 averages noise as large as the radii.
    pub pixel_scale: f32,
    /// By how much measured gaps scatter from one comparison to the next, in mean radii of the
    /// pair's coarser cloud. A solver that was fed this noise would keep bodies from coming to
    /// rest, so contacts are kept, riding on their bodies, until the pair has moved by as much
    /// relative to each other, and a penetration that is measured then pushes only by what it is
    /// deeper. 0 measures in every step and pushes out all of it.
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

    /// Parameters of a pair whose coarser cloud has this mean radius, in metres, for contacts up to
    /// a gap of `prediction` metres.
    pub(crate) fn params(&self, mean_radius: f32, prediction: f32) -> Params {
        match self.variant {
            Variant::Paper => Params::paper(mean_radius),
            Variant::Oriented => Params::for_radius(mean_radius),
        }
        .with_pixel_size(self.pixel_scale * mean_radius)
        .with_prediction(prediction)
    }
}
