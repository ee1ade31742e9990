//! Builds and validates clouds.

use crate::cloud::checks::{check_count, check_dropped, check_length};
use crate::cloud::gather::{
    bounds_of_blocks, index_before_drop, merged, non_finite_indices, without,
};
use crate::cloud::morton::{morton_order, permuted};
use crate::cloud::neighborhoods::Neighborhoods;
use crate::cloud::point_cloud::{Spare, next_content_id};
use crate::cloud::point_normals::{fill_from_nearest, normalize, turn_towards};
use crate::cloud::radii::{check_radii, mean_and_max};
use crate::stage::stage;
use crate::{Aabb, CloudError, CloudRecipe, NonFinite, PointCloud, Radii, RadiusRule};
use glamx::Vec3;
use std::borrow::Cow;

/// Normals of the caller's.
#[derive(Clone, Debug)]
struct GivenNormals<'a> {
    normals: Cow<'a, [Vec3]>,
    /// Whether their sign tells the outside.
    outward: bool,
}

/// Builds a [`PointCloud`]: validates everything once, reading the positions once.
///
/// Unless told otherwise, radii are made from nearest neighbours
/// ([`knn_radii(7, 0.65)`](Self::knn_radii)), normals and colours are absent, non-finite points
/// are dropped, and the points keep their order. The result does not depend on the number of
/// threads.
///
/// ```
/// use tldi::{PointCloud, glamx::Vec3};
/// let points: Vec<Vec3> = (0..400)
///     .map(|i| 0.1 * Vec3::new((i % 20) as f32, 0.0, (i / 20) as f32))
///     .collect();
/// let cloud = PointCloud::builder(&points)
///     .knn_radii(7, 0.65)
///     .pca_normals(12)
///     .viewpoint(Vec3::new(1.0, 5.0, 1.0))
///     .build()?;
/// assert!(cloud.normals().is_some_and(|n| n.iter().all(|n| n.y > 0.999)));
/// // Away from the border, the 7th nearest neighbour on a square grid is √2 × the spacing away.
/// assert!((cloud.radius(210) - 0.65 * 0.1 * 2f32.sqrt()).abs() < 1e-6);
/// # Ok::<(), tldi::CloudError>(())
/// ```
#[derive(Clone, Debug)]
pub struct CloudBuilder<'a> {
    points: Cow<'a, [Vec3]>,
    recipe: CloudRecipe,
    radii: Option<Cow<'a, [f32]>>,
    normals: Option<GivenNormals<'a>>,
    colors: Option<Cow<'a, [[u8; 4]]>>,
    spatial_order: bool,
}

impl<'a> PointCloud<'a> {
    /// Starts a builder over `points`, metres, borrowed or owned. They are not copied, unless some are dropped or
    /// reordered.
    pub fn builder(points: impl Into<Cow<'a, [Vec3]>>) -> CloudBuilder<'a> {
        CloudBuilder::new(points.into())
    }
}

impl<'a> CloudBuilder<'a> {
    fn new(points: Cow<'a, [Vec3]>) -> Self {
        Self {
            points,
            recipe: CloudRecipe::default(),
            radii: None,
            normals: None,
            colors: None,
            spatial_order: false,
        }
    }

    /// All that [`radius`](Self::radius), [`knn_radii`](Self::knn_radii),
    /// [`noise`](Self::noise), [`pca_normals`](Self::pca_normals), [`viewpoint`](Self::viewpoint)
    /// and [`non_finite`](Self::non_finite) say, at once.
    pub fn recipe(mut self, recipe: CloudRecipe) -> Self {
        self.recipe = recipe;
        self
    }

    /// One radius in metres for all points, 10⁻¹² to 10¹². The cheapest, and right for evenly
    /// sampled surfaces: at least 0.71 × the spacing of a square grid covers it. Of this,
    /// [`radii`](Self::radii) and [`knn_radii`](Self::knn_radii) the last call counts.
    pub fn radius(mut self, radius: f32) -> Self {
        self.recipe.radii = RadiusRule::Global(radius);
        self.radii = None;
        self
    }

    /// One radius in metres for each point given, as from a sensor's range model. Borrowed, unless
    /// points are dropped or reordered.
    pub fn radii(mut self, radii: impl Into<Cow<'a, [f32]>>) -> Self {
        self.radii = Some(radii.into());
        self
    }

    /// Radii of `scale` × the distance to the `k`-th nearest neighbour, in parallel: the spherical
    /// cover of Radwan, Ohrhallinger and Wimmer (Graphics Interface 2014) with `k` = 7 and
    /// `scale` = 0.65, which is the default.
    ///
    /// - Neighbours are counted at distinct positions other than the point's own, so that repeated
    ///   points neither give radius 0 nor shrink the radii around them. Positions within 2⁻²⁰ of the largest
    ///   coordinate of each other, a few steps of `f32`, are one: a scan that was moved and merged with itself has
    ///   the radii of the scan. Where there are fewer than `k`, the farthest counts.
    /// - No radius exceeds 10 × the median (over distinct positions): an isolated outlier, such as
    ///   a depth camera's flying pixel, does not become a huge ball. A surface may still be sampled
    ///   at densities of 100 : 1, which is 10 : 1 in spacing; beyond that, give
    ///   [`radii`](Self::radii).
    /// - Points that nearly coincide do not get radii too small for their coordinates
    ///   ([`CloudError::CoordinateTooLarge`]), unless the median itself is too small.
    ///
    /// Fails with [`CloudError::BadParameter`] for `k` = 0 or a scale that is not positive and
    /// finite, with [`CloudError::NoSpacing`] if all points coincide.
    pub fn knn_radii(mut self, k: usize, scale: f32) -> Self {
        self.recipe.radii = RadiusRule::NearestNeighbors { k, scale };
        self.radii = None;
        self
    }

    /// Standard deviation of the points along the surface's normal in metres, from the sensor's
    /// range model; 0 unless told. Of clouds with noise, the least gap is less than that of their surfaces:
    /// where noise alone explains a collision, there is none. Contacts stay where they are.
    ///
    /// With σ = r̄ (of both clouds, pixels of r̄) it takes the wrong answers from 2.5 to 0.7 % (see
    /// `docs/benchmarks.md`). Fails with [`CloudError::BadParameter`] for a value that is negative or not
    /// finite.
    pub fn noise(mut self, sigma: f32) -> Self {
        self.recipe.noise = sigma;
        self
    }

    /// One outward normal for each point given; any that are not of unit length are normalised.
    /// Borrowed, unless something must be changed.
    ///
    /// A normal that is zero or not finite (a vertex without a face, say) is replaced by that of
    /// the nearest point with a usable one; if none is, the build fails with
    /// [`CloudError::NoUsableNormal`].
    pub fn normals(mut self, normals: impl Into<Cow<'a, [Vec3]>>) -> Self {
        self.normals = Some(GivenNormals {
            normals: normals.into(),
            outward: true,
        });
        self
    }

    /// [`normals`](Self::normals) whose sign says nothing of the outside, such as the shortest axes of
    /// splats. Of the two the last call counts. With a [`viewpoint`](Self::viewpoint) they are
    /// turned to its side and count as oriented.
    ///
    /// ```
    /// use tldi::{PointCloud, glamx::Vec3};
    /// let seen = PointCloud::builder(vec![Vec3::ZERO, Vec3::X])
    ///     .unoriented_normals(vec![Vec3::Y, -Vec3::Y])
    ///     .viewpoint(Vec3::new(0.5, 3.0, 0.0))
    ///     .build()?;
    /// assert_eq!(seen.normals(), Some(&[Vec3::Y, Vec3::Y][..]));
    /// # Ok::<(), tldi::CloudError>(())
    /// ```
    pub fn unoriented_normals(mut self, normals: impl Into<Cow<'a, [Vec3]>>) -> Self {
        self.normals = Some(GivenNormals {
            normals: normals.into(),
            outward: false,
        });
        self
    }

    /// Normals of the planes that best fit each point and its `k` nearest neighbours at distinct
    /// positions, as [`knn_radii`](Self::knn_radii) tells them (principal component analysis), in parallel. Not oriented, unless a
    /// [`viewpoint`](Self::viewpoint) is known; [`normals`](Self::normals), if given, win. 8 to 24
    /// neighbours are usual, more against noise.
    ///
    /// Where no plane fits best, the normal is one of those that fit: across a line of points, or
    /// along z if all points coincide. Fails with [`CloudError::BadParameter`] for `k` < 2.
    pub fn pca_normals(mut self, k: usize) -> Self {
        self.recipe.pca_neighbors = Some(k);
        self
    }

    /// Where the surface was seen from, in the cloud's frame: normals made by
    /// [`pca_normals`](Self::pca_normals), and [unoriented](Self::unoriented_normals) ones, point to
    /// its side, and count as oriented. Without effect on [`normals`](Self::normals).
    pub fn viewpoint(mut self, point: Vec3) -> Self {
        self.recipe.viewpoint = Some(point);
        self
    }

    /// One colour (red, green, blue, alpha) for each point given. Borrowed, unless points are
    /// dropped or reordered.
    pub fn colors(mut self, colors: impl Into<Cow<'a, [[u8; 4]]>>) -> Self {
        self.colors = Some(colors.into());
        self
    }

    /// What to do with points that have a NaN or infinite coordinate; they are dropped by default.
    /// Also applies to [`PointCloud::set_points`].
    pub fn non_finite(mut self, policy: NonFinite) -> Self {
        self.recipe.non_finite = policy;
        self
    }

    /// Reorders the points, with their attributes, along a Morton curve, so that the bounds of
    /// [`PointCloud::blocks`] are tight and most blocks can be skipped. Worth its cost (a sort)
    /// for static scans. [`PointCloud::order`] tells where each point came from.
    pub fn spatial_order(mut self) -> Self {
        self.spatial_order = true;
        self
    }

    /// Validates and builds. See [`CloudError`] for what can be wrong.
    pub fn build(self) -> Result<PointCloud<'a>, CloudError> {
        let _stage = stage!("points");
        self.recipe.check()?;
        let count = self.check_lengths()?;
        let mut points = self.points;
        let mut blocks: Vec<Aabb> = bounds_of_blocks(&points).collect();
        let dropped: Vec<u32> = non_finite_indices(&points, &blocks).collect();
        let recipe = self.recipe;
        check_dropped(recipe.non_finite, count, &dropped)?;
        let mut radii = self.radii;
        let outward = self.normals.as_ref().is_some_and(|given| given.outward);
        let mut normals = self.normals.map(|given| given.normals);
        let mut colors = self.colors;
        if !dropped.is_empty() {
            points = Cow::Owned(without(&points, &dropped));
            blocks = bounds_of_blocks(&points).collect();
            radii = radii.map(|r| Cow::Owned(without(&r, &dropped)));
            normals = normals.map(|n| Cow::Owned(without(&n, &dropped)));
            colors = colors.map(|c| Cow::Owned(without(&c, &dropped)));
        }

        let mut order = None;
        if self.spatial_order {
            let curve = morton_order(&points, merged(&blocks));
            points = Cow::Owned(permuted(&points, &curve));
            radii = radii.map(|r| Cow::Owned(permuted(&r, &curve)));
            normals = normals.map(|n| Cow::Owned(permuted(&n, &curve)));
            colors = colors.map(|c| Cow::Owned(permuted(&c, &curve)));
            blocks = bounds_of_blocks(&points).collect();
            order = Some(curve);
        }

        let bounds = merged(&blocks);
        let given_index = |i: usize| {
            let kept = order
                .as_ref()
                .map_or(i, |order: &Vec<u32>| order[i] as usize);
            index_before_drop(kept, &dropped)
        };
        let radii_given = radii.is_some();
        let found = Neighborhoods {
            radii: recipe.radii.neighbors().filter(|_| !radii_given),
            normals: recipe.pca_neighbors.filter(|_| normals.is_none()),
            viewpoint: recipe.viewpoint,
        }
        .of(&points)?;
        let radii = match (radii, recipe.radii) {
            (Some(given), _) => Radii::PerPoint(given),
            (None, RadiusRule::Global(radius)) => Radii::Global(radius),
            (None, RadiusRule::NearestNeighbors { .. }) => Radii::PerPoint(found.radii.into()),
        };
        check_radii(&points, &blocks, &radii, given_index)?;

        let normals_given = normals.is_some();
        let normals = match (normals, recipe.viewpoint) {
            (Some(given), Some(viewpoint)) if !outward => {
                let mut normals = usable_normals(given, &points)?.into_owned();
                turn_towards(viewpoint, &points, &mut normals);
                Some(Cow::Owned(normals))
            }
            (Some(given), _) => Some(usable_normals(given, &points)?),
            (None, _) => recipe.pca_neighbors.map(|_| Cow::Owned(found.normals)),
        };

        let (mean_radius, max_radius) = mean_and_max(&radii);
        Ok(PointCloud {
            points,
            radii,
            radii_given,
            radii_kept: false,
            normals_oriented: normals.is_some() && (outward || recipe.viewpoint.is_some()),
            normals_given,
            normals,
            colors,
            bounds,
            blocks,
            mean_radius,
            max_radius,
            dropped,
            recipe,
            order,
            content: next_content_id(),
            kept_normals: None,
            spare: Spare::default(),
        })
    }

    /// Number of points given, if it is within the limit and all attributes have as many entries.
    fn check_lengths(&self) -> Result<usize, CloudError> {
        let count = self.points.len();
        check_count(count)?;
        if let Some(radii) = &self.radii {
            check_length("radii", radii.len(), count)?;
        }
        if let Some(given) = &self.normals {
            check_length("normals", given.normals.len(), count)?;
        }
        if let Some(colors) = &self.colors {
            check_length("colors", colors.len(), count)?;
        }
        Ok(count)
    }
}

/// The given normals, normalised and completed; borrowed if nothing had to be done.
fn usable_normals<'a>(
    given: Cow<'a, [Vec3]>,
    points: &[Vec3],
) -> Result<Cow<'a, [Vec3]>, CloudError> {
    if given.iter().all(|n| n.is_normalized()) {
        return Ok(given);
    }
    let mut normals = given.into_owned();
    if !normalize(&mut normals) {
        fill_from_nearest(&mut normals, points)?;
    }
    Ok(Cow::Owned(normals))
}
