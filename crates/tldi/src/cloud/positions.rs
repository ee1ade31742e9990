//! Where the positions of a cloud come from.

use crate::Aabb;
use crate::cloud::gather::{Gathered, block_bounds, non_finite_indices, without};
use glamx::Vec3;
use std::borrow::Cow;

/// Where the positions of a cloud come from.
///
/// ```
/// use tldi::{PointCloud, Positions};
/// let (x, y, z) = (vec![0.0, 1.0, 2.0], vec![0.0; 3], vec![0.0; 3]);
/// let cloud = PointCloud::builder([&x[..], &y[..], &z[..]]).radius(1.0).build()?;
/// assert_eq!(cloud.coordinates()[0].as_ptr(), x.as_ptr(), "no copy");
/// # Ok::<(), tldi::CloudError>(())
/// ```
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
impl<'a> From<[&'a [f32]; 3]> for Positions<'a> {
    fn from([x, y, z]: [&'a [f32]; 3]) -> Self {
        Self::Soa {
            x: x.into(),
            y: y.into(),
            z: z.into(),
        }
    }
}
impl From<[Vec<f32>; 3]> for Positions<'_> {
    fn from([x, y, z]: [Vec<f32>; 3]) -> Self {
        Self::Soa {
            x: x.into(),
            y: y.into(),
            z: z.into(),
        }
    }
}

/// The coordinates of the finite points, the bounds of their blocks, and the indices of the others, ascending.
pub(crate) type Finite<'a> = ([Cow<'a, [f32]>; 3], Vec<Aabb>, Vec<u32>);

impl<'a> Positions<'a> {
    /// Reads all positions once.
    pub(crate) fn gather(self) -> Finite<'a> {
        match self {
            Positions::Vectors(points) => {
                let mut gathered = Gathered::default();
                gathered.refill(&points, None);
                let Gathered {
                    x,
                    y,
                    z,
                    blocks,
                    dropped,
                } = gathered;
                ([x, y, z].map(Cow::Owned), blocks, dropped)
            }
            Positions::Soa { x, y, z } => {
                let dropped = non_finite_indices([&x, &y, &z]);
                let mut coordinates = [x, y, z];
                if !dropped.is_empty() {
                    coordinates = coordinates.map(|c| Cow::Owned(without(&c, &dropped)));
                }
                let blocks = block_bounds(coordinates.each_ref().map(|c| &**c));
                (coordinates, blocks, dropped)
            }
        }
    }
}
