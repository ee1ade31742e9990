//! The up direction of a scene that a camera sees: level surfaces, by how cameras are held.

use tldi::glamx::{Pose3, Vec3};

/// Angles, in steps of 15°, by which the camera may look down.
const TILTS: usize = 5;
const TILT_STEP: f32 = 0.262;
/// Half angles of the cones in which normals are averaged, one after the other, as cosines: 25°, 15°
/// and 10°.
const CONES: [f32; 3] = [0.906, 0.966, 0.985];

/// The direction, among those at most 60° off the upper edge of the camera's image towards the
/// camera, that most normals agree on; the upper edge itself where none does. `normals` are of unit
/// length, towards the camera, in the world.
pub fn camera_up(normals: &[Vec3], world_from_camera: &Pose3) -> Vec3 {
    let up_in_image = world_from_camera.rotation * -Vec3::Y;
    let backward = world_from_camera.rotation * -Vec3::Z;
    let mut best = (0.0, up_in_image);
    for tilt in 0..TILTS {
        let (sin, cos) = (tilt as f32 * TILT_STEP).sin_cos();
        let mut up = cos * up_in_image + sin * backward;
        let mut count = 0;
        for cone in CONES {
            let inside = normals.iter().filter(|n| n.dot(up) > cone);
            count = inside.clone().count();
            up = inside.sum::<Vec3>().normalize_or(up);
        }
        // Of two directions, rather the one that is up in the image.
        let score = count as f32 * up.dot(up_in_image);
        if score > best.0 {
            best = (score, up);
        }
    }
    best.1
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;
    use tldi::glamx::Quat;

    /// A table, a larger wall behind it, upright or leant back by 45°, and clutter, seen by a camera
    /// that looks down by 10 to 60°, in a world whose axes are anywhere.
    #[test]
    fn a_table_before_a_wall_is_level() {
        let mut rng = Rng::with_seed(3);
        for case in 0..40 {
            let wall = [-Vec3::Z, -(Vec3::Y + Vec3::Z).normalize()][case % 2];
            let mut random = || Vec3::new(rng.f32(), rng.f32(), rng.f32()) * 2.0 - Vec3::ONE;
            let world = Quat::from_axis_angle(random().normalize(), 3.0 * random().x);
            let down = (10.0 + 50.0 * case as f32 / 40.0).to_radians();
            // The camera's y is down in the image, its z ahead.
            let pose = Pose3::from_rotation(world * Quat::from_rotation_x(-down));
            let mut normals = Vec::new();
            for (count, normal) in [(3000, -Vec3::Y), (4000, wall)] {
                for _ in 0..count {
                    normals.push(world * (normal + 0.15 * random()).normalize());
                }
            }
            for _ in 0..1500 {
                normals.push(random().normalize());
            }
            let up = camera_up(&normals, &pose);
            let off = up.angle_between(world * -Vec3::Y);
            assert!(off < 0.03, "{wall} {down}: {off}");
        }
    }
}
