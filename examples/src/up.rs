//! Finds out which way is up in a scan.
//!
//! Floors, table tops and ground make the normals of a scan cluster around one axis, and walls are
//! perpendicular to it. In a room the directions of the walls cluster as well; there the extent
//! decides, as rooms are wider than high. Which end of the axis is up shows in what stands on the
//! level surfaces: furniture on a floor, hardly anything hangs from a ceiling or under a table.

use tldi::glamx::Vec3;

/// Which way is up in a scan.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Up {
    /// Unit vector against gravity, in the frame of the scan.
    pub direction: Vec3,
    /// How far to trust it.
    pub confidence: Confidence,
}

/// How far a detected up direction is to be trusted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Confidence {
    /// The scan has level surfaces, and things stand on them.
    Clear,
    /// The vertical axis is clear, but not which of its ends is up.
    AxisOnly,
    /// The scan does not tell: z is assumed.
    Assumed,
}

/// Normals within this cosine of an axis are parallel to it (15°).
const PARALLEL: f32 = 0.966;
/// Normals below this cosine are perpendicular to an axis (7° off).
const PERPENDICULAR: f32 = 0.12;
/// Share of normals that must be parallel to the axis. Normals spread evenly over the sphere give
/// 0.034 (1 − cos 15°).
const MIN_PARALLEL_SHARE: f32 = 0.09;
/// What an extent as large as the scan's largest one costs an axis, in shares of normals.
const EXTENT_WEIGHT: f32 = 0.3;
/// Normals and points looked at, at most.
const SAMPLES: usize = 20_000;
const HEIGHT_SAMPLES: usize = 100_000;
/// Evidence for the sign of the axis below which the convention of the file decides: a mean height
/// that is 5 % of the scan's height off the middle, or as much of a difference of two mean heights.
const MIN_SIGN_EVIDENCE: f32 = 0.1;
/// Height at either end of the scan, as a share of its height, in which a floor or a ceiling is.
const END: f32 = 0.1;
/// Share of the level points that make an end a floor or a ceiling. Level surfaces at any height
/// would leave 0.1 in each end.
const MIN_END_SHARE: f32 = 0.16;

/// Finds the up direction from the points of a scan and their normals (unit length, of either
/// sign; one for each point).
///
/// Takes time linear in the number of points, some 100 ms for the largest scans. A direction that
/// cannot be told from a coordinate axis of the file becomes that axis: terrain has no sharp
/// level surface, but its files are levelled.
///
/// ```
/// use tldi::glamx::Vec3;
/// use tldi_examples::up::detect_up;
/// // A floor with a box on it, heights along −y.
/// let mut points = Vec::new();
/// let mut normals = Vec::new();
/// for i in 0..100 {
///     for j in 0..100 {
///         let on_box = (40..60).contains(&i) && (40..60).contains(&j);
///         let height = if on_box { 10.0 } else { 0.0 };
///         points.push(Vec3::new(i as f32, -height, j as f32));
///         normals.push(Vec3::Y);
///         if on_box && (i == 40 || i == 59) {
///             points.extend((1..10).map(|h| Vec3::new(i as f32, -h as f32, j as f32)));
///             normals.extend([Vec3::X; 9]);
///         }
///     }
/// }
/// assert!(detect_up(&points, &normals).direction.y < -0.999);
/// ```
///
/// # Panics
/// If there is not one normal for each point.
pub fn detect_up(points: &[Vec3], normals: &[Vec3]) -> Up {
    assert_eq!(points.len(), normals.len(), "one normal for each point");
    let assumed = Up {
        direction: Vec3::Z,
        confidence: Confidence::Assumed,
    };
    let sampled: Vec<(Vec3, Vec3)> = every_nth(points.len(), SAMPLES)
        .map(|i| (points[i], normals[i]))
        .filter(|(p, n)| p.is_finite() && n.is_normalized())
        .collect();
    if sampled.len() < 100 {
        return assumed;
    }
    let (axis, share) = vertical_axis(&sampled);
    if share < MIN_PARALLEL_SHARE {
        return assumed;
    }
    let evidence = sign_evidence(points, normals, axis);
    let (sign, confidence) = if evidence.abs() >= MIN_SIGN_EVIDENCE {
        (evidence.signum(), Confidence::Clear)
    } else {
        // Scanners write z up; where y is vertical, viewers expect it up.
        let conventional = if axis.z.abs() > 0.5 { axis.z } else { axis.y };
        (conventional.signum(), Confidence::AxisOnly)
    };
    Up {
        direction: axis * sign,
        confidence,
    }
}

/// At most `limit` of the indices below `len`, evenly spread.
fn every_nth(len: usize, limit: usize) -> impl Iterator<Item = usize> {
    (0..len).step_by(len.div_ceil(limit).max(1))
}

/// The vertical axis (of either sign), and the share of normals that are parallel to it.
fn vertical_axis(sampled: &[(Vec3, Vec3)]) -> (Vec3, f32) {
    let extents = Vec3::AXES.map(|axis| extent_along(sampled, axis));
    let largest_extent = extents.into_iter().fold(f32::MIN_POSITIVE, f32::max);
    let score = |axis: Vec3| {
        let (parallel, perpendicular) = shares(sampled, axis);
        let extent = extent_along(sampled, axis) / largest_extent;
        parallel + perpendicular - EXTENT_WEIGHT * extent
    };
    let best = peaks(sampled)
        .into_iter()
        .map(|peak| refined(sampled, peak))
        .max_by(|a, b| score(*a).total_cmp(&score(*b)))
        .unwrap_or(Vec3::Z);
    let best = snapped_to_file_axis(sampled, best);
    (best, shares(sampled, best).0)
}

/// Shares of the normals that are parallel and perpendicular to an axis.
fn shares(sampled: &[(Vec3, Vec3)], axis: Vec3) -> (f32, f32) {
    let (mut parallel, mut perpendicular) = (0u32, 0u32);
    for (_, normal) in sampled {
        let cos = normal.dot(axis).abs();
        parallel += u32::from(cos > PARALLEL);
        perpendicular += u32::from(cos < PERPENDICULAR);
    }
    let total = sampled.len() as f32;
    (parallel as f32 / total, perpendicular as f32 / total)
}

/// Length in metres, along an axis, of what holds 98 % of the points.
fn extent_along(sampled: &[(Vec3, Vec3)], axis: Vec3) -> f32 {
    let [low, high] = without_tails(sampled.iter().map(|(p, _)| p.dot(axis)));
    high - low
}

/// Between which numbers 98 % of them are.
fn without_tails(numbers: impl Iterator<Item = f32>) -> [f32; 2] {
    let mut numbers: Vec<f32> = numbers.collect();
    numbers.sort_unstable_by(f32::total_cmp);
    let tail = numbers.len() / 100;
    [tail, numbers.len() - 1 - tail].map(|k| numbers[k])
}

/// Directions around which the normals cluster, most of them first.
fn peaks(sampled: &[(Vec3, Vec3)]) -> Vec<Vec3> {
    const DIRECTIONS: usize = 800; // over the hemisphere: about 5° apart
    const MOST: usize = 6;
    let golden_angle = std::f32::consts::PI * (3.0 - 5.0f32.sqrt());
    let mut directions: Vec<(f32, Vec3)> = (0..DIRECTIONS)
        .map(|i| {
            let z = (i as f32 + 0.5) / DIRECTIONS as f32;
            let (sin, cos) = (golden_angle * i as f32).sin_cos();
            let r = (1.0 - z * z).sqrt();
            let direction = Vec3::new(r * cos, r * sin, z);
            (shares(sampled, direction).0, direction)
        })
        .collect();
    directions.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut peaks: Vec<Vec3> = Vec::new();
    for (_, direction) in directions {
        // cos 30°: one peak for each cluster of 15° radius.
        if peaks.len() < MOST && peaks.iter().all(|peak| peak.dot(direction).abs() < 0.866) {
            peaks.push(direction);
        }
    }
    peaks
}

/// The centre of the cluster of normals around an axis: mean shift with a shrinking window.
fn refined(sampled: &[(Vec3, Vec3)], axis: Vec3) -> Vec3 {
    let mut axis = axis;
    for cos in [PARALLEL, PARALLEL, PARALLEL, 0.985, 0.985, 0.9945, 0.9945] {
        let sum: Vec3 = sampled
            .iter()
            .filter(|(_, n)| n.dot(axis).abs() > cos)
            .map(|(_, n)| *n * n.dot(axis).signum())
            .sum();
        axis = sum.try_normalize().unwrap_or(axis);
    }
    axis
}

/// The nearest coordinate axis if the cluster of normals is too wide to tell it from `axis`.
fn snapped_to_file_axis(sampled: &[(Vec3, Vec3)], axis: Vec3) -> Vec3 {
    let (mut sum, mut count) = (0.0, 0u32);
    for (_, normal) in sampled {
        let cos = normal.dot(axis).abs();
        if cos > PARALLEL {
            sum += 1.0 - cos * cos;
            count += 1;
        }
    }
    // Root mean square of the sine between the cluster's normals and its axis. 0.14: a cluster
    // that fills its window of 15° evenly has 0.18 and is terrain, a scanned floor has 0.1. 2°
    // is what the noise and the registration of a scan leave uncertain at best.
    let spread = (sum / count.max(1) as f32).sqrt();
    let reach = if spread > 0.14 { 0.14 } else { 0.035 };
    (Vec3::AXES.into_iter())
        .map(|file_axis| file_axis * file_axis.dot(axis).signum())
        .find(|file_axis| file_axis.cross(axis).length() < reach)
        .unwrap_or(axis)
}

/// Positive if `axis` points up, negative if down, 2 at most.
///
/// Between level surfaces at both ends, floor and ceiling, things stand on the lower one. Else what
/// is not level (walls, sides of furniture) is above the middle of what is, and stands on it.
fn sign_evidence(points: &[Vec3], normals: &[Vec3], axis: Vec3) -> f32 {
    let picked: Vec<usize> = every_nth(points.len(), HEIGHT_SAMPLES)
        .filter(|&i| points[i].is_finite() && normals[i].is_normalized())
        .collect();
    let [low, high] = without_tails(picked.iter().map(|&i| points[i].dot(axis)));
    if high <= low {
        return 0.0;
    }
    // Height of each point as a share of what holds 98 % of them, and whether it is level there.
    let places: Vec<(f32, bool)> = picked
        .iter()
        .map(|&i| {
            let share = (points[i].dot(axis) - low) / (high - low);
            (share.clamp(0.0, 1.0), is_level(normals[i], axis))
        })
        .collect();
    let mean_of = |keep: &dyn Fn(f32, bool) -> bool| {
        let kept = places.iter().filter(|(share, level)| keep(*share, *level));
        let (sum, count) = kept.fold((0.0, 0u32), |(sum, count), (share, _)| {
            (sum + f64::from(*share), count + 1)
        });
        (count > 0).then(|| (sum / f64::from(count)) as f32)
    };
    let level_points = || places.iter().filter(|(_, level)| *level);
    let is_floor_or_ceiling = |is_in_end: fn(f32) -> bool| {
        let in_end = level_points()
            .filter(|(share, _)| is_in_end(*share))
            .count();
        in_end as f32 > MIN_END_SHARE * level_points().count() as f32
    };
    if is_floor_or_ceiling(|share| share < END) && is_floor_or_ceiling(|share| share > 1.0 - END) {
        let between = mean_of(&|share, _| (END..=1.0 - END).contains(&share));
        return between.map_or(0.0, |mean| 1.0 - 2.0 * mean);
    }
    let (level, other) = (mean_of(&|_, level| level), mean_of(&|_, level| !level));
    level
        .zip(other)
        .map_or(0.0, |(level, other)| 2.0 * (other - level))
}

fn is_level(normal: Vec3, axis: Vec3) -> bool {
    normal.dot(axis).abs() >= PARALLEL
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::furnished_room;
    use crate::surface_sampling::{SampledSurface, sample_surface};
    use fastrand::Rng;
    use tldi::glamx::Quat;

    /// Evenly distributed over all rotations (Shoemake 1992).
    fn random_rotation(rng: &mut Rng) -> Quat {
        let (u, v, w) = (
            rng.f32(),
            rng.f32() * std::f32::consts::TAU,
            rng.f32() * std::f32::consts::TAU,
        );
        let (a, b) = ((1.0 - u).sqrt(), u.sqrt());
        Quat::from_xyzw(a * v.sin(), a * v.cos(), b * w.sin(), b * w.cos()).normalize()
    }

    /// Up of the scene, found after it was turned.
    fn turned(scene: &SampledSurface, rotation: Quat) -> Up {
        let mut rng = Rng::with_seed(5);
        let points: Vec<Vec3> = scene.points.iter().map(|p| rotation * *p).collect();
        // Normals as PCA gives them: noisy and of either sign.
        let noisy = |n: &Vec3| {
            let error = Vec3::new(rng.f32() - 0.5, rng.f32() - 0.5, rng.f32() - 0.5);
            let sign = if rng.bool() { 1.0 } else { -1.0 };
            sign * (rotation * *n + 0.2 * error).normalize()
        };
        let normals: Vec<Vec3> = scene.normals.iter().map(noisy).collect();
        detect_up(&points, &normals)
    }

    /// Up of a scene with z up, turned, is the turned z; `case` is named on failure.
    #[track_caller]
    fn assert_up_is_found(scene: &SampledSurface, rotation: Quat, case: (u64, usize)) {
        let up = turned(scene, rotation);
        let angle = (rotation * Vec3::Z)
            .angle_between(up.direction)
            .to_degrees();
        // 2°: within it a level floor does not make bodies slide.
        assert!(angle < 2.0, "case {case:?}, {rotation}: {angle}° off");
        assert_eq!(
            up.confidence,
            Confidence::Clear,
            "case {case:?}, {rotation}"
        );
    }

    #[test]
    fn up_is_found_in_a_room_turned_in_any_way() {
        let room = furnished_room(0.04, 0.003, 2);
        let mut rng = Rng::with_seed(11);
        for case in 0..40 {
            assert_up_is_found(&room, random_rotation(&mut rng), (2, case));
        }
    }

    /// The room of the other tests with a ceiling 2.4 m over its floor.
    fn room_with_ceiling(seed: u64) -> SampledSurface {
        let mut room = furnished_room(0.04, 0.003, seed);
        let mut rng = Rng::with_seed(seed);
        for _ in 0..(4.2 * 3.6 / (0.04 * 0.04)) as usize {
            let noise = 0.01 * (rng.f32() - 0.5);
            room.points
                .push(Vec3::new(4.2 * rng.f32(), 3.6 * rng.f32(), 2.4 + noise));
            room.normals.push(-Vec3::Z);
        }
        room
    }

    #[test]
    fn up_is_found_under_a_ceiling() {
        for seed in 1..4 {
            let room = room_with_ceiling(seed);
            let mut rng = Rng::with_seed(seed);
            for case in 0..12 {
                assert_up_is_found(&room, random_rotation(&mut rng), (seed, case));
            }
        }
    }

    #[test]
    fn terrain_is_levelled_by_its_file() {
        let bounds = tldi::Aabb {
            min: Vec3::new(0.0, 0.0, -2.0),
            max: Vec3::new(30.0, 30.0, 4.0),
        };
        let height = |p: Vec3| {
            let hill = 3.0 * (-0.05 * ((p.x - 12.0).powi(2) + (p.y - 15.0).powi(2))).exp();
            hill + 0.3 * (p.x * 1.3).sin() * (p.y * 0.9).cos() + 0.04 * p.x
        };
        let hill = sample_surface(|p| 0.6 * (p.z - height(p)), bounds, 0.3, 1);
        assert_eq!(turned(&hill, Quat::IDENTITY).direction, Vec3::Z);
    }

    #[test]
    fn a_ball_tells_nothing() {
        let bounds = tldi::Aabb {
            min: Vec3::splat(-1.1),
            max: Vec3::splat(1.1),
        };
        let ball = sample_surface(|p| p.length() - 1.0, bounds, 0.05, 1);
        let up = turned(&ball, Quat::from_rotation_x(1.0));
        assert_eq!(
            up,
            Up {
                direction: Vec3::Z,
                confidence: Confidence::Assumed
            }
        );
        assert_eq!(detect_up(&[], &[]).confidence, Confidence::Assumed);
    }
}
