//! The surface that rays and projections see: a disc for each point.

use crate::PointCloudShape;
use rapier3d::glamx::Vec3;
use rapier3d::parry::bounding_volume::{Aabb, BoundingVolume};
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

    /// Whether `point`, whose nearest sample this is, lies behind the surface, if the cloud tells its outside. Beyond an edge
    /// the nearest sample may belong to the face around the corner: of those within two radii of it, the one whose normal is
    /// most along the way to the point decides.
    pub(crate) fn is_behind(&self, nearest: usize, point: Vec3) -> bool {
        let cloud = self.cloud();
        let Some(normals) = cloud.normals().filter(|_| cloud.normals_oriented()) else {
            return false;
        };
        let sample = cloud.point(nearest);
        let offset = point - sample;
        let reach = 2.0 * cloud.radius(nearest);
        let around = Aabb::new(sample, sample).loosened(reach);
        let is_near = |leaf: &u32| cloud.point(*leaf as usize).distance(sample) <= reach;
        let along = |leaf: u32| normals[leaf as usize].dot(offset);
        let near = self.bvh().intersect_aabb(&around).filter(is_near);
        let order = |a: &u32, b: &u32| {
            let by_way = along(*a).abs().total_cmp(&along(*b).abs());
            by_way.then(b.cmp(a))
        };
        near.max_by(order).is_some_and(|leaf| along(leaf) < 0.0)
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
    /// sample. Where normals are oriented, a point behind the discs is inside; for an open scan
    /// that is all that lies behind it. Far beyond a sharp edge or tip, one in a hundred points may count to the wrong
    /// side. A point that is not finite is its own projection.
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
        (
            PointProjection::new(self.is_behind(index, point), foot),
            feature,
        )
    }
}
