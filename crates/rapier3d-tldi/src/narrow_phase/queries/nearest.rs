//! Where a cloud is nearest to another surface: branch and bound over the cloud's tree.
//!
//! The search first finds the nearest samples, without their discs. Their distance D is at least the distance d of the
//! surfaces. Smooth surfaces face each other where they are nearest, so the two discs there lie across the line between
//! the nearest points. With l the sum of their radii, their samples are at most √(d² + l²) apart. So only samples at most
//! √(D² + l²) apart can decide, and only these are looked at. The order of the search does not change which they are.

use super::discs::{Disc, DiscSurface};
use crate::ExactShape;
use rapier3d::glamx::{Pose3, Vec3};
use rapier3d::parry::partitioning::BvhNode;
use rapier3d::parry::query::PointQuery;
use tldi::RaySurface;

/// Steps of a descent over a disc towards an exact surface. A plane takes one. Half or twice: no test of queries
/// fails.
const DESCENT_STEPS: usize = 4;

/// Sine of the angle between a disc and a surface below which they are taken to be parallel. Half or twice: no test
/// of queries fails.
const LEAST_SINE: f32 = 1e-3;

/// Share of its radius by which a disc may seem to miss a surface without inside that it meets, by rounding. Half
/// or twice: no test of queries fails.
const RIM_ROUNDING: f32 = 1e-3;

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
    /// Whether each point lies inside the other surface, by the normals. If that holds for the nearest points of all, the
    /// surfaces have passed through each other as a whole.
    overlap: bool,
}

/// A sample of the cloud that is searched, seen from the target.
pub(super) struct Sample<'a> {
    source: &'a DiscSurface<'a>,
    target_from_source: &'a Pose3,
    index: u32,
}

impl Sample<'_> {
    fn disc(&self) -> Disc {
        self.source.disc(self.index).moved(self.target_from_source)
    }

    /// See [`DiscSurface::full_disc`].
    fn full_disc(&self) -> Disc {
        self.source
            .full_disc(self.index)
            .moved(self.target_from_source)
    }
}

/// What a cloud may be near to. Points are in the target's own frame.
pub(super) trait Target {
    /// Distance in metres from `point` to the nearest sample, or to an exact surface; at most 0
    /// inside of one.
    fn distance(&self, point: Vec3) -> f32;

    /// Greatest distance in metres of the surface from its nearest sample.
    fn reach(&self) -> f32;

    /// Whether [`Nearest::overlap`] is known, and not only from surfaces that cross.
    fn tells_overlap(&self) -> bool;

    /// Where the target is nearest to a sample's disc; may be `None` if that is `limit` metres or
    /// more.
    fn nearest(&self, sample: &Sample<'_>, candidates: Candidates, limit: f32) -> Option<Nearest>;
}

/// The pairs of samples that may be nearest.
#[derive(Clone, Copy)]
pub(super) struct Candidates {
    /// Distance in metres of the samples that are nearest, or of a sample and an exact surface.
    least: f32,
}

impl Candidates {
    /// Least distance of the discs of two samples that are `distance` metres apart and whose radii
    /// add up to `reach`; [`f32::MAX`] if they are too far apart to be candidates.
    fn bound(self, distance: f32, reach: f32) -> f32 {
        let facing_squared = distance * distance - reach * reach;
        if distance > 0.0 && facing_squared > self.least * self.least {
            f32::MAX
        } else {
            (distance - reach).max(0.0)
        }
    }
}

/// Where `source` is nearest to `target`, if that is less than `limit` metres.
pub(super) fn nearest(
    source: &DiscSurface<'_>,
    target_from_source: &Pose3,
    target: &impl Target,
    limit: f32,
) -> Option<Nearest> {
    let distance_to_node = |node: &BvhNode| {
        let around = source.sample_bounds(node);
        let center = *target_from_source * around.center();
        target.distance(center) - around.half_extents().length()
    };
    let (_, least) = source.bvh().find_best(
        f32::MAX,
        |node: &BvhNode, _| distance_to_node(node),
        |index, _| {
            let center = source.shape.cloud().point(index as usize);
            Some(target.distance(*target_from_source * center).max(0.0))
        },
    )?;
    let candidates = Candidates { least };
    let reach = source.shape.cloud().max_radius() + target.reach();
    // Surfaces that overlap may be farther from each other than surfaces apart should be.
    if !target.tells_overlap() && candidates.bound(least, reach) >= limit {
        return None;
    }
    let best = source.bvh().find_best(
        f32::MAX,
        |node: &BvhNode, _| candidates.bound(distance_to_node(node), reach),
        |index, limit| {
            let sample = Sample {
                source,
                target_from_source,
                index,
            };
            let near = target.nearest(&sample, candidates, limit)?;
            Some((near.distance, near))
        },
    );
    best.map(|(_, (_, near))| Nearest {
        distance: if near.overlap { 0.0 } else { near.distance },
        ..near
    })
    .filter(|near| near.distance < limit)
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
    fn distance(&self, point: Vec3) -> f32 {
        let cloud = self.discs.shape.cloud();
        let nearest = self.discs.bvh().find_best(
            f32::MAX,
            |node: &BvhNode, _| {
                let around = self.discs.sample_bounds(node);
                around.distance_to_local_point(point, true)
            },
            |sample, _| Some(cloud.point(sample as usize).distance(point)),
        );
        nearest.map_or(f32::MAX, |(_, distance)| distance)
    }

    fn reach(&self) -> f32 {
        self.discs.shape.cloud().max_radius()
    }

    fn tells_overlap(&self) -> bool {
        self.are_oriented
    }

    fn nearest(&self, sample: &Sample<'_>, candidates: Candidates, limit: f32) -> Option<Nearest> {
        let full = sample.full_disc();
        let reach = full.reach + self.reach();
        let distance = |[p, q]: [Vec3; 2]| p.distance(q);
        let best = self.discs.bvh().find_best(
            limit,
            |node: &BvhNode, _| {
                let around = self.discs.sample_bounds(node);
                candidates.bound(around.distance_to_local_point(full.center, true), reach)
            },
            |index, limit| {
                let other = self.discs.full_disc(index);
                let apart = full.center.distance(other.center);
                if candidates.bound(apart, full.reach + other.reach) >= limit
                    || distance(full.nearest_points(&other)) >= limit
                {
                    return None;
                }
                let (disc, other) = (sample.disc(), self.discs.disc(index));
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
    fn distance(&self, point: Vec3) -> f32 {
        self.project(point).0
    }

    fn reach(&self) -> f32 {
        0.0
    }

    fn tells_overlap(&self) -> bool {
        false
    }

    fn nearest(&self, sample: &Sample<'_>, candidates: Candidates, limit: f32) -> Option<Nearest> {
        let full = sample.full_disc();
        let mut at = full.center;
        let (mut distance, mut normal) = self.project(at);
        if candidates.bound(distance, full.reach) >= limit {
            return None;
        }
        let disc = sample.disc();
        for _ in 0..DESCENT_STEPS {
            let uphill = normal - normal.dot(disc.normal) * disc.normal;
            let sine = uphill.length();
            if distance <= 0.0 || sine < LEAST_SINE || disc.reach == 0.0 {
                break;
            }
            // To where the tangent plane of the surface is met, or to the rim; a surface that bends
            // away is nearest before that.
            let to_plane = disc.nearest_to(at - uphill * (distance / (sine * sine)));
            let to_foot = disc.nearest_to(at - distance * normal);
            let lower = [to_plane, to_foot]
                .map(|next| (next, self.project(next)))
                .into_iter()
                .min_by(|p, q| p.1.0.total_cmp(&q.1.0))
                .filter(|(_, (next_distance, _))| *next_distance < distance);
            let Some((next, projection)) = lower else {
                break;
            };
            (at, (distance, normal)) = (next, projection);
        }
        if distance <= RIM_ROUNDING * disc.reach {
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
