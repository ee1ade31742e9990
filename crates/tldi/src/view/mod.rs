//! Views: virtual cameras, how they are aimed, and the layered images that they see.

pub(crate) mod approach;
pub(crate) mod camera;
pub(crate) mod camera_policy;
pub(crate) mod main_axis;
pub(crate) mod tldi;
pub(crate) mod zone_normals;
