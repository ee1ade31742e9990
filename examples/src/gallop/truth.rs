//! How deep things are in each other by their shapes as generated, beside what the contacts say.

use super::ground::WavyGround;
use crate::scene::BodyShape;
use serde::Serialize;
use tldi::PointCloud;
use tldi::glamx::{Pose3, Vec3};

/// Depths in metres of a pair in a step: told by its deepest contact, and by the shapes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TrueDepth {
    /// By its deepest contact; 0 without one.
    pub told: f32,
    /// Of the deepest point of the one in the other's true surface.
    pub truth: f32,
    /// Number of the step, from 1.
    pub step: usize,
}

/// Comparisons of one kind of contact.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Comparisons {
    /// Pairs and steps that were compared.
    pub compared: usize,
    /// Mean of the differences, metres.
    pub mean_error: f32,
    /// Where they differ most; null without any.
    pub worst: Option<TrueDepth>,
}

impl Comparisons {
    /// Counts a pair in which something touches.
    pub(super) fn count(&mut self, depth: TrueDepth) {
        let error = |depth: TrueDepth| (depth.told - depth.truth).abs();
        self.compared += 1;
        self.mean_error += (error(depth) - self.mean_error) / self.compared as f32;
        if self.worst.is_none_or(|worst| error(worst) < error(depth)) {
            self.worst = Some(depth);
        }
    }
}

/// How deep the deepest of these points, in the world, is below the ground at a time; negative over it and beside it. To
/// first order in the height over the surface, which bends by less than 2 % over a hoof.
pub(super) fn below_ground(
    ground: &WavyGround,
    time: f32,
    points: impl Iterator<Item = Vec3>,
) -> f32 {
    let [along, across] = ground.half_size;
    let depth = |p: Vec3| {
        let (surface, normal) = ground.surface(p.x, p.z, time);
        (surface - p).dot(normal)
    };
    (points.filter(|p| p.x.abs() <= along && p.z.abs() <= across))
        .map(depth)
        .fold(f32::NEG_INFINITY, f32::max)
}

/// A generated body's true surface, in the frame of its cloud.
pub(super) struct TrueBody {
    pub(super) shape: BodyShape,
    /// Middle of the shape's bounds, and what its cloud is scaled by.
    pub(super) center: Vec3,
    pub(super) scale: f32,
}

impl TrueBody {
    /// How deep the deepest point of a cloud is in the body; negative outside. Points farther than `reach` from the middle
    /// are not looked at.
    pub(super) fn depth_of(
        &self,
        cloud: &PointCloud<'_>,
        body_from_cloud: &Pose3,
        reach: f32,
    ) -> f32 {
        (cloud.points().iter().map(|&p| *body_from_cloud * p))
            .filter(|p| p.length() < reach)
            .map(|p| -self.scale * self.distance(p / self.scale + self.center))
            .fold(f32::NEG_INFINITY, f32::max)
    }

    /// Signed distance in the frame of the shape: its bound by how fast that grows.
    fn distance(&self, p: Vec3) -> f32 {
        let bound = self.shape.distance(p);
        let slope = |axis: Vec3| {
            let [ahead, behind] = [1e-3, -1e-3].map(|way| self.shape.distance(p + way * axis));
            (ahead - behind) / 2e-3
        };
        let growth = Vec3::AXES.map(slope);
        // It is half or all of the distance, and flat only in the middle of the body.
        bound / Vec3::from(growth).length().max(0.5)
    }
}
