//! What is made of the points of a cloud: now, and of new ones later.

use crate::CloudError;
use crate::cloud::radii::RADIUS_RANGE;
use glamx::Vec3;

/// The paper's spherical cover: 0.65 × the distance to the 7th nearest neighbour.
const DEFAULT_NEIGHBORS: usize = 7;
const DEFAULT_SCALE: f32 = 0.65;

/// How the radii of points are found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RadiusRule {
    /// One radius in metres for all points; see [`CloudBuilder::radius`](crate::CloudBuilder::radius).
    Global(f32),
    /// From the distance to neighbours; see
    /// [`CloudBuilder::knn_radii`](crate::CloudBuilder::knn_radii).
    NearestNeighbors {
        /// Which neighbour, counted from 1.
        k: usize,
        /// Radius in units of the distance to it.
        scale: f32,
    },
}

impl RadiusRule {
    /// Which neighbour, and radius in units of the distance to it.
    pub(crate) fn neighbors(&self) -> Option<(usize, f32)> {
        match *self {
            Self::Global(_) => None,
            Self::NearestNeighbors { k, scale } => Some((k, scale)),
        }
    }
}

/// What to do with points that have a NaN or infinite coordinate.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum NonFinite {
    /// Leave them out, together with their attributes, and count them
    /// ([`PointCloud::dropped`](crate::PointCloud::dropped)): depth cameras emit NaN where they saw nothing.
    #[default]
    Drop,
    /// Fail with [`CloudError::NonFinite`].
    Refuse,
}

/// What a cloud makes of its points, as a value: a builder applies it once,
/// [`PointCloud::set_points`](crate::PointCloud::set_points) and streams of frames to all points
/// that come later.
///
/// ```
/// use tldi::{CloudRecipe, PointCloud, RadiusRule, glamx::Vec3};
/// let recipe = CloudRecipe {
///     radii: RadiusRule::NearestNeighbors { k: 4, scale: 0.8 },
///     pca_neighbors: Some(8),
///     viewpoint: Some(Vec3::new(2.0, 5.0, 2.0)), // of the sensor
///     ..CloudRecipe::default()
/// };
/// let grid = |n: i32| (0..n * n).map(|i| Vec3::new((i % n) as f32, 0.0, (i / n) as f32)).collect();
/// let (first, second): (Vec<Vec3>, Vec<Vec3>) = (grid(5), grid(9));
/// let mut cloud = PointCloud::builder(&first).recipe(recipe).build()?.into_owned();
/// cloud.set_points(&second, None)?; // another number of points
/// assert_eq!(cloud.normals(), Some(&vec![Vec3::Y; 81][..]));
/// # Ok::<(), tldi::CloudError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CloudRecipe {
    /// How radii are found where none are given for each point.
    pub radii: RadiusRule,
    /// Neighbours of the planes that normals are taken of, where none are given; `None`: no normals.
    /// See [`CloudBuilder::pca_normals`](crate::CloudBuilder::pca_normals).
    pub pca_neighbors: Option<usize>,
    /// Where the surface is seen from, in the cloud's frame, metres; see
    /// [`CloudBuilder::viewpoint`](crate::CloudBuilder::viewpoint).
    pub viewpoint: Option<Vec3>,
    /// Standard deviation of the points along the normal in metres; see
    /// [`CloudBuilder::noise`](crate::CloudBuilder::noise).
    pub noise: f32,
    /// What happens to points that are not finite.
    pub non_finite: NonFinite,
}

impl Default for CloudRecipe {
    /// Radii of 0.65 × the distance to the 7th nearest neighbour, no normals, no noise; points that
    /// are not finite are dropped.
    fn default() -> Self {
        Self {
            radii: RadiusRule::NearestNeighbors {
                k: DEFAULT_NEIGHBORS,
                scale: DEFAULT_SCALE,
            },
            pca_neighbors: None,
            viewpoint: None,
            noise: 0.0,
            non_finite: NonFinite::default(),
        }
    }
}

impl CloudRecipe {
    /// Checks what does not depend on the points; building a cloud does so as well.
    ///
    /// # Errors
    /// [`CloudError::BadParameter`].
    pub fn check(&self) -> Result<(), CloudError> {
        let bad = |parameter, value, expected| {
            Err(CloudError::BadParameter {
                parameter,
                value,
                expected,
            })
        };
        if let RadiusRule::NearestNeighbors { k, scale } = self.radii {
            if k == 0 {
                return bad("knn_radii: k", 0.0, "at least one neighbour is needed");
            }
            if !(scale.is_finite() && scale > 0.0) {
                return bad(
                    "knn_radii: scale",
                    scale,
                    "it must be finite and greater than zero",
                );
            }
        }
        if !(0.0..=*RADIUS_RANGE.end()).contains(&self.noise) {
            let expected =
                "it is a standard deviation in metres: not negative, and at most 1e12, as radii";
            return bad("noise", self.noise, expected);
        }
        if let Some(k) = self.pca_neighbors.filter(|k| *k < 2) {
            let expected = "a plane needs at least two neighbours";
            return bad("pca_normals: k", k as f32, expected);
        }
        if let Some(viewpoint) = self.viewpoint
            && let Some(value) = viewpoint.to_array().into_iter().find(|v| !v.is_finite())
        {
            return bad("viewpoint", value, "its coordinates must be finite");
        }
        Ok(())
    }
}
