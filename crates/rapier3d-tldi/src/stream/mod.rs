//! Streams: the frames of a sensor as a collider, and which of their points lie on other colliders.

pub(crate) mod cloud_stream;
pub(crate) mod own_points;
