//! Everything a program with clouds in rapier names.

pub use crate::{
    CloudStream, Contact as CloudContact, MassModel, PointCloudShape, Resolution, StepReport,
    TldiConfig, TldiError, TldiPipeline, cloud_collider,
};
pub use tldi::{CameraPolicy, CloudError, NonFinite, PointCloud, Variant};
