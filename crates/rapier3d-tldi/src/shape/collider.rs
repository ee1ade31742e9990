//! Clouds as colliders.

use crate::PointCloudShape;
use rapier3d::geometry::{ColliderBuilder, SharedShape};
use rapier3d::pipeline::ActiveHooks;

/// A collider for a cloud, or for one of several bodies that share a cloud (clones of the shape
/// share the points).
///
/// The collider has [`ActiveHooks::FILTER_INTERSECTION_PAIR`] set: rapier then asks for its
/// contacts in every step. Without any hook flag rapier keeps a pair's contacts while the relative
/// pose drifts by less than 5 cm (`normalized_contact_recycle_distance`), which for a body of
/// 15 cm means deep penetration. For a cloud in a collider of another make, such as a compound, set the
/// flag yourself; a pipeline warns once in the [`log`] where it is missing. Of the flags this one has the
/// fewest side effects: user hooks see the pairs of the collider only where one is a sensor.
///
/// ```
/// use rapier3d::prelude::*;
/// use rapier3d_tldi::{cloud_collider, prelude::*};
/// let points: Vec<Vector> = (0..100)
///     .map(|i| Vector::new((i % 10) as f32, 0.0, (i / 10) as f32))
///     .collect();
/// let shape = PointCloudShape::new(PointCloud::builder(points).radius(0.8).build()?);
/// let mut world = PhysicsWorld::default();
/// for i in 0..3 {
///     let body = RigidBodyBuilder::fixed().translation(Vector::Y * i as f32);
///     world.insert(body, cloud_collider(shape.clone()).friction(0.8));
/// }
/// # Ok::<(), CloudError>(())
/// ```
pub fn cloud_collider(shape: PointCloudShape) -> ColliderBuilder {
    ColliderBuilder::new(SharedShape::new(shape))
        .active_hooks(ActiveHooks::FILTER_INTERSECTION_PAIR)
}
