//! The part of a straight way on which two shapes can meet.
//!
//! A cast may be as long as an `f32` can say. Images are built only for the part on which the shapes' bounds meet, so
//! they are no larger than the shapes. Lengths of the whole are `f64`, whose squares do not overflow.

use crate::narrow_phase::parts::cloud_of;
use rapier3d::glamx::DVec3;
use rapier3d::math::{Pose, Vector};
use rapier3d::parry::shape::Shape;
use tldi::Params;

/// Longest part of a way in pixels: what the images resolve in depth. Half or twice: no row of any suite changes.
const MAX_PIXELS: f64 = 131_072.0;

/// By how much bounding spheres are enlarged, in themselves: rounding, and the contact zone around them. Half or
/// twice: no change in any suite.
const ENLARGED: f64 = 2.0;

/// What of a straight motion can bring a moving shape to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct StraightWay {
    /// Unit vector.
    pub(crate) direction: Vector,
    /// From where on, and until where, the bounds meet, metres along the way.
    pub(crate) from: f64,
    pub(crate) to: f64,
}

impl StraightWay {
    /// The way of the second part along `way`, metres. `a_from_b` is its pose in the frame of the first. `None` if the way
    /// has no length, or passes the first part.
    pub(crate) fn new(
        parts: [&dyn Shape; 2],
        a_from_b: &Pose,
        way: DVec3,
        params: &Params,
    ) -> Option<Self> {
        let direction = way.try_normalize()?;
        let middles = parts.map(|part| part.compute_local_bounding_sphere().center);
        let [reach_a, reach_b] = parts.map(|part| {
            let points = cloud_of(part).map_or(0.0, |shape| shape.cloud().max_radius());
            let around = points + params.prediction;
            let sphere = part.compute_local_bounding_sphere();
            ENLARGED * (f64::from(sphere.radius) + f64::from(around))
        });
        let middle_b = (a_from_b * middles[1]).as_dvec3();
        let (from, to) = if let Some(ground) = parts[0].as_halfspace() {
            let normal = ground.normal.as_dvec3();
            let (gap, approach) = (normal.dot(middle_b) - reach_b, -normal.dot(direction));
            if gap > 0.0 && approach <= 0.0 {
                return None;
            }
            let from = if gap > 0.0 { gap / approach } else { 0.0 };
            (from, f64::INFINITY)
        } else {
            // The chord of a ball around the first one's middle.
            let apart = middle_b - middles[0].as_dvec3();
            let nearest = -apart.dot(direction);
            let beside = apart + nearest * direction;
            let half = (reach_a + reach_b).powi(2) - beside.length_squared();
            let half = (half >= 0.0).then(|| half.sqrt())?;
            ((nearest - half).max(0.0), nearest + half)
        };
        let longest = MAX_PIXELS * f64::from(params.pixel_size);
        let to = to.min(way.length()).min(from + longest);
        (from < to).then_some(Self {
            direction: direction.as_vec3(),
            from,
            to,
        })
    }

    /// The second part's pose where its way can first bring it to the first.
    pub(crate) fn begin(&self, a_from_b: &Pose) -> Pose {
        self.at(a_from_b, 0.0)
    }

    /// The same `distance` metres farther.
    pub(crate) fn at(&self, a_from_b: &Pose, distance: f32) -> Pose {
        let moved = (self.from + f64::from(distance)) * self.direction.as_dvec3();
        let translation = a_from_b.translation.as_dvec3() + moved;
        Pose::from_parts(translation.as_vec3(), a_from_b.rotation)
    }

    /// What is moved from there, metres.
    pub(crate) fn motion(&self) -> Vector {
        (self.to - self.from) as f32 * self.direction
    }
}
