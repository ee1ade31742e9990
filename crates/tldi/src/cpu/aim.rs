//! Stage `aim`: the axes from which the contact zone is looked at.
//!
//! The first axis is the top eigenvector of Σ n nᵀ over the near points of both surfaces. A camera
//! along it sees the touching surfaces as flat as can be; an axis along the motion alone would look
//! along the surface whenever bodies slide, spin or rest. Where both surfaces also meet on faces
//! that this axis sees edge-on (a corner, a groove), up to two more axes follow.

use crate::AXIS_HYSTERESIS;
use crate::normals::least_variance_axis;
use glamx::{DMat3, DVec3, Mat3, Vec3};

/// Most views of one pair: three axes span all directions.
pub(crate) const MAX_VIEWS: usize = 3;

/// A normal within this of the axis is well seen: cos 50°. Depth errors of splats grow as the
/// tangent beyond.
const WELL_SEEN: f32 = 0.643;

/// The other side must face a further axis within 60° ...
const SUPPORTED: f32 = 0.5;

/// ... with at least this share of its near points. Fewer is noise at the rim of the zone.
const LEAST_SHARE: f32 = 0.05;

/// Mean of n·v, over the normals that face an axis, below which their signs say nothing about the
/// side (a ring around a deep contact has its normals all around the axis); likewise the least
/// cosine between an axis and a hint.
const CONCLUSIVE: f32 = 0.3;

/// Weight of the hint's direction beside the normals of a surface: decides where normals point all
/// around (balls deep in each other), and turns the axis of a flat contact by 3° at the most.
const HINT_WEIGHT: f32 = 0.1;

/// Normals of the near points of one surface.
pub(crate) struct ZoneNormals<'a> {
    pub(crate) normals: &'a [Vec3],
    /// Whether their sign is outward.
    pub(crate) oriented: bool,
}

/// What else decides the side on which the second surface is.
pub(crate) struct Hint {
    /// From the first surface towards the second.
    pub(crate) toward_b: Vec3,
    /// The main axis of the frame before.
    pub(crate) last_axis: Option<Vec3>,
}

/// The axes, unit vectors from `b` towards `a`; at least one. Empty normals on either side give
/// the hint's axis.
pub(crate) fn aim(a: &ZoneNormals, b: &ZoneNormals, hint: &Hint, axes: &mut Vec<Vec3>) {
    axes.clear();
    let mut seen: [Vec3; MAX_VIEWS] = [Vec3::ZERO; MAX_VIEWS];
    let mut views = 0;
    while views < MAX_VIEWS {
        let unseen = |n: &Vec3| seen[..views].iter().all(|v| v.dot(*n).abs() < WELL_SEEN);
        let share = |s: &ZoneNormals, keep: &dyn Fn(&Vec3) -> bool| {
            s.normals.iter().filter(|n| keep(n)).count() as f32 / s.normals.len().max(1) as f32
        };
        let mut covariance = covariance(a.normals, &unseen) + covariance(b.normals, &unseen);
        if views == 0 {
            covariance += HINT_WEIGHT * outer(hint.toward_b.normalize_or_zero());
        }
        let Some(mut axis) = top_eigenvector(&covariance) else {
            break;
        };
        if views > 0 {
            let (left_a, left_b) = (share(a, &unseen), share(b, &unseen));
            let supports = |n: &Vec3| axis.dot(*n).abs() >= SUPPORTED;
            let worthwhile = left_a.max(left_b) >= LEAST_SHARE
                && share(a, &supports) >= LEAST_SHARE
                && share(b, &supports) >= LEAST_SHARE;
            if !worthwhile {
                break;
            }
        } else if let Some(last) = hint.last_axis
            && axis.dot(last).abs() >= AXIS_HYSTERESIS.cos()
        {
            axis = last;
        }
        let (axis, conclusive) = oriented(axis, a, b, hint);
        if views > 0 && !conclusive {
            // A guess at the side would turn a gap into a penetration.
            break;
        }
        seen[views] = axis;
        axes.push(axis);
        views += 1;
    }
    if axes.is_empty() {
        let fallback = hint.last_axis.unwrap_or(-hint.toward_b);
        axes.push(fallback.try_normalize().unwrap_or(Vec3::Z));
    }
}

/// The axis or its opposite, such that it points from `b` towards `a`; and whether anything told.
fn oriented(axis: Vec3, a: &ZoneNormals, b: &ZoneNormals, hint: &Hint) -> (Vec3, bool) {
    let mean_along = |s: &ZoneNormals| {
        let facing = || {
            s.normals
                .iter()
                .map(|n| n.dot(axis))
                .filter(|d| d.abs() >= SUPPORTED)
        };
        let count = facing().count() as f32;
        if !s.oriented || count < LEAST_SHARE * s.normals.len() as f32 {
            return 0.0;
        }
        facing().sum::<f32>() / count.max(1.0)
    };
    let by_normals = mean_along(b) - mean_along(a);
    let by_memory = hint.last_axis.map_or(0.0, |last| axis.dot(last));
    let by_position = -axis.dot(hint.toward_b.normalize_or_zero());
    let sign = [by_normals, by_memory, by_position]
        .into_iter()
        .find(|s| s.abs() >= CONCLUSIVE);
    let flip = sign.unwrap_or(by_position) < 0.0;
    (if flip { -axis } else { axis }, sign.is_some())
}

/// Mean of n nᵀ over all normals, counting those that `keep` accepts.
fn covariance(normals: &[Vec3], keep: &dyn Fn(&Vec3) -> bool) -> Mat3 {
    let sum = normals
        .iter()
        .filter(|n| keep(n))
        .fold(Mat3::ZERO, |m, &n| m + outer(n));
    sum * (1.0 / normals.len().max(1) as f32)
}

fn outer(n: Vec3) -> Mat3 {
    Mat3::from_cols(n * n.x, n * n.y, n * n.z)
}

fn top_eigenvector(m: &Mat3) -> Option<Vec3> {
    let trace = m.x_axis.x + m.y_axis.y + m.z_axis.z;
    if trace.is_nan() || trace <= 0.0 {
        return None;
    }
    // The largest eigenvalue of m is the least of trace − m.
    let rest = DMat3::from_diagonal(DVec3::splat(f64::from(trace))) - m.as_dmat3();
    least_variance_axis(rest).as_vec3().try_normalize()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn hint(toward_b: Vec3) -> Hint {
        Hint {
            toward_b,
            last_axis: None,
        }
    }

    fn zone(normals: &[Vec3], oriented: bool) -> ZoneNormals<'_> {
        ZoneNormals { normals, oriented }
    }

    #[test]
    fn facing_planes_give_one_axis_from_b_to_a() {
        let (up, down) = (vec![Vec3::Y; 50], vec![-Vec3::Y; 30]);
        let mut axes = vec![];
        // Oriented normals beat a wrong hint.
        aim(
            &zone(&up, true),
            &zone(&down, true),
            &hint(-Vec3::Y),
            &mut axes,
        );
        assert_eq!(axes, [-Vec3::Y]);
        // Without orientation the hint decides.
        aim(
            &zone(&up, false),
            &zone(&down, false),
            &hint(-Vec3::Y),
            &mut axes,
        );
        assert_eq!(axes, [Vec3::Y]);
    }

    #[test]
    fn a_corner_gives_two_axes_and_a_box_on_a_floor_one() {
        let corner = [vec![Vec3::Y; 50], vec![Vec3::X; 30]].concat();
        let edges = [vec![-Vec3::Y; 20], vec![-Vec3::X; 20]].concat();
        let mut axes = vec![];
        aim(
            &zone(&corner, true),
            &zone(&edges, true),
            &hint(Vec3::Y),
            &mut axes,
        );
        assert_eq!(axes, [-Vec3::Y, -Vec3::X]);
        let floor = vec![Vec3::Y; 50];
        aim(
            &zone(&floor, true),
            &zone(&edges, true),
            &hint(Vec3::Y),
            &mut axes,
        );
        assert_eq!(axes, [-Vec3::Y]);
    }

    #[test]
    fn the_last_axis_is_kept_within_the_hysteresis() {
        let tilted = |angle: f32| vec![Vec3::new(angle.sin(), angle.cos(), 0.0); 10];
        for (angle, kept) in [(0.1, true), (0.3, false)] {
            let normals = tilted(angle);
            let mut axes = vec![];
            aim(
                &zone(&normals, false),
                &zone(&normals, false),
                &Hint {
                    toward_b: Vec3::Y,
                    last_axis: Some(-Vec3::Y),
                },
                &mut axes,
            );
            assert_eq!(axes[0] == -Vec3::Y, kept, "{angle}");
            // Memory also keeps the side.
            assert!(axes[0].y < 0.0);
        }
    }
}
