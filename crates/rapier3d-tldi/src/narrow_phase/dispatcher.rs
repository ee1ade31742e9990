//! What rapier's narrow phase asks, and who answers.

use super::manifolds;
use super::queries;
use super::shape_casts;
use crate::narrow_phase::parts::{PartPair, ShapePair, has_cloud, part};
use crate::step::measured::{Measured, rolls};
use crate::step::prepared::{PROBE_ANSWER, PairKey, Question, Shared};
use rapier3d::geometry::{ContactData, ContactManifold, ContactManifoldData};
use rapier3d::math::{Pose, Vector};
use rapier3d::parry::query::details::{
    ContactManifoldsWorkspace, NormalConstraints, ShapeCastOptions,
};
use rapier3d::parry::query::{
    ClosestPoints, Contact, DefaultQueryDispatcher, NonlinearRigidMotion,
    PersistentQueryDispatcher, QueryDispatcher, ShapeCastHit, ShapeDistance, ShapeIntersection,
    Unsupported,
};
use rapier3d::parry::shape::Shape;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use tldi::PairResult;

/// Answers rapier's questions about pairs with a cloud. It takes the results that the pipeline
/// prepared, or compares the pair at once. Get it from
/// [`TldiPipeline::dispatcher`](crate::TldiPipeline::dispatcher).
///
/// It must come first in a chain. Rapier's default dispatcher answers some pairs with custom shapes
/// wrongly (no contacts) instead of declining them.
///
/// | question | pairs with a cloud | other pairs |
/// |---|---|---|
/// | contact manifolds | answered | declined |
/// | intersection (sensors) | whether the surfaces cross | declined |
/// | distance, closest points | between the surfaces; 0 where they intersect | declined |
/// | contact | the deepest point of a comparison where they intersect, else the nearest points | declined |
/// | shape casts, straight and turning | where the surfaces first meet | declined |
///
/// # Shape casts
/// The distance of a straight cast is exact to 0.2 r̄ of the coarser cloud if surfaces meet face
/// on. Otherwise it is exact to a pixel divided by the cosine between normal and motion. A target
/// distance counts along the normal. With `stop_at_penetration` off, a straight cast is held at its
/// start by what touches the shape there, if the motion leads into it: by more than 0.2 pixels in
/// its first pixel. Of the rest, and in turning casts, a shape passes two things: surfaces that touch
/// it at the start, unless the motion goes on towards them by more than a pixel; and surfaces that
/// only its rim would meet. The rim is two pixels wide, or three where the motion goes on by no more
/// than that. Turning casts are early by up to a pixel.
/// They may miss a surface that the shape touches only briefly: for less than it takes to turn by
/// half its CCD thickness. In a step of the pipeline, they ignore, from behind, a sheet that the
/// shape's contacts push it out of. Cost: both clouds and the layers in the way are read once for
/// each piece. A coarse piece turns the shape by half its CCD thickness. If something is met in it,
/// fine pieces displace no point by more than half a pixel. There are at most 64 of each.
///
/// # Distances, nearest points and contacts
/// The surface of a cloud is one disc for each point, as for rays
/// ([`PointCloudShape`](crate::PointCloudShape)). Without normals, discs lie on planes through 13
/// points. At an edge or a corner, only the bare point counts. Of compounds, the nearest parts
/// count and are named. Shapes intersect if discs cross each other or a surface, if a point is
/// inside one of rapier's solids, or if the nearest discs of two clouds with oriented normals lie
/// behind each other. A body inside a cloud with the surfaces apart does not intersect it.
///
/// Accuracy, for points of radius r and spacing r: between smooth surfaces with radii of curvature
/// R₁ and R₂, a distance is within r²/2 · (1/R₁ + 1/R₂) of the true one. It is exact for planes.
/// Shapes that are closer than this may count as touching. At the edges and corners of a box, the
/// distance is too large by the gap between the outermost points and the edge. Estimated normals
/// add 0.03 r, the edges of rapier's own shapes 0.15 r. If shapes intersect, a comparison measures
/// the depth.
///
/// Cost: O(log n) for each point that may be nearest. These are few on curved surfaces, and all on
/// faces that lie flat on each other, as in rapier's own answers for meshes. On one core, 3,000
/// points against one of rapier's shapes take 15–180 µs, against a cloud of 10,000 points 0.4–1.5
/// ms, and 3 ms flat on its face. The tree, and missing normals, are built on first use.
///
/// ```
/// use rapier3d::parry::query::QueryDispatcher;
/// use rapier3d::prelude::*;
/// use rapier3d_tldi::prelude::*;
/// let points: Vec<Vector> = (0..400)
///     .map(|i| Vector::new((i % 20) as f32, 0.0, (i / 20) as f32) * 0.1)
///     .collect();
/// let floor = PointCloudShape::new(PointCloud::builder(points).radius(0.1).build()?);
/// let dispatcher = TldiPipeline::new(TldiConfig::default())?.dispatcher();
/// // A ball of 0.2 m half a metre above the floor.
/// let pose = Pose::from_translation(Vector::new(1.02, 0.7, 0.93));
/// let answer = dispatcher.distance(&pose, &floor, &Ball::new(0.2)).expect("holds a cloud");
/// assert!((answer.distance - 0.5).abs() < 1e-4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone)]
pub struct TldiDispatcher {
    shared: Arc<Shared>,
}

impl TldiDispatcher {
    pub(crate) fn new(shared: Arc<Shared>) -> Self {
        Self { shared }
    }

    /// Declines unless one of the shapes holds a cloud.
    fn accept(shape1: &dyn Shape, shape2: &dyn Shape) -> Result<(), Unsupported> {
        if has_cloud(shape1) || has_cloud(shape2) {
            Ok(())
        } else {
            Err(Unsupported)
        }
    }
}

impl PersistentQueryDispatcher<ContactManifoldData, ContactData> for TldiDispatcher {
    fn contact_manifolds(
        &self,
        pos12: &Pose,
        shape1: &dyn Shape,
        shape2: &dyn Shape,
        prediction: f32,
        manifolds: &mut Vec<ContactManifold>,
        workspace: &mut Option<ContactManifoldsWorkspace>,
    ) -> Result<(), Unsupported> {
        Self::accept(shape1, shape2).inspect_err(|_| manifolds::leave(manifolds, workspace))?;
        let pair = ShapePair::new(shape1, shape2, *pos12, prediction);
        let batch = self.shared.batch();
        let key = PairKey::new(Question::Contacts(prediction), [shape1, shape2], pos12);
        let bodies = manifolds.first().map(|manifold| {
            let data = &manifold.data;
            [data.rigid_body1, data.rigid_body2]
        });
        let prepared = batch.get(&key, bodies);
        if let Some(prepared) = prepared.filter(|prepared| !prepared.is_kept) {
            prepared.used.store(true, Ordering::Relaxed);
            let parts = &batch.parts[prepared.parts.clone()];
            let measured = prepared.measured;
            manifolds::fill(&pair, measured, parts, &batch.results, manifolds, workspace);
            return Ok(());
        }
        if manifolds::keep(&pair, manifolds, workspace) {
            if let Some(prepared) = prepared {
                prepared.used.store(true, Ordering::Relaxed);
            }
            return Ok(());
        }
        drop(batch);
        let config = self.shared.config();
        let measured = Measured::new(&pair, &config);
        let filled = self
            .shared
            .compare_on_the_spot(pair, &config, |parts, results| {
                let measured = measured.filter(|_| !rolls(parts, results));
                manifolds::fill(&pair, measured, parts, results, manifolds, workspace);
            });
        if filled.is_none() {
            manifolds::fill(&pair, None, &[], &[], manifolds, workspace);
        }
        Ok(())
    }

    fn contact_manifold_convex_convex(
        &self,
        _pos12: &Pose,
        _shape1: &dyn Shape,
        _shape2: &dyn Shape,
        _normal_constraints1: Option<&dyn NormalConstraints>,
        _normal_constraints2: Option<&dyn NormalConstraints>,
        _prediction: f32,
        _manifold: &mut ContactManifold,
    ) -> Result<(), Unsupported> {
        Err(Unsupported)
    }
}

impl QueryDispatcher for TldiDispatcher {
    fn intersection_test(
        &self,
        pos12: &Pose,
        shape1: &dyn Shape,
        shape2: &dyn Shape,
    ) -> Result<ShapeIntersection, Unsupported> {
        Self::accept(shape1, shape2)?;
        let pair = ShapePair::new(shape1, shape2, *pos12, 0.0);
        let crosses = |pair: &PartPair, results: &[PairResult]| match pair.result(results) {
            Some(result) => result.collides || result.gap.is_some_and(|gap| gap <= 0.0),
            None => DefaultQueryDispatcher
                .intersection_test(
                    &pair.a_from_b,
                    part(shape1, pair.indices[0]).1,
                    part(shape2, pair.indices[1]).1,
                )
                .is_ok_and(|answer| answer.intersecting),
        };
        let first_crossing = |parts: &[PartPair], results: &[PairResult]| {
            let crossing = parts.iter().find(|pair| crosses(pair, results));
            crossing.map(|pair| pair.indices)
        };
        let batch = self.shared.batch();
        let key = PairKey::new(Question::Crossing, [shape1, shape2], pos12);
        let crossing = if let Some(prepared) = batch.get(&key, None) {
            prepared.used.store(true, Ordering::Relaxed);
            first_crossing(&batch.parts[prepared.parts.clone()], &batch.results)
        } else {
            drop(batch);
            let config = self.shared.config().for_intersection();
            self.shared
                .compare_on_the_spot(pair, &config, first_crossing)
                .flatten()
        };
        Ok(match crossing {
            Some([part1, part2]) => ShapeIntersection::new(true).with_subshapes(part1, part2),
            None => ShapeIntersection::new(false),
        })
    }

    /// 0 where the shapes intersect. The pipeline finds out by a shape of its own whether it is
    /// attached.
    fn distance(
        &self,
        pos12: &Pose,
        shape1: &dyn Shape,
        shape2: &dyn Shape,
    ) -> Result<ShapeDistance, Unsupported> {
        if std::ptr::addr_eq(shape1, &raw const self.shared.probe) {
            return Ok(ShapeDistance::new(PROBE_ANSWER));
        }
        Self::accept(shape1, shape2)?;
        let found = queries::closest(pos12, shape1, shape2, f32::MAX)?;
        Ok(found.map_or(ShapeDistance::new(f32::MAX), |found| {
            let [part1, part2] = found.parts;
            ShapeDistance::new(found.distance).with_subshapes(part1, part2)
        }))
    }

    fn contact(
        &self,
        pos12: &Pose,
        shape1: &dyn Shape,
        shape2: &dyn Shape,
        prediction: f32,
    ) -> Result<Option<Contact>, Unsupported> {
        Self::accept(shape1, shape2)?;
        let pair = ShapePair::new(shape1, shape2, *pos12, prediction);
        queries::contact(&self.shared, pair)
    }

    fn closest_points(
        &self,
        pos12: &Pose,
        shape1: &dyn Shape,
        shape2: &dyn Shape,
        max_distance: f32,
    ) -> Result<ClosestPoints, Unsupported> {
        Self::accept(shape1, shape2)?;
        let limit = max_distance.max(0.0).next_up();
        Ok(match queries::closest(pos12, shape1, shape2, limit)? {
            None => ClosestPoints::Disjoint,
            Some(found) if found.distance <= 0.0 => ClosestPoints::Intersecting,
            Some(found) => {
                let [point1, point2] = found.points;
                ClosestPoints::WithinMargin(point1, pos12.inverse() * point2)
            }
        })
    }

    fn cast_shapes(
        &self,
        pos12: &Pose,
        local_velocity12: Vector,
        shape1: &dyn Shape,
        shape2: &dyn Shape,
        options: ShapeCastOptions,
    ) -> Result<Option<ShapeCastHit>, Unsupported> {
        Self::accept(shape1, shape2)?;
        let pair = ShapePair::new(shape1, shape2, *pos12, 0.0);
        shape_casts::cast_shapes(&self.shared, &pair, local_velocity12, options)
    }

    fn cast_shapes_nonlinear(
        &self,
        motion1: &NonlinearRigidMotion,
        shape1: &dyn Shape,
        motion2: &NonlinearRigidMotion,
        shape2: &dyn Shape,
        start_time: f32,
        end_time: f32,
        stop_at_penetration: bool,
    ) -> Result<Option<ShapeCastHit>, Unsupported> {
        Self::accept(shape1, shape2)?;
        shape_casts::cast_shapes_nonlinear(
            &self.shared,
            [motion1, motion2],
            [shape1, shape2],
            (start_time, end_time),
            stop_at_penetration,
        )
    }
}
