//! Which of many contact points the solver gets.

use crate::contact::beyond::beyond;
use crate::contact::bowl::{Bowl, Floor, Lowest};
use crate::contact::main_plane::GapPlane;
use crate::contact::point_axes::PlaneAxes;
use crate::{ContactPatch, ContactPoint, PATCH_POINTS};
use arrayvec::ArrayVec;
use glamx::{Vec2, Vec3};
use std::f32::consts::SQRT_2;

/// Points on which a body would rest.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Supports {
    /// Indices of up to [`PATCH_POINTS`] of the points.
    pub(crate) indices: ArrayVec<usize, PATCH_POINTS>,
    /// Their gaps above a plane, in metres: the plane that fits all gaps best, or, the flatter the gaps are,
    /// the one on which most of them lie.
    pub(crate) above_plane: ArrayVec<f32, PATCH_POINTS>,
    /// 1 if so many gaps lie on one plane that the others count as errors, as at the rim of a face
    /// with estimated normals. 0 if the gaps bend, or too few are on any plane.
    pub(crate) flatness: f32,
    /// Standard deviation, in metres, of the gaps about the plane that fits them best.
    pub(crate) roughness: f32,
    /// Standard deviation, in metres, of the gaps about the bowl that fits them best: a paraboloid
    /// that widens along two axes, or does not bend. What is left of the roughness where the
    /// surfaces are round.
    pub(crate) roughness_about_bowl: f32,
    /// The lowest point of that bowl. It is set if the gaps bend in both directions, the point is
    /// among the points, and the bowl explains most of the roughness.
    pub(crate) lowest_of_bowl: Option<Lowest>,
    /// The floor of that bowl, if it is a valley: bent along one axis only.
    pub(crate) floor_of_valley: Option<Floor>,
}

/// Limit of how much depth counts, in units of the roughness. A still lower point is an outlier, and would otherwise be
/// chosen in all directions. On a flat face it does not count: a low point in the middle of an edge would take the
/// place of both corners, and the body tip over the third. Half: a bunny on new samples each frame fails with 5 of 6
/// seeds instead of one; twice: no change.
const MOST_LOW: f32 = 2.5;

/// Share of points on one plane [`beyond`] which gaps count as flat. Measured: faces of 10 × 10 points have 0.6 on a plane and
/// 0.43 on each other, where their rims meet. Half: 17 of 636 stability rows fail instead of 3; twice: depths of boxes on
/// ramps, exact now, are 0.02 mean radii off.
const FLAT: f32 = 0.33;

/// Chooses those of `points`, on one plane with the unit normal `normal`, on which a body would rest: for each of four
/// directions, the point that is farthest out and lowest. One standard deviation of extent counts as much as √2 of
/// roughness, which is at least `smooth` metres. The directions lead to the corners: in them the points reach out
/// farthest once their extents along both main axes are made equal.
///
/// Heights are measured from the plane that fits the gaps. So the choice does not depend on the
/// tilt of the body, and a lifted edge remains. Cost: linear in points.
pub(crate) fn supports(points: &[ContactPoint], normal: Vec3, smooth: f32) -> Supports {
    let axes = PlaneAxes::of(points, normal);
    let count = points.len() as f32;
    let heights = || points.iter().map(|p| (axes.place(p), p.gap));
    // Along the main axes the slopes of the gaps are separate.
    let mean_gap = points.iter().map(|p| p.gap).sum::<f32>() / count;
    let slope = heights().map(|(place, gap)| (gap - mean_gap) * place);
    let slope = slope.sum::<Vec2>() / count;
    let plane = GapPlane::new(mean_gap, slope);
    let residuals = || heights().map(|height| (height.0, plane.residual(height)));
    let squares = residuals().map(|(_, off)| off.powi(2)).sum::<f32>();
    let roughness = (squares / count).sqrt();
    let bowl = Bowl::fit(residuals(), axes.sigma);
    // A perfectly flat patch has none, by which nothing can be divided.
    let smooth = smooth.max(f32::MIN_POSITIVE);
    let is_bent = roughness > smooth && bowl.explains_most(roughness);
    let (main_plane, flatness) = if is_bent {
        (plane, 0.0)
    } else {
        let (main_plane, share) = plane.of_most(heights(), roughness, smooth);
        let flatness = beyond(share / FLAT);
        (plane.lerp(main_plane, flatness), flatness)
    };
    let above_plane = |height| main_plane.residual(height);
    let most = (1.0 - flatness) * MOST_LOW;
    let low = |height| (-above_plane(height) / roughness.max(smooth)).min(most);
    let lows = heights().map(|height| (height.0, low(height)));
    let stretch = (axes.sigma.x / axes.sigma.y).sqrt();
    let indices = farthest_out(lows, Vec2::new(stretch, stretch.recip()));
    // Of the bowl: its gaps bend along one of them independently of the other.
    let own = axes.turned(bowl.turn);
    let own_slope = bowl.own(slope / axes.sigma) * own.sigma;
    Supports {
        above_plane: (indices.iter())
            .map(|&k| above_plane((axes.place(&points[k]), points[k].gap)))
            .collect(),
        indices,
        flatness,
        roughness,
        roughness_about_bowl: bowl.left.min(roughness),
        lowest_of_bowl: (bowl.lowest(own_slope, roughness)).map(|(place, above)| {
            let aside = bowl.place_per_slope() * own.sigma;
            let radii = aside * own.sigma;
            Lowest {
                point: own.contact_at(place, mean_gap + above, points),
                aside: [0, 1].map(|k| aside[k] * own.axes[k]),
                radii: [0, 1].map(|k| radii[k] * own.axes[k]),
            }
        }),
        floor_of_valley: (bowl.valley(own_slope))
            .and_then(|valley| own.floor(valley, own_slope, points)),
    }
}

impl ContactPatch {
    /// The patch of `points` with one unit normal: of more than [`PATCH_POINTS`] those on which a body would rest, and the
    /// deepest, unless it is deeper by less than `scatter` metres. Cost: linear in points.
    ///
    /// ```
    /// use tldi::{ContactPatch, ContactPoint, glamx::Vec3};
    /// // A 3 × 3 grid, flat: the corners.
    /// let points: Vec<ContactPoint> = (0..9)
    ///     .map(|k| Vec3::new((k % 3) as f32, 0.0, (k / 3) as f32))
    ///     .map(|p| ContactPoint { point_a: p, point_b: p, gap: 0.0 })
    ///     .collect();
    /// let corners = ContactPatch::bearing(Vec3::Y, &points, 0.01).points;
    /// assert_eq!(corners.len(), 4);
    /// assert!([0, 2, 6, 8].into_iter().all(|k| corners.contains(&points[k])));
    /// ```
    pub fn bearing(normal: Vec3, points: &[ContactPoint], scatter: f32) -> Self {
        let all = ArrayVec::try_from(points);
        Self {
            normal,
            points: all.unwrap_or_else(|_| bearing(points, normal, scatter)),
            relative_radii: None,
            roughness: scatter,
        }
    }
}

/// The `points` on which a body would rest, lowest first, and the deepest point if it is deeper than these by `scatter` or more.
fn bearing(
    points: &[ContactPoint],
    normal: Vec3,
    scatter: f32,
) -> ArrayVec<ContactPoint, PATCH_POINTS> {
    let by_gap = |p: &ContactPoint, q: &ContactPoint| p.gap.total_cmp(&q.gap);
    let supports = supports(points, normal, scatter).indices;
    let mut kept: ArrayVec<_, PATCH_POINTS> = supports.into_iter().map(|k| points[k]).collect();
    kept.sort_by(by_gap);
    let deepest = points.iter().copied().min_by(by_gap);
    if let Some(deepest) = deepest.filter(|deepest| deepest.gap < kept[0].gap - scatter) {
        kept.truncate(PATCH_POINTS - 1);
        kept.push(deepest);
    }
    kept
}

/// Indices of the places that are farthest out and lowest in four directions. Places are in standard deviations along both
/// axes. `extents` are these deviations, scaled so that their product is 1: how far out a place is goes by metres, so that a
/// pixel that is missing at the corner of a rod does not cost many pixels of its length.
fn farthest_out(
    lows: impl ExactSizeIterator<Item = (Vec2, f32)> + Clone,
    extents: Vec2,
) -> ArrayVec<usize, PATCH_POINTS> {
    let corner = SQRT_2 * Vec2::from_angle(corner_angle(lows.clone().map(|(place, _)| place)));
    let corners = [corner, corner.perp(), -corner, -corner.perp()].map(|c| c * extents);
    let count = lows.len();
    let mut best = [(f32::NEG_INFINITY, 0); PATCH_POINTS];
    for (k, (place, low)) in lows.enumerate() {
        for (best, corner) in best.iter_mut().zip(corners) {
            let score = corner.dot(place) + low;
            if score > best.0 {
                *best = (score, k);
            }
        }
    }
    let mut indices = ArrayVec::new();
    for (_, k) in best {
        if k < count && !indices.contains(&k) {
            indices.push(k);
        }
    }
    indices
}

/// Angle of the first of four directions, at right angles to each other, in which `places` reach out
/// farthest: a quarter of the angle of the mean of their fourth powers, as complex numbers. For a square this
/// leads to its corners, where main axes would be arbitrary.
fn corner_angle(places: impl Iterator<Item = Vec2>) -> f32 {
    let fourth_power = |z: Vec2| {
        let square = z.rotate(z);
        square.rotate(square)
    };
    0.25 * places.map(fourth_power).sum::<Vec2>().to_angle()
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;

    fn point(middle: Vec3, gap: f32) -> ContactPoint {
        ContactPoint::about(middle, gap, Vec3::Y)
    }

    /// Feet under a table of noisy height: always the same four, however it is tilted.
    #[test]
    fn tilting_changes_nothing() {
        let mut rng = Rng::with_seed(3);
        let mut feet: Vec<Vec3> = (0..60)
            .map(|_| Vec3::new(rng.f32() - 0.5, 0.0, 0.6 * rng.f32() - 0.3))
            .collect();
        feet.extend(
            [[-1.0, 0.5], [1.0, 0.5], [-1.0, -0.5], [1.0, -0.5]].map(|[x, z]| Vec3::new(x, 0.0, z)),
        );
        let noise: Vec<f32> = feet.iter().map(|_| 0.002 * rng.f32()).collect();
        for tilt in [Vec2::ZERO, Vec2::new(0.1, 0.0), Vec2::new(-0.03, 0.08)] {
            let points: Vec<ContactPoint> = feet
                .iter()
                .zip(&noise)
                .map(|(&p, noise)| point(p, noise + tilt.x * p.x + tilt.y * p.z))
                .collect();
            let found = supports(&points, Vec3::Y, 0.001);
            let mut indices = found.indices;
            indices.sort();
            assert_eq!(indices[..], [60, 61, 62, 63], "{tilt}");
            assert!(found.roughness < 0.002, "{}", found.roughness);
        }
    }

    /// A ball's cap is rough about a plane and smooth about a bowl; a dome upside down is no bowl.
    #[test]
    fn bowls_are_smooth() {
        let cap = |bend: Vec2| {
            let points: Vec<ContactPoint> = (0..81)
                .map(|k| Vec2::new((k % 9) as f32 - 4.0, (k / 9) as f32 - 4.0))
                .map(|p| {
                    point(
                        Vec3::new(p.x, 0.0, p.y),
                        (bend * p * p).element_sum() + 0.1 * p.x,
                    )
                })
                .collect();
            supports(&points, Vec3::Y, 1e-4)
        };
        for bend in [Vec2::splat(0.02), Vec2::new(0.02, 0.0), Vec2::ZERO] {
            let found = cap(bend);
            assert!(found.roughness_about_bowl < 1e-4, "{bend}: {found:?}");
            // The variance of k² over −4 … 4 is 34.2.
            let expected = (34.22 * bend.length_squared()).sqrt();
            assert!(
                (found.roughness - expected).abs() < 0.01 * expected + 1e-6,
                "{found:?}"
            );
        }
        let dome = cap(Vec2::splat(-0.02));
        assert_eq!(dome.roughness_about_bowl, dome.roughness);
        assert_eq!(dome.lowest_of_bowl, None);
        // d(0.02 x² + 0.1 x) = 0 at −2.5.
        let lowest = cap(Vec2::splat(0.02)).lowest_of_bowl.expect("a bowl").point;
        assert!((lowest.gap + 0.125).abs() < 1e-3, "{lowest:?}");
        assert!((lowest.middle().x + 2.5).abs() < 0.01, "{lowest:?}");
        assert!(lowest.middle().z.abs() < 0.01, "{lowest:?}");
        assert_eq!(cap(Vec2::new(0.02, 0.0)).lowest_of_bowl, None);
    }

    /// A trough has a floor, with its depth, length and radius. A trough whose sides alone are seen
    /// has none.
    #[test]
    fn troughs_have_floors() {
        let trough = |is_seen: fn(i32) -> bool| {
            let places = (-4..=4).flat_map(|i| (-9..=9).map(move |j| (i, j)));
            let points: Vec<ContactPoint> = (places.filter(|(i, _)| is_seen(*i)))
                .map(|(i, j)| Vec3::new(i as f32, 0.0, j as f32))
                .map(|p| point(p, 0.05 * (p.x - 1.0).powi(2) + 0.01 * p.z))
                .collect();
            supports(&points, Vec3::Y, 1e-4)
        };
        let floor = trough(|_| true).floor_of_valley.expect("a floor");
        for end in floor.ends {
            let middle = end.middle();
            assert!((middle.x - 1.0).abs() < 1e-3, "{end:?}");
            assert!((middle.z.abs() - 9.0).abs() < 1e-3, "{end:?}");
            assert!((end.gap - 0.01 * middle.z).abs() < 1e-3, "{end:?}");
        }
        assert!((floor.radius.length() - 10.0).abs() < 0.01, "{floor:?}");
        assert_eq!(trough(|i| i.abs() >= 3).floor_of_valley, None);
    }

    /// Points that extend equally in all directions do not tell the axes of what bends: the gaps do. A trough stays a trough in
    /// any direction, and an oblong bowl has the radii of its own axes.
    #[test]
    fn square_patches_bend_along_axes_of_their_own() {
        let square: Vec<Vec3> = (0..144)
            .map(|k| Vec3::new((k % 12) as f32 - 5.5, 0.0, (k / 12) as f32 - 5.5))
            .collect();
        for degrees in 0..18 {
            let axis = Vec2::from_angle((10.0 * degrees as f32).to_radians());
            let bent = |along: f32, across: f32| {
                let gap = |p: Vec2| along * p.dot(axis).powi(2) + across * p.perp_dot(axis).powi(2);
                let points = square.iter().map(|p| point(*p, gap(Vec2::new(p.x, p.z))));
                supports(&points.collect::<Vec<_>>(), Vec3::Y, 1e-4)
            };
            let axis = Vec3::new(axis.x, 0.0, axis.y);
            let trough = bent(0.05, 0.0).floor_of_valley.expect("a floor");
            assert!(
                (trough.radius.dot(axis).abs() - 10.0).abs() < 0.01,
                "{trough:?}"
            );
            let bowl = bent(0.05, 0.03).lowest_of_bowl.expect("a bowl");
            assert!(bowl.point.middle().length() < 1e-3, "{bowl:?}");
            let [first, second] = bowl.radii;
            assert!((first.dot(axis).abs() - 10.0).abs() < 0.01, "{bowl:?}");
            assert!((second.length() - 16.667).abs() < 0.02, "{bowl:?}");
        }
    }

    /// A face whose rim dips on two sides and is lifted on the others is as flat as its middle, and its
    /// supports tell so; what bends is not flat, along one axis neither.
    #[test]
    fn faces_are_flat_in_spite_of_their_rims() {
        let tilt = |p: Vec3| 0.02 * p.x - 0.01 * p.z;
        let rim = |p: Vec3| match p.x.max(p.z) {
            most if most > 5.0 => 0.7,
            _ if p.x.min(p.z) < -5.0 => -0.25,
            _ => 0.0,
        };
        let face: Vec<ContactPoint> = (0..144)
            .map(|k| Vec3::new((k % 12) as f32 - 5.5, 0.0, (k / 12) as f32 - 5.5))
            .map(|p| point(p, tilt(p) + rim(p)))
            .collect();
        let found = supports(&face, Vec3::Y, 0.05);
        assert_eq!(found.flatness, 1.0);
        for (&k, above) in found.indices.iter().zip(&found.above_plane) {
            // The plane that fits best would be off by 0.2 and more.
            let off = face[k].gap - above - tilt(face[k].middle());
            assert!(off.abs() < 0.05, "{off}");
        }
        // So shallow that most of their gaps are within 0.1 of a plane.
        let cylinder = |p: Vec3| (p.x / 12.0).powi(2);
        let ball = |p: Vec3| (p / 12.0).length_squared();
        for bend in [cylinder, ball] {
            let bent = face.iter().map(ContactPoint::middle);
            let bent: Vec<ContactPoint> = bent
                .map(|p| p.with_y(0.0))
                .map(|p| point(p, bend(p)))
                .collect();
            assert_eq!(supports(&bent, Vec3::Y, 0.05).flatness, 0.0);
        }
    }

    /// A face whose gaps bend by less than they may be rough stands on its corners.
    #[test]
    fn faint_bends_leave_the_corners() {
        let points: Vec<ContactPoint> = (0..144)
            .map(|k| Vec2::new((k % 12) as f32 - 5.5, (k / 12) as f32 - 5.5))
            .map(|p| {
                let gap = 0.02 * (p.x / 5.5).powi(2) - 0.02 * (p.y / 5.5).powi(4);
                point(Vec3::new(p.x, 0.0, p.y), gap)
            })
            .collect();
        for k in supports(&points, Vec3::Y, 0.05).indices {
            let middle = points[k].middle().abs();
            assert!(middle.x.min(middle.z) > 5.0, "{middle} is no corner");
        }
    }

    /// Through few points, or points in few places, goes many a bowl: none of them is believed, least
    /// of all one that is kilometres deep.
    #[test]
    fn few_places_make_no_bowl() {
        let mut rng = Rng::with_seed(5);
        for case in 0..2000 {
            // Up to five points anywhere, or any number at the corners of a rectangle.
            let at_corners = case % 2 == 0;
            let count = if at_corners { 12 } else { 1 + case / 2 % 5 };
            let points: Vec<ContactPoint> = (0..count)
                .map(|_| {
                    let sides = [(); 2].map(|()| if rng.bool() { 1.0 } else { -1.0 });
                    let place = if at_corners {
                        sides
                    } else {
                        sides.map(|s| s * rng.f32())
                    };
                    let middle = Vec3::new(0.004 * place[0], 0.0, 0.002 * place[1]);
                    point(middle, 0.01 * rng.f32())
                })
                .collect();
            let found = supports(&points, Vec3::Y, 1e-5);
            assert_eq!(found.lowest_of_bowl, None, "{points:?}");
            assert!(found.roughness_about_bowl <= found.roughness);
        }
    }

    /// A square stands on its four corners, however it is turned, with heights that scatter, and one far
    /// below the others in the middle of an edge.
    #[test]
    fn squares_stand_on_their_corners() {
        let mut rng = Rng::with_seed(9);
        for turn in 0..90 {
            let turn = Vec2::from_angle((turn as f32).to_radians());
            let mut points: Vec<ContactPoint> = (0..100)
                .map(|k| Vec2::new((k % 10) as f32 - 4.5, (k / 10) as f32 - 4.5))
                .map(|p| {
                    let jitter = Vec2::new(rng.f32(), rng.f32()) - 0.5;
                    let p = turn.rotate(p + 0.2 * jitter);
                    point(Vec3::new(p.x, 0.0, p.y), 0.02 * rng.f32())
                })
                .collect();
            points[94].gap = -0.3;
            let found = supports(&points, Vec3::Y, 0.05).indices;
            for corner in [0, 9, 90, 99].map(|k: usize| points[k].middle()) {
                // A neighbour may be as low.
                let is_near = |&k: &usize| points[k].middle().distance(corner) < 1.5;
                assert!(found.iter().any(is_near), "{turn}: {found:?}");
            }
        }
    }

    /// Of many points the patch keeps four, the deepest among them where it is deeper by more than they scatter.
    #[test]
    fn patches_keep_corners_and_what_is_deeper() {
        let mut points: Vec<ContactPoint> = (0..25)
            .map(|k| Vec3::new((k % 5) as f32, 0.0, (k / 5) as f32))
            .map(|p| point(p, 0.0))
            .collect();
        for (depth, is_kept) in [(0.5, true), (0.005, false)] {
            points[12].gap = -depth;
            let patch = ContactPatch::bearing(Vec3::Y, &points, 0.01);
            assert_eq!(patch.points.len(), PATCH_POINTS, "{depth}");
            assert_eq!(patch.points.contains(&points[12]), is_kept, "{depth}");
            let corners = [0, 4, 20, 24].map(|k| patch.points.contains(&points[k]));
            let kept = corners.iter().filter(|kept| **kept).count();
            assert_eq!(kept, 4 - usize::from(is_kept), "{depth}");
        }
    }

    /// One point far below all others does not take the place of the corners.
    #[test]
    fn an_odd_one_out_leaves_the_corners() {
        let mut points: Vec<ContactPoint> = (0..81)
            .map(|k| Vec3::new((k % 9) as f32, 0.0, (k / 9) as f32))
            .map(|p| point(p, 0.0))
            .collect();
        points[39].gap = -1.0;
        let mut found = supports(&points, Vec3::Y, 0.01).indices;
        found.sort();
        assert_eq!(found[..], [0, 8, 72, 80]);
    }

    #[test]
    fn rows_and_single_points_are_enough() {
        let row: Vec<ContactPoint> = (0..5)
            .map(|k| Vec3::new(k as f32, 0.0, 0.0))
            .map(|p| point(p, 0.0))
            .collect();
        let mut ends = supports(&row, Vec3::Y, 0.01).indices;
        ends.sort();
        assert_eq!((ends[0], ends[ends.len() - 1]), (0, 4));
        assert_eq!(supports(&row[..1], Vec3::Y, 0.01).indices[..], [0]);
        // Exactly flat, and no roughness given.
        let mut ends = supports(&row, Vec3::Y, 0.0).indices;
        ends.sort();
        assert_eq!((ends[0], ends[ends.len() - 1]), (0, 4));
        assert!(supports(&[], Vec3::Y, 0.01).indices.is_empty());
    }
}
