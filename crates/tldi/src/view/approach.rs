//! Where two surfaces are and how they move against each other, as the stage `aim` asks.

use crate::Aabb;
use crate::pair::surface::first_is_smaller;
use glamx::{Pose3, Quat, Vec3};

/// Least weight of the direction to `b`, see [`Approach::plainness`]. Half: 16 of 636 stability rows fail instead of 3,
/// all new ones of a ball in a groove; twice: no change.
const LEAST_PLAIN: f32 = 0.2;

/// Share of its half extent by which the middle of the smaller surface is plainly on one side of the other. Half or
/// twice: no row changes.
const PLAINLY: f32 = 0.5;

/// Least cosine between a motion and an axis at which the motion tells from which side `b` came. A motion that runs
/// along the surface more than across it does not tell: a slope may lean either way. Half or twice the angle: no row
/// changes.
const CROSSING: f32 = 0.5;

/// For [`stage_constants`](crate::pair::plan::stage_constants).
pub(crate) const CONSTANTS: [(&str, f64); 2] =
    [("PLAINLY", PLAINLY as f64), ("CROSSING", CROSSING as f64)];

/// What else than the normals decides the axis; in the frame of `a`.
#[derive(Clone, Copy, Debug)]
pub struct Approach {
    /// From the frame of `a` into that of the larger surface.
    pub larger_from_a: Quat,
    /// Half the extents of the region where the bounds meet, in the frame of the larger surface,
    /// metres.
    pub half_extents: Vec3,
    /// From the middle of where the bounds meet to the middle of `b`, metres.
    pub lies: Vec3,
    /// Of `b` over the step, metres.
    pub motion: Vec3,
    /// The smaller surface.
    pub body: Body,
    /// The main axis of the frame before.
    pub last_axis: Option<Vec3>,
}

/// The smaller surface of a pair, taken for a body.
#[derive(Clone, Copy, Debug)]
pub struct Body {
    /// Middle of its bounds, in the frame of `a`, metres.
    pub middle: Vec3,
    /// Half the extents of its bounds, in its own frame, metres.
    pub half_extents: Vec3,
    /// From the frame of `a` into its own.
    pub from_a: Quat,
    /// Whether it is `b`.
    pub is_b: bool,
}

impl Body {
    /// Whether `b`, off by `offset`, is plainly on the side of `a` that `axis` points away from, or
    /// on the other; `sheet` is where along `axis` the larger surface faces it, metres.
    fn side(&self, sheet: f32, axis: Vec3, offset: Vec3) -> Option<bool> {
        let share = self.share_along(axis, sheet, offset);
        (share.abs() > PLAINLY).then_some(share < 0.0)
    }

    /// Signed distance of `b`, moved by `offset`, from the larger surface along `axis`, in half extents of the smaller one.
    /// Positive: `axis` points from `a` to `b`.
    fn share_along(&self, axis: Vec3, sheet: f32, offset: Vec3) -> f32 {
        let toward_body = self.middle.dot(axis) - sheet;
        let toward_b = if self.is_b { toward_body } else { -toward_body };
        let half = self.half_extents.dot((self.from_a * axis).abs());
        (toward_b + axis.dot(offset)) / half.max(f32::MIN_POSITIVE)
    }
}

/// A unit vector along `axis`: itself, to the bit, if it is one.
fn unit(axis: Vec3) -> Option<Vec3> {
    match axis.is_normalized() {
        true => Some(axis),
        false => axis.try_normalize(),
    }
}

/// Length of a motion, metres, if it is along `axis`; else 0.
///
/// ```
/// use tldi::{glamx::Vec3, plan::moved_along};
/// assert_eq!(moved_along(3.0 * Vec3::X, Vec3::X), 3.0);
/// assert_eq!(moved_along(3.0 * Vec3::X, -Vec3::X), 0.0);
/// ```
pub fn moved_along(motion: Vec3, axis: Vec3) -> f32 {
    match motion.dot(axis) > 0.0 {
        true => motion.length(),
        false => 0.0,
    }
}

impl Approach {
    /// `motion` is that of `b` relative to `a` over the step, in the frame of `a`, metres.
    pub(crate) fn new(
        a: &Aabb,
        b: &Aabb,
        a_from_b: &Pose3,
        motion: Vec3,
        last_axis: Option<Vec3>,
    ) -> Self {
        // A small body on a large scan lies on the side of its own middle. In the frame of the
        // smaller surface the larger one would fill its bounds, and they would tell nothing.
        let is_b = !first_is_smaller([a.extents(), b.extents()]);
        let meeting = |larger: &Aabb, smaller: &Aabb| {
            let (low, high) = (larger.min.max(smaller.min), larger.max.min(smaller.max));
            let half_extents = 0.5 * (high - low).abs();
            (smaller.center() - 0.5 * (low + high), half_extents)
        };
        let b_from_a = a_from_b.inverse();
        let (toward_b, half_extents, larger_from_a, body) = if is_b {
            let (toward_b, half_extents) = meeting(a, &b.transformed(a_from_b));
            let body = Body {
                middle: *a_from_b * b.center(),
                half_extents: 0.5 * b.extents(),
                from_a: b_from_a.rotation,
                is_b,
            };
            (toward_b, half_extents, Quat::IDENTITY, body)
        } else {
            let (toward_a, half_extents) = meeting(b, &a.transformed(&b_from_a));
            let toward_b = a_from_b.rotation * -toward_a;
            let body = Body {
                middle: a.center(),
                half_extents: 0.5 * a.extents(),
                from_a: Quat::IDENTITY,
                is_b,
            };
            (toward_b, half_extents, b_from_a.rotation, body)
        };
        Self {
            larger_from_a,
            half_extents,
            lies: toward_b,
            motion,
            body,
            last_axis: last_axis.and_then(unit),
        }
    }

    /// From where the bounds meet to where `b` lies or comes from, metres.
    pub fn toward_b(&self) -> Vec3 {
        self.lies - self.motion
    }

    /// From `a` towards `b`, unit length or zero.
    pub(crate) fn direction(&self) -> Vec3 {
        self.toward_b().normalize_or_zero()
    }

    /// Half of where the bounds meet, along `axis`, metres.
    pub(crate) fn half_extent(&self, axis: Vec3) -> f32 {
        self.half_extents.dot((self.larger_from_a * axis).abs())
    }

    /// Weight of the direction to `b`. It is 1 if `b` lies outside the overlap of the bounds, or
    /// comes from there. Inside it is less, but enough to decide between two similar walls.
    pub fn plainness(&self) -> f32 {
        let inside = self.half_extent(self.direction()).max(f32::MIN_POSITIVE);
        (self.toward_b().length() / inside).clamp(LEAST_PLAIN, 1.0)
    }

    /// Whether `b` surely lies on the side of `a` that `axis` points away from. This is so if its
    /// middle, or the place it came from, is plainly off the near points of `a`, or outside the
    /// overlap of the bounds.
    pub(crate) fn side_by_position(&self, axis: Vec3, sheet: Option<f32>) -> Option<bool> {
        let side = |from: Vec3| match sheet {
            Some(sheet) => self.body.side(sheet, axis, from),
            None => {
                let along = (self.lies + from).dot(axis);
                (along.abs() > self.half_extent(axis)).then_some(along < 0.0)
            }
        };
        let crosses = self.motion.dot(axis).abs() >= CROSSING * self.motion.length();
        let before = side(-self.motion).filter(|_| crosses);
        before.or_else(|| side(Vec3::ZERO))
    }

    /// The side of `a` on which `b` seems to lie, or from which it seems to come, along `axis`,
    /// when nothing is certain. If the near points may be a sheet, `b`'s middle and these points
    /// decide, in half extents of the body: the bounds of a tilted sheet hold a body on either side
    /// of it. Elsewhere the bounds decide, as a cosine.
    pub(crate) fn leaning(&self, axis: Vec3, sheet: Option<f32>) -> f32 {
        match sheet {
            Some(sheet) => self.body.share_along(axis, sheet, -self.motion),
            None => axis.dot(self.direction()),
        }
    }
}
