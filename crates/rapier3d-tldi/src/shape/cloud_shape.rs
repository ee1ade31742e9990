//! A point cloud as a rapier shape.

use crate::shape::mass::{MassModel, mass_properties};
use rapier3d::glamx::Vec3;
use rapier3d::parry::bounding_volume::{Aabb, BoundingSphere};
use rapier3d::parry::partitioning::{Bvh, BvhBuildStrategy};
use rapier3d::parry::shape::{Shape, ShapeType, TypedShape};
use rapier3d::prelude::MassProperties;
use std::f32::consts::FRAC_PI_4;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Once, OnceLock};
use tldi::{CloudError, NonFinite, PointCloud, Radii};

/// Neighbours for normals that are not given or that scaling made wrong. Half or twice: no test of shapes fails.
const PCA_NEIGHBORS: usize = 12;

/// Source of [`PointCloudShape::revision`].
static NEXT_REVISION: AtomicU64 = AtomicU64::new(1);

fn next_revision() -> u64 {
    NEXT_REVISION.fetch_add(1, Ordering::Relaxed)
}

/// A [`PointCloud`] as a collider's shape.
///
/// Contacts, distances and shape casts need the dispatcher of this crate
/// ([`TldiDispatcher`](crate::TldiDispatcher)); rapier's default one knows custom shapes only through
/// rays and point projections. Clones share the points; replacing the points
/// of one clone leaves the others as they are.
///
/// # The surface that rays and projections see
/// One disc a point, of the point's radius, across its normal; for a cloud without normals a disc
/// that faces the ray, and the bare points for projections. On a surface with radius of curvature
/// R a disc of radius r is off by up to r²/2R; that bounds the error of a projection, and divided
/// by the cosine of the angle between ray and normal that of a ray hit. Without normals the error
/// reaches r · tan of that angle for a ray; a projection is then within r of the true one along
/// the surface. Where the radii leave a gap in the cover (3 % of a random sample with
/// radii of 0.65 × the distance to the 7th neighbour), a ray goes through it.
///
/// # Cost
/// Bounds, bounding sphere and CCD thickness are O(1). Mass properties are computed when first
/// asked for ([`unit_mass_properties`](crate::unit_mass_properties)) and kept, also when the points change; a collider that is
/// given its mass properties
/// ([`ColliderBuilder::mass_properties`](rapier3d::prelude::ColliderBuilder::mass_properties)), or
/// the density 0, never asks. The tree for rays and projections is built on first use after the
/// points changed, O(points · log points). A new shape of a cloud without normals [keeps](PointCloud::keep_normals) estimated
/// ones, half a microsecond and 24 bytes a point, until its points change.
///
/// ```
/// use rapier3d::prelude::*;
/// use rapier3d_tldi::{PointCloud, PointCloudShape};
/// let points: Vec<Vector> = (0..100)
///     .map(|i| Vector::new((i % 10) as f32, 0.0, (i / 10) as f32))
///     .collect();
/// let cloud = PointCloud::builder(points).radius(0.8).build()?;
/// let floor = ColliderBuilder::new(SharedShape::new(PointCloudShape::new(cloud))).build();
/// let ray = Ray::new(Vector::new(4.2, 3.0, 5.1), -Vector::Y);
/// assert_eq!(floor.shape().cast_local_ray(&ray, 10.0, true), Some(3.0));
/// # Ok::<(), rapier3d_tldi::CloudError>(())
/// ```
#[derive(Clone)]
pub struct PointCloudShape {
    content: Arc<Content>,
}

/// What clones share.
struct Content {
    cloud: PointCloud<'static>,
    mass_model: MassModel,
    revision: u64,
    unit_mass: OnceLock<MassProperties>,
    bvh: OnceLock<Bvh>,
    fitted_normals: OnceLock<Vec<Vec3>>,
    least_radius: OnceLock<f32>,
}

impl Content {
    fn new(cloud: PointCloud<'static>, mass_model: MassModel) -> Self {
        Self {
            cloud,
            mass_model,
            revision: next_revision(),
            unit_mass: OnceLock::new(),
            bvh: OnceLock::new(),
            fitted_normals: OnceLock::new(),
            least_radius: OnceLock::new(),
        }
    }
}

impl std::fmt::Debug for PointCloudShape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PointCloudShape")
            .field("points", &self.cloud().len())
            .field("bounds", &self.cloud().bounds())
            .field("mean_radius", &self.cloud().mean_radius())
            .field("mass_model", &self.mass_model())
            .field("revision", &self.revision())
            .finish_non_exhaustive()
    }
}

/// The value of `cell`, made where there is none. It is made outside of the cell's lock: a thread that waits for others
/// there may take up work that asks for the same value.
fn made_once<T>(cell: &OnceLock<T>, make: impl FnOnce() -> T) -> &T {
    if let Some(value) = cell.get() {
        return value;
    }
    let made = make();
    cell.get_or_init(|| made)
}

/// What is made into a shape is taken to stay as it is, until it gets other points.
fn with_kept_normals(mut cloud: PointCloud<'static>) -> PointCloud<'static> {
    cloud.keep_normals();
    cloud
}

impl PointCloudShape {
    /// A shape over `cloud`, with the mass of the solid that it encloses.
    ///
    /// ```
    #[doc = example_scan!()]
    /// let shape = PointCloudShape::new(scan);
    /// assert_eq!(shape.mass_model(), MassModel::default());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn new(cloud: PointCloud<'static>) -> Self {
        Self {
            content: Arc::new(Content::new(with_kept_normals(cloud), MassModel::default())),
        }
    }

    /// A shape over `cloud` with the mass that `mass_model` says.
    ///
    /// # Errors
    /// [`CloudError::BadParameter`] for a shell whose thickness is not finite, or not greater than 0.
    ///
    /// ```
    #[doc = example_scan!()]
    /// use rapier3d_tldi::MassModel;
    /// let shape = PointCloudShape::with_mass_model(scan, MassModel::Shell { thickness: 0.01 })?;
    /// let mass = ColliderBuilder::new(SharedShape::new(shape)).density(1000.0).build().mass();
    /// assert!(mass > 0.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn with_mass_model(
        cloud: PointCloud<'static>,
        mass_model: MassModel,
    ) -> Result<Self, CloudError> {
        mass_model.check()?;
        Ok(Self {
            content: Arc::new(Content::new(with_kept_normals(cloud), mass_model)),
        })
    }

    /// The points, in the shape's own frame.
    ///
    /// ```
    #[doc = example_scan!()]
    /// let shape = PointCloudShape::new(scan);
    /// assert_eq!((shape.cloud().len(), shape.cloud().mean_radius()), (400, 0.1));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn cloud(&self) -> &PointCloud<'static> {
        &self.content.cloud
    }

    /// What of the cloud has mass.
    ///
    /// ```
    #[doc = example_scan!()]
    /// let model = MassModel::Shell { thickness: 0.01 };
    /// assert_eq!(PointCloudShape::with_mass_model(scan, model)?.mass_model(), model);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn mass_model(&self) -> MassModel {
        self.content.mass_model
    }

    /// A number that no other content of any shape in this process has: shapes of equal revision
    /// hold the same points, and new points bring a new revision.
    ///
    /// ```
    #[doc = example_scan!()]
    /// let mut shape = PointCloudShape::new(scan);
    /// let copy = shape.clone();
    /// assert_eq!(shape.revision(), copy.revision());
    /// shape.set_points(&points[1..], None)?;
    /// assert_ne!(shape.revision(), copy.revision());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn revision(&self) -> u64 {
        self.content.revision
    }

    /// Replaces the points, see [`PointCloud::set_points`]. On an error the shape is as it was.
    ///
    /// The mass properties stay those of the former points, once they were asked for: a body that
    /// deforms keeps its mass, and noise does not shake its centre. Call
    /// [`refresh_mass`](Self::refresh_mass) where they should follow.
    ///
    /// Memory is reused unless clones share it. A collider's shape is reached through
    /// [`Collider::shape_mut`](rapier3d::prelude::Collider::shape_mut), which also tells rapier of
    /// the change.
    ///
    /// ```
    #[doc = example_scan!()]
    /// let mut shape = PointCloudShape::new(scan);
    /// shape.set_points(&points[..300], None)?;
    /// assert_eq!(shape.cloud().len(), 300);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn set_points(
        &mut self,
        points: &[Vec3],
        normals: Option<&[Vec3]>,
    ) -> Result<(), CloudError> {
        self.change(|cloud| cloud.set_points(points, normals))
    }

    /// [`set_points`](Self::set_points) for a surface that deforms, see [`PointCloud::move_points`].
    ///
    /// # Errors
    /// Those of `set_points`.
    ///
    /// ```
    #[doc = example_scan!()]
    /// let mut shape = PointCloudShape::new(scan);
    /// let moved: Vec<Vector> = points.iter().map(|p| *p + 0.1 * Vector::Y).collect();
    /// shape.move_points(&moved, None)?; // as many as before; radii stay
    /// assert_eq!(shape.cloud().point(7), moved[7]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn move_points(
        &mut self,
        points: &[Vec3],
        normals: Option<&[Vec3]>,
    ) -> Result<(), CloudError> {
        self.change(|cloud| cloud.move_points(points, normals))
    }

    /// Changes the cloud, and forgets what was derived from it.
    fn change(
        &mut self,
        change: impl FnOnce(&mut PointCloud<'static>) -> Result<(), CloudError>,
    ) -> Result<(), CloudError> {
        if let Some(content) = Arc::get_mut(&mut self.content) {
            change(&mut content.cloud)?;
            content.bvh.take();
            content.fitted_normals.take();
            content.least_radius.take();
            content.revision = next_revision();
        } else {
            let mut cloud = self.cloud().clone();
            change(&mut cloud)?;
            self.set_cloud(cloud);
        }
        Ok(())
    }

    /// Replaces the cloud as a whole: points, radii, normals and colours. The mass properties stay, as
    /// with [`set_points`](Self::set_points).
    ///
    /// ```
    #[doc = example_scan!()]
    /// let (mut shape, former) = (PointCloudShape::new(scan), 400);
    /// shape.set_cloud(PointCloud::builder(points[..9].to_vec()).radius(0.2).build()?);
    /// assert_eq!((former, shape.cloud().len()), (400, 9));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn set_cloud(&mut self, cloud: PointCloud<'static>) {
        let mut content = Content::new(cloud, self.mass_model());
        content.unit_mass = self.content.unit_mass.clone();
        self.content = Arc::new(content);
    }

    /// Lets the mass properties follow the present points when they are asked for next.
    ///
    /// ```
    #[doc = example_scan!()]
    /// use rapier3d::parry::shape::Shape;
    /// let mut shape = PointCloudShape::with_mass_model(scan, MassModel::Shell { thickness: 0.01 })?;
    /// let mass_of = |shape: &PointCloudShape| shape.mass_properties(1000.0).mass();
    /// let before = mass_of(&shape);
    /// let shrunk: Vec<Vector> = points.iter().map(|p| 0.5 * *p).collect();
    /// shape.set_points(&shrunk, None)?;
    /// assert_eq!(mass_of(&shape), before);
    /// shape.refresh_mass();
    /// assert!(mass_of(&shape) < 0.5 * before);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn refresh_mass(&mut self) {
        if let Some(content) = Arc::get_mut(&mut self.content) {
            content.unit_mass.take();
        } else {
            self.content = Arc::new(Content::new(self.cloud().clone(), self.mass_model()));
        }
    }

    /// The tree over the points, one leaf box of the point's radius around each.
    pub(crate) fn bvh(&self) -> &Bvh {
        self.content.bvh.get_or_init(|| {
            let cloud = self.cloud();
            let leaves: Vec<Aabb> = cloud
                .points()
                .iter()
                .copied()
                .enumerate()
                .map(|(i, p)| Aabb::from_half_extents(p, Vec3::splat(cloud.radius(i))))
                .collect();
            Bvh::from_leaves(BvhBuildStrategy::Binned, &leaves)
        })
    }

    /// The smallest point radius, metres; computed once.
    pub(crate) fn least_radius(&self) -> f32 {
        *self
            .content
            .least_radius
            .get_or_init(|| match self.cloud().radii() {
                Radii::Global(radius) => *radius,
                Radii::PerPoint(radii) => radii.iter().copied().fold(f32::MAX, f32::min),
            })
    }

    /// The cloud's normals or, where it has none, those of planes through neighbours, which are not
    /// oriented; computed once.
    pub(crate) fn surface_normals(&self) -> &[Vec3] {
        let cloud = self.cloud();
        cloud.normals().unwrap_or_else(|| {
            made_once::<Vec<Vec3>>(&self.content.fitted_normals, || {
                let points: Vec<Vec3> = cloud.points().to_vec();
                let with_normals = PointCloud::builder(points)
                    .radius(cloud.max_radius())
                    .pca_normals(PCA_NEIGHBORS)
                    .build()
                    .expect("the points of a valid cloud are valid");
                let normals = with_normals.normals();
                normals.expect("they were asked for").to_vec()
            })
        })
    }
}

impl Shape for PointCloudShape {
    /// Bounds of the points, grown by the mean radius: the surface passes through the points, and
    /// between them it bulges by a fraction of the radius.
    fn compute_local_aabb(&self) -> Aabb {
        let bounds = self.cloud().bounds().loosened(self.cloud().mean_radius());
        Aabb::new(bounds.min, bounds.max)
    }

    /// The sphere around [`compute_local_aabb`](Self::compute_local_aabb).
    fn compute_local_bounding_sphere(&self) -> BoundingSphere {
        self.compute_local_aabb().bounding_sphere()
    }

    fn clone_dyn(&self) -> Box<dyn Shape> {
        Box::new(self.clone())
    }

    /// Radii grow by the largest of the three factors, so that the balls still cover the surface;
    /// a given shell thickness does as well. Normals that are not oriented are computed anew. Fails
    /// if a factor is zero or not finite, or the scaled points are not valid any more.
    fn scale_dyn(&self, scale: Vec3, _num_subdivisions: u32) -> Option<Box<dyn Shape>> {
        if scale.cmpeq(Vec3::ZERO).any() || !scale.is_finite() {
            return None;
        }
        let cloud = self.cloud();
        let largest = scale.abs().max_element();
        let points: Vec<Vec3> = cloud.points().iter().map(|&p| p * scale).collect();
        let mut builder = PointCloud::builder(points)
            .noise(cloud.noise() * largest)
            .non_finite(NonFinite::Refuse);
        builder = match cloud.radii() {
            Radii::Global(radius) => builder.radius(radius * largest),
            Radii::PerPoint(radii) => {
                builder.radii(radii.iter().map(|r| r * largest).collect::<Vec<_>>())
            }
        };
        if let Some(normals) = cloud.normals() {
            builder = if cloud.normals_oriented() {
                builder.normals(normals.iter().map(|n| n / scale).collect::<Vec<_>>())
            } else {
                builder.pca_normals(PCA_NEIGHBORS)
            };
        }
        if let Some(colors) = cloud.colors() {
            builder = builder.colors(colors.to_vec());
        }
        let mass_model = match self.mass_model() {
            MassModel::Solid => MassModel::Solid,
            MassModel::Shell { thickness } => MassModel::Shell {
                thickness: thickness * largest,
            },
        };
        let scaled = Self::with_mass_model(builder.build().ok()?, mass_model).ok()?;
        Some(Box::new(scaled))
    }

    fn mass_properties(&self, density: f32) -> MassProperties {
        let unit = made_once(&self.content.unit_mass, || {
            mass_properties(self.cloud(), self.mass_model())
        });
        MassProperties::with_principal_inertia_frame(
            unit.local_com,
            unit.mass() * density,
            unit.principal_inertia() * density,
            unit.principal_inertia_local_frame,
        )
    }

    /// Warns once, in the log: only rapier's default dispatcher asks for it before it finds contacts, and it has
    /// none for clouds.
    fn shape_type(&self) -> ShapeType {
        static WARNING: Once = Once::new();
        WARNING.call_once(|| {
            log::warn!(
                "rapier's own dispatcher was asked about contacts of a point cloud, and finds none: bodies pass \
                 through it. Call TldiPipeline::attach before the world's first step. Rapier's \
                 KinematicCharacterController always asks it whether it is grounded: docs/in_your_app.md"
            );
        });
        ShapeType::Custom
    }

    fn as_typed_shape(&self) -> TypedShape<'_> {
        TypedShape::Custom(self)
    }

    /// Half the smallest extent of the points, but not below the mean radius (a flat scan): rapier
    /// takes a body for fast when it moves by half of this in a step.
    fn ccd_thickness(&self) -> f32 {
        let half_extent = 0.5 * self.cloud().bounds().extents().min_element();
        half_extent.max(self.cloud().mean_radius())
    }

    /// As for a triangle mesh, 45°.
    fn ccd_angular_thickness(&self) -> f32 {
        FRAC_PI_4
    }
}
