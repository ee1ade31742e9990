//! Everything a program with clouds in rapier names.
//!
//! ```
//! use rapier3d_tldi::prelude::*;
//! let config = TldiConfig { resolution: Resolution::Radii(2.0), ..TldiConfig::default() };
//! assert_eq!(config.variant, Variant::Oriented);
//! ```

pub use crate::{
    CloudStream, Contact as CloudContact, MassModel, PointCloudShape, Resolution, SeenPoints,
    StepReport, TldiConfig, TldiError, TldiPipeline, cloud_collider, points_on, sample_shape,
};
pub use tldi::{CameraPolicy, CloudError, CloudRecipe, NonFinite, PointCloud, RadiusRule, Variant};
