//! How long measured contacts stay valid.
//!
//! Every comparison samples the surfaces anew, and its depths vary by up to a tenth of the coarser
//! cloud's point radius. In every step, this noise would keep bodies from coming to rest. So
//! contacts are measured again only after the pair has moved by that distance. Until then they stay
//! fixed to their bodies. Rapier does the same for its own shapes (`contact_recycling`), with a
//! distance that does not depend on the cloud.

use crate::TldiConfig;
use crate::narrow_phase::parts::{
    PartPair, ShapePair, cloud_shapes_of, coarsest_radius, results_of,
};
use rapier3d::math::Pose;
use rapier3d::parry::bounding_volume::Aabb;
use rapier3d::parry::shape::Shape;
use tldi::plan::{first_is_smaller, largest_pixel};
use tldi::{ContactPatch, PairResult};

/// Whether a pair touches in one or two round spots or lines. Such a pair rolls, and a point that
/// is fixed to the bodies would soon be late. A contact point that lags by a tenth of a
/// radius accelerates a ball as a slope would.
pub(crate) fn rolls(parts: &[PartPair], results: &[PairResult]) -> bool {
    let patches = results_of(parts, results).flat_map(|result| &result.patches);
    parts.iter().all(|part| part.comparison.is_some())
        && (1..=2).contains(&patches.clone().count())
        && patches.clone().all(ContactPatch::is_round)
}

/// Where a pair's contacts were measured, and for how long they hold.
#[derive(Clone, Copy, PartialEq)]
pub(crate) struct Measured {
    pos12: Pose,
    prediction: f32,
    /// Of the points: the user may change them without a word to the pipeline.
    revision: u64,
    /// Bounds of the smaller shape, in its own frame: only where it is can there be contacts.
    bounds: Aabb,
    shape1_is_smaller: bool,
    /// How far the smaller shape may move relative to the other, in metres.
    max_drift: f32,
}

impl Measured {
    /// The measurement of `pair`, or `None` where it does not outlive the step: shapes that deform
    /// in place, or a configuration that says so.
    pub(crate) fn new(pair: &ShapePair<'_>, config: &TldiConfig) -> Option<Self> {
        let deforms = |shape: &dyn Shape| {
            shape
                .as_composite_shape()
                .is_some_and(|shape| shape.is_deformable())
        };
        if deforms(pair.shape1) || deforms(pair.shape2) {
            return None;
        }
        let coarsest = coarsest_radius([pair.shape1, pair.shape2])?;
        let bounds = [pair.shape1, pair.shape2].map(|shape| shape.compute_local_aabb());
        let shape1_is_smaller = first_is_smaller(bounds.map(|bounds| bounds.extents()));
        let smaller = bounds[usize::from(!shape1_is_smaller)];
        // Otherwise a body smaller than the spacing of the points would be through them before they
        // are compared again.
        let max_drift = config.scatter * coarsest.min(largest_pixel(smaller.extents(), 0.0));
        (max_drift > 0.0).then_some(Self {
            pos12: pair.pos12,
            prediction: pair.prediction,
            revision: revision_of(pair),
            bounds: smaller,
            shape1_is_smaller,
            max_drift,
        })
    }

    /// Whether the clouds of the pair have the points that were measured.
    pub(crate) fn is_of_same_points(&self, pair: &ShapePair<'_>) -> bool {
        self.revision == revision_of(pair)
    }

    /// How far one collider has turned beside the other since, radians. Of half a turn, 2.
    pub(crate) fn turned(&self, pair: &ShapePair<'_>) -> f32 {
        let turn = self.pos12.rotation.inverse() * pair.pos12.rotation;
        2.0 * turn.xyz().length()
    }

    /// Whether the contacts still hold for the pair where it is now.
    pub(crate) fn holds(&self, pair: &ShapePair<'_>) -> bool {
        let pos12 = &pair.pos12;
        if pair.prediction != self.prediction || !self.is_of_same_points(pair) {
            return false;
        }
        let (before, now) = if self.shape1_is_smaller {
            (self.pos12.inverse(), pos12.inverse())
        } else {
            (self.pos12, *pos12)
        };
        // A rigid motion moves no point of a box farther than the farthest of its corners.
        let corners = self.bounds.vertices();
        let limit = self.max_drift * self.max_drift;
        corners
            .into_iter()
            .all(|corner| (now * corner).distance_squared(before * corner) <= limit)
    }
}

/// Changes when a cloud of the pair gets other points.
fn revision_of(pair: &ShapePair<'_>) -> u64 {
    let clouds = cloud_shapes_of(pair.shape1).chain(cloud_shapes_of(pair.shape2));
    clouds.fold(0, |sum: u64, cloud| {
        sum.wrapping_mul(31).wrapping_add(cloud.revision())
    })
}
