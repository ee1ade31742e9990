//! What rapier's narrow phase asks, and who answers.

use crate::manifolds;
use crate::measured::Measured;
use crate::parts::{PartPair, ShapePair, has_cloud, part};
use crate::prepared::{Batch, PROBE_ANSWER, PairKey, PreparedPair, Shared};
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
/// | shape casts | declined | declined |
#[derive(Clone)]
pub struct TldiDispatcher {
    shared: Arc<Shared>,
}

impl TldiDispatcher {
    pub(crate) fn new(shared: Arc<Shared>) -> Self {
        Self { shared }
    }

    /// What the batch holds about `pair`, if rapier asks as foreseen.
    fn prepared<'b>(batch: &'b Batch, pair: &ShapePair<'_>) -> Option<&'b PreparedPair> {
        batch.get(&PairKey::new(pair.shape1, pair.shape2, &pair.pos12))
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
        let prepared = Self::prepared(&batch, &pair).filter(|p| p.prediction == prediction);
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
        let measured = Measured::new(&pair, &self.shared.config);
        let filled = self.shared.compare_on_the_spot(pair, |parts, results| {
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
        let prepared = Self::prepared(&batch, &pair).filter(|prepared| !prepared.is_kept);
        let crossing = if let Some(prepared) = prepared {
            prepared.used.store(true, Ordering::Relaxed);
            first_crossing(&batch.parts[prepared.parts.clone()], &batch.results)
        } else {
            drop(batch);
            self.shared
                .compare_on_the_spot(pair, first_crossing)
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
