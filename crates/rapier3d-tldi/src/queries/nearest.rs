//! Where a cloud is nearest to another surface: branch and bound over the cloud's tree.

use super::discs::{Disc, DiscSurface};
use crate::ExactShape;
use rapier3d::glamx::{Pose3, Vec3};
use rapier3d::parry::partitioning::BvhNode;
use rapier3d::parry::query::PointQuery;
use tldi::RaySurface;

/// Steps of a descent over a disc towards an exact surface. A plane takes one.
const DESCENT_STEPS: usize = 4;

/// Sine of the angle between a disc and a surface below which they are taken to be parallel.
const FLAT: f32 = 1e-3;

/// Part of its radius by which a disc may miss a surface without inside that it meets: rounding.
const ROUNDING: f32 = 1e-3;

/// Points in which two surfaces are nearest to each other, in the frame of the target.
#[derive(Clone, Copy, Debug)]
pub(super) struct Nearest {
    /// Metres; 0 where the surfaces intersect.
    pub(super) distance: f32,
    /// On the cloud that was searched.
    pub(super) on_source: Vec3,
    pub(super) on_target: Vec3,
    /// Unit normal of the target at its point; of a cloud without oriented normals, either way.
    pub(super) normal: Vec3,
    /// Whether each point lies inside of the other surface as far as normals tell. Of the nearest
    /// points of all this says that the surfaces have passed through each other as a whole.
    overlap: bool,
}

/// What a cloud may be near to. Points and discs are in the target's own frame.
pub(super) trait Target {
    /// A lower bound on the distance in metres from `point` to any disc or surface, which changes
    /// by no more than the point is moved by; at most 0 inside.
    fn bound(&self, point: Vec3) -> f32;

    /// Where the target is nearest to `disc`; may be `None` if that is `limit` metres or more.
    fn nearest(&self, disc: &Disc, limit: f32) -> Option<Nearest>;
}

/// Where `source` is nearest to `target`, if that is less than `limit` metres.
pub(super) fn nearest(
    source: &DiscSurface<'_>,
    target_from_source: &Pose3,
    target: &impl Target,
    limit: f32,
) -> Option<Nearest> {
    let cloud = source.shape.cloud();
    let best = source.bvh().find_best(
        limit,
        |node: &BvhNode, _| {
            let around = node.aabb();
            let bound = target.bound(*target_from_source * around.center());
            (bound - around.half_extents().length()).max(0.0)
        },
        |sample, limit| {
            let center = *target_from_source * cloud.point(sample as usize);
            if target.bound(center) - cloud.radius(sample as usize) >= limit {
                return None;
            }
            let disc = source.disc(sample).moved(target_from_source);
            target
                .nearest(&disc, limit)
                .map(|near| (near.distance, near))
        },
    );
    best.map(|(_, (_, near))| Nearest {
        distance: if near.overlap { 0.0 } else { near.distance },
        ..near
    })
}

/// Another cloud.
pub(super) struct CloudTarget<'a> {
    discs: DiscSurface<'a>,
    /// Whether the normals of both clouds tell inside from outside.
    are_oriented: bool,
}

impl<'a> CloudTarget<'a> {
    pub(super) fn new(discs: DiscSurface<'a>, source: &DiscSurface<'_>) -> Self {
        let is_oriented = |discs: &DiscSurface<'_>| discs.shape.cloud().normals_oriented();
        Self {
            are_oriented: is_oriented(source) && is_oriented(&discs),
            discs,
        }
    }
}

impl Target for CloudTarget<'_> {
    fn bound(&self, point: Vec3) -> f32 {
        let cloud = self.discs.shape.cloud();
        let nearest_ball = self.discs.bvh().find_best(
            f32::MAX,
            |node: &BvhNode, _| node.aabb().distance_to_local_point(point, true),
            |sample, _| {
                let sample = sample as usize;
                Some((cloud.point(sample).distance(point) - cloud.radius(sample)).max(0.0))
            },
        );
        nearest_ball.map_or(f32::MAX, |(_, distance)| distance)
    }

    fn nearest(&self, disc: &Disc, limit: f32) -> Option<Nearest> {
        let best = self.discs.bvh().find_best(
            limit,
            |node: &BvhNode, _| {
                let distance = node.aabb().distance_to_local_point(disc.center, true);
                (distance - disc.reach).max(0.0)
            },
            |sample, _| {
                let other = self.discs.disc(sample);
                let [on_source, on_target] = disc.nearest_points(&other);
                let near = Nearest {
                    distance: on_source.distance(on_target),
                    on_source,
                    on_target,
                    normal: other.normal,
                    overlap: self.are_oriented
                        && disc.has_behind(on_target)
                        && other.has_behind(on_source),
                };
                Some((near.distance, near))
            },
        );
        best.map(|(_, (_, near))| near)
    }
}

/// A shape of rapier's.
pub(super) struct ExactTarget<'a> {
    shape: ExactShape<'a>,
    is_closed: bool,
}

impl<'a> ExactTarget<'a> {
    pub(super) fn new(shape: ExactShape<'a>) -> Self {
        Self {
            is_closed: shape.is_closed(),
            shape,
        }
    }

    /// Distance, negative inside of a solid only, and the direction in which it grows.
    fn project(&self, point: Vec3) -> (f32, Vec3) {
        let (distance, normal) = self.shape.project(point);
        if distance < 0.0 && !self.is_closed {
            (-distance, -normal)
        } else {
            (distance, normal)
        }
    }
}

impl Target for ExactTarget<'_> {
    fn bound(&self, point: Vec3) -> f32 {
        self.project(point).0
    }

    fn nearest(&self, disc: &Disc, _limit: f32) -> Option<Nearest> {
        let mut at = disc.center;
        let (mut distance, mut normal) = self.project(at);
        for _ in 0..DESCENT_STEPS {
            let uphill = normal - normal.dot(disc.normal) * disc.normal;
            let sine = uphill.length();
            if distance <= 0.0 || sine < FLAT || disc.reach == 0.0 {
                break;
            }
            // To where the tangent plane of the surface is met, or to the rim.
            let down = at - uphill * (distance / (sine * sine)) - disc.center;
            let next = disc.center + down.clamp_length_max(disc.reach);
            let (next_distance, next_normal) = self.project(next);
            if next_distance >= distance {
                break;
            }
            (at, distance, normal) = (next, next_distance, next_normal);
        }
        if distance <= ROUNDING * disc.reach {
            distance = 0.0;
        }
        Some(Nearest {
            distance,
            on_source: at,
            on_target: at - distance * normal,
            normal,
            overlap: false,
        })
    }
}
