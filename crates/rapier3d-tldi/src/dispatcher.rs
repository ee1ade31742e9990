//! What rapier's narrow phase asks, and who answers.

use crate::manifolds;
use crate::measured::{Measured, rolls};
use crate::parts::{PartPair, ShapePair, has_cloud, part};
use crate::prepared::{PROBE_ANSWER, PairKey, Question, Shared};
use crate::queries;
use crate::shape_casts;
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

/// Answers rapier's questions about pairs with a cloud, from the results that its pipeline
/// prepared, or else by a comparison on the spot. Got from
/// [`TldiPipeline::dispatcher`](crate::TldiPipeline::dispatcher).
///
/// It must come first in a chain: rapier's default dispatcher answers some pairs with custom
/// shapes wrongly (no contacts) where it should decline.
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
/// The time of a straight cast is good to 0.2 r̄ of the coarser cloud over the speed where surfaces
/// meet face on, and to a pixel over the cosine between normal and motion where they do not; a target
/// distance counts along the motion. With `stop_at_penetration` off, and in turning casts, what touches
/// at the start is passed unless the motion goes on towards it by more than a pixel, and so is what
/// only the outer two pixels of the moving shape would meet, or three where it goes on by no more. Turning casts are early by up to a
/// pixel; what a shape touches for less than it takes to turn by half its CCD thickness may be passed. In a step
/// of the pipeline they do not stop a shape, from behind, at a sheet that its contacts push it out of.
/// Cost: reading both clouds and the layers in the way, for each piece in which the shape turns by that
/// and, of pieces in which something is met, for each in which it displaces no point by more than half a
/// pixel (64 of either at the most).
///
/// # Distances, nearest points and contacts
/// The surface of a cloud is a disc a sample, as for rays ([`PointCloudShape`](crate::PointCloudShape));
/// a cloud without normals has those of planes through 13 samples, and at an edge or a corner there
/// is the bare sample. Of compounds the nearest parts count, and are named. Shapes intersect where
/// discs cross each other or a surface, where a sample is inside a solid of rapier's, and where the
/// nearest discs of two clouds with oriented normals lie behind each other. A body inside a cloud,
/// surfaces apart, does not intersect it.
///
/// Accuracy, for samples of radius r (spacing r): where smooth surfaces with radii of curvature R₁
/// and R₂ are nearest, a distance is within r²/2 · (1/R₁ + 1/R₂) of the true one, exact for planes;
/// closer ones may count as touching. At the edges and corners of a box it is too large by what
/// the outermost samples are short of them. Estimated normals add 0.03 r, the edges of rapier's own
/// shapes 0.15 r. How deep shapes are that intersect is measured by a comparison, on the spot.
///
/// Cost: O(log n) for each sample that may be nearest. On curved surfaces these are few; of faces
/// that lie flat on each other it is all, as in rapier's own answers for meshes. 3,000 samples
/// against a shape of rapier's take 15–180 µs, against a cloud of 10,000 0.4–1.5 ms, flat on its
/// face 3 ms (one core). The tree, and the normals of a cloud without, are built when first asked
/// for.
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
        Self::accept(shape1, shape2)?;
        let pair = ShapePair {
            shape1,
            shape2,
            pos12: *pos12,
            prediction,
        };
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
        let pair = ShapePair {
            shape1,
            shape2,
            pos12: *pos12,
            prediction: 0.0,
        };
        let crosses = |pair: &PartPair, results: &[PairResult]| match &pair.comparison {
            Some(comparison) => {
                let result = &results[comparison.query];
                result.collides || result.gap.is_some_and(|gap| gap <= 0.0)
            }
            None => DefaultQueryDispatcher
                .intersection_test(
                    &pair.a_from_b,
                    part(shape1, pair.parts[0]).1,
                    part(shape2, pair.parts[1]).1,
                )
                .is_ok_and(|answer| answer.intersecting),
        };
        let first_crossing = |parts: &[PartPair], results: &[PairResult]| {
            let crossing = parts.iter().find(|pair| crosses(pair, results));
            crossing.map(|pair| pair.parts)
        };
        let batch = self.shared.batch();
        let key = PairKey::new(Question::Crossing, [shape1, shape2], pos12);
        let prepared = batch.get(&key, None).filter(|prepared| !prepared.is_kept);
        let crossing = if let Some(prepared) = prepared {
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
        let pair = ShapePair {
            shape1,
            shape2,
            pos12: *pos12,
            prediction,
        };
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
        let pair = ShapePair {
            shape1,
            shape2,
            pos12: *pos12,
            prediction: 0.0,
        };
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
