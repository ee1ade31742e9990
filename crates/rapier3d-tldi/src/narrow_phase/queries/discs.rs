//! A cloud's surface as discs: one a sample, across its normal, of the sample's radius.

use crate::PointCloudShape;
use rapier3d::glamx::{Pose3, Vec3};
use rapier3d::parry::bounding_volume::{Aabb, BoundingVolume};
use rapier3d::parry::partitioning::{Bvh, BvhNode};
use std::cell::RefCell;
use std::collections::HashMap;

/// Samples within this many radii say whether the surface is smooth around one of them. Half or twice: tests of
/// distances fail.
const NEIGHBORHOOD: f32 = 2.0;

/// A sample whose neighbours lie within this many radii of its plane has a disc. A surface with a
/// radius of curvature of 4 point radii is just so smooth. Half: no test of queries fails; twice: tests of
/// distances do.
const LEAST_SMOOTH: f32 = 0.5;

/// Square of the sine between planes that are taken to be parallel: their discs are then nearest at
/// a centre. Half or twice: no test of queries fails.
const PARALLEL: f32 = 1e-6;

/// A sample and the surface that it stands for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Disc {
    pub(super) center: Vec3,
    /// Unit normal.
    pub(super) normal: Vec3,
    /// Radius in metres; 0 at an edge or a corner of the surface, where a disc would stand out.
    pub(super) reach: f32,
}

impl Disc {
    pub(super) fn moved(&self, pose: &Pose3) -> Self {
        Self {
            center: *pose * self.center,
            normal: pose.rotation * self.normal,
            reach: self.reach,
        }
    }

    /// The point of the disc nearest to `point`.
    pub(super) fn nearest_to(&self, point: Vec3) -> Vec3 {
        let offset = point - self.center;
        let along = offset - self.normal.dot(offset) * self.normal;
        self.center + along.clamp_length_max(self.reach)
    }

    /// Whether `point` lies behind the disc, on the side that its normal points away from.
    pub(super) fn has_behind(&self, point: Vec3) -> bool {
        self.reach > 0.0 && self.normal.dot(point - self.center) < 0.0
    }

    /// A point that both discs contain.
    pub(super) fn crossing(&self, other: &Self) -> Option<Vec3> {
        if self.reach == 0.0 || other.reach == 0.0 {
            return None;
        }
        // The line in which the planes meet, from a point of it.
        let line = self.normal.cross(other.normal);
        let squared = line.length_squared();
        if squared < PARALLEL {
            return None;
        }
        let height = other.normal.dot(other.center - self.center);
        let start = self.center + height / squared * line.cross(self.normal);
        let chord = |disc: &Self| {
            let middle = line.dot(disc.center - start) / squared;
            let aside = start + middle * line - disc.center;
            let half = (disc.reach * disc.reach - aside.length_squared()) / squared;
            (half >= 0.0).then(|| [middle - half.sqrt(), middle + half.sqrt()])
        };
        let ([low1, high1], [low2, high2]) = (chord(self)?, chord(other)?);
        let (low, high) = (low1.max(low2), high1.min(high2));
        (low <= high).then(|| start + 0.5 * (low + high) * line)
    }

    /// Points of this disc and of `other` that are nearest to each other if one of them is a
    /// centre, or else one that both contain.
    pub(super) fn nearest_points(&self, other: &Self) -> [Vec3; 2] {
        if let Some(point) = self.crossing(other) {
            return [point; 2];
        }
        let from_center = [self.center, other.nearest_to(self.center)];
        let to_center = [self.nearest_to(other.center), other.center];
        let squared = |[p, q]: [Vec3; 2]| p.distance_squared(q);
        if squared(from_center) <= squared(to_center) {
            from_center
        } else {
            to_center
        }
    }
}

/// The discs of a cloud.
pub(super) struct DiscSurface<'a> {
    pub(super) shape: &'a PointCloudShape,
    normals: &'a [Vec3],
    least_radius: f32,
    /// Whether the surface is smooth around the samples that were asked for.
    smooth: RefCell<HashMap<u32, bool>>,
}

impl<'a> DiscSurface<'a> {
    pub(super) fn new(shape: &'a PointCloudShape) -> Self {
        Self {
            shape,
            normals: shape.surface_normals(),
            least_radius: shape.least_radius(),
            smooth: RefCell::default(),
        }
    }

    /// The tree over the samples.
    pub(super) fn bvh(&self) -> &'a Bvh {
        self.shape.bvh()
    }

    /// Bounds of the samples of a node.
    pub(super) fn sample_bounds(&self, node: &BvhNode) -> Aabb {
        node.aabb().tightened(self.least_radius)
    }

    /// The disc of a sample as if the surface were smooth there: nothing that
    /// [`disc`](Self::disc) has is nearer to anything than what this has.
    pub(super) fn full_disc(&self, sample: u32) -> Disc {
        let (cloud, sample) = (self.shape.cloud(), sample as usize);
        Disc {
            center: cloud.point(sample),
            normal: self.normals[sample],
            reach: cloud.radius(sample),
        }
    }

    /// What a sample stands for.
    pub(super) fn disc(&self, sample: u32) -> Disc {
        let full = self.full_disc(sample);
        let is_smooth = *self
            .smooth
            .borrow_mut()
            .entry(sample)
            .or_insert_with(|| self.is_smooth(&full));
        Disc {
            reach: if is_smooth { full.reach } else { 0.0 },
            ..full
        }
    }

    fn is_smooth(&self, disc: &Disc) -> bool {
        let distance = NEIGHBORHOOD * disc.reach;
        let around = Aabb::from_half_extents(disc.center, Vec3::splat(distance));
        let stands_out = |neighbor: u32| {
            let offset = self.shape.cloud().point(neighbor as usize) - disc.center;
            offset.length_squared() < distance * distance
                && disc.normal.dot(offset).abs() > LEAST_SMOOTH * disc.reach
        };
        !self
            .bvh()
            .leaves(|node: &BvhNode| node.aabb().intersects(&around))
            .any(stands_out)
    }
}
