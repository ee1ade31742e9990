//! Shapes known only through their own ray casts and projections.

use super::distance::Projection;
use super::line::Line;
use rapier3d::glamx::{DVec3, Vec3};
use rapier3d::parry::query::Ray;
use rapier3d::parry::shape::{FeatureId, Shape};
use tldi::RayHit;

/// Part of the shape's size that a cast restarts behind a hit. Half or twice: no test of shapes or queries fails.
const STEP: f32 = 1e-5;

/// Most crossings of one ray that are looked for. Half or twice: no test of shapes or queries fails.
const MAX_CROSSINGS: usize = 4096;

pub(super) fn crossings(shape: &dyn Shape, line: &Line, hits: &mut Vec<RayHit>) {
    let sphere = shape.compute_local_bounding_sphere();
    let step = STEP * (sphere.radius + sphere.center.length());
    let direction = line.direction.as_vec3();
    let mut start = 0.0f32;
    for _ in 0..MAX_CROSSINGS {
        let ray = Ray::new(line.at(start.into()).as_vec3(), direction);
        let rest = line.max as f32 - start;
        if rest < 0.0 {
            return;
        }
        let Some(hit) = shape.cast_local_ray_and_get_normal(&ray, rest, false) else {
            return;
        };
        let t = start + hit.time_of_impact;
        let is_inside = |t: f32| shape.contains_local_point(line.at(t.into()).as_vec3());
        // Normals of hits from inside may be turned towards the ray: the inside tells.
        let outward = match (is_inside(t - step), is_inside(t + step)) {
            (false, true) => -1.0,
            (true, false) => 1.0,
            _ => hit.normal.dot(direction).signum(),
        };
        let normal = hit.normal * (outward * hit.normal.dot(direction).signum());
        line.push(t.into(), normal.as_dvec3(), hits);
        start = t + step;
    }
}

pub(super) fn project(shape: &dyn Shape, point: Vec3) -> Projection {
    let (projection, feature) = shape.project_local_point_and_get_feature(point);
    let delta = (point - projection.point).as_dvec3();
    let side = if projection.is_inside { -1.0 } else { 1.0 };
    let normal = delta.try_normalize().map(|n| side * n).or_else(|| {
        let (subshape, at) = (projection.subshape, projection.point);
        (feature != FeatureId::Unknown)
            .then(|| shape.feature_normal_at_point(subshape, feature, at))
            .flatten()
            .map(Vec3::as_dvec3)
    });
    // The last resort points away from the middle.
    let normal = normal.unwrap_or_else(|| {
        let center = shape.compute_local_bounding_sphere().center;
        (point - center)
            .as_dvec3()
            .try_normalize()
            .unwrap_or(DVec3::Y)
    });
    (side * delta.length(), normal)
}
