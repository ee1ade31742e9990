//! The distance and nearest points of two shapes, at least one of which holds a cloud.
//!
//! The surface of a cloud is one disc for each point, as for rays and projections
//! ([`PointCloudShape`](crate::PointCloudShape)), with two differences. Without normals, discs lie
//! on planes through 13 points. At an edge or a corner, a disc would stand out by up to its radius,
//! so only the bare point counts.

mod discs;
mod nearest;

use crate::ExactShape;
use crate::narrow_phase::parts::{PartPair, ShapePair, cloud_of, pairs_of_parts, part};
use crate::step::prepared::Shared;
use discs::DiscSurface;
use nearest::{CloudTarget, ExactTarget, Nearest, nearest};
use rapier3d::math::{Pose, Vector};
use rapier3d::parry::query::{
    ClosestPoints, Contact, DefaultQueryDispatcher, QueryDispatcher, Unsupported,
};
use rapier3d::parry::shape::Shape;
use tldi::PairResult;

/// Where two shapes are nearest to each other.
pub(crate) struct Closest {
    /// Metres; 0 where the shapes intersect.
    pub(crate) distance: f32,
    /// On shape 1 and on shape 2, both in the frame of shape 1.
    pub(crate) points: [Vector; 2],
    /// Unit normal from shape 1 towards shape 2 at these points, in the frame of shape 1; where
    /// the second is a cloud without oriented normals that intersects the first, either way.
    normal: Vector,
    /// Indices of the parts in their compounds; 0 where the shape is not one.
    pub(crate) parts: [u32; 2],
}

/// Where the shapes are nearest to each other, if that is less than `limit` metres. `pos12` maps
/// from the frame of shape 2 into that of shape 1. Declined where a pair of parts without a cloud
/// is one that rapier's own dispatcher declines.
pub(crate) fn closest(
    pos12: &Pose,
    shape1: &dyn Shape,
    shape2: &dyn Shape,
    limit: f32,
) -> Result<Option<Closest>, Unsupported> {
    let mut best: Option<Closest> = None;
    for parts in pairs_of_parts(shape1, shape2) {
        let limit = best.as_ref().map_or(limit, |best| best.distance);
        if limit <= 0.0 {
            return Ok(best);
        }
        let [pose1, pose2] = parts.wholes_from_parts();
        let [part1, part2] = parts.shapes;
        let a_from_b = pose1.inv_mul(&(*pos12 * pose2));
        if let Some(found) = closest_of_parts(&a_from_b, part1, part2, limit)? {
            best = Some(Closest {
                distance: found.distance,
                points: found.points.map(|point| pose1 * point),
                normal: pose1.rotation * found.normal,
                parts: parts.indices,
            });
        }
    }
    Ok(best)
}

/// [`closest`] for two parts, in the frame of the first.
fn closest_of_parts(
    a_from_b: &Pose,
    part1: &dyn Shape,
    part2: &dyn Shape,
    limit: f32,
) -> Result<Option<Closest>, Unsupported> {
    let ahead = |near: Nearest| Closest {
        distance: near.distance,
        points: [*a_from_b * near.on_source, *a_from_b * near.on_target],
        normal: -(a_from_b.rotation * near.normal),
        parts: [0, 0],
    };
    let back = |near: Nearest| Closest {
        distance: near.distance,
        points: [near.on_target, near.on_source],
        normal: near.normal,
        parts: [0, 0],
    };
    let b_from_a = a_from_b.inverse();
    Ok(match (cloud_of(part1), cloud_of(part2)) {
        (Some(cloud1), Some(cloud2)) => {
            let source = DiscSurface::new(cloud1);
            let target = CloudTarget::new(DiscSurface::new(cloud2), &source);
            nearest(&source, &b_from_a, &target, limit).map(ahead)
        }
        (Some(cloud), None) => {
            let target = ExactTarget::new(ExactShape(part2));
            nearest(&DiscSurface::new(cloud), &b_from_a, &target, limit).map(ahead)
        }
        (None, Some(cloud)) => {
            let target = ExactTarget::new(ExactShape(part1));
            nearest(&DiscSurface::new(cloud), a_from_b, &target, limit).map(back)
        }
        (None, None) => closest_by_rapier(a_from_b, part1, part2, limit)?,
    })
}

/// [`closest`] for two parts that are no clouds.
fn closest_by_rapier(
    a_from_b: &Pose,
    part1: &dyn Shape,
    part2: &dyn Shape,
    limit: f32,
) -> Result<Option<Closest>, Unsupported> {
    let found = match DefaultQueryDispatcher.closest_points(a_from_b, part1, part2, limit)? {
        ClosestPoints::Disjoint => return Ok(None),
        ClosestPoints::WithinMargin(point1, point2) => {
            let points = [point1, *a_from_b * point2];
            let apart = points[1] - points[0];
            (apart.length(), points, apart.normalize_or(Vector::Y))
        }
        ClosestPoints::Intersecting => {
            let contact = DefaultQueryDispatcher.contact(a_from_b, part1, part2, 0.0)?;
            contact.map_or((0.0, [a_from_b.translation; 2], Vector::Y), |contact| {
                let points = [contact.point1, *a_from_b * contact.point2];
                (0.0, points, contact.normal1)
            })
        }
    };
    let (distance, points, normal) = found;
    Ok(Some(Closest {
        distance,
        points,
        normal,
        parts: [0, 0],
    }))
}

/// The deepest contact of two shapes or, where they do not intersect, their nearest points, if
/// these are within `prediction` metres of each other.
pub(crate) fn contact(
    shared: &Shared,
    pair: ShapePair<'_>,
) -> Result<Option<Contact>, Unsupported> {
    let limit = pair.prediction.max(0.0).next_up();
    let Some(found) = closest(&pair.pos12, pair.shape1, pair.shape2, limit)? else {
        return Ok(None);
    };
    let measured = (found.distance <= 0.0)
        .then(|| {
            shared.compare_on_the_spot(pair, &shared.config(), |parts, results| {
                deepest(&pair, parts, results)
            })
        })
        .flatten()
        .flatten();
    Ok(Some(measured.unwrap_or_else(|| {
        let [point1, point2] = found.points;
        let apart = point2 - point1;
        // The surfaces have passed through each other. The distance of their nearest points is the
        // penetration.
        let sign = if found.distance > 0.0 { 1.0 } else { -1.0 };
        let normal = (sign * apart).try_normalize().unwrap_or(found.normal);
        let distance = sign * apart.length();
        contact_in_frames(&pair, [point1, point2], normal, distance, found.parts)
    })))
}

/// The contact with the least signed distance that a comparison found.
fn deepest(pair: &ShapePair<'_>, parts: &[PartPair], results: &[PairResult]) -> Option<Contact> {
    let contacts = parts.iter().filter_map(|part_pair| {
        let pose1 = part_pair.poses[0].unwrap_or(Pose::IDENTITY);
        let (points, normal, distance) = match part_pair.result(results) {
            Some(result) => {
                let patches = result.patches.iter();
                let points = patches.flat_map(|patch| patch.points.iter().map(move |p| (patch, p)));
                let (patch, point) = points.min_by(|p, q| p.1.gap.total_cmp(&q.1.gap))?;
                ([point.point_a, point.point_b], patch.normal, point.gap)
            }
            None => {
                let [part1, part2] = [
                    part(pair.shape1, part_pair.indices[0]).1,
                    part(pair.shape2, part_pair.indices[1]).1,
                ];
                let a_from_b = &part_pair.a_from_b;
                let contact =
                    DefaultQueryDispatcher.contact(a_from_b, part1, part2, pair.prediction);
                let contact = contact.ok().flatten()?;
                let points = [contact.point1, *a_from_b * contact.point2];
                (points, contact.normal1, contact.dist)
            }
        };
        let points = points.map(|point| pose1 * point);
        let normal = pose1.rotation * normal;
        Some(contact_in_frames(
            pair,
            points,
            normal,
            distance,
            part_pair.indices,
        ))
    });
    contacts.min_by(|p, q| p.dist.total_cmp(&q.dist))
}

/// A contact in the frames of both shapes from points and a normal in that of shape 1.
fn contact_in_frames(
    pair: &ShapePair<'_>,
    [point1, point2]: [Vector; 2],
    normal: Vector,
    distance: f32,
    [part1, part2]: [u32; 2],
) -> Contact {
    let from1 = pair.pos12.inverse();
    Contact::new(
        point1,
        from1 * point2,
        normal,
        -(from1.rotation * normal),
        distance,
    )
    .with_subshapes(part1, part2)
}
