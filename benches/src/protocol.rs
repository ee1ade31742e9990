//! The cases of the paper's accuracy protocol: two copies of a model, the second at 31 distances and
//! 900 rotations.

use crate::placements::bounds;
use tldi::glamx::{Pose3, Quat, Vec3};

/// Distances: 3.0 down to 0 along x.
const DISTANCES: usize = 31;
/// Rotations about y, and about z.
const ROTATIONS: usize = 30;
/// All cases.
pub const ALL_CASES: usize = DISTANCES * ROTATIONS * ROTATIONS;

/// One case.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// Its number among [`ALL_CASES`].
    pub number: usize,
    /// Distance of the middles along x, in units of which the model is 2 large.
    pub distance: f32,
    /// From the frame of the second copy into that of the first.
    pub a_from_b: Pose3,
}

/// The case of a distance and a rotation, by their numbers.
fn case(distance: usize, rotation: usize) -> Case {
    let number = distance * ROTATIONS * ROTATIONS + rotation;
    let distance = 3.0 - 0.1 * distance as f32;
    let turn = |k: usize| std::f32::consts::TAU * k as f32 / ROTATIONS as f32;
    let about_y = Quat::from_rotation_y(turn(rotation / ROTATIONS));
    let about_z = Quat::from_rotation_z(turn(rotation % ROTATIONS));
    Case {
        number,
        distance,
        a_from_b: Pose3::from_parts(distance.max(0.0) * Vec3::X, about_y * about_z),
    }
}

/// Shares no factor with the number of rotations: its multiples pass through all of them.
const ROTATION_STEP: usize = 557;

/// An even sample of `count` of all cases: as many at every distance, of rotations all over.
pub fn cases(count: usize) -> impl Iterator<Item = Case> {
    let count = count.min(ALL_CASES);
    (0..count).map(move |k| {
        let rotation = k * ROTATION_STEP % (ROTATIONS * ROTATIONS);
        case(k * DISTANCES / count, rotation)
    })
}

/// Moves and scales points so that their bounds are in a cube of 2 about the origin.
pub fn normalised(points: &[Vec3]) -> Vec<Vec3> {
    let bounds = bounds(points);
    let scale = 2.0 / bounds.extents().max_element();
    let middle = bounds.center();
    points.iter().map(|p| (*p - middle) * scale).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn all_cases_are_those_of_the_paper() {
        assert_eq!(ALL_CASES, 27_900);
        let all: HashSet<String> = cases(ALL_CASES)
            .map(|case| format!("{:.1} {:.4}", case.distance, case.a_from_b.rotation))
            .collect();
        // Turns by 180° about both axes, in different orders, are the same.
        assert!(all.len() > 27_000, "{}", all.len());
        assert_eq!(case(0, 0).distance, 3.0);
        assert!(case(DISTANCES - 1, 0).distance.abs() < 1e-5);
    }

    /// By matrices, as the paper has it: a turn about z, then one about y, then the way along x.
    #[test]
    fn copies_lie_where_matrices_put_them() {
        let p = [0.3f64, -0.7, 1.1];
        for case in cases(930) {
            let (distance, rotation) = (case.number / 900, case.number % 900);
            let angle = |k: usize| 12.0f64.to_radians() * k as f64;
            let (sy, cy) = angle(rotation / 30).sin_cos();
            let (sz, cz) = angle(rotation % 30).sin_cos();
            let about_z = [cz * p[0] - sz * p[1], sz * p[0] + cz * p[1], p[2]];
            let expected = [
                cy * about_z[0] + sy * about_z[2] + 3.0 - 0.1 * distance as f64,
                about_z[1],
                -sy * about_z[0] + cy * about_z[2],
            ];
            let moved = case.a_from_b * Vec3::from_array(p.map(|x| x as f32));
            let error = moved.distance(Vec3::from_array(expected.map(|x| x as f32)));
            assert!(error < 1e-5, "{case:?}: {error}");
        }
        let numbers: HashSet<usize> = cases(ALL_CASES).map(|case| case.number).collect();
        assert_eq!(numbers.len(), ALL_CASES);
    }

    #[test]
    fn samples_are_even() {
        let distances: HashSet<i32> = cases(310)
            .map(|c| (10.0 * c.distance).round() as i32)
            .collect();
        assert_eq!(distances.len(), 31);
        let turns: HashSet<String> = cases(930)
            .map(|c| format!("{:.4}", c.a_from_b.rotation))
            .collect();
        assert!(turns.len() > 800, "{}", turns.len());
    }
}
