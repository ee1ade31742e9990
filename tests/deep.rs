//! Contacts so deep that larger pixels find them, against analytic truth: they err by the share of
//! their depth that is allowed.

use tldi::glamx::{Pose3, Quat, Vec3};
use tldi::{Params, PointCloud, Surface, View};
use tldi_tests::{
    Samples, compare_batch, deepest_contact, random_unit, sampled_box, sampled_sphere,
};

/// Spacing and radius of all samples, in metres.
const R: f32 = 0.005;

/// Half the edge of the cube, and radius of the balls, in metres.
const SIZE: f32 = 0.25;

/// What is pushed into what, along −y: its lowest point starts at y = 0, the top of the other.
struct Case {
    name: &'static str,
    below: Samples,
    above: Samples,
    /// Of what is above, before it is lowered.
    start: fn(&mut fastrand::Rng) -> Pose3,
    /// Share of its depth by which a contact may err in the median, and degrees of its normal.
    limits: [f32; 2],
}

fn spun(rng: &mut fastrand::Rng) -> Quat {
    Quat::from_axis_angle(Vec3::Y, std::f32::consts::TAU * rng.f32())
}

/// A turn after which every face of a cube is at least 20° from level.
fn on_a_corner(rng: &mut fastrand::Rng) -> Quat {
    loop {
        let turn = Quat::from_axis_angle(random_unit(rng), 6.0 * rng.f32());
        let down = turn.inverse() * Vec3::Y;
        if down.abs().max_element() < 20f32.to_radians().cos() {
            return turn;
        }
    }
}

fn cases() -> Vec<Case> {
    let mut rng = fastrand::Rng::with_seed(1);
    let ball = || sampled_sphere(SIZE, R);
    let mut block = |half: Vec3| sampled_box(half, R, &mut rng);
    let wide = SIZE * Vec3::new(3.0, 1.0, 3.0);
    let below = |samples: Samples| samples.moved(&Pose3::translation(0.0, -SIZE, 0.0));
    vec![
        Case {
            name: "ball in ball",
            below: below(ball()),
            above: ball(),
            start: |rng| {
                let turn = Quat::from_axis_angle(random_unit(rng), 6.0 * rng.f32());
                Pose3::from_parts(SIZE * Vec3::Y, turn)
            },
            limits: [0.02, 5.0],
        },
        Case {
            name: "face in face",
            below: below(block(wide)),
            above: block(Vec3::splat(SIZE)),
            start: |rng| {
                let aside = SIZE * random_unit(rng).reject_from(Vec3::Y);
                Pose3::from_parts(SIZE * Vec3::Y + aside, spun(rng))
            },
            limits: [0.02, 5.0],
        },
        Case {
            name: "corner in face",
            below: below(block(wide)),
            above: block(Vec3::splat(SIZE)),
            start: |rng| {
                let turn = on_a_corner(rng);
                let reach = (turn.inverse() * Vec3::Y).abs().dot(Vec3::splat(SIZE));
                Pose3::from_parts(reach * Vec3::Y, turn)
            },
            limits: [0.1, 5.0],
        },
    ]
}

#[test]
fn deep_contacts_err_by_the_share_that_is_allowed() {
    for case in cases() {
        for with_normals in [true, false] {
            let cloud = |samples: &Samples| match with_normals {
                true => samples.cloud(R),
                false => samples.bare_cloud(R),
            };
            let (a, b) = (cloud(&case.below), cloud(&case.above));
            let what = format!("{}, normals: {with_normals}", case.name);
            let mut rng = fastrand::Rng::with_seed(2);
            let (mut errors, mut angles, mut larger) = (Vec::new(), Vec::new(), 0);
            for _ in 0..15 {
                let depth = SIZE * (0.8 + 0.6 * rng.f32());
                let mut a_from_b = (case.start)(&mut rng);
                a_from_b.translation.y -= depth;
                let (normal, found, pixel_size) = deepest(&a, &b, a_from_b, &what);
                errors.push((found - depth).abs() / depth);
                angles.push(normal.angle_between(Vec3::Y).to_degrees());
                larger += usize::from(pixel_size >= 2.0 * R);
            }
            let median = |mut of: Vec<f32>| {
                of.sort_by(f32::total_cmp);
                of[of.len() / 2]
            };
            let (error, angle) = (median(errors), median(angles));
            let [most_error, most_angle] = case.limits;
            assert!(error <= most_error, "{what}: {error} of the depth");
            assert!(angle <= most_angle, "{what}: {angle}°");
            assert_eq!(larger, 15, "{what}");
        }
    }
}

/// Normal and depth of the deepest contact, and the edge of the pixels that found it.
fn deepest(a: &PointCloud, b: &PointCloud, a_from_b: Pose3, what: &str) -> (Vec3, f32, f32) {
    let query = tldi::PairQuery {
        a: Surface::Cloud(a),
        b: Surface::Cloud(b),
        a_from_b,
        view: View::Aim {
            policy: Default::default(),
            motion: -0.05 * Vec3::Y,
            last_axis: None,
        },
        params: Params {
            depth_error: 0.08,
            ..Params::for_radius(R)
        },
    };
    let result = compare_batch(&[query]).remove(0);
    assert!(result.collides, "{what}");
    let (normal, depth) = deepest_contact(&result).unwrap_or_else(|| panic!("{what}: missed"));
    (normal, depth, result.pixel_size)
}
