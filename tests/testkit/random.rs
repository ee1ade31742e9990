//! Seeded random directions and poses.

use tldi::glamx::{Pose3, Quat, Vec3};

/// A direction drawn evenly from the sphere.
pub fn random_unit(rng: &mut fastrand::Rng) -> Vec3 {
    loop {
        let v = Vec3::from_array(std::array::from_fn(|_| 2.0 * rng.f32() - 1.0));
        if (0.01..=1.0).contains(&v.length_squared()) {
            return v.normalize();
        }
    }
}

/// A pose with any rotation and a translation of at most `reach` metres.
pub fn random_pose(rng: &mut fastrand::Rng, reach: f32) -> Pose3 {
    let angle = std::f32::consts::TAU * rng.f32();
    let rotation = Quat::from_axis_angle(random_unit(rng), angle);
    Pose3::from_parts(random_unit(rng) * (reach * rng.f32()), rotation)
}
