//! The settings of a pipeline.

use crate::{Resolution, TldiError};
use tldi::{CameraPolicy, Variant};

/// Settings of a [`TldiPipeline`](crate::TldiPipeline), the same for all its pairs.
///
/// ```
/// use rapier3d_tldi::prelude::*;
/// let resolution = Resolution::Radii(2.0); // a noisy sensor
/// let config = TldiConfig { resolution, ..TldiConfig::default() };
/// let pipeline = TldiPipeline::new(config)?;
/// # Ok::<(), TldiError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TldiConfig {
    /// Which construction and comparison of the layers to use.
    pub variant: Variant,
    /// How view axes are chosen. By default, sensors are looked at from [all
    /// directions](CameraPolicy::AllDirections).
    pub camera_policy: CameraPolicy,
    /// How large pixels are: a number of radii, or what an error or time budget allows.
    pub resolution: Resolution,
    /// How much measured gaps vary from one comparison to the next, in mean radii of the pair's
    /// coarser cloud. This noise would keep bodies from coming to rest. So contacts stay fixed to
    /// their bodies until the pair has moved by this distance. Gaps and penetrations within the
    /// contact's own roughness, at most twice this distance, count as touching. What is measured then
    /// differs from what was measured before by the motion and by what slid into the contact: the rest
    /// is an error, and left out. With 0, every step measures anew and corrects every penetration.
    pub scatter: f32,
}

impl Default for TldiConfig {
    fn default() -> Self {
        Self {
            variant: Variant::default(),
            camera_policy: CameraPolicy::default(),
            resolution: Resolution::default(),
            scatter: 0.1,
        }
    }
}

impl TldiConfig {
    /// The settings of a query that only asks whether surfaces meet. By default, it looks from all
    /// directions.
    pub(crate) fn for_intersection(self) -> Self {
        let camera_policy = match self.camera_policy {
            CameraPolicy::ContactZone => CameraPolicy::AllDirections,
            policy => policy,
        };
        Self {
            camera_policy,
            ..self
        }
    }

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
        let (resolution, is_valid) = self.resolution.check();
        check(
            "resolution",
            resolution,
            is_valid,
            "its radii, metres or seconds must be finite and greater than 0",
        )?;
        check(
            "scatter",
            self.scatter,
            self.scatter >= 0.0,
            "it must be finite and not negative",
        )?;
        Ok(self)
    }

    /// These settings with pixels of a fixed number of radii where a time budget decides:
    /// `coarsening`.
    pub(crate) fn settled(self, coarsening: f32) -> Self {
        let resolution = match self.resolution {
            Resolution::Time(_) => Resolution::Radii(coarsening),
            fixed => fixed,
        };
        Self { resolution, ..self }
    }
}
