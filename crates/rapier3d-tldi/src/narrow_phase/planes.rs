//! One manifold a plane, over all parts of a pair.
//!
//! Rapier solves at most four points a plane and, where several manifolds lie on one, takes the
//! deepest and those farthest from it in every step. Among points that differ by less than a
//! measurement scatters that choice changes from step to step and can drop the ones that bear the
//! load, so that a compound would never rest. Here it is made once a measurement.

use crate::narrow_phase::parts::ShapePair;
use rapier3d::geometry::ContactManifold;
use tldi::{ContactPoint, PATCH_POINTS, SAME_PLANE, supports};

/// Merges the manifolds of each plane into the first of them, which keeps the names of its parts;
/// their points are in the frames of the colliders. `scatter`, in metres, is what gaps scatter by.
pub(crate) fn share_planes(
    pair: &ShapePair<'_>,
    scatter: f32,
    manifolds: &mut Vec<ContactManifold>,
) {
    let mut first = 0;
    while first < manifolds.len() {
        let normal = manifolds[first].local_n1;
        let mut other = first + 1;
        while other < manifolds.len() {
            if manifolds[other].local_n1.dot(normal) >= SAME_PLANE {
                let merged = manifolds.remove(other);
                manifolds[first].points.extend(merged.points);
            } else {
                other += 1;
            }
        }
        if manifolds[first].points.len() > PATCH_POINTS {
            keep_supports(pair, scatter, &mut manifolds[first]);
        }
        first += 1;
    }
}

/// Leaves a manifold the points that a body would rest on, the deepest among them.
fn keep_supports(pair: &ShapePair<'_>, scatter: f32, manifold: &mut ContactManifold) {
    let points: Vec<ContactPoint> = manifold
        .points
        .iter()
        .map(|point| ContactPoint {
            point_a: point.local_p1,
            point_b: pair.pos12 * point.local_p2,
            gap: point.dist,
        })
        .collect();
    let mut kept = supports(&points, manifold.local_n1, scatter).indices;
    kept.sort_by(|&k, &l| points[k].gap.total_cmp(&points[l].gap));
    let deepest = (0..points.len()).min_by(|&k, &l| points[k].gap.total_cmp(&points[l].gap));
    if let Some(deepest) = deepest.filter(|&k| points[k].gap < points[kept[0]].gap - scatter) {
        kept.truncate(PATCH_POINTS - 1);
        kept.push(deepest);
    }
    let all = std::mem::take(&mut manifold.points);
    manifold.points.extend(kept.into_iter().map(|k| all[k]));
}
