//! From a pair of shapes to the comparisons it needs: one for each pair of parts.

use crate::shape::exact::ExactShape;
use crate::{PointCloudShape, TldiConfig};
use rapier3d::math::{Pose, Vector};
use rapier3d::parry::bounding_volume::{Aabb, BoundingVolume};
use rapier3d::parry::shape::{Shape, ShapeType};
use tldi::plan::{DepthScale, first_is_smaller, largest_pixel, least_pixel};
use tldi::{PairQuery, PairResult, Params, PointCloud, Surface, Variant, View};

/// Contacts are searched up to this many standard deviations of given noise. So the fit at a light
/// contact has points around it on all sides. Half or twice: no row of any suite changes.
const FITTED: f32 = 3.0;

/// The cloud of a shape that is one.
pub(crate) fn cloud_of(shape: &dyn Shape) -> Option<&PointCloudShape> {
    shape.as_shape::<PointCloudShape>()
}

/// The clouds that a shape consists of: itself, or parts of a compound.
pub(crate) fn clouds_of(shape: &dyn Shape) -> impl Iterator<Item = &PointCloud<'static>> {
    cloud_shapes_of(shape).map(PointCloudShape::cloud)
}

/// The same as shapes.
pub(crate) fn cloud_shapes_of(shape: &dyn Shape) -> impl Iterator<Item = &PointCloudShape> {
    (0..part_count(shape)).filter_map(move |i| cloud_of(part(shape, i).1))
}

/// Mean radius of the coarsest of the clouds that two shapes consist of, metres; none where there is no cloud.
pub(crate) fn coarsest_radius(shapes: [&dyn Shape; 2]) -> Option<f32> {
    let clouds = shapes.into_iter().flat_map(clouds_of);
    clouds.map(|cloud| cloud.mean_radius()).reduce(f32::max)
}

/// Whether the shape is a cloud or a compound that holds one.
pub(crate) fn has_cloud(shape: &dyn Shape) -> bool {
    clouds_of(shape).next().is_some()
}

/// Whether rays can cross the shape or it is a cloud, whose points have radii.
pub(crate) fn has_surface(shape: &dyn Shape) -> bool {
    if cloud_of(shape).is_some() {
        return true;
    }
    let pixel = largest_pixel(shape.compute_local_aabb().extents(), 0.0);
    let is_line = matches!(shape.shape_type(), ShapeType::Segment | ShapeType::Polyline);
    pixel >= *Params::LENGTHS.start() && !is_line
}

/// Number of parts: those of a compound, or one.
pub(crate) fn part_count(shape: &dyn Shape) -> u32 {
    shape
        .as_compound()
        .map_or(1, |compound| compound.shapes().len() as u32)
}

/// A part's pose in the frame of the whole (none: the same frame) and its shape.
pub(crate) fn part(shape: &dyn Shape, index: u32) -> (Option<&Pose>, &dyn Shape) {
    match shape.as_compound() {
        Some(compound) => {
            let (pose, part) = &compound.shapes()[index as usize];
            (Some(pose), &**part)
        }
        None => (None, shape),
    }
}

/// A part of each of two shapes.
pub(crate) struct Parts<'a> {
    /// In their compounds; 0 where the shape is not one.
    pub(crate) indices: [u32; 2],
    /// In the frames of the wholes (none: the same frame).
    pub(crate) poses: [Option<&'a Pose>; 2],
    pub(crate) shapes: [&'a dyn Shape; 2],
}

impl Parts<'_> {
    /// From the frames of the parts into those of the wholes.
    pub(crate) fn wholes_from_parts(&self) -> [Pose; 2] {
        self.poses
            .map(|pose| pose.copied().unwrap_or(Pose::IDENTITY))
    }
}

/// Each part of the first shape with each of the second, in the order of their indices.
pub(crate) fn pairs_of_parts<'a>(
    shape1: &'a dyn Shape,
    shape2: &'a dyn Shape,
) -> impl Iterator<Item = Parts<'a>> {
    (0..part_count(shape1)).flat_map(move |i| {
        let (pose1, part1) = part(shape1, i);
        (0..part_count(shape2)).map(move |j| {
            let (pose2, part2) = part(shape2, j);
            Parts {
                indices: [i, j],
                poses: [pose1, pose2],
                shapes: [part1, part2],
            }
        })
    })
}

/// The pose with a unit quaternion: those of joints that turn for minutes drift, and rapier leaves them so.
pub(crate) fn rigid(pose: Pose) -> Pose {
    match pose.rotation.is_normalized() {
        true => pose,
        false => Pose::from_parts(pose.translation, pose.rotation.normalize()),
    }
}

/// Two shapes as rapier's narrow phase sees them.
#[derive(Clone, Copy)]
pub(crate) struct ShapePair<'a> {
    pub(crate) shape1: &'a dyn Shape,
    pub(crate) shape2: &'a dyn Shape,
    /// From the frame of shape 2 into that of shape 1.
    pub(crate) pos12: Pose,
    /// Contacts up to this gap are wanted, metres.
    pub(crate) prediction: f32,
}

impl<'a> ShapePair<'a> {
    pub(crate) fn new(
        shape1: &'a dyn Shape,
        shape2: &'a dyn Shape,
        pos12: Pose,
        prediction: f32,
    ) -> Self {
        Self {
            shape1,
            shape2,
            pos12,
            prediction,
        }
    }

    /// Whether such contacts are possible: the bounds meet in the frames of both shapes.
    pub(crate) fn is_within_reach(&self) -> bool {
        let local1 = self.shape1.compute_local_aabb().loosened(self.prediction);
        let local2 = self.shape2.compute_local_aabb().loosened(self.prediction);
        local1.intersects(&self.shape2.compute_aabb(&self.pos12))
            && local2.intersects(&self.shape1.compute_aabb(&self.pos12.inverse()))
    }
}

/// What the caller knows about a pair of parts beyond their shapes.
#[derive(Clone, Copy, Default)]
pub(crate) struct Hint {
    /// Motion of the second part relative to the first over the step, in the frame of the first
    /// part, metres.
    pub(crate) motion: Vector,
    /// Main view axis of the frame before, in the frame of the first part.
    pub(crate) last_axis: Option<Vector>,
}

/// A pair of parts within reach of each other.
pub(crate) struct PartPair {
    /// Of the parts in their compounds; 0 where the shape is not one.
    pub(crate) indices: [u32; 2],
    /// Poses of the parts in the frames of their colliders; none where they are the same.
    pub(crate) poses: [Option<Pose>; 2],
    /// From the frame of the second part into that of the first.
    pub(crate) a_from_b: Pose,
    /// The comparison; none where no side is a cloud, which rapier's own dispatcher answers.
    pub(crate) comparison: Option<Comparison>,
}

impl PartPair {
    /// From the frame of the first part into the world; `pose1` is that of the first collider.
    pub(crate) fn world_from_a(&self, pose1: &Pose) -> Pose {
        self.poses[0].map_or(*pose1, |pose| *pose1 * pose)
    }

    /// The result of its comparison among those of all; none where there is no comparison.
    pub(crate) fn result<'r>(&self, results: &'r [PairResult]) -> Option<&'r PairResult> {
        self.comparison
            .as_ref()
            .map(|comparison| &results[comparison.query])
    }
}

/// The results of the comparisons of some parts among those of all.
pub(crate) fn results_of<'r>(
    parts: &[PartPair],
    results: &'r [PairResult],
) -> impl Iterator<Item = &'r PairResult> + Clone {
    parts.iter().filter_map(move |part| part.result(results))
}

/// What a backend is asked about a pair of parts.
pub(crate) struct Comparison {
    view: View,
    params: Params,
    /// Penetration in metres up to which surfaces just touch: what its measurement scatters by.
    pub(crate) scatter: f32,
    /// Place in the batch.
    pub(crate) query: usize,
}

impl Comparison {
    /// The side on which the parts are by earlier steps, as an axis from the second to the first.
    pub(crate) fn last_axis(&self) -> Option<Vector> {
        match self.view {
            View::Aim { last_axis, .. } => last_axis,
            View::Fixed(_) => None,
        }
    }

    /// Edge of a pixel that is asked for, metres.
    pub(crate) fn pixel_size(&self) -> f32 {
        self.params.pixel_size
    }

    /// Distance in metres up to which a contact point counts as the one of the step before.
    pub(crate) fn match_distance(&self) -> f32 {
        self.params.prediction.max(2.0 * self.params.pixel_size)
    }
}

impl TldiConfig {
    /// Parameters of a pair of parts for contacts up to a gap of `prediction` metres; none where no
    /// part is a cloud.
    pub(crate) fn params(&self, parts: [&dyn Shape; 2], prediction: f32) -> Option<Params> {
        let coarsest = coarsest_radius(parts)?;
        let extents = parts.map(|part| part.compute_local_aabb().extents());
        let smaller = usize::from(!first_is_smaller(extents));
        let own_radius = cloud_of(parts[smaller]).map_or(0.0, |shape| shape.cloud().mean_radius());
        let to_resolve = largest_pixel(extents[smaller], own_radius);
        let noise = |part| cloud_of(part).map_or(0.0, |shape| shape.cloud().noise());
        let fitted = FITTED * parts.into_iter().map(noise).fold(0.0, f32::max);
        let prediction = prediction.max(fitted);
        // A body that is smaller than the points beside it is modelled at its own scale, as long as depths up to the
        // prediction can be told apart.
        let told_apart = 2.0 * prediction / DepthScale::reach(&Params::for_radius(1.0));
        let scale = coarsest.min(to_resolve.max(told_apart));
        let params = match self.variant {
            Variant::Paper => Params::paper(scale),
            Variant::Oriented => Params::for_radius(scale),
        };
        let least = |part| cloud_of(part).map_or(0.0, |shape| least_pixel(shape.cloud()));
        let least = parts.into_iter().map(least).fold(0.0, f32::max);
        let pixel_size = self.resolution.pixel_size(coarsest).min(to_resolve);
        Some(
            params
                .with_pixel_size(pixel_size.max(least))
                .with_prediction(prediction),
        )
    }
}

/// Appends the part pairs of `pair` that are within reach, and for each comparison its two sides;
/// the place of a comparison in `sides` is its place in the batch.
///
/// `hint` gets the part indices, the pose of the first part in the frame of shape 1, and the middle
/// of the region where the bounds meet, in the frame of the first part.
pub(crate) fn append_part_pairs<'a>(
    pair: ShapePair<'a>,
    config: &TldiConfig,
    parts: &mut Vec<PartPair>,
    sides: &mut Vec<[ExactShape<'a>; 2]>,
    mut hint: impl FnMut([u32; 2], Option<&Pose>, Vector) -> Hint,
) {
    let prediction = pair.prediction;
    for Parts {
        indices,
        poses: [pose1, pose2],
        shapes: [part1, part2],
    } in pairs_of_parts(pair.shape1, pair.shape2)
    {
        let mut a_from_b = pair.pos12;
        if let Some(pose2) = pose2 {
            a_from_b *= *pose2;
        }
        if let Some(pose1) = pose1 {
            a_from_b = pose1.inv_mul(&a_from_b);
        }
        let a_from_b = rigid(a_from_b);
        let part_pair = ShapePair::new(part1, part2, a_from_b, prediction);
        if !(part_pair.is_within_reach() && has_surface(part1) && has_surface(part2)) {
            continue;
        }
        let comparison = config.params([part1, part2], prediction).map(|params| {
            let a = part1.compute_local_aabb().loosened(prediction);
            let b = part2.compute_aabb(&a_from_b);
            let Hint { motion, last_axis } = hint(indices, pose1, middle_of_meeting(&a, &b));
            let query = sides.len();
            sides.push([ExactShape(part1), ExactShape(part2)]);
            Comparison {
                view: View::Aim {
                    policy: config.camera_policy,
                    motion,
                    last_axis,
                },
                params,
                scatter: config.scatter * 0.5 * params.thickness,
                query,
            }
        });
        parts.push(PartPair {
            indices,
            poses: [pose1.copied(), pose2.copied()],
            a_from_b,
            comparison,
        });
    }
}

/// Appends the queries of `parts` to the batch, in the order of `sides`.
pub(crate) fn append_queries<'s>(
    parts: &[PartPair],
    sides: &'s [[ExactShape<'_>; 2]],
    batch: &mut Vec<PairQuery<'s>>,
) {
    for part in parts {
        if let Some(comparison) = &part.comparison {
            debug_assert_eq!(batch.len(), comparison.query);
            let [a, b] = &sides[comparison.query];
            batch.push(PairQuery {
                a: surface(a),
                b: surface(b),
                a_from_b: part.a_from_b,
                view: comparison.view,
                params: comparison.params,
            });
        }
    }
}

pub(crate) fn surface<'s>(side: &'s ExactShape<'_>) -> Surface<'s> {
    match cloud_of(side.0) {
        Some(shape) => Surface::Cloud(shape.cloud()),
        None => Surface::Exact(side),
    }
}

/// Middle of the region where the bounds meet or, if they do not quite, of that between them.
fn middle_of_meeting(a: &Aabb, b: &Aabb) -> Vector {
    let (low, high) = (a.mins.max(b.mins), a.maxs.min(b.maxs));
    low.midpoint(high)
}
