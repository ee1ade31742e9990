//! The frames of a sensor as a collider.

use crate::step::candidates::pose_of;
use crate::{PointCloudShape, TldiError, TldiPipeline, cloud_collider, points_on};
use rapier3d::dynamics::RigidBodySet;
use rapier3d::geometry::{ColliderHandle, ColliderSet};
use rapier3d::math::{Pose, Vector};
use rapier3d::parry::shape::Shape;
use tldi::{CloudError, CloudRecipe, PointCloud};

/// Radius in metres of the point that stands for no points in a collider that is disabled.
const STAND_IN_RADIUS: f32 = 1.0;

/// A collider that a sensor fills with new points in every frame, as many as it sees: 300,000, or none.
///
/// The [recipe](CloudRecipe) says once how radii and normals are found. Normals, found or given, are turned to
/// where the sensor was in the frame. A frame without points disables the collider: there are no
/// contacts, what rested on it wakes, and the collider keeps no point.
///
/// The collider has no body and is at the origin of the world. It may be moved with the sensor, before a frame, where
/// coordinates are large (see [`CloudError::CoordinateTooLarge`]). Its friction and groups are set as those of any other.
///
/// ```
/// use rapier3d::prelude::*;
/// use rapier3d_tldi::{CloudRecipe, CloudStream, prelude::*};
/// let mut world = PhysicsWorld::default();
/// let mut tldi = TldiPipeline::new(TldiConfig::default())?;
/// tldi.attach(&mut world);
/// let recipe = CloudRecipe { pca_neighbors: Some(8), ..CloudRecipe::default() };
/// let mut stream = CloudStream::new(&mut world.colliders, recipe)?;
/// world.colliders[stream.collider()].set_friction(0.8);
///
/// let ball = RigidBodyBuilder::dynamic().translation(Vector::Y * 0.15);
/// let (ball, _) = world.insert(ball, ColliderBuilder::ball(0.1));
/// let world_from_sensor = Pose::from_translation(Vector::Y * 2.0); // it looks down
/// for frame in 0..30 {
///     let n = 15 + frame % 3; // points a row: another number in every frame
///     let seen: Vec<Vector> = (0..n * n)
///         .map(|i| Vector::new((i % n) as f32 / n as f32 - 0.5, -2.0, (i / n) as f32 / n as f32 - 0.5))
///         .collect();
///     let taken = stream.frame(&mut tldi, &world.bodies, &mut world.colliders, &seen, &world_from_sensor)?;
///     assert_eq!(taken.points, seen.len());
///     tldi.step(&mut world)?;
/// }
/// assert!((world.bodies[ball].translation().y - 0.1).abs() < 0.02);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct CloudStream {
    recipe: CloudRecipe,
    collider: ColliderHandle,
    own: Vec<ColliderHandle>,
    own_margin: f32,
    /// Of the frame, in the frame of the collider; kept for their memory.
    points: Vec<Vector>,
    normals: Vec<Vector>,
    radii: Vec<f32>,
    last_radius: Option<f32>,
    /// Whether the stream disabled the collider, since there are no points.
    is_hidden: bool,
}

/// What a sensor saw in a frame, in its own frame, metres; points alone become one by `into`. Where a ray met nothing,
/// sensors write what is not finite, or their own place, (0, 0, 0): such points are dropped.
///
/// What comes in rows and columns has radii and normals by its neighbours there
/// (`tldi_sources::depth::OrganizedCloud` and `DepthCamera`), which costs less than a search for them.
///
/// ```
/// use rapier3d::prelude::*;
/// use rapier3d_tldi::{CloudRecipe, CloudStream, SeenPoints, prelude::*};
/// let mut world = PhysicsWorld::default();
/// let mut tldi = TldiPipeline::new(TldiConfig::default())?;
/// let mut stream = CloudStream::new(&mut world.colliders, CloudRecipe::default())?;
/// let (points, radii) = ([Vector::Z, 1.1 * Vector::Z], [0.1, 0.11]);
/// let seen = SeenPoints { radii: Some(&radii), ..SeenPoints::from(&points[..]) };
/// let taken = stream.frame(&mut tldi, &world.bodies, &mut world.colliders, seen, &Pose::IDENTITY)?;
/// assert_eq!(taken.points, 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default)]
pub struct SeenPoints<'a> {
    /// Positions.
    pub points: &'a [Vector],
    /// A normal for each point, of either sign; the recipe's where there are none.
    pub normals: Option<&'a [Vector]>,
    /// A radius for each point; the recipe's where there are none.
    pub radii: Option<&'a [f32]>,
}

impl<'a> From<&'a [Vector]> for SeenPoints<'a> {
    fn from(points: &'a [Vector]) -> Self {
        Self {
            points,
            ..Self::default()
        }
    }
}

impl<'a> From<&'a Vec<Vector>> for SeenPoints<'a> {
    fn from(points: &'a Vec<Vector>) -> Self {
        Self::from(&points[..])
    }
}

/// What became of the points of a frame. Together they are those given.
///
/// ```
/// # use rapier3d::prelude::*;
/// # use rapier3d_tldi::prelude::*;
/// # let mut world = PhysicsWorld::default();
/// # let mut tldi = TldiPipeline::new(TldiConfig::default())?;
/// use rapier3d_tldi::StreamFrame;
/// let recipe = CloudRecipe { radii: RadiusRule::Global(0.1), ..CloudRecipe::default() };
/// let mut stream = CloudStream::new(&mut world.colliders, recipe)?;
/// let seen = [Vector::Z, Vector::splat(f32::NAN)];
/// let taken = stream.frame(&mut tldi, &world.bodies, &mut world.colliders, &seen[..], &Pose::IDENTITY)?;
/// assert_eq!(taken, StreamFrame { points: 1, dropped: 1, own: 0 });
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StreamFrame {
    /// Points of the collider.
    pub points: usize,
    /// Points that were dropped since they are not finite, or exactly at the sensor: rays that met nothing.
    pub dropped: usize,
    /// Points that were left out since they are on [what carries the sensor](CloudStream::without).
    pub own: usize,
}

impl CloudStream {
    /// A stream whose collider is among `colliders`, disabled until the first frame.
    ///
    /// # Errors
    /// [`CloudError::BadParameter`] for a recipe that cannot be followed.
    ///
    /// ```
    /// # use rapier3d::prelude::*;
    /// # use rapier3d_tldi::prelude::*;
    /// # let mut world = PhysicsWorld::default();
    /// let stream = CloudStream::new(&mut world.colliders, CloudRecipe::default())?;
    /// assert!(!world.colliders[stream.collider()].is_enabled());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn new(colliders: &mut ColliderSet, recipe: CloudRecipe) -> Result<Self, CloudError> {
        recipe.check()?;
        let collider = cloud_collider(stand_in()?).enabled(false);
        Ok(Self {
            recipe,
            collider: colliders.insert(collider),
            own: Vec::new(),
            own_margin: 0.0,
            points: Vec::new(),
            normals: Vec::new(),
            radii: Vec::new(),
            last_radius: None,
            is_hidden: true,
        })
    }

    /// Leaves out points on these colliders, where their bodies are when a frame is taken: the links of the robot that
    /// carries the sensor. `margin` is in metres, see [`points_on`]; one that is negative or not finite is an error of
    /// each [`frame`](Self::frame).
    ///
    /// ```
    /// # use rapier3d::prelude::*;
    /// # use rapier3d_tldi::prelude::*;
    /// # let mut world = PhysicsWorld::default();
    /// # let mut tldi = TldiPipeline::new(TldiConfig::default())?;
    /// let hand = world.colliders.insert(ColliderBuilder::ball(0.1).translation(Vector::Z));
    /// let recipe = CloudRecipe { radii: RadiusRule::Global(0.05), ..CloudRecipe::default() };
    /// let mut stream = CloudStream::new(&mut world.colliders, recipe)?.without([hand], 0.02);
    /// let seen = [Vector::Z, 2.0 * Vector::Z]; // in the hand, and beyond it
    /// let taken = stream.frame(&mut tldi, &world.bodies, &mut world.colliders, &seen[..], &Pose::IDENTITY)?;
    /// assert_eq!((taken.points, taken.own), (1, 1));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn without(mut self, own: impl IntoIterator<Item = ColliderHandle>, margin: f32) -> Self {
        self.own = own.into_iter().collect();
        self.own_margin = margin;
        self
    }

    /// The collider; the same one in all frames.
    ///
    /// ```
    /// # use rapier3d::prelude::*;
    /// # use rapier3d_tldi::prelude::*;
    /// # let mut world = PhysicsWorld::default();
    /// let stream = CloudStream::new(&mut world.colliders, CloudRecipe::default())?;
    /// world.colliders[stream.collider()].set_friction(0.8);
    /// assert_eq!(world.colliders[stream.collider()].friction(), 0.8);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn collider(&self) -> ColliderHandle {
        self.collider
    }

    /// Replaces the points by those of a frame; call it before the step.
    ///
    /// Where all points are in one place and neighbours tell no radius, it is the mean one of
    /// the frame before.
    ///
    /// Cost: a pass over the points, and what the recipe asks for and the frame does not tell. Radii and normals from
    /// neighbours take a tree over all points: give a global radius, and no normals, where time is short and the points
    /// are in no order. What the step models of it is estimated there anyway, but does not know its side.
    ///
    /// # Errors
    /// [`TldiError::Cloud`] where the points or the margin are refused, or the pose is not finite;
    /// [`TldiError::NoSuchCollider`] if the collider, or one of those [without](Self::without) which
    /// the frame is taken, was removed. The collider then keeps the points of the frame before.
    ///
    /// ```
    /// # use rapier3d::prelude::*;
    /// # use rapier3d_tldi::prelude::*;
    /// # let mut world = PhysicsWorld::default();
    /// # let mut tldi = TldiPipeline::new(TldiConfig::default())?;
    /// let recipe = CloudRecipe { radii: RadiusRule::Global(0.1), ..CloudRecipe::default() };
    /// let mut stream = CloudStream::new(&mut world.colliders, recipe)?;
    /// let above = Pose::from_translation(Vector::Y);
    /// let taken = stream.frame(&mut tldi, &world.bodies, &mut world.colliders, &[Vector::Z][..], &above)?;
    /// assert_eq!(taken.points, 1);
    /// let bounds = world.colliders[stream.collider()].compute_aabb();
    /// assert!(bounds.center().distance(Vector::Y + Vector::Z) < 1e-6);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn frame<'a>(
        &mut self,
        tldi: &mut TldiPipeline,
        bodies: &RigidBodySet,
        colliders: &mut ColliderSet,
        seen: impl Into<SeenPoints<'a>>,
        world_from_sensor: &Pose,
    ) -> Result<StreamFrame, TldiError> {
        let collider = self.collider;
        let refused = |source| TldiError::Cloud { collider, source };
        let seen = seen.into();
        check(&seen, world_from_sensor).map_err(refused)?;
        let world_from_collider = pose_of(get(colliders, collider)?, bodies);
        let collider_from_world = world_from_collider.inverse();
        let collider_from_sensor = collider_from_world * *world_from_sensor;
        self.points.clear();
        self.points.extend(seen.points.iter().map(|p| {
            if *p == Vector::ZERO {
                Vector::NAN
            } else {
                collider_from_sensor * *p
            }
        }));
        self.normals.clear();
        let turn = collider_from_sensor.rotation;
        self.normals
            .extend(seen.normals.unwrap_or_default().iter().map(|n| turn * *n));
        self.radii.clear();
        self.radii.extend(seen.radii.unwrap_or_default());
        self.remove_own(bodies, colliders, &collider_from_world)?;

        let own = seen.points.len() - self.points.len();
        self.recipe.viewpoint = Some(collider_from_sensor.translation);
        let built = match self.build(&seen, self.recipe) {
            Err(CloudError::Empty { dropped }) => {
                self.clear(tldi, colliders)?;
                return Ok(StreamFrame {
                    points: 0,
                    dropped,
                    own,
                });
            }
            Err(CloudError::NoSpacing { .. }) if self.last_radius.is_some() => {
                let radii = self
                    .last_radius
                    .map_or(self.recipe.radii, tldi::RadiusRule::Global);
                self.build(
                    &seen,
                    CloudRecipe {
                        radii,
                        ..self.recipe
                    },
                )
            }
            built => built,
        };
        let cloud = built.map_err(refused)?;
        let taken = StreamFrame {
            points: cloud.len(),
            dropped: cloud.dropped(),
            own,
        };
        self.last_radius = Some(cloud.mean_radius());
        tldi.set_collider_cloud(colliders, collider, cloud)?;
        if std::mem::take(&mut self.is_hidden)
            && let Some(collider) = colliders.get_mut(collider)
        {
            collider.set_enabled(true);
        }
        Ok(taken)
    }

    /// Takes what is on the own colliders out of all lists.
    fn remove_own(
        &mut self,
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
        collider_from_world: &Pose,
    ) -> Result<(), TldiError> {
        let shapes = (self.own.iter())
            .map(|own| {
                let own = get(colliders, *own)?;
                Ok((*collider_from_world * pose_of(own, bodies), own.shape()))
            })
            .collect::<Result<Vec<(Pose, &dyn Shape)>, TldiError>>()?;
        if shapes.is_empty() {
            return Ok(());
        }
        let collider = self.collider;
        let on = points_on(&self.points, &shapes, self.own_margin)
            .map_err(|source| TldiError::Cloud { collider, source })?;
        for list in [&mut self.points, &mut self.normals] {
            remove(list, &on);
        }
        remove(&mut self.radii, &on);
        Ok(())
    }

    /// The cloud of the points, with what was seen of them.
    fn build(
        &self,
        seen: &SeenPoints<'_>,
        recipe: CloudRecipe,
    ) -> Result<PointCloud<'static>, CloudError> {
        let mut builder = PointCloud::builder(&self.points[..]).recipe(recipe);
        if seen.normals.is_some() {
            builder = builder.unoriented_normals(&self.normals[..]);
        }
        if seen.radii.is_some() {
            builder = builder.radii(&self.radii[..]);
        }
        Ok(builder.build()?.into_owned())
    }

    /// Disables the collider, without its points.
    fn clear(
        &mut self,
        tldi: &mut TldiPipeline,
        colliders: &mut ColliderSet,
    ) -> Result<(), TldiError> {
        let collider = self.collider;
        let empty = stand_in().map_err(|source| TldiError::Cloud { collider, source })?;
        tldi.set_collider_cloud(colliders, collider, empty.cloud().clone())?;
        if let Some(collider) = colliders.get_mut(collider) {
            collider.set_enabled(false);
        }
        self.is_hidden = true;
        Ok(())
    }
}

/// What a collider without points consists of: rapier has no empty shape.
fn stand_in() -> Result<PointCloudShape, CloudError> {
    let point = PointCloud::builder(vec![Vector::ZERO]).radius(STAND_IN_RADIUS);
    Ok(PointCloudShape::new(point.build()?))
}

fn get(
    colliders: &ColliderSet,
    handle: ColliderHandle,
) -> Result<&rapier3d::geometry::Collider, TldiError> {
    colliders
        .get(handle)
        .ok_or(TldiError::NoSuchCollider(handle))
}

/// Takes out what is marked; a list without entries stays so.
fn remove<T>(list: &mut Vec<T>, marks: &[bool]) {
    let mut marks = marks.iter();
    list.retain(|_| !marks.next().is_some_and(|mark| *mark));
}

/// Checks what must hold before points are transformed.
fn check(seen: &SeenPoints<'_>, world_from_sensor: &Pose) -> Result<(), CloudError> {
    let expected = seen.points.len();
    let lengths = [
        ("normals", seen.normals.map(<[_]>::len)),
        ("radii", seen.radii.map(<[_]>::len)),
    ];
    for (attribute, actual) in lengths {
        if let Some(actual) = actual.filter(|actual| *actual != expected) {
            return Err(CloudError::LengthMismatch {
                attribute,
                expected,
                actual,
            });
        }
    }
    let translation = world_from_sensor.translation.to_array();
    let pose = translation
        .into_iter()
        .chain(world_from_sensor.rotation.to_array());
    match pose.into_iter().find(|value| !value.is_finite()) {
        None => Ok(()),
        Some(value) => Err(CloudError::BadParameter {
            parameter: "world_from_sensor",
            value,
            expected: "translation and rotation must be finite",
        }),
    }
}
