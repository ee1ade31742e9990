//! Which few of many places the solver gets: those that reach out farthest.

use crate::PATCH_POINTS;
use arrayvec::ArrayVec;
use glamx::{Vec2, Vec3};

/// Least extent across the longest axis, in units of that along it: less is rounding, and the places are a line.
const LEAST_EXTENT: f32 = 1e-4;

/// The places that reach out farthest in four directions at right angles to each other, by index, without repetition. The
/// directions are those in which the places, in standard deviations along the axes, reach out most: the corners of a
/// rectangle. A line has its ends only.
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
    let least = LEAST_EXTENT * deviation.x;
    let scale = [deviation.x, deviation.y].map(|d| if d > least { d.recip() } else { 0.0 });
    let scaled = || off().map(|off| along(off) * Vec2::from(scale));
    // As complex numbers, the fourth powers of the corners of a square are equal.
    let fourth_power = |z: Vec2| {
        let square = z.rotate(z);
        square.rotate(square)
    };
    let angle = 0.25 * scaled().map(fourth_power).sum::<Vec2>().to_angle();
    let corner = Vec2::from_angle(angle);
    let corners = [corner, corner.perp(), -corner, -corner.perp()];
    let mut best = [(0.0, None); PATCH_POINTS];
    for (k, place) in scaled().enumerate() {
        for (best, corner) in best.iter_mut().zip(corners) {
            let reach = corner.dot(place);
            if reach > best.0 {
                *best = (reach, Some(k));
            }
        }
    }
    let mut indices = ArrayVec::new();
    for k in best.into_iter().filter_map(|(_, k)| k) {
        if !indices.contains(&k) {
            indices.push(k);
        }
    }
    if indices.is_empty() && count > 0.0 {
        indices.push(0);
    }
    indices
}

/// Of points in metres on one plane with unit normal `normal`, those that reach out farthest along four directions at right
/// angles to each other, by index: a body that rests on all of them rests on these. None of no points.
///
/// Cost: linear in points, about six passes.
///
/// ```
/// use tldi::{supports, glamx::Vec3};
/// // A 3 × 3 grid: the corners.
/// let points = (0..9).map(|k| Vec3::new((k % 3) as f32, 0.0, (k / 3) as f32));
/// let mut corners = supports(points, Vec3::Y);
/// corners.sort();
/// assert_eq!(corners[..], [0, 2, 6, 8]);
/// ```
pub fn supports(
    points: impl Iterator<Item = Vec3> + Clone,
    normal: Vec3,
) -> ArrayVec<usize, PATCH_POINTS> {
    let (u, v) = normal.any_orthonormal_pair();
    farthest(points.map(|p| Vec2::new(p.dot(u), p.dot(v))))
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

#[cfg(test)]
mod tests {
    use super::{farthest, supports};
    use glamx::{Vec2, Vec3};

    #[test]
    fn a_rectangle_rests_on_its_corners_however_it_is_turned() {
        for degrees in 0..90 {
            let axis = Vec2::from_angle((degrees as f32).to_radians());
            let places: Vec<Vec2> = (0..21 * 9)
                .map(|k| Vec2::new((k % 21) as f32, (k / 21) as f32).rotate(axis))
                .collect();
            let mut found = farthest(places.iter().copied());
            found.sort();
            assert_eq!(found[..], [0, 20, 168, 188], "{degrees}°");
        }
    }

    #[test]
    fn lines_rest_on_their_ends_and_few_places_on_all() {
        for (count, expected) in [(0, &[][..]), (1, &[0]), (2, &[0, 1]), (9, &[0, 8])] {
            let mut found = supports((0..count).map(|k| 0.1 * k as f32 * Vec3::ONE), Vec3::Y);
            found.sort();
            assert_eq!(found[..], *expected);
        }
        let same = supports([Vec3::ONE; 5].into_iter(), Vec3::Y);
        assert_eq!(same[..], [0]);
    }
}
