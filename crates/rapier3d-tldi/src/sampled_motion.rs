//! How fast a surface moves that is sampled anew in every frame.
//!
//! New points say nothing of where the old ones went, but a surface that comes nearer stands higher
//! along the normal of a contact than it did. What is told apart from the noise of the samples, in two
//! steps in a row, is taken for its speed; a surface that is replaced by another one, or that stands
//! still, has none.

use rapier3d::glamx::{Mat3, Vec3};
use rapier3d::math::Vector;
use tldi::{Aabb, BLOCK, PointCloud};

/// Radius about a contact, in mean radii, whose points tell the height of the surface: some thirty.
const AROUND: f32 = 3.0;

/// Fewest points that tell it.
const LEAST_POINTS: usize = 6;

/// Farthest that a surface moves in a step, in mean radii: beyond, the points of others are as near.
const FARTHEST: f32 = 8.0;

/// Shortest way in a step, in mean radii, that counts as a motion: twice what measured depths
/// scatter by.
const SHORTEST: f32 = 0.2;

/// Standard errors that a motion must exceed. Twice in a row, that of a surface at rest does so by
/// chance once in 10⁸ steps.
const SURE: f32 = 4.0;

/// The points that a cloud had, by blocks.
#[derive(Default)]
pub(crate) struct Snapshot {
    points: Vec<Vector>,
    blocks: Vec<Aabb>,
}

impl Snapshot {
    /// Takes over the points of `cloud`, keeping the memory.
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
    /// Height of the plane that fits the points around the line up to `reach` metres away best.
    fn height(
        &self,
        blocks: &[Aabb],
        point: impl Fn(usize) -> Vector,
        count: usize,
        reach: f32,
    ) -> Option<Height> {
        let (u, v) = self.normal.any_orthonormal_pair();
        let about = self.radius.hypot(reach);
        let mut near: Vec<Vec3> = Vec::new();
        for (block, bounds) in blocks.iter().enumerate() {
            let nearest = self.point.clamp(bounds.min, bounds.max);
            if nearest.distance_squared(self.point) > about * about {
                continue;
            }
            let first = block * BLOCK;
            near.extend((first..(first + BLOCK).min(count)).filter_map(|i| {
                let from = point(i) - self.point;
                let (a, b, height) = (from.dot(u), from.dot(v), from.dot(self.normal));
                let is_near = a * a + b * b <= self.radius * self.radius && height.abs() <= reach;
                is_near.then_some(Vec3::new(a, b, height))
            }));
        }
        if near.len() < LEAST_POINTS {
            return None;
        }
        let (mut matrix, mut moments) = (Mat3::ZERO, Vec3::ZERO);
        for p in &near {
            let basis = Vec3::new(1.0, p.x / self.radius, p.y / self.radius);
            matrix += Mat3::from_cols(basis * basis.x, basis * basis.y, basis * basis.z);
            moments += p.z * basis;
        }
        let inverse = matrix.inverse();
        let plane = inverse * moments;
        if !plane.is_finite() {
            return None; // points in a row
        }
        let residual =
            |p: &Vec3| p.z - plane.dot(Vec3::new(1.0, p.x / self.radius, p.y / self.radius));
        let squares: f32 = near.iter().map(|p| residual(p).powi(2)).sum();
        let variance = squares / (near.len() - 3) as f32;
        Some(Height {
            value: plane.x,
            standard_error: (variance * inverse.x_axis.x.max(0.0)).sqrt(),
        })
    }
}

/// How far the surface of `cloud` moved along the unit `normal` at `point` in the last step, metres,
/// from the points that it had before the step and before the one before; 0 where that cannot be
/// told apart from noise.
pub(crate) fn way_along(
    cloud: &PointCloud<'_>,
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
    let [x, y, z] = cloud.coordinates();
    let now = probe.height(
        cloud.blocks(),
        |i| Vector::new(x[i], y[i], z[i]),
        cloud.len(),
        AROUND * radius,
    );
    let of = |old: &Snapshot, steps: f32| {
        let reach = (AROUND + steps * FARTHEST) * radius;
        probe.height(&old.blocks, |i| old.points[i], old.points.len(), reach)
    };
    let way = |from: Height, to: Height| {
        let way = to.value - from.value;
        let noise = SURE * from.standard_error.hypot(to.standard_error);
        let is_sure = way.abs() > noise.max(SHORTEST * radius);
        (is_sure && way.abs() <= FARTHEST * radius).then_some(way)
    };
    let ways = || {
        let (now, before, earlier) = (now?, of(before, 1.0)?, of(earlier, 2.0)?);
        Some((way(before, now)?, way(earlier, before)?))
    };
    match ways() {
        Some((last, previous)) if last * previous > 0.0 => {
            last.signum() * last.abs().min(previous.abs())
        }
        _ => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;

    const SPACING: f32 = 0.02;

    /// A level sheet at a height, sampled anew with noise of `sigma` mean radii along y.
    fn sheet(height: f32, sigma: f32, rng: &mut Rng) -> PointCloud<'static> {
        let mut jitter = || SPACING * (rng.f32() - 0.5);
        let mut points = Vec::new();
        for k in 0..900 {
            // A sum of twelve has the variance of one.
            let noise: f32 = (0..12).map(|_| jitter()).sum();
            points.push(Vector::new(
                (k % 30 - 15) as f32 * SPACING + jitter(),
                height + sigma * noise,
                (k / 30 - 15) as f32 * SPACING + jitter(),
            ));
        }
        PointCloud::builder(points)
            .radius(SPACING)
            .build()
            .expect("a valid cloud")
    }

    fn way(heights: [f32; 3], sigma: f32, rng: &mut Rng) -> f32 {
        let [earlier, before, now] = heights.map(|height| sheet(height, sigma, rng));
        let [earlier, before] = [earlier, before].map(|cloud| {
            let mut snapshot = Snapshot::default();
            snapshot.take(&cloud);
            snapshot
        });
        way_along(&now, [&earlier, &before], Vector::ZERO, Vector::Y)
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
