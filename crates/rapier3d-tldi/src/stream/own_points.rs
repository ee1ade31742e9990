//! Takes a sensor's own carrier out of what it sees.

use crate::narrow_phase::parts::{cloud_of, part, part_count};
use crate::{ExactShape, PointCloudShape};
use rapier3d::math::{Pose, Vector};
use rapier3d::parry::bounding_volume::BoundingVolume;
use rapier3d::parry::shape::Shape;
use rayon::prelude::*;
use tldi::{CloudError, RaySurface};

/// Whether each point lies on or in one of `shapes`, such as the links of the robot that carries the
/// sensor. In parallel; the result does not depend on the number of threads.
///
/// Points and the poses of the shapes are in one frame. `margin` says how far off the surface its points are
/// seen, in metres: three standard deviations of the sensor's noise, and what the model of the robot is wrong
/// by.
///
/// - A shape of rapier's has the points within the margin of its surface, and those inside if it has an
///   inside.
/// - A cloud with normals has those up to the margin above its surface (and within the margin and the radius of a
///   sample), and those behind it; one without has those within the margin and the radius of a sample.
///
/// Cost: a box test for each point and shape, and a search in the shape's tree where that is met.
///
/// # Errors
/// [`CloudError::BadParameter`] for a margin that is negative or not finite.
///
/// ```
/// use rapier3d::prelude::*;
/// use rapier3d_tldi::points_on;
/// let arm = SharedShape::capsule_y(0.5, 0.1);
/// let pose = Pose::from_translation(Vector::X);
/// let seen = [Vector::new(1.11, 0.2, 0.0), Vector::new(1.3, 0.2, 0.0)];
/// assert_eq!(points_on(&seen, &[(pose, &*arm)], 0.02)?, [true, false]);
/// # Ok::<(), rapier3d_tldi::CloudError>(())
/// ```
pub fn points_on(
    points: &[Vector],
    shapes: &[(Pose, &dyn Shape)],
    margin: f32,
) -> Result<Vec<bool>, CloudError> {
    if !(margin.is_finite() && margin >= 0.0) {
        return Err(CloudError::BadParameter {
            parameter: "margin",
            value: margin,
            expected: "metres off a surface, finite and not negative",
        });
    }
    let parts: Vec<_> = (shapes.iter())
        .flat_map(|(pose, shape)| {
            (0..part_count(*shape)).map(move |i| {
                let (whole_from_part, part) = part(*shape, i);
                let pose = whole_from_part.map_or(*pose, |part| *pose * *part);
                (
                    pose.inverse(),
                    part,
                    part.compute_aabb(&pose).loosened(margin),
                )
            })
        })
        .collect();
    let is_on = |point: &Vector| {
        parts.iter().any(|(part_from_points, part, bounds)| {
            bounds.contains_local_point(*point)
                && is_on_part(*part, *part_from_points * *point, margin)
        })
    };
    Ok(points.par_iter().map(is_on).collect())
}

/// Whether a point in the frame of the part lies on or in it.
fn is_on_part(part: &dyn Shape, point: Vector, margin: f32) -> bool {
    if let Some(cloud) = cloud_of(part) {
        return is_on_cloud(cloud, point, margin);
    }
    let surface = ExactShape(part);
    let (distance, _) = surface.project(point);
    distance <= margin && (distance >= -margin || surface.is_closed())
}

fn is_on_cloud(shape: &PointCloudShape, point: Vector, margin: f32) -> bool {
    let Some(nearest) = shape.nearest(point) else {
        return false;
    };
    let cloud = shape.cloud();
    let offset = point - cloud.point(nearest);
    let is_near = offset.length() <= margin + cloud.radius(nearest);
    let Some(normals) = cloud.normals() else {
        return is_near;
    };
    let normal = normals[nearest];
    let height = offset.dot(normal);
    if !cloud.normals_oriented() {
        return is_near && height.abs() <= margin;
    }
    is_near && height <= margin || shape.is_behind(nearest, point)
}
