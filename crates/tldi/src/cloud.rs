//! The point cloud: positions, radii, optional normals and colours, bounds.

use crate::{Aabb, CloudBuilder, Positions};
use glamx::Vec3;
use std::borrow::Cow;

/// Points per block: [`PointCloud::blocks`] bounds that many consecutive points each.
pub const BLOCK: usize = 256;

/// Radius of the ball around each point, in metres.
#[derive(Clone, Debug, PartialEq)]
pub enum Radii<'a> {
    /// The same for all points.
    Global(f32),
    /// One for each point.
    PerPoint(Cow<'a, [f32]>),
}

/// Points of one body in its own frame, validated once, with what is derived from them.
///
/// Coordinates are held as structure of arrays, owned or borrowed ([`Positions`]). The balls of
/// the radii around the points are meant to cover the surface that was sampled.
///
/// ```
/// use tldi::{PointCloud, glamx::Vec3};
/// let points: Vec<Vec3> = (0..100)
///     .map(|i| Vec3::new((i % 10) as f32, 0.0, (i / 10) as f32))
///     .collect();
/// let cloud = PointCloud::builder(&points).radius(0.7).build()?;
/// assert_eq!(cloud.len(), 100);
/// assert_eq!(cloud.bounds().max, Vec3::new(9.0, 0.0, 9.0));
/// # Ok::<(), tldi::CloudError>(())
/// ```
#[derive(Clone, Debug)]
pub struct PointCloud<'a> {
    pub(crate) x: Cow<'a, [f32]>,
    pub(crate) y: Cow<'a, [f32]>,
    pub(crate) z: Cow<'a, [f32]>,
    pub(crate) radii: Radii<'a>,
    pub(crate) normals: Option<Cow<'a, [Vec3]>>,
    pub(crate) normals_oriented: bool,
    pub(crate) colors: Option<Cow<'a, [[u8; 4]]>>,
    pub(crate) bounds: Aabb,
    pub(crate) blocks: Vec<Aabb>,
    pub(crate) mean_radius: f32,
    pub(crate) max_radius: f32,
    pub(crate) dropped: usize,
}

impl<'a> PointCloud<'a> {
    /// Starts a builder over `points`: a slice or vector of vectors (transposed in the pass that
    /// validates), or [`Positions::Soa`] slices, which are borrowed.
    pub fn builder(points: impl Into<Positions<'a>>) -> CloudBuilder<'a> {
        CloudBuilder::new(points.into())
    }

    /// Number of points (at least one).
    #[allow(
        clippy::len_without_is_empty,
        reason = "a cloud is never empty: the builder refuses"
    )]
    pub fn len(&self) -> usize {
        self.x.len()
    }

    /// The coordinates in metres, in the cloud's own frame.
    pub fn coordinates(&self) -> [&[f32]; 3] {
        [&self.x, &self.y, &self.z]
    }

    /// Position of one point in metres.
    pub fn point(&self, index: usize) -> Vec3 {
        Vec3::new(self.x[index], self.y[index], self.z[index])
    }

    /// All positions, in order.
    pub fn points(&self) -> impl ExactSizeIterator<Item = Vec3> + '_ {
        (0..self.len()).map(|i| self.point(i))
    }

    /// The radii in metres.
    pub fn radii(&self) -> &Radii<'a> {
        &self.radii
    }

    /// Radius of one point in metres.
    pub fn radius(&self, index: usize) -> f32 {
        match &self.radii {
            Radii::Global(r) => *r,
            Radii::PerPoint(r) => r[index],
        }
    }

    /// Mean radius r̄ in metres.
    pub fn mean_radius(&self) -> f32 {
        self.mean_radius
    }

    /// Largest radius in metres.
    pub fn max_radius(&self) -> f32 {
        self.max_radius
    }

    /// Unit normals, one for each point, where given or computed.
    pub fn normals(&self) -> Option<&[Vec3]> {
        self.normals.as_deref()
    }

    /// Whether the normals point outward (given, or oriented towards a viewpoint), so that their
    /// sign means something.
    pub fn normals_oriented(&self) -> bool {
        self.normals_oriented
    }

    /// Colours (red, green, blue, alpha), one for each point, where given.
    pub fn colors(&self) -> Option<&[[u8; 4]]> {
        self.colors.as_deref()
    }

    /// Bounds of the positions (radii not included).
    pub fn bounds(&self) -> Aabb {
        self.bounds
    }

    /// Bounds of each run of [`BLOCK`] consecutive points: where the order of the points is
    /// spatially coherent, whole blocks are skipped by the culling pass.
    pub fn blocks(&self) -> &[Aabb] {
        &self.blocks
    }

    /// Non-finite points that the builder dropped.
    pub fn dropped(&self) -> usize {
        self.dropped
    }

    /// The cloud with everything owned.
    pub fn into_owned(self) -> PointCloud<'static> {
        PointCloud {
            x: Cow::Owned(self.x.into_owned()),
            y: Cow::Owned(self.y.into_owned()),
            z: Cow::Owned(self.z.into_owned()),
            radii: match self.radii {
                Radii::Global(r) => Radii::Global(r),
                Radii::PerPoint(r) => Radii::PerPoint(Cow::Owned(r.into_owned())),
            },
            normals: self.normals.map(|n| Cow::Owned(n.into_owned())),
            normals_oriented: self.normals_oriented,
            colors: self.colors.map(|c| Cow::Owned(c.into_owned())),
            bounds: self.bounds,
            blocks: self.blocks,
            mean_radius: self.mean_radius,
            max_radius: self.max_radius,
            dropped: self.dropped,
        }
    }
}
