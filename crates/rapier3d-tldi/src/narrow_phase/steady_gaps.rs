//! Keeps the gaps of rigid bodies from jumping between two measurements.
//!
//! Where a pair has moved, its contacts are measured again. The pixels then lie otherwise on the points, and at edges and on
//! thin parts a gap may differ by half a radius from that of the measurement before. A body that loses the contact it lies on
//! drops until it is measured again: in a heap something always drops, and nothing comes to rest. But rigid bodies get nearer
//! or farther by their motion, which is known exactly, and by what slides into the contact. What differs by more is an error
//! of the measurement.

use crate::narrow_phase::manifolds::{COS_SAME_NORMAL, nearest};
use crate::narrow_phase::parts::ShapePair;
use rapier3d::geometry::{ContactData, ContactManifold};
use rapier3d::glamx::Mat3;
use rapier3d::math::Vector;
use rapier3d::parry::query::TrackedContact;

/// How much a gap may change by itself for each metre that the surfaces slide: the tangent of the angle up to which contacts
/// count as the same ([`COS_SAME_NORMAL`]). What is steeper has another normal. Of 288 concave bodies in heaps 126 sleep after
/// 400 steps. Half: 202, but the gap of what slides over a slope lags behind; twice: 6.
const STEEPEST: f32 = 0.484;

/// The measurement before.
pub(super) struct Before<'a> {
    /// Its contacts, moved to where the pair is now, in the frames of the colliders.
    pub(super) manifolds: &'a [ContactManifold],
    /// How far the pair has turned since, radians.
    pub(super) turned: f32,
    /// A contact that is farther from all of its contacts is new, metres.
    pub(super) match_distance: f32,
    /// Contacts that are less apart say little of how a gap rises, metres.
    pub(super) pixel_size: f32,
}

impl Before<'_> {
    /// Limits how far the gaps of `manifold`, which was just measured in the frames of the colliders of `pair`, differ from
    /// what the motion made of those before. New contacts are as deep as they are.
    ///
    /// A contact that rolls is at other places of both surfaces each time. While they turn, gaps there change by no more than
    /// by that angle.
    pub(super) fn steady(&self, manifold: &mut ContactManifold, pair: &ShapePair<'_>) {
        let normal = manifold.local_n1;
        let is_same = |old: &ContactManifold| old.local_n1.dot(normal) >= COS_SAME_NORMAL;
        for point in &mut manifold.points {
            let Some((m, p)) = nearest(point, self.manifolds, self.match_distance, is_same) else {
                continue;
            };
            let old = GapPlane::of(&self.manifolds[m], pair, self.pixel_size);
            let nearest = &self.manifolds[m].points[p];
            let slid = old.flat(apart(nearest, pair)).length();
            let place = middle(point, pair);
            let aside = old.flat(place - middle(nearest, pair)).length();
            let most = STEEPEST * slid + self.turned * aside;
            let expected = old.at(place);
            let change = point.dist.max(expected - most).min(expected + most) - point.dist;
            point.dist += change;
            let half = 0.5 * change * normal;
            point.local_p1 -= half;
            point.local_p2 += pair.pos12.rotation.inverse() * half;
        }
    }
}

/// From the first collider's surface to the second's, in the frame of the first.
fn apart(contact: &TrackedContact<ContactData>, pair: &ShapePair<'_>) -> Vector {
    pair.pos12 * contact.local_p2 - contact.local_p1
}

/// Between the surfaces, in the frame of the first collider.
fn middle(contact: &TrackedContact<ContactData>, pair: &ShapePair<'_>) -> Vector {
    contact.local_p1 + 0.5 * apart(contact, pair)
}

/// The plane through the gaps of a manifold.
struct GapPlane {
    normal: Vector,
    centre: Vector,
    at_centre: f32,
    /// Metres per metre.
    slope: Vector,
}

impl GapPlane {
    fn of(manifold: &ContactManifold, pair: &ShapePair<'_>, pixel_size: f32) -> Self {
        let points = || manifold.points.iter();
        let share = 1.0 / manifold.points.len() as f32;
        let mut plane = Self {
            normal: manifold.local_n1,
            centre: share * points().map(|point| middle(point, pair)).sum::<Vector>(),
            at_centre: share * points().map(|point| point.dist).sum::<f32>(),
            slope: Vector::ZERO,
        };
        let mut spread = Mat3::from_diagonal(Vector::splat(pixel_size * pixel_size));
        let mut rise = Vector::ZERO;
        for point in points() {
            let place = plane.flat(middle(point, pair) - plane.centre);
            spread += Mat3::from_cols(place * place.x, place * place.y, place * place.z);
            rise += place * (point.dist - plane.at_centre);
        }
        plane.slope = spread.inverse() * rise;
        plane
    }

    /// What of a vector is along the plane.
    fn flat(&self, vector: Vector) -> Vector {
        vector.reject_from_normalized(self.normal)
    }

    /// The gap at a place, metres.
    fn at(&self, place: Vector) -> f32 {
        self.at_centre + self.slope.dot(place - self.centre)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rapier3d::math::{Pose, Rotation};
    use rapier3d::parry::shape::{Ball, PackedFeatureId};

    /// Contacts between two colliders at one pose, with the normal y, at these places and with these gaps.
    fn contacts(pose: &Pose, points: &[(Vector, f32)]) -> ContactManifold {
        let mut manifold = ContactManifold::new();
        manifold.local_n1 = Vector::Y;
        manifold.local_n2 = pose.rotation.inverse() * -Vector::Y;
        manifold.points = (points.iter())
            .map(|&(middle, gap)| {
                let half = 0.5 * gap * Vector::Y;
                let [p1, p2] = [middle - half, pose.inverse() * (middle + half)];
                let none = PackedFeatureId::UNKNOWN;
                TrackedContact::new(p1, p2, none, none, gap)
            })
            .collect();
        manifold
    }

    #[derive(Clone, Copy, Default)]
    struct Motion {
        slid: f32,
        risen: f32,
        /// This is only said, and not done.
        turned: f32,
    }

    fn before(manifolds: &[ContactManifold], turned: f32) -> Before<'_> {
        Before {
            manifolds,
            turned,
            match_distance: 0.5,
            pixel_size: 0.1,
        }
    }

    #[test]
    fn the_steepest_slope_is_that_of_the_angle() {
        assert!((STEEPEST - COS_SAME_NORMAL.acos().tan()).abs() < 1e-3);
    }

    /// The gaps that are left of `measured`, all at y = 0, where a pair that had contacts with `gaps` has moved.
    fn steadied(gaps: [f32; 4], motion: Motion, measured: &[(Vector, f32)]) -> Vec<f32> {
        let Motion {
            slid,
            risen,
            turned,
        } = motion;
        let ball = Ball::new(1.0);
        let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]];
        let places = corners.map(|[x, z]| Vector::new(x, 0.0, z));
        let start = Pose::from_parts(Vector::Y, Rotation::from_rotation_y(0.7));
        let old: Vec<(Vector, f32)> = places.into_iter().zip(gaps).collect();
        let mut previous = contacts(&start, &old);
        let mut now = start;
        now.translation += Vector::new(slid, risen, 0.0);
        let pair = ShapePair::new(&ball, &ball, now, 0.1);
        previous.update_separations(&now);
        let mut manifold = contacts(&now, measured);
        before(&[previous], turned).steady(&mut manifold, &pair);
        for point in &manifold.points {
            let apart = now * point.local_p2 - point.local_p1;
            assert!((apart.y - point.dist).abs() < 1e-5 && apart.with_y(0.0).length() < 1e-5);
        }
        manifold.points.iter().map(|point| point.dist).collect()
    }

    #[test]
    fn gaps_change_by_motion_and_slide_alone() {
        let corner = Vector::new(1.0, 0.0, 1.0);
        for measured in [-0.3, 0.0, 0.2, 0.4] {
            for (slid, risen) in [(0.0, 0.0), (0.0, 0.1), (0.1, 0.0), (0.2, -0.1)] {
                let turned = 0.0;
                let motion = Motion {
                    slid,
                    risen,
                    turned,
                };
                let gap = steadied([0.0; 4], motion, &[(corner, measured)])[0];
                let most = STEEPEST * slid;
                let expected = measured.clamp(risen - most, risen + most);
                assert!((gap - expected).abs() < 1e-5, "{measured}: {gap}");
            }
        }
    }

    /// Between the old contacts their plane tells the gap, here one that rises by a tenth along x.
    #[test]
    fn other_points_of_a_tilted_face_stay_as_they_are() {
        let points: Vec<(Vector, f32)> = [-1.2, -0.8, 0.7, 1.1]
            .map(|x| (Vector::new(x, 0.0, 1.0), 0.1 * x))
            .to_vec();
        let gaps = steadied([-0.1, -0.1, 0.1, 0.1], Motion::default(), &points);
        for (gap, (place, measured)) in gaps.into_iter().zip(points) {
            // Of the slope, as much is left out as a pixel of 0.1 weighs beside a width of 2.
            assert!((gap - measured).abs() < 0.002, "at {place}: {gap}");
        }
    }

    /// By the angle, and the farther from the old contact the more.
    #[test]
    fn gaps_of_a_contact_that_rolls_change() {
        let motion = Motion {
            turned: 0.1,
            ..Motion::default()
        };
        for aside in [0.0, 0.1, 0.3] {
            let place = Vector::new(1.0, 0.0, 1.0 + aside);
            let gap = steadied([0.0; 4], motion, &[(place, 0.2)])[0];
            assert!((gap - 0.1 * aside).abs() < 1e-5, "{aside}: {gap}");
        }
    }

    #[test]
    fn new_contacts_are_as_deep_as_they_are() {
        let far = Vector::new(0.3, 0.0, 0.3);
        assert_eq!(
            steadied([0.0; 4], Motion::default(), &[(far, -0.2)]),
            [-0.2]
        );
        let ball = Ball::new(1.0);
        let pair = ShapePair::new(&ball, &ball, Pose::IDENTITY, 0.1);
        let old = contacts(&pair.pos12, &[(Vector::ZERO, 0.0)]);
        let mut manifold = contacts(&pair.pos12, &[(Vector::ZERO, -0.2)]);
        manifold.local_n1 = Vector::new(0.6, 0.8, 0.0);
        before(&[old], 0.0).steady(&mut manifold, &pair);
        assert_eq!(manifold.points[0].dist, -0.2);
    }
}
