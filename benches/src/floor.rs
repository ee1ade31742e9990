//! The floor: what it costs to look at every point of a pair once.

use multiversion::multiversion;
use tldi::Aabb;
use tldi::glamx::{Pose3, Vec3};

/// Points with an array for each coordinate, as a pass over all of them reads fastest.
pub struct Coordinates {
    x: Vec<f32>,
    y: Vec<f32>,
    z: Vec<f32>,
}

impl Coordinates {
    /// Of points in metres.
    pub fn of(points: &[Vec3]) -> Self {
        Self {
            x: points.iter().map(|p| p.x).collect(),
            y: points.iter().map(|p| p.y).collect(),
            z: points.iter().map(|p| p.z).collect(),
        }
    }

    /// One pass that moves every point by `pose` and counts those within `bounds`.
    pub fn moved_into(&self, pose: &Pose3, bounds: Aabb) -> usize {
        let columns = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| pose.rotation * axis);
        // A row for each coordinate of the result.
        let row = |k: usize| {
            let [x, y, z] = columns.map(|column| column[k]);
            [x, y, z, pose.translation[k]]
        };
        let rows = [row(0), row(1), row(2)];
        let limits = [0, 1, 2].map(|k| [bounds.min[k], bounds.max[k]]);
        count([&self.x, &self.y, &self.z], rows, limits)
    }
}

#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2+fma"))]
fn count([x, y, z]: [&[f32]; 3], rows: [[f32; 4]; 3], limits: [[f32; 2]; 3]) -> usize {
    let mut inside = 0u32;
    for ((x, y), z) in x.iter().zip(y).zip(z) {
        let mut is_inside = true;
        for ([a, b, c, d], [low, high]) in rows.into_iter().zip(limits) {
            let moved = a * x + b * y + c * z + d;
            is_inside &= (moved >= low) & (moved <= high);
        }
        inside += u32::from(is_inside);
    }
    inside as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use tldi::glamx::Quat;

    #[test]
    fn counts_what_a_plain_loop_counts() {
        let mut rng = fastrand::Rng::with_seed(5);
        let mut at = || 2.0 * Vec3::new(rng.f32(), rng.f32(), rng.f32()) - Vec3::ONE;
        let points: Vec<Vec3> = (0..1003).map(|_| at()).collect();
        let pose = Pose3::from_parts(
            Vec3::new(0.3, -0.1, 0.2),
            Quat::from_axis_angle(Vec3::new(1.0, 2.0, 3.0).normalize(), 0.7),
        );
        let bounds = Aabb {
            min: Vec3::new(-0.4, -0.5, -0.2),
            max: Vec3::new(0.6, 0.5, 0.9),
        };
        let expected = points
            .iter()
            .filter(|p| bounds.contains(pose * **p))
            .count();
        assert!((100..900).contains(&expected));
        assert_eq!(Coordinates::of(&points).moved_into(&pose, bounds), expected);
    }
}
