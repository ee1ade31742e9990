//! Normals: as given, or by principal component analysis of neighbours.

use crate::{CloudError, KdTree};
use glamx::{DMat3, DSymmetricEigen3, DVec3, Vec3};

/// Unit normal of the plane that best fits a position and its neighbours: the direction of least
/// variance (Hoppe et al. 1992, doi:10.1145/133994.134011). With a viewpoint it points to its side of the
/// surface, else either way.
pub(crate) fn plane_normal(
    position: Vec3,
    neighbors: impl Iterator<Item = Vec3>,
    viewpoint: Option<Vec3>,
) -> Vec3 {
    let origin = position.as_dvec3();
    let offsets = neighbors.map(|neighbor| neighbor.as_dvec3() - origin);
    let normal = least_variance_axis(covariance(offsets.chain([DVec3::ZERO])));
    let away = viewpoint.is_some_and(|v| (v.as_dvec3() - origin).dot(normal) < 0.0);
    (if away { -normal } else { normal }).as_vec3()
}

/// Covariance of points given by their offsets from a point near them; not divided by their
/// number.
pub(crate) fn covariance(offsets: impl Iterator<Item = DVec3>) -> DMat3 {
    let (mut count, mut sum, mut moment) = (0.0, DVec3::ZERO, DMat3::ZERO);
    for d in offsets {
        count += 1.0;
        sum += d;
        moment += DMat3::from_cols(d * d.x, d * d.y, d * d.z);
    }
    let mean = sum / count;
    moment - DMat3::from_cols(sum * mean.x, sum * mean.y, sum * mean.z)
}

/// The unit eigenvector of the least eigenvalue of a symmetric positive semi-definite matrix.
///
/// Where it is not unique, one of those that fit: any direction across a line of points; z for
/// points that coincide.
///
/// Of the two outer eigenvalues one is well apart from the middle one. Its eigenvector is computed
/// first (Eberly, "A robust eigensolver for 3 × 3 symmetric matrices"), since that of a nearly
/// double eigenvalue would be noise; what remains is a 2 × 2 problem across it.
pub(crate) fn least_variance_axis(covariance: DMat3) -> DVec3 {
    let largest = covariance
        .to_cols_array()
        .into_iter()
        .fold(0.0, |a: f64, b| a.max(b.abs()));
    if largest == 0.0 {
        return DVec3::Z;
    }
    // The solver compares with absolute thresholds.
    let scaled = covariance * (1.0 / largest);
    let [least, middle, greatest] = DSymmetricEigen3::eigenvalues(scaled).to_array();
    if middle - least > greatest - middle {
        return DSymmetricEigen3::eigenvector1(scaled, least);
    }
    let along = DSymmetricEigen3::eigenvector1(scaled, greatest);
    let (u, v) = along.any_orthonormal_pair();
    let (uu, uv, vv) = (u.dot(scaled * u), u.dot(scaled * v), v.dot(scaled * v));
    let angle = 0.5 * (2.0 * uv).atan2(uu - vv);
    v * angle.cos() - u * angle.sin()
}

/// Makes every given normal a unit vector; whether all were usable. Zero and non-finite ones
/// become zero.
pub(crate) fn normalize(normals: &mut [Vec3]) -> bool {
    let mut usable = true;
    for normal in normals {
        *normal = unit_or_zero(*normal);
        usable &= *normal != Vec3::ZERO;
    }
    usable
}

/// A given normal as a unit vector; zero if it tells no direction.
pub(crate) fn unit_or_zero(normal: Vec3) -> Vec3 {
    if normal.is_normalized() {
        return normal;
    }
    // In f64 neither the squares of the smallest nor of the largest f32 leave the range.
    let unit = normal.as_dvec3().try_normalize();
    unit.map_or(Vec3::ZERO, |n| n.as_vec3())
}

/// Turns the normals of `points` to the side of `viewpoint`.
pub(crate) fn turn_towards(viewpoint: Vec3, points: &[Vec3], normals: &mut [Vec3]) {
    for (normal, point) in normals.iter_mut().zip(points) {
        if (viewpoint - *point).dot(*normal) < 0.0 {
            *normal = -*normal;
        }
    }
}

/// Replaces the zero normals by that of the nearest point which has one.
pub(crate) fn fill_from_nearest(normals: &mut [Vec3], points: &[Vec3]) -> Result<(), CloudError> {
    let usable: Vec<usize> = (0..normals.len())
        .filter(|&i| normals[i] != Vec3::ZERO)
        .collect();
    if usable.is_empty() {
        return Err(CloudError::NoUsableNormal {
            count: normals.len(),
        });
    }
    let of_usable: Vec<Vec3> = usable.iter().map(|&i| points[i]).collect();
    let tree = KdTree::from_points(&of_usable);
    for i in 0..normals.len() {
        if normals[i] == Vec3::ZERO
            && let Some(nearest) = tree.nearest(points[i], f32::INFINITY)
        {
            normals[i] = normals[usable[nearest.index]];
        }
    }
    Ok(())
}
