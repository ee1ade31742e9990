//! The contacts of all parts of a pair in one frame, one patch a plane.
//!
//! Rapier solves at most four points a plane and, where several manifolds lie on one, takes the
//! deepest and those farthest from it in every step. Among points that differ by less than a
//! measurement scatters that choice changes from step to step and can drop the ones that bear the
//! load, so that a compound would never rest. Here it is made once a measurement.

use crate::narrow_phase::parts::{Comparison, PartPair};
use rapier3d::geometry::ContactManifold;
use tldi::{ContactPatch, ContactPoint, SAME_PLANE};

/// Most roughness of a contact that counts as scatter of its measurement, in scatters: rougher ones
/// are not noisy but uneven. Half: 7 of 636 stability rows fail instead of 3, all new ones of new
/// samples each frame; twice: no change in any suite.
const MOST_SCATTERS: f32 = 2.0;

/// A patch between two parts.
#[derive(Clone)]
pub(super) struct PartPatch {
    /// Of the parts in their compounds.
    pub(super) indices: [u32; 2],
    /// In the frame of the first collider.
    pub(super) patch: ContactPatch,
    /// Edge of a pixel of the comparison, metres. None where no part is a cloud: exact contacts do not jump.
    pub(super) pixel_size: Option<f32>,
}

impl PartPatch {
    /// A patch of a comparison. A gap within the patch's roughness, and within what a measurement scatters by, counts as
    /// touching.
    pub(super) fn of_clouds(
        parts: &PartPair,
        comparison: &Comparison,
        patch: &ContactPatch,
    ) -> Self {
        let scatter = (MOST_SCATTERS * comparison.scatter).min(patch.roughness);
        let touching = |point: &ContactPoint| {
            let gap = (point.gap - scatter).max(0.0) + (point.gap + scatter).min(0.0);
            let apart = 0.5 * (gap - point.gap) * patch.normal;
            ContactPoint {
                point_a: point.point_a - apart,
                point_b: point.point_b + apart,
                gap,
            }
        };
        let patch = ContactPatch {
            points: patch.points.iter().map(touching).collect(),
            ..patch.clone()
        };
        Self {
            indices: parts.indices,
            patch: in_collider(parts, patch),
            pixel_size: Some(comparison.pixel_size()),
        }
    }

    /// What rapier finds between two parts of which none is a cloud.
    pub(super) fn of_exact(parts: &PartPair, found: &ContactManifold) -> Self {
        let points = found.points.iter().map(|point| ContactPoint {
            point_a: point.local_p1,
            point_b: parts.a_from_b * point.local_p2,
            gap: point.dist,
        });
        let points: Vec<ContactPoint> = points.collect();
        Self {
            indices: parts.indices,
            patch: in_collider(parts, ContactPatch::bearing(found.local_n1, &points, 0.0)),
            pixel_size: None,
        }
    }
}

/// A patch in the frame of the first part, in that of its collider.
fn in_collider(parts: &PartPair, patch: ContactPatch) -> ContactPatch {
    match parts.poses[0] {
        Some(pose) => patch.transformed(&pose),
        None => patch,
    }
}

/// Merges the patches of each plane into the first of them, which keeps the names of its parts. `scatter`, in metres, is what
/// gaps scatter by.
pub(super) fn share_planes(patches: &mut Vec<PartPatch>, scatter: f32) {
    let mut first = 0;
    while let Some(PartPatch { patch, .. }) = patches.get(first) {
        let (normal, mut points) = (patch.normal, patch.points.to_vec());
        let in_plane = |other: &mut PartPatch| other.patch.normal.dot(normal) >= SAME_PLANE;
        let merged = patches.extract_if(first + 1.., in_plane);
        points.extend(merged.flat_map(|other| other.patch.points));
        patches[first].patch = ContactPatch::bearing(normal, &points, scatter);
        first += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rapier3d::math::Vector;

    /// Four points about `x` on a plane.
    fn patch(part: u32, x: f32, normal: Vector) -> PartPatch {
        let (u, v) = normal.any_orthonormal_pair();
        let corners = [u + v, u - v, -u + v, -u - v].map(|corner| x * Vector::X + corner);
        let points = corners.map(|corner| ContactPoint {
            point_a: corner,
            point_b: corner,
            gap: 0.0,
        });
        PartPatch {
            indices: [part, 0],
            patch: ContactPatch::bearing(normal, &points, 0.0),
            pixel_size: None,
        }
    }

    /// Three legs of a table stand on one plane, and lean on a wall: the table rests on its outer corners.
    #[test]
    fn parts_on_one_plane_share_its_points() {
        let legs = [-10.0, 0.0, 10.0].into_iter().zip(0..);
        let mut patches: Vec<PartPatch> = legs.map(|(x, k)| patch(k, x, Vector::Y)).collect();
        patches.insert(1, patch(3, 0.0, Vector::X));
        share_planes(&mut patches, 0.01);
        let names: Vec<[u32; 2]> = patches.iter().map(|patch| patch.indices).collect();
        assert_eq!(names, [[0, 0], [3, 0]]);
        let floor = &patches[0].patch.points;
        assert_eq!((floor.len(), patches[1].patch.points.len()), (4, 4));
        assert!(
            floor.iter().all(|point| point.point_a.x.abs() == 11.0),
            "{floor:?}"
        );
    }
}
