//! The up direction of a scene that a camera sees: level surfaces, by how cameras are held.

use thiserror::Error;
use tldi::glamx::{Pose3, Vec3};

/// Angles, in steps of 15°, by which the camera may look down.
const TILTS: usize = 5;
const TILT_STEP: f32 = 0.262;
/// Cosine of the largest angle between up and the upper edge of the image (60°).
const FARTHEST: f32 = 0.5;
/// Half angles of the cones in which normals are averaged, one after the other, as cosines: 25°, 15°
/// and 10°.
const CONES: [f32; 3] = [0.906, 0.966, 0.985];
/// Least share of the normals in the last cone. Normals spread evenly over what faces the camera give
/// 0.015.
const LEAST_SHARE: f32 = 0.06;
/// Most support for another direction, as a share of that for the best.
const MOST_RIVAL: f32 = 0.85;
/// Cosine of the angle from which on a direction is another one (25°).
const OTHER: f32 = 0.906;

/// Up, and how sure that is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraUp {
    /// Against gravity, unit length, in the world.
    pub direction: Vec3,
    /// Share of the normals within 10° of it, from 0 to 1.
    pub share: f32,
    /// Support for the next best direction, as a share of the support for this: 1 is a tie.
    pub rival: f32,
}

/// The normals do not tell which way is up.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
pub enum UnclearUp {
    /// Too few agree.
    #[error(
        "up is not clear: only {:.0} % of the normals agree on a direction within 60° of the image's upper edge; \
         pass it by hand (--up X,Y,Z, against gravity, in the world of the poses)", 100.0 * .share
    )]
    FewAgree {
        /// Share of the normals that agree on the best direction, from 0 to 1.
        share: f32,
    },
    /// Two directions are as good.
    #[error(
        "up is not clear: {first} and {second} are both likely; pass it by hand (--up X,Y,Z, against gravity, \
         in the world of the poses)"
    )]
    Ambiguous {
        /// The best direction, unit length, in the world.
        first: Vec3,
        /// The next best.
        second: Vec3,
    },
}

/// The direction, among those at most 60° off the upper edge of the camera's image towards the
/// camera, that most normals agree on. `normals` are of unit length, towards the camera, in the world.
///
/// # Errors
/// [`UnclearUp`] where few normals agree, or as many on another direction.
///
/// ```
/// use tldi::glamx::{Pose3, Vec3};
/// use tldi_examples::depth::camera_up;
/// // A camera that looks ahead, its y down, over a floor.
/// let up = camera_up(&[-Vec3::Y; 500], &Pose3::IDENTITY).unwrap();
/// assert_eq!((up.direction, up.share, up.rival), (-Vec3::Y, 1.0, 0.0));
/// assert!(camera_up(&[-Vec3::Z; 500], &Pose3::IDENTITY).is_err());
/// ```
pub fn camera_up(normals: &[Vec3], world_from_camera: &Pose3) -> Result<CameraUp, UnclearUp> {
    let up_in_image = world_from_camera.rotation * -Vec3::Y;
    let backward = world_from_camera.rotation * -Vec3::Z;
    // Of two directions, rather the one that is up in the image.
    let mut found: Vec<(f32, Vec3)> = (0..TILTS)
        .map(|tilt| {
            let (sin, cos) = (tilt as f32 * TILT_STEP).sin_cos();
            let mut up = cos * up_in_image + sin * backward;
            for cone in CONES {
                let inside = normals.iter().filter(|n| n.dot(up) > cone);
                up = inside.sum::<Vec3>().normalize_or(up);
            }
            (share_around(normals, up) * up.dot(up_in_image), up)
        })
        // Averages may drift out of range.
        .filter(|(_, up)| up.dot(up_in_image) >= FARTHEST)
        .collect();
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    let Some(&(best, direction)) = found.first() else {
        return Err(UnclearUp::FewAgree { share: 0.0 });
    };
    let share = share_around(normals, direction);
    if share < LEAST_SHARE {
        return Err(UnclearUp::FewAgree { share });
    }
    let other = found.iter().find(|(_, up)| up.dot(direction) < OTHER);
    let rival = other.map_or(0.0, |(score, _)| score / best);
    match other {
        Some((_, second)) if rival > MOST_RIVAL => Err(UnclearUp::Ambiguous {
            first: direction,
            second: *second,
        }),
        _ => Ok(CameraUp {
            direction,
            share,
            rival,
        }),
    }
}

/// Share of the normals within the last cone around a direction.
fn share_around(normals: &[Vec3], direction: Vec3) -> f32 {
    let inside = normals.iter().filter(|n| n.dot(direction) > CONES[2]);
    inside.count() as f32 / normals.len().max(1) as f32
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
            let down = (10.0 + 48.0 * case as f32 / 40.0).to_radians();
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
            let up = camera_up(&normals, &pose).unwrap();
            let off = up.direction.angle_between(world * -Vec3::Y);
            assert!(off < 0.03, "{wall} {down}: {off}");
            assert!(up.share > 0.3 && up.rival < MOST_RIVAL, "{up:?}");
        }
    }

    #[test]
    fn what_is_not_clear_is_refused() {
        let mut rng = Rng::with_seed(4);
        // Spread evenly: nothing is level.
        let spread: Vec<Vec3> = (0..5000)
            .map(|_| {
                let z = 2.0 * rng.f32() - 1.0;
                let (sin, cos) = (std::f32::consts::TAU * rng.f32()).sin_cos();
                let ring = (1.0 - z * z).sqrt();
                Vec3::new(ring * cos, ring * sin, z)
            })
            .collect();
        let few = camera_up(&spread, &Pose3::IDENTITY);
        assert!(matches!(few, Err(UnclearUp::FewAgree { .. })), "{few:?}");
        // A slope leant back by 50°, a little larger than the floor: as much counts for either.
        let slope = Quat::from_rotation_x(50_f32.to_radians()) * -Vec3::Y;
        let two = [vec![-Vec3::Y; 1000], vec![slope; 1500]].concat();
        let tie = camera_up(&two, &Pose3::IDENTITY);
        assert!(matches!(tie, Err(UnclearUp::Ambiguous { .. })), "{tie:?}");
        // A wall ahead only, 90° off the upper edge.
        let wall = camera_up(&[-Vec3::Z; 100], &Pose3::IDENTITY).unwrap_err();
        assert!(wall.to_string().contains("--up X,Y,Z"), "{wall}");
        assert!(camera_up(&[], &Pose3::IDENTITY).is_err());
    }
}
