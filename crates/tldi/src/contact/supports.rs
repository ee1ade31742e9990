//! Which few of many places the solver gets: those that reach out farthest.

use crate::{ContactPoint, PATCH_POINTS};
use arrayvec::ArrayVec;
use glamx::{Vec2, Vec3};

/// Least extent across the longest axis, in units of that along it: less is rounding.
const LEAST_EXTENT: f32 = 1e-6;

/// The places that reach out farthest in four directions at right angles to each other, by index, without repetition. The
/// directions are those in which the places, in standard deviations along the axes, reach out most: the corners of a
/// rectangle.
///
/// Cost: linear in places.
pub(crate) fn farthest(
    places: impl Iterator<Item = Vec2> + Clone,
) -> ArrayVec<usize, PATCH_POINTS> {
    let count = places.clone().count() as f32;
    let mean = places.clone().sum::<Vec2>() / count;
    let off = || places.clone().map(|place| place - mean);
    let longest = main_axis(off());
    let along = |off: Vec2| Vec2::new(off.dot(longest), off.dot(longest.perp()));
    let variance = off().map(|off| along(off).powf(2.0)).sum::<Vec2>() / count;
    let deviation = Vec2::new(variance.x.sqrt(), variance.y.sqrt());
    let least = f32::max(LEAST_EXTENT * deviation.x, f32::MIN_POSITIVE);
    let deviation = deviation.max(Vec2::splat(least));
    let scaled = || off().map(|off| along(off) / deviation);
    // As complex numbers, the fourth powers of the corners of a square are equal.
    let fourth_power = |z: Vec2| {
        let square = z.rotate(z);
        square.rotate(square)
    };
    let angle = 0.25 * scaled().map(fourth_power).sum::<Vec2>().to_angle();
    let corner = Vec2::from_angle(angle);
    let corners = [corner, corner.perp(), -corner, -corner.perp()];
    let mut best = [(f32::NEG_INFINITY, 0); PATCH_POINTS];
    for (k, place) in scaled().enumerate() {
        for (best, corner) in best.iter_mut().zip(corners) {
            let reach = corner.dot(place);
            if reach > best.0 {
                *best = (reach, k);
            }
        }
    }
    let mut indices = ArrayVec::new();
    for (reach, k) in best {
        if reach.is_finite() && !indices.contains(&k) {
            indices.push(k);
        }
    }
    indices
}

/// Of points on one plane with unit normal `normal`, those that reach out farthest along four directions at right angles to
/// each other, by index: a body that rests on all of them rests on these.
///
/// Cost: linear in points.
///
/// ```
/// use tldi::{ContactPoint, supports, glamx::Vec3};
/// // A 3 × 3 grid: the corners.
/// let points: Vec<ContactPoint> = (0..9)
///     .map(|k| Vec3::new((k % 3) as f32, 0.0, (k / 3) as f32))
///     .map(|p| ContactPoint { point_a: p, point_b: p, gap: 0.0 })
///     .collect();
/// let mut corners = supports(&points, Vec3::Y);
/// corners.sort();
/// assert_eq!(corners[..], [0, 2, 6, 8]);
/// ```
pub fn supports(points: &[ContactPoint], normal: Vec3) -> ArrayVec<usize, PATCH_POINTS> {
    let (u, v) = normal.any_orthonormal_pair();
    let middles = points.iter().map(ContactPoint::middle);
    farthest(middles.map(|p| Vec2::new(p.dot(u), p.dot(v))))
}

/// Direction across `normal`, of unit length, in which points about `centre` extend the most.
pub(crate) fn longest_axis(points: impl Iterator<Item = Vec3>, centre: Vec3, normal: Vec3) -> Vec3 {
    let (u, v) = normal.any_orthonormal_pair();
    let axis = main_axis(points.map(|p| Vec2::new((p - centre).dot(u), (p - centre).dot(v))));
    axis.x * u + axis.y * v
}

/// Unit axis along which places extend the most from the origin.
fn main_axis(places: impl Iterator<Item = Vec2>) -> Vec2 {
    let (mut xx, mut xy, mut yy) = (0.0, 0.0, 0.0);
    for p in places {
        xx += p.x * p.x;
        xy += p.x * p.y;
        yy += p.y * p.y;
    }
    Vec2::from_angle(0.5 * (2.0 * xy).atan2(xx - yy))
}
