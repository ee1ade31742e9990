//! What changes the surface of a cloud that is in a world.

use super::TldiPipeline;
use crate::{PointCloudShape, TldiError};
use rapier3d::geometry::{ColliderHandle, ColliderSet};
use rapier3d::math::Vector;
use rapier3d::pipeline::{ActiveHooks, PhysicsWorld};
use tldi::{CloudError, PointCloud};

impl TldiPipeline {
    /// Replaces the points and, where given, the normals (one for each point) of a cloud's
    /// collider, and tells rapier, which wakes the body and what it touches; see
    /// [`PointCloud::set_points`] for radii, and normals that are not given. The body keeps its mass
    /// ([`PointCloudShape::refresh_mass`] lets it follow the points). For the frames of a sensor there is
    /// [`CloudStream`](crate::CloudStream).
    ///
    /// Points of two frames in a row tell how fast the surface comes nearer, or goes away, along the normal of a contact; what
    /// moves by less than 0.2 mean radii a frame counts as noise. How it slides is not known: [`deform`](Self::deform) tells it.
    /// The solver gets the speed if the step has the pipeline's hooks, as [`step`](Self::step) does; the collider's
    /// [`ActiveHooks::MODIFY_SOLVER_CONTACTS`] is set. Cost: for each contact, a pass over the points of the blocks around it
    /// in three frames.
    ///
    /// Called with other points in every step, it keeps what touches the collider awake for ever;
    /// with the points that the cloud has it does nothing. Bodies that share the points keep the
    /// old ones.
    ///
    /// # Errors
    /// [`TldiError::NoSuchCollider`], [`TldiError::NotACloud`], and [`TldiError::Cloud`] where the
    /// points are refused: the collider then keeps the old ones.
    ///
    /// ```
    #[doc = example_world!()]
    /// let sunk: Vec<Vector> = points.iter().map(|p| *p - 0.5 * Vector::Y).collect();
    /// tldi.set_points(&mut world, scan, &sunk, None)?;
    /// for _ in 0..60 {
    ///     tldi.step(&mut world)?;
    /// }
    /// assert!(world.bodies[ball].translation().y < -0.25);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn set_points(
        &mut self,
        world: &mut PhysicsWorld,
        collider: ColliderHandle,
        points: &[Vector],
        normals: Option<&[Vector]>,
    ) -> Result<(), TldiError> {
        self.set_collider_points(&mut world.colliders, collider, points, normals)
    }

    /// [`set_points`](Self::set_points) for split sets.
    ///
    /// # Errors
    /// Those of [`set_points`](Self::set_points).
    ///
    /// ```
    #[doc = example_world!()]
    /// let sunk: Vec<Vector> = points.iter().map(|p| *p - 0.5 * Vector::Y).collect();
    /// tldi.set_collider_points(&mut world.colliders, scan, &sunk, None)?;
    /// assert!((world.colliders[scan].compute_aabb().center().y + 0.5).abs() < 1e-6);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn set_collider_points(
        &mut self,
        colliders: &mut ColliderSet,
        collider: ColliderHandle,
        points: &[Vector],
        normals: Option<&[Vector]>,
    ) -> Result<(), TldiError> {
        let shape = cloud_of(colliders, collider)?;
        if shape.cloud().consists_of(points, normals) {
            self.motions.forget_velocities(collider);
            return Ok(());
        }
        let before = self.motions.snapshot(shape.cloud());
        self.change_shape(colliders, collider, |shape| {
            shape.set_points(points, normals)
        })?;
        self.motions.record_sampled(collider, before);
        Ok(())
    }

    /// Replaces the cloud of a collider as a whole, where [`set_points`](Self::set_points) does not
    /// do: a depth camera's frame brings other points with other radii. Rapier is told, which wakes
    /// the body and what it touches.
    ///
    /// # Errors
    /// [`TldiError::NoSuchCollider`], [`TldiError::NotACloud`].
    ///
    /// ```
    #[doc = example_world!()]
    /// let half = PointCloud::builder(points[..200].to_vec()).radius(0.1).build()?;
    /// tldi.set_cloud(&mut world, scan, half)?;
    /// tldi.step(&mut world)?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn set_cloud(
        &mut self,
        world: &mut PhysicsWorld,
        collider: ColliderHandle,
        cloud: PointCloud<'static>,
    ) -> Result<(), TldiError> {
        self.set_collider_cloud(&mut world.colliders, collider, cloud)
    }

    /// [`set_cloud`](Self::set_cloud) for split sets.
    ///
    /// # Errors
    /// Those of [`set_cloud`](Self::set_cloud).
    ///
    /// ```
    #[doc = example_world!()]
    /// let half = PointCloud::builder(points[..200].to_vec()).radius(0.1).build()?;
    /// tldi.set_collider_cloud(&mut world.colliders, scan, half)?;
    /// assert!(world.colliders[scan].compute_aabb().center().z < 0.5);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn set_collider_cloud(
        &mut self,
        colliders: &mut ColliderSet,
        collider: ColliderHandle,
        cloud: PointCloud<'static>,
    ) -> Result<(), TldiError> {
        let shape = cloud_of(colliders, collider)?;
        if *shape.cloud() == cloud {
            self.motions.forget_velocities(collider);
            return Ok(());
        }
        let before = self.motions.snapshot(shape.cloud());
        self.change_shape(colliders, collider, |shape| {
            shape.set_cloud(cloud);
            Ok(())
        })?;
        self.motions.record_sampled(collider, before);
        Ok(())
    }

    /// Changes the shape of a cloud's collider, and remembers that it was. The hooks see its contacts from now on: they tell
    /// rapier's solver how the surface moves.
    fn change_shape(
        &mut self,
        colliders: &mut ColliderSet,
        collider: ColliderHandle,
        change: impl FnOnce(&mut PointCloudShape) -> Result<(), CloudError>,
    ) -> Result<(), TldiError> {
        // The batch of a step that was not finished shares the shape: without it the change is
        // made in place.
        self.shared.batch_mut().clear();
        let found = (colliders.get_mut(collider)).ok_or(TldiError::NoSuchCollider(collider))?;
        let shape = (found.shape_mut().as_shape_mut()).ok_or(TldiError::NotACloud(collider))?;
        change(shape).map_err(|source| TldiError::Cloud { collider, source })?;
        found.set_active_hooks(found.active_hooks() | ActiveHooks::MODIFY_SOLVER_CONTACTS);
        if !self.changed.contains(&collider) {
            self.changed.push(collider);
        }
        Ok(())
    }

    /// [`set_points`](Self::set_points) for a surface that deforms: the same points, where they are by now. They are taken to
    /// go on with the velocity that brought them there, which reaches the contacts: what stands on a floor that slides or
    /// rises is carried along. If there are several calls since the last step, the points before the first one count.
    ///
    /// The velocity is how far the points moved in their collider's frame, divided by the time since they changed last; until
    /// they change first, by the time since the pipeline's first step. So the speed is right if they come every few steps. The
    /// same points again change nothing. Points go on for as many steps as there were between the last two changes, at most
    /// eight; then they stand still.
    ///
    /// Sets [`ActiveHooks::MODIFY_SOLVER_CONTACTS`] on the collider; the hooks of
    /// [`step_with_events`](Self::step_with_events) see its contacts then, too. Cost beside that of
    /// `set_points`: for each contact, a pass over the points in the blocks around it.
    ///
    /// # Errors
    /// Those of `set_points`, [`TldiError::BadConfig`] if the time step is negative or not finite, and
    /// [`TldiError::OtherPoints`] if there are not as many points as the cloud was given before. Points that are not finite
    /// count: they are dropped, and have no velocity when they come back.
    ///
    /// ```
    /// use rapier3d::prelude::*;
    /// use rapier3d_tldi::prelude::*;
    /// let mut world = PhysicsWorld::default();
    /// let mut tldi = TldiPipeline::new(TldiConfig::default())?;
    /// tldi.attach(&mut world);
    /// let mut points: Vec<Vector> = (0..441)
    ///     .map(|i| Vector::new((i % 21) as f32, 0.0, (i / 21) as f32) * 0.05)
    ///     .collect();
    /// let belt = PointCloud::builder(&points).radius(0.05).build()?.into_owned();
    /// let (_, belt) = world.insert(RigidBodyBuilder::fixed(), tldi.collider(belt));
    /// let start = Vector::new(0.2, 0.1, 0.5);
    /// let parcel = RigidBodyBuilder::dynamic().translation(start);
    /// let (parcel, _) = world.insert(parcel, ColliderBuilder::cuboid(0.1, 0.1, 0.1));
    /// for _ in 0..30 {
    ///     for point in &mut points {
    ///         point.x += 0.6 * world.integration_parameters.dt; // 0.6 m/s
    ///     }
    ///     tldi.deform(&mut world, belt, &points, None)?;
    ///     tldi.step(&mut world)?;
    /// }
    /// assert!(world.bodies[parcel].linvel().x > 0.5);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn deform(
        &mut self,
        world: &mut PhysicsWorld,
        collider: ColliderHandle,
        points: &[Vector],
        normals: Option<&[Vector]>,
    ) -> Result<(), TldiError> {
        let dt = world.integration_parameters.dt;
        self.deform_collider(&mut world.colliders, collider, points, normals, dt)
    }

    /// [`deform`](Self::deform) for split sets and steps of `dt` seconds each, also if the points come every few steps only.
    /// Give the step [`hooks`](Self::hooks).
    ///
    /// # Errors
    /// Those of [`deform`](Self::deform).
    ///
    /// ```
    #[doc = example_world!()]
    /// let moved: Vec<Vector> = points.iter().map(|p| *p + 0.01 * Vector::X).collect(); // 0.6 m/s
    /// tldi.deform_collider(&mut world.colliders, scan, &moved, None, 1.0 / 60.0)?;
    /// assert!(world.colliders[scan].active_hooks().contains(ActiveHooks::MODIFY_SOLVER_CONTACTS));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn deform_collider(
        &mut self,
        colliders: &mut ColliderSet,
        collider: ColliderHandle,
        points: &[Vector],
        normals: Option<&[Vector]>,
        dt: f32,
    ) -> Result<(), TldiError> {
        TldiError::check_dt(dt)?;
        let cloud = cloud_of(colliders, collider)?.cloud();
        let expected = cloud.len() + cloud.dropped();
        if expected != points.len() {
            return Err(TldiError::OtherPoints {
                collider,
                expected,
                found: points.len(),
            });
        }
        if cloud.lies_at(points, normals) {
            return Ok(());
        }
        let before = self.motions.before(cloud);
        self.change_shape(colliders, collider, |shape| {
            shape.move_points(points, normals)
        })?;
        let after = cloud_of(colliders, collider)?;
        self.motions.record(collider, before, after, dt);
        Ok(())
    }
}

/// The shape of a cloud's collider.
fn cloud_of(
    colliders: &ColliderSet,
    collider: ColliderHandle,
) -> Result<&PointCloudShape, TldiError> {
    let found = colliders
        .get(collider)
        .ok_or(TldiError::NoSuchCollider(collider))?;
    let shape = found.shape().as_shape();
    shape.ok_or(TldiError::NotACloud(collider))
}
