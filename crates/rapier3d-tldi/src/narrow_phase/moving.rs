//! Two parts of which the smaller one is taken to move, and what it hits.

use crate::TldiConfig;
use rapier3d::math::Pose;
use rapier3d::parry::query::{ShapeCastHit, ShapeCastStatus};
use rapier3d::parry::shape::Shape;
use tldi::plan::first_is_smaller;
use tldi::{Impact, Params};

/// Distance in pixels up to which surfaces count as touching. It is twice the scatter of measured
/// gaps (0.1), because contacts are kept until a pair has moved by that much. Half or twice: no
/// change in any suite.
pub(super) const TOUCHING: f32 = 0.2;

/// A pair of parts, the smaller one second: it is taken to move.
pub(super) struct Moving<'a> {
    pub(super) parts: [&'a dyn Shape; 2],
    /// Whether the second part was the first one.
    pub(super) is_swapped: bool,
}

impl<'a> Moving<'a> {
    pub(super) fn new([part1, part2]: [&'a dyn Shape; 2]) -> Self {
        let extents = [part1, part2].map(|part| part.compute_local_aabb().extents());
        let is_swapped = first_is_smaller(extents);
        Self {
            parts: if is_swapped {
                [part2, part1]
            } else {
                [part1, part2]
            },
            is_swapped,
        }
    }

    /// What belongs to the parts, in their order.
    pub(super) fn order<T>(&self, [of1, of2]: [T; 2]) -> [T; 2] {
        if self.is_swapped {
            [of2, of1]
        } else {
            [of1, of2]
        }
    }

    /// A hit in the order in which the parts were given.
    pub(super) fn restore(&self, hit: ShapeCastHit) -> ShapeCastHit {
        if self.is_swapped { hit.swapped() } else { hit }
    }

    pub(super) fn params(&self, config: &TldiConfig) -> Option<Params> {
        config.params(self.parts, 0.0)
    }
}

/// The hit of an impact; `a_from_b` maps from the second part's frame as it is then.
pub(super) fn hit_of(impact: &Impact, time_of_impact: f32, a_from_b: &Pose) -> ShapeCastHit {
    let b_from_a = a_from_b.inverse();
    ShapeCastHit {
        time_of_impact,
        witness1: impact.point,
        witness2: b_from_a * impact.point,
        normal1: impact.normal,
        normal2: b_from_a.rotation * -impact.normal,
        status: ShapeCastStatus::Converged,
        subshape1: 0,
        subshape2: 0,
    }
}
