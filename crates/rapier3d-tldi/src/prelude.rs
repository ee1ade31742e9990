//! Everything a program with clouds in rapier names.

pub use crate::{
    CloudStream, Contact as CloudContact, MassModel, PointCloudShape, Resolution, SeenPoints,
    StepReport, TldiConfig, TldiError, TldiPipeline, cloud_collider, points_on, sample_shape,
};
pub use tldi::{CameraPolicy, CloudError, CloudRecipe, NonFinite, PointCloud, RadiusRule, Variant};
