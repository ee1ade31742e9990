//! Builds and validates clouds.

use crate::{Aabb, BLOCK, CloudError, PointCloud, Radii};
use glamx::Vec3;
use std::borrow::Cow;

/// Where the positions of a cloud come from.
#[derive(Clone, Debug)]
pub enum Positions<'a> {
    /// Vectors, borrowed or owned; transposed into the cloud in the pass that validates them.
    Vectors(Cow<'a, [Vec3]>),
    /// One slice per coordinate: borrowed by the cloud without a copy where every point is finite.
    Soa {
        /// x coordinates in metres.
        x: Cow<'a, [f32]>,
        /// y coordinates in metres.
        y: Cow<'a, [f32]>,
        /// z coordinates in metres.
        z: Cow<'a, [f32]>,
    },
}

impl<'a> From<&'a [Vec3]> for Positions<'a> {
    fn from(points: &'a [Vec3]) -> Self {
        Self::Vectors(Cow::Borrowed(points))
    }
}
impl<'a> From<&'a Vec<Vec3>> for Positions<'a> {
    fn from(points: &'a Vec<Vec3>) -> Self {
        Self::Vectors(Cow::Borrowed(points))
    }
}
impl From<Vec<Vec3>> for Positions<'_> {
    fn from(points: Vec<Vec3>) -> Self {
        Self::Vectors(Cow::Owned(points))
    }
}

/// What to do with points that have a NaN or infinite coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum NonFinite {
    /// Leave them out, together with their attributes, and count them
    /// ([`PointCloud::dropped`]): depth cameras emit NaN where they saw nothing.
    #[default]
    Drop,
    /// Fail with [`CloudError::NonFinite`].
    Refuse,
}

/// Builds a [`PointCloud`].
#[derive(Clone, Debug)]
pub struct CloudBuilder<'a> {
    positions: Positions<'a>,
    radius: f32,
}

impl<'a> CloudBuilder<'a> {
    pub(crate) fn new(positions: Positions<'a>) -> Self {
        Self { positions, radius: 0.01 }
    }
    /// One radius in metres for all points.
    pub fn radius(mut self, radius: f32) -> Self {
        self.radius = radius;
        self
    }
    /// Builds.
    pub fn build(self) -> Result<PointCloud<'a>, CloudError> {
        let Positions::Vectors(p) = &self.positions else { unimplemented!() };
        let x: Vec<f32> = p.iter().map(|p| p.x).collect();
        let y: Vec<f32> = p.iter().map(|p| p.y).collect();
        let z: Vec<f32> = p.iter().map(|p| p.z).collect();
        let bb = |c: &[Vec3]| c.iter().fold(Aabb::EMPTY, |b, p| b.including(*p));
        Ok(PointCloud { x: Cow::Owned(x), y: Cow::Owned(y), z: Cow::Owned(z), radii: Radii::Global(self.radius),
            normals: None, normals_oriented: false, colors: None, bounds: bb(p), blocks: p.chunks(BLOCK).map(bb).collect(),
            mean_radius: self.radius, max_radius: self.radius, dropped: 0 })
    }
}
