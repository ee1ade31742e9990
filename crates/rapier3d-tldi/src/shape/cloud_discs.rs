//! The surface that rays and projections see: a disc for each point.

use crate::PointCloudShape;
use rapier3d::glamx::Vec3;
use rapier3d::parry::partitioning::BvhNode;
use rapier3d::parry::query::{PointProjection, PointQuery, Ray, RayCast, RayIntersection};
use rapier3d::parry::shape::FeatureId;

impl PointCloudShape {
    /// Index of the point nearest to `point`; `None` if that is not finite.
    pub(crate) fn nearest(&self, point: Vec3) -> Option<usize> {
        self.bvh()
            .find_best(
                f32::MAX,
                |node: &BvhNode, _| node.aabb().distance_to_local_point(point, true),
                |leaf, _| Some(self.cloud().point(leaf as usize).distance(point)),
            )
            .map(|(leaf, _)| leaf as usize)
    }

    /// Where the line of `ray` passes through the disc of a point, in units of the direction.
    fn disc_hit(&self, index: usize, ray: &Ray) -> Option<f32> {
        let cloud = self.cloud();
        let to_point = cloud.point(index) - ray.origin;
        let normal = cloud.normals().map_or(ray.dir, |normals| normals[index]);
        let t = normal.dot(to_point) / normal.dot(ray.dir);
        let in_disc = (t * ray.dir - to_point).length() <= cloud.radius(index);
        (t >= 0.0 && in_disc).then_some(t)
    }
}

impl RayCast for PointCloudShape {
    /// The first disc that the ray passes, see [`PointCloudShape`]; the feature is the point's
    /// index and the normal is turned towards the ray, as with meshes. A cloud is a surface:
    /// `solid` has no effect.
    fn cast_local_ray_and_get_normal(
        &self,
        ray: &Ray,
        max_time_of_impact: f32,
        _solid: bool,
    ) -> Option<RayIntersection> {
        let (leaf, t) = self.bvh().find_best(
            max_time_of_impact,
            |node: &BvhNode, best| node.cast_ray(ray, best),
            |leaf, _| self.disc_hit(leaf as usize, ray),
        )?;
        let normal = self.cloud().normals().map_or(-ray.dir, |normals| {
            let normal = normals[leaf as usize];
            if normal.dot(ray.dir) > 0.0 {
                -normal
            } else {
                normal
            }
        });
        let feature = FeatureId::Vertex(leaf);
        Some(RayIntersection::new(t, normal.normalize_or_zero(), feature))
    }
}

impl PointQuery for PointCloudShape {
    /// As [`project_local_point_and_get_feature`](Self::project_local_point_and_get_feature), but
    /// with `solid` a point inside is its own projection.
    fn project_local_point(&self, point: Vec3, solid: bool) -> PointProjection {
        let (projection, _) = self.project_local_point_and_get_feature(point);
        if solid && projection.is_inside {
            return PointProjection::new(true, point);
        }
        projection
    }

    /// The point of the nearest sample's disc that is nearest to `point`, and the index of that
    /// sample. Where normals are oriented, a point behind the disc is inside; for an open scan
    /// that is all that lies behind it. A point that is not finite is its own projection.
    fn project_local_point_and_get_feature(&self, point: Vec3) -> (PointProjection, FeatureId) {
        let Some(index) = self.nearest(point) else {
            return (PointProjection::new(false, point), FeatureId::Unknown);
        };
        let cloud = self.cloud();
        let sample = cloud.point(index);
        let feature = FeatureId::Vertex(index as u32);
        let Some(normals) = cloud.normals() else {
            return (PointProjection::new(false, sample), feature);
        };
        let height = normals[index].dot(point - sample);
        let along = point - sample - height * normals[index];
        let foot = sample + along.clamp_length_max(cloud.radius(index));
        let is_inside = cloud.normals_oriented() && height < 0.0;
        (PointProjection::new(is_inside, foot), feature)
    }
}
