//! The speed of a surface that is sampled anew in every frame.
//!
//! New points do not tell where the old ones went. But a surface that comes nearer stands higher than before, along the
//! normal of a contact. If the rise exceeds the noise of the samples twice in a row, it is the surface's speed. A surface
//! that stands still, or is replaced by another one, has no speed.

use crate::corrections::blocks;
use nalgebra::{SMatrix, SVector};
use rapier3d::math::{Pose, Vector};
use tldi::{Aabb, PointCloud};

/// Radius about a contact, in mean radii, whose points tell the height of the surface: some thirty. Half: 13 of 636
/// stability rows fail instead of 3, all new ones of streamed walls; twice: no change in any suite.
const AROUND: f32 = 3.0;

/// Fewest points of a fit, for each of its terms. Half or twice: no change in any suite.
const POINTS_PER_TERM: usize = 3;

/// Terms of a plane and of a paraboloid.
const PLANE: usize = 3;
const PARABOLOID: usize = 6;

/// Farthest motion of a surface from one frame to the next, in mean radii. Beyond it, points of another surface are as
/// near. Half: 11 of 636 stability rows fail instead of 3, all new ones of walls streamed at 5 m/s; twice: no row of
/// any suite changes.
const FARTHEST: f32 = 8.0;

/// Shortest motion from one frame to the next, in mean radii, that counts: twice the scatter of measured
/// depths. Half or twice: no row of any suite changes.
const SHORTEST: f32 = 0.2;

/// A motion must exceed this many standard errors. A surface at rest seems to do so twice in a row a few times in 10⁷
/// steps, by chance. Half or twice: no row of any suite changes.
const SURE: f32 = 4.0;

/// The points that a cloud had, by blocks.
#[derive(Default)]
pub(crate) struct Snapshot {
    points: Vec<Vector>,
    blocks: Vec<Aabb>,
    /// Where the cloud was, in the frame of what carries it.
    pub(crate) base_from_points: Pose,
}

impl Snapshot {
    /// Takes over the points of `cloud`, keeping the memory and the pose.
    pub(crate) fn take(&mut self, cloud: &PointCloud<'_>) {
        self.points.clear();
        self.points.extend(cloud.points());
        self.blocks.clear();
        self.blocks.extend(cloud.blocks());
    }
}

/// Height of a surface along an axis, metres.
#[derive(Clone, Copy)]
struct Height {
    value: f32,
    standard_error: f32,
}

/// A line through a contact.
struct Probe {
    point: Vector,
    normal: Vector,
    radius: f32,
}

impl Probe {
    /// The same line in another frame.
    fn moved(&self, pose: &Pose) -> Self {
        Self {
            point: *pose * self.point,
            normal: pose.rotation * self.normal,
            radius: self.radius,
        }
    }

    /// Heights of the points around the line that are up to `reach` metres away along it.
    fn heights(
        &self,
        blocks: &[Aabb],
        point: impl Fn(usize) -> Vector,
        count: usize,
        reach: f32,
    ) -> Heights {
        let (u, v) = self.normal.any_orthonormal_pair();
        // Half the edges of the cylinder's bounds: those of its line, and of a disc across it.
        let across = (Vector::ONE - self.normal * self.normal).max(Vector::ZERO);
        let half = reach * self.normal.abs() + self.radius * across.map(f32::sqrt);
        let bounds = Aabb {
            min: self.point - half,
            max: self.point + half,
        };
        let mut heights = Heights::default();
        for i in blocks::meeting(blocks, count, bounds).flatten() {
            let from = (point(i) - self.point) / self.radius;
            let (a, b) = (from.dot(u), from.dot(v));
            let height = from.dot(self.normal) * self.radius;
            if a * a + b * b <= 1.0 && height.abs() <= reach {
                heights.add(a, b, height);
            }
        }
        heights
    }
}

/// Heights of points around a line, metres, and where they are across it, in radii of the probe: the normal equations of a
/// paraboloid's least squares.
#[derive(Default)]
struct Heights {
    count: usize,
    matrix: SMatrix<f32, PARABOLOID, PARABOLOID>,
    moments: SVector<f32, PARABOLOID>,
    squares: f32,
}

impl Heights {
    fn add(&mut self, a: f32, b: f32, height: f32) {
        let terms = SVector::from([1.0, a, b, a * a, a * b, b * b]);
        self.count += 1;
        self.matrix += terms * terms.transpose();
        self.moments += height * terms;
        self.squares += height * height;
    }

    /// Height on the line of the surface that fits the points best: the first `N` terms of a paraboloid. `None` where they
    /// are too few, or in a row.
    fn on_line<const N: usize>(&self) -> Option<Height> {
        if self.count < POINTS_PER_TERM * N {
            return None;
        }
        let matrix = self.matrix.fixed_view::<N, N>(0, 0).clone_owned();
        let moments = self.moments.fixed_rows::<N>(0);
        let inverse = matrix.cholesky()?.inverse();
        let fit = inverse * moments;
        let squares = (self.squares - fit.dot(&moments)).max(0.0);
        let variance = squares / (self.count - N) as f32;
        let height = Height {
            value: fit[0],
            standard_error: (variance * inverse[(0, 0)]).sqrt(),
        };
        (height.value.is_finite() && height.standard_error.is_finite()).then_some(height)
    }
}

/// How far the surface of `cloud` moved in the last frame along the unit `normal` at `point`, metres, seen from what carries
/// the cloud; `point` and `normal` are in the frame of the cloud. The points of the two frames before tell it. 0 if the
/// motion does not exceed the noise.
pub(crate) fn way_along(
    (cloud, base_from_points): (&PointCloud<'_>, &Pose),
    [earlier, before]: [&Snapshot; 2],
    point: Vector,
    normal: Vector,
) -> f32 {
    let radius = cloud.mean_radius();
    let probe = Probe {
        point,
        normal,
        radius: AROUND * radius,
    };
    let points = cloud.points();
    let now = probe.heights(cloud.blocks(), |i| points[i], cloud.len(), AROUND * radius);
    let of = |old: &Snapshot, steps: f32| {
        let reach = (AROUND + steps * FARTHEST) * radius;
        let old_from_now = old.base_from_points.inv_mul(base_from_points);
        let probe = probe.moved(&old_from_now);
        probe.heights(&old.blocks, |i| old.points[i], old.points.len(), reach)
    };
    let heights = [of(earlier, 2.0), of(before, 1.0), now];
    // Few noisy points tell a plane best; what bends is no plane, and seems noisy.
    let plane = heights.each_ref().map(Heights::on_line::<PLANE>);
    steady_way(plane, radius)
        .or_else(|| {
            let paraboloid = heights.each_ref().map(Heights::on_line::<PARABOLOID>);
            steady_way(paraboloid, radius)
        })
        .unwrap_or(0.0)
}

/// The last way, metres, where the heights of three tell two in the same direction: the shorter.
fn steady_way(heights: [Option<Height>; 3], radius: f32) -> Option<f32> {
    let [Some(earlier), Some(before), Some(now)] = heights else {
        return None;
    };
    let way = |from: Height, to: Height| {
        let way = to.value - from.value;
        let noise = SURE * from.standard_error.hypot(to.standard_error);
        let is_sure = way.abs() > noise.max(SHORTEST * radius);
        (is_sure && way.abs() <= FARTHEST * radius).then_some(way)
    };
    let (last, previous) = (way(before, now)?, way(earlier, before)?);
    (last * previous > 0.0).then(|| last.signum() * last.abs().min(previous.abs()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;

    const SPACING: f32 = 0.02;

    /// A level sheet at a height, sampled anew with noise of `sigma` mean radii along y.
    fn sheet(height: f32, sigma: f32, rng: &mut Rng) -> PointCloud<'static> {
        sampled(|_, _| height, sigma, rng)
    }

    /// The same of a surface that is as high as `height` tells of x and z.
    fn sampled(height: impl Fn(f32, f32) -> f32, sigma: f32, rng: &mut Rng) -> PointCloud<'static> {
        let mut jitter = || SPACING * (rng.f32() - 0.5);
        let mut points = Vec::new();
        for k in 0..900 {
            // A sum of twelve has the variance of one.
            let noise: f32 = (0..12).map(|_| jitter()).sum();
            let x = (k % 30 - 15) as f32 * SPACING + jitter();
            let z = (k / 30 - 15) as f32 * SPACING + jitter();
            points.push(Vector::new(x, height(x, z) + sigma * noise, z));
        }
        PointCloud::builder(points)
            .radius(SPACING)
            .build()
            .expect("a valid cloud")
    }

    fn way(heights: [f32; 3], sigma: f32, rng: &mut Rng) -> f32 {
        way_of(heights.map(|height| sheet(height, sigma, rng)))
    }

    fn way_of([earlier, before, now]: [PointCloud<'static>; 3]) -> f32 {
        let [earlier, before] = [earlier, before].map(|cloud| {
            let mut snapshot = Snapshot::default();
            snapshot.take(&cloud);
            snapshot
        });
        let here = (&now, &Pose::IDENTITY);
        way_along(here, [&earlier, &before], Vector::ZERO, Vector::Y)
    }

    #[test]
    fn a_steady_motion_is_told_from_noise() {
        let mut rng = Rng::with_seed(5);
        for _ in 0..20 {
            let up = way([-0.16, -0.08, 0.0], 0.25, &mut rng);
            assert!((up - 0.08).abs() < 0.5 * SPACING, "{up}");
            let down = way([0.1, 0.05, 0.0], 0.25, &mut rng);
            assert!((down + 0.05).abs() < 0.5 * SPACING, "{down}");
        }
    }

    /// A trough as narrow as waves of fourteen radii rises slower than a plane's fit to it is wrong.
    #[test]
    fn a_trough_that_rises_is_told_from_one_that_does_not() {
        let mut rng = Rng::with_seed(8);
        let wave = |x: f32| -2.0 * SPACING * (std::f32::consts::TAU * x / (14.0 * SPACING)).cos();
        let mut way = |step: f32| {
            way_of([-2.0, -1.0, 0.0].map(|steps| {
                let height = |x: f32, _| 2.0 * SPACING + wave(x) + steps * step;
                sampled(height, 0.0, &mut rng)
            }))
        };
        for _ in 0..20 {
            let up = way(0.35 * SPACING);
            assert!((up - 0.35 * SPACING).abs() < 0.1 * SPACING, "{up}");
            assert_eq!(way(0.0), 0.0);
        }
    }

    #[test]
    fn noise_is_no_motion() {
        let mut rng = Rng::with_seed(6);
        for _ in 0..300 {
            assert_eq!(way([0.0; 3], 0.25, &mut rng), 0.0);
        }
    }

    /// A surface that is replaced by another one once does not throw what lies on it.
    #[test]
    fn a_jump_is_no_motion() {
        let mut rng = Rng::with_seed(7);
        assert_eq!(way([-0.08, -0.08, 0.0], 0.0, &mut rng), 0.0);
        assert_eq!(way([-0.08, 0.0, 0.0], 0.0, &mut rng), 0.0);
        assert_eq!(way([-0.08, 0.04, 0.0], 0.0, &mut rng), 0.0);
    }
}
