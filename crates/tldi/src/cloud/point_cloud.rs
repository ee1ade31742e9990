//! The point cloud: positions, radii, optional normals and colours, bounds.

use crate::cloud::checks::{check_count, check_dropped, check_length};
use crate::cloud::gather::{Gathered, extend_without, index_before_drop, merged};
use crate::cloud::morton::permuted;
use crate::cloud::neighborhoods::Neighborhoods;
use crate::cloud::point_normals::{fill_from_nearest, normalize, unit_or_zero};
use crate::cloud::radii::{check_radii, mean_and_max};
use crate::cpu::normals::kept::KeptNormals;
use crate::stage::stage;
use crate::{Aabb, CloudError, CloudRecipe, Radii, RadiusRule};
use glamx::Vec3;
use std::borrow::Cow;
use std::sync::atomic::{AtomicU64, Ordering};

/// Points of one body in its own frame, validated once, with what is derived from them.
///
/// Points are owned or borrowed, as they come. The balls of the radii around them are meant to cover the surface that
/// was sampled.
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
    pub(crate) points: Cow<'a, [Vec3]>,
    pub(crate) radii: Radii<'a>,
    /// Whether the caller gave a radius for each point.
    pub(crate) radii_given: bool,
    /// Whether radii from neighbours are those that the points had before they moved.
    pub(crate) radii_kept: bool,
    pub(crate) normals: Option<Cow<'a, [Vec3]>>,
    pub(crate) normals_oriented: bool,
    /// Whether they are the caller's.
    pub(crate) normals_given: bool,
    /// Where the cloud has no normals and was told to [keep](Self::keep_normals) estimated ones.
    pub(crate) kept_normals: Option<KeptNormals>,
    pub(crate) colors: Option<Cow<'a, [[u8; 4]]>>,
    pub(crate) bounds: Aabb,
    pub(crate) blocks: Vec<Aabb>,
    pub(crate) mean_radius: f32,
    pub(crate) max_radius: f32,
    /// Indices, among the points last given, of those left out because they are not finite; ascending.
    pub(crate) dropped: Vec<u32>,
    pub(crate) recipe: CloudRecipe,
    pub(crate) order: Option<Vec<u32>>,
    pub(crate) content: u64,
    pub(crate) spare: Spare,
}

/// Memory for the next frame of a cloud that is given new points; a clone of the cloud starts
/// without.
#[derive(Debug, Default)]
pub(crate) struct Spare {
    gathered: Gathered,
    normals: Vec<Vec3>,
}

impl Clone for Spare {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl<'a> PointCloud<'a> {
    /// Number of points (at least one).
    #[allow(
        clippy::len_without_is_empty,
        reason = "a cloud is never empty: the builder refuses"
    )]
    pub fn len(&self) -> usize {
        self.points.len()
    }

    /// All positions in metres, in the cloud's own frame.
    pub fn points(&self) -> &[Vec3] {
        &self.points
    }

    /// Position of one point in metres.
    pub fn point(&self, index: usize) -> Vec3 {
        self.points[index]
    }

    /// The radii in metres.
    pub fn radii(&self) -> &Radii<'a> {
        &self.radii
    }

    /// Radius of one point in metres.
    pub fn radius(&self, index: usize) -> f32 {
        self.radii.of(index)
    }

    /// Mean radius r̄ in metres.
    pub fn mean_radius(&self) -> f32 {
        self.mean_radius
    }

    /// Largest radius in metres.
    pub fn max_radius(&self) -> f32 {
        self.max_radius
    }

    /// Whether some radius is twice the mean or more: in such a cloud what is near depends on the place, as its
    /// resolution does. Cost: O(1).
    ///
    /// ```
    /// use tldi::{PointCloud, glamx::Vec3};
    /// let points = [Vec3::ZERO, Vec3::X, 2.0 * Vec3::X];
    /// let with = |radii: &[f32]| PointCloud::builder(&points[..]).radii(radii.to_vec()).build();
    /// assert!(!with(&[0.5, 0.8, 0.5])?.is_uneven());
    /// assert!(with(&[0.5, 0.5, 4.0])?.is_uneven());
    /// # Ok::<(), tldi::CloudError>(())
    /// ```
    pub fn is_uneven(&self) -> bool {
        self.max_radius >= 2.0 * self.mean_radius
    }

    /// Standard deviation of the points along the surface's normal in metres, as
    /// [told](crate::CloudBuilder::noise); 0 where it was not.
    pub fn noise(&self) -> f32 {
        self.recipe.noise
    }

    /// What is made of new points ([`set_points`](Self::set_points)).
    pub fn recipe(&self) -> &CloudRecipe {
        &self.recipe
    }

    /// Unit normals, one for each point, where given or computed.
    pub fn normals(&self) -> Option<&[Vec3]> {
        self.normals.as_deref()
    }

    /// Whether there are normals that point outward (given, or oriented towards a viewpoint), so that
    /// their sign means something.
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

    /// Bounds of each run of [`BLOCK`](crate::BLOCK) consecutive points: where the order of the points is
    /// spatially coherent, whole blocks are skipped by the culling pass.
    pub fn blocks(&self) -> &[Aabb] {
        &self.blocks
    }

    /// Non-finite points that were dropped from those last given.
    pub fn dropped(&self) -> usize {
        self.dropped.len()
    }

    /// Number of the content: clouds of this process with the same number have the same points,
    /// radii and normals, so that what was derived from one of them (a copy on a device) holds for
    /// the others. New points or radii change it; clones share it.
    pub fn content_id(&self) -> u64 {
        self.content
    }

    /// After [`CloudBuilder::spatial_order`](crate::CloudBuilder::spatial_order), the index that each point would have without it (the
    /// index given by the caller, where nothing was dropped), so that whoever is told of a point of
    /// the cloud finds it in their own data. Else `None`: the points are as given.
    pub fn order(&self) -> Option<&[u32]> {
        self.order.as_deref()
    }

    /// The index, among the points last given, of the one with this index in the cloud: some may have been
    /// dropped, or [reordered](crate::CloudBuilder::spatial_order).
    ///
    /// ```
    /// use tldi::{PointCloud, glamx::Vec3};
    /// let points = [Vec3::ZERO, Vec3::NAN, Vec3::X];
    /// let cloud = PointCloud::builder(&points[..]).radius(0.5).build()?;
    /// assert_eq!((cloud.point(1), cloud.given_index(1)), (Vec3::X, 2));
    /// # Ok::<(), tldi::CloudError>(())
    /// ```
    ///
    /// # Panics
    /// If a reordered cloud has no such point.
    pub fn given_index(&self, index: usize) -> usize {
        let kept = self.order().map_or(index, |order| order[index] as usize);
        index_before_drop(kept, &self.dropped)
    }

    /// Whether [`set_points`](Self::set_points) with these points and normals would leave the cloud
    /// as it is. `false` also for normals of which one tells no direction. Cost: one pass, up to the first difference.
    ///
    /// ```
    /// use tldi::{PointCloud, glamx::Vec3};
    /// let cloud = PointCloud::builder(vec![Vec3::ZERO, Vec3::NAN, Vec3::X]).radius(0.5).build()?;
    /// assert!(cloud.consists_of(&[Vec3::ZERO, Vec3::NAN, Vec3::X], None));
    /// assert!(!cloud.consists_of(&[Vec3::X, Vec3::NAN, Vec3::ZERO], None));
    /// # Ok::<(), tldi::CloudError>(())
    /// ```
    pub fn consists_of(&self, points: &[Vec3], normals: Option<&[Vec3]>) -> bool {
        !self.radii_kept && self.lies_at(points, normals)
    }

    /// [`consists_of`](Self::consists_of) for [`move_points`](Self::move_points).
    ///
    /// ```
    /// use tldi::{PointCloud, glamx::Vec3};
    /// let (points, moved) = ([Vec3::ZERO, Vec3::X], [Vec3::ZERO, Vec3::Y]);
    /// let mut cloud = PointCloud::builder(&points[..]).knn_radii(1, 0.5).build()?.into_owned();
    /// cloud.move_points(&moved, None)?;
    /// assert!(cloud.lies_at(&moved, None));
    /// assert!(!cloud.consists_of(&moved, None), "as new points they get other radii");
    /// # Ok::<(), tldi::CloudError>(())
    /// ```
    pub fn lies_at(&self, points: &[Vec3], normals: Option<&[Vec3]>) -> bool {
        if points.len() != self.len() + self.dropped.len() {
            return false;
        }
        let same_normals = match (self.normals(), normals) {
            (_, None) => !self.normals_given,
            (Some(own), Some(new)) => {
                let is_same = |i| own[i] == unit_or_zero(new[self.given_index(i)]);
                self.normals_oriented && new.len() == points.len() && (0..own.len()).all(is_same)
            }
            _ => false,
        };
        same_normals
            && (0..self.len()).all(|i| self.point(i) == points[self.given_index(i)])
            && (self.dropped.iter()).all(|&i| !points[i as usize].is_finite())
    }

    /// Replaces all points, as a streaming cloud does in every frame: with what the builder was told to
    /// make of points (its [recipe](CloudRecipe)).
    ///
    /// - A global radius is kept; radii from neighbours are made anew. Radii given for each point are
    ///   kept if as many points as the cloud has are given, all finite, or as many as were given before, the same
    ///   ones not finite: they are taken to be the same points, moved. Otherwise they are an error ([`CloudError::LengthMismatch`]):
    ///   [set](Self::set_radii) a global radius first, or build another cloud. Colours are kept under the
    ///   same condition, else removed.
    /// - Normals are replaced by those given, which must be outward (see
    ///   [`CloudBuilder::normals`](crate::CloudBuilder::normals)). Without any they are estimated as
    ///   [`CloudBuilder::pca_normals`](crate::CloudBuilder::pca_normals) and [`viewpoint`](crate::CloudBuilder::viewpoint) told the builder, or
    ///   removed where it was not told: the former ones would be wrong.
    /// - A cloud built with [`CloudBuilder::spatial_order`](crate::CloudBuilder::spatial_order) takes the points in the order in which
    ///   they were given to the builder and puts them into its own; if the number changes, or some
    ///   are dropped, it keeps them as they come and [`order`](Self::order) becomes `None`.
    ///
    /// On an error the cloud is unchanged. Cost: one pass over the points, and what radii and normals
    /// from neighbours cost. Without these memory is reused: after
    /// two calls with as many points nothing is allocated, unless normals must be replaced.
    ///
    /// ```
    /// use tldi::{PointCloud, glamx::Vec3};
    /// let mut points = vec![Vec3::ZERO, Vec3::X, Vec3::Y];
    /// let mut cloud = PointCloud::builder(&points).radius(0.7).build()?.into_owned();
    /// points.push(2.0 * Vec3::Z);
    /// cloud.set_points(&points, None)?;
    /// assert_eq!((cloud.len(), cloud.bounds().max), (4, Vec3::new(1.0, 1.0, 2.0)));
    /// # Ok::<(), tldi::CloudError>(())
    /// ```
    pub fn set_points(
        &mut self,
        points: &[Vec3],
        normals: Option<&[Vec3]>,
    ) -> Result<(), CloudError> {
        self.replace(points, normals, false)
    }

    /// [`set_points`](Self::set_points) for a surface that deforms: the same points, elsewhere. Radii from
    /// neighbours stay as well, where all points are there and the same ones are finite, which saves their cost.
    ///
    /// ```
    /// use tldi::{PointCloud, glamx::Vec3};
    /// let points = [Vec3::ZERO, Vec3::X, Vec3::Y];
    /// let mut cloud = PointCloud::builder(&points[..]).knn_radii(1, 0.5).build()?.into_owned();
    /// cloud.move_points(&points.map(|p| 3.0 * p), None)?;
    /// assert_eq!(cloud.mean_radius(), 0.5);
    /// cloud.set_points(&points.map(|p| 3.0 * p), None)?;
    /// assert_eq!(cloud.mean_radius(), 1.5);
    /// # Ok::<(), tldi::CloudError>(())
    /// ```
    ///
    /// # Errors
    /// Those of `set_points`.
    pub fn move_points(
        &mut self,
        points: &[Vec3],
        normals: Option<&[Vec3]>,
    ) -> Result<(), CloudError> {
        self.replace(points, normals, true)
    }

    /// `moved`: they are the same points.
    fn replace(
        &mut self,
        points: &[Vec3],
        normals: Option<&[Vec3]>,
        moved: bool,
    ) -> Result<(), CloudError> {
        let _stage = stage!("points");
        check_count(points.len())?;
        if let Some(normals) = normals {
            check_length("normals", normals.len(), points.len())?;
        }
        // Everything is prepared in spare memory and swapped in at the end.
        let Spare {
            gathered,
            normals: new_normals,
        } = &mut self.spare;
        let mut order = self.order.as_ref().filter(|o| o.len() == points.len());
        if let Some(curve) = order {
            gathered.refill(points, Some(curve));
            if !gathered.dropped.is_empty() {
                order = None;
            }
        }
        if order.is_none() {
            gathered.refill(points, None);
        }
        check_dropped(self.recipe.non_finite, points.len(), &gathered.dropped)?;
        let own_moved = points.len() == self.points.len() && gathered.dropped.is_empty();
        let given_moved = self.order.is_none()
            && points.len() == self.points.len() + self.dropped.len()
            && gathered.dropped == self.dropped;
        let same_points = own_moved || given_moved;
        let bounds = merged(&gathered.blocks);
        let new_points = &gathered.points;
        let rule = match &self.radii {
            Radii::PerPoint(_) if same_points && (moved || self.radii_given) => None,
            Radii::PerPoint(radii) if self.radii_given => {
                let kept = points.len() - gathered.dropped.len();
                let same_count = points.len() == radii.len();
                let expected = if same_count { kept } else { points.len() };
                return check_length("radii", radii.len(), expected);
            }
            Radii::PerPoint(_) => self.recipe.radii.neighbors(),
            Radii::Global(_) => None,
        };
        let found = Neighborhoods {
            radii: rule,
            normals: self.recipe.pca_neighbors.filter(|_| normals.is_none()),
            viewpoint: self.recipe.viewpoint,
        }
        .of(new_points)?;
        let new_radii = rule.map(|_| Radii::PerPoint(found.radii.into()));
        let radii = new_radii.as_ref().unwrap_or(&self.radii);
        let given_index = |i: usize| {
            let kept = order.map_or(i, |order| order[i] as usize);
            index_before_drop(kept, &gathered.dropped)
        };
        check_radii(new_points, &gathered.blocks, radii, given_index)?;
        if let Some(normals) = normals {
            new_normals.clear();
            match order {
                Some(order) => new_normals.extend(order.iter().map(|&i| normals[i as usize])),
                None => extend_without(new_normals, normals.iter().copied(), &gathered.dropped),
            }
            if !normalize(new_normals) {
                fill_from_nearest(new_normals, new_points)?;
            }
        } else if self.recipe.pca_neighbors.is_some() {
            *new_normals = found.normals;
        }

        // Nothing fails from here on.
        if order.is_none() {
            self.order = None;
        }
        swap(&mut self.points, &mut gathered.points);
        std::mem::swap(&mut self.blocks, &mut gathered.blocks);
        let estimated = normals.is_none() && self.recipe.pca_neighbors.is_some();
        if normals.is_some() || estimated {
            swap(self.normals.get_or_insert_default(), new_normals);
        } else if let Some(Cow::Owned(unused)) = self.normals.take() {
            *new_normals = unused;
        }
        self.normals_given = normals.is_some();
        self.normals_oriented =
            self.normals_given || (estimated && self.recipe.viewpoint.is_some());
        let keeps = |radii: &Radii<'_>| matches!(radii, Radii::PerPoint(_)) && !self.radii_given;
        self.radii_kept = new_radii.is_none() && keeps(&self.radii);
        if let Some(radii) = new_radii {
            (self.mean_radius, self.max_radius) = mean_and_max(&radii);
            self.radii = radii;
        }
        self.colors.take_if(|_| !same_points);
        self.bounds = bounds;
        std::mem::swap(&mut self.dropped, &mut gathered.dropped);
        self.kept_normals = None;
        self.content = next_content_id();
        Ok(())
    }

    /// Replaces the radii; those for each point come in the order in which
    /// [`set_points`](Self::set_points) takes the points, without dropped ones. A global radius is
    /// that of new points, too. On an error the cloud is unchanged.
    pub fn set_radii(&mut self, radii: Radii<'a>) -> Result<(), CloudError> {
        let mut radii = radii;
        if let Radii::PerPoint(radii) = &mut radii {
            check_length("radii", radii.len(), self.len())?;
            if let Some(order) = &self.order {
                *radii = Cow::Owned(permuted(radii, order));
            }
        }
        let given_index = |i: usize| self.order.as_ref().map_or(i, |order| order[i] as usize);
        check_radii(&self.points, &self.blocks, &radii, given_index)?;
        (self.mean_radius, self.max_radius) = mean_and_max(&radii);
        self.radii_given = matches!(radii, Radii::PerPoint(_));
        self.radii_kept = false;
        if let Radii::Global(radius) = radii {
            self.recipe.radii = RadiusRule::Global(radius);
        }
        self.radii = radii;
        self.kept_normals = None;
        self.content = next_content_id();
        Ok(())
    }

    /// The cloud with everything owned.
    pub fn into_owned(self) -> PointCloud<'static> {
        PointCloud {
            points: Cow::Owned(self.points.into_owned()),
            radii: match self.radii {
                Radii::Global(r) => Radii::Global(r),
                Radii::PerPoint(r) => Radii::PerPoint(Cow::Owned(r.into_owned())),
            },
            radii_given: self.radii_given,
            radii_kept: self.radii_kept,
            normals: self.normals.map(|n| Cow::Owned(n.into_owned())),
            normals_oriented: self.normals_oriented,
            normals_given: self.normals_given,
            kept_normals: self.kept_normals,
            colors: self.colors.map(|c| Cow::Owned(c.into_owned())),
            bounds: self.bounds,
            blocks: self.blocks,
            mean_radius: self.mean_radius,
            max_radius: self.max_radius,
            dropped: self.dropped,
            recipe: self.recipe,
            order: self.order,
            content: self.content,
            spare: self.spare,
        }
    }
}

/// Clouds are equal if they hold the same points, radii, normals and colours in the same order, and make the same of new
/// points. Cost: one pass, up to the first difference.
impl PartialEq<PointCloud<'_>> for PointCloud<'_> {
    fn eq(&self, other: &PointCloud<'_>) -> bool {
        let told = |cloud: &PointCloud<'_>| {
            let PointCloud {
                radii_given,
                radii_kept,
                normals_oriented,
                normals_given,
                ..
            } = *cloud;
            [radii_given, radii_kept, normals_oriented, normals_given]
        };
        self.content == other.content
            || self.points == other.points
                && told(self) == told(other)
                && self.radii == other.radii
                && self.normals == other.normals
                && self.colors == other.colors
                && self.dropped == other.dropped
                && self.recipe == other.recipe
                && self.order == other.order
    }
}

/// A number that no cloud had before.
pub(crate) fn next_content_id() -> u64 {
    static NEXT: AtomicU64 = AtomicU64::new(0);
    NEXT.fetch_add(1, Ordering::Relaxed)
}

/// Makes `new` current and keeps the memory of the former content, if it was owned.
fn swap<T: Clone>(current: &mut Cow<'_, [T]>, new: &mut Vec<T>) {
    let former = std::mem::replace(current, Cow::Owned(std::mem::take(new)));
    if let Cow::Owned(former) = former {
        *new = former;
    }
}
