//! The main direction of the near points' normals: an eigenvector of Σ n nᵀ or, where several faces are alike, one of them.

use crate::cloud::point_normals::least_variance_axis;
use crate::view::zone_normals::ZoneNormals;
use glamx::{DMat3, DVec3, Mat3, Vec3};

/// Share of the normals along an axis that another direction across it must have for both to be alike, as a floor and
/// a wall are: then any direction between is as good an eigenvector, and the axis turns to one of them. With 0 a box's
/// edge takes the axis from the floor that it stands on, and shallow depths are three times as wrong. Half: a ring meets its
/// pole badly; twice, which is never: corners are missed, too.
const ALIKE: f32 = 0.7;

/// Steps in which the axis turns to a face. The angle to it shrinks with its cube: eight are enough from 1° off the middle
/// between two. With half, one of 160 contacts in corners is missed; twice: no change.
const TURNS: usize = 8;

/// Least mean of (n·v)⁴, as a share of that of (n·v)², of faces across v. It is 1 of flat ones and 0.6 of normals in all
/// directions, as around two balls that are deep in each other, whose axis then stays as it is. Half and twice: as for
/// [`ALIKE`].
const FLAT: f32 = 0.7;

/// For [`stage_constants`](crate::pair::plan::stage_constants).
pub(crate) const CONSTANTS: [(&str, f64); 3] = [
    ("ALIKE", ALIKE as f64),
    ("TURNS", TURNS as f64),
    ("FLAT", FLAT as f64),
];

/// Mean of n nᵀ over the normals of both sides, each as `map` makes it, if it keeps it.
pub(crate) fn zone_covariance(
    sides: &[ZoneNormals; 2],
    map: impl Fn(Vec3) -> Option<Vec3>,
) -> Mat3 {
    let [a, b] = sides.each_ref().map(|side| {
        let kept = side.normals.iter().filter_map(|n| map(*n));
        let sum = kept.fold(Mat3::ZERO, |m, n| m + outer(n));
        sum * (1.0 / side.normals.len().max(1) as f32)
    });
    a + b
}

/// n nᵀ.
pub(crate) fn outer(n: Vec3) -> Mat3 {
    Mat3::from_cols(n * n.x, n * n.y, n * n.z)
}

/// Unit eigenvector of the largest eigenvalue, if there is one above zero.
pub(crate) fn top_eigenvector(m: &Mat3) -> Option<Vec3> {
    let trace = m.x_axis.x + m.y_axis.y + m.z_axis.z;
    if trace.is_nan() || trace <= 0.0 {
        return None;
    }
    // The largest eigenvalue of m is the least of trace − m.
    let rest = DMat3::from_diagonal(DVec3::splat(f64::from(trace))) - m.as_dmat3();
    least_variance_axis(rest).as_vec3().try_normalize()
}

/// Whether another direction across `axis` has nearly as much of the normals' covariance.
fn is_one_of_alike(covariance: &Mat3, axis: Vec3) -> bool {
    let along = |v: Vec3| v.dot(*covariance * v);
    let onto = Mat3::IDENTITY - outer(axis);
    let across = top_eigenvector(&(onto * *covariance * onto));
    across.is_some_and(|other| along(other) >= ALIKE * along(axis))
}

/// The axis turned to the face that it is nearest to: towards the next maximum of the mean of (n·v)⁴ over the normals of
/// both sides, each as `map` makes it. The axis itself, if no other direction is like it or there are no faces: `covariance`
/// is the mean of n nᵀ.
pub(crate) fn turned_to_face(
    sides: &[ZoneNormals; 2],
    axis: Vec3,
    covariance: &Mat3,
    map: impl Fn(Vec3) -> Option<Vec3>,
) -> Vec3 {
    if !is_one_of_alike(covariance, axis) {
        return axis;
    }
    let (mut turned, mut flatness) = (axis, 0.0);
    for _ in 0..TURNS {
        let [a, b] = sides.each_ref().map(|side| {
            let kept = side.normals.iter().filter_map(|n| map(*n));
            let pulls = kept.map(|n| n.dot(turned).powi(3) * n);
            pulls.sum::<Vec3>() / side.normals.len().max(1) as f32
        });
        let pull = a + b;
        flatness = pull.dot(turned) / turned.dot(*covariance * turned);
        turned = pull.normalize_or(turned);
    }
    if flatness >= FLAT { turned } else { axis }
}
