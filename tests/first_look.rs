//! What is deep is settled with large pixels: as deep as it is, and only where surfaces cross.

use tldi::glamx::{Pose3, Quat, Vec3};
use tldi_tests::{
    Samples, cloud_of, compare_clouds, deepest_contact, random_unit, sampled_box, sampled_plane,
    sampled_sphere,
};

/// Spacing of the samples and their radius, metres.
const R: f32 = 0.01;

/// Spheres 5 to 30 radii deep, up to three quarters of the smaller one's radius, with and without normals, in any
/// direction. (Deeper, one case in forty is 40 % off, as `docs/limits.md` says: the zone's normals point everywhere and a view
/// sees it askew.)
#[test]
fn spheres_are_as_deep_as_they_are() {
    let mut rng = fastrand::Rng::with_seed(31);
    let [big, small] = [0.6, 0.4].map(|radius| sampled_sphere(radius, R));
    for with_normals in [true, false] {
        let cloud = |samples: &Samples| match with_normals {
            true => samples.cloud(R),
            false => samples.bare_cloud(R),
        };
        let (a, b) = (cloud(&big), cloud(&small));
        for case in 0..40 {
            let depth = (5.0 + 25.0 * rng.f32()) * R;
            let towards_b = random_unit(&mut rng);
            let turn = Quat::from_axis_angle(random_unit(&mut rng), 3.0 * rng.f32());
            let pose = Pose3::from_parts((1.0 - depth) * towards_b, turn);
            let result = compare_clouds(&a, &b, pose, R);
            let case = format!("{with_normals}, case {case}, {depth} m");
            assert!(result.collides, "{case}");
            let (normal, found) = deepest_contact(&result).expect("they touch");
            // The contact accuracy allows as much (5 %) at all depths; a large pixel errs by a tenth, 2 pixels deep.
            assert!((found - depth).abs() < 0.05 * depth, "{case}: {found}");
            let off = normal.angle_between(towards_b).to_degrees();
            assert!(off < 3.0, "{case}: {off}° off");
        }
    }
}

/// A box that is deep in a floor, turned about the vertical, 5 to 12 radii, with and without normals. Without, what is deep
/// all over is the contact because a window shows that the surfaces cross.
#[test]
fn a_box_in_a_block_is_as_deep_as_it_is() {
    let mut rng = fastrand::Rng::with_seed(32);
    let block = sampled_box(Vec3::new(0.7, 0.3, 0.7), R, &mut rng);
    let half = Vec3::new(0.3, 0.2, 0.25);
    let body = sampled_box(half, R, &mut rng);
    let clouds = [
        [block.cloud(R), body.cloud(R)],
        [block.bare_cloud(R), body.bare_cloud(R)],
    ];
    for [block, body] in &clouds {
        for case in 0..20 {
            let depth = (5.0 + 7.0 * rng.f32()) * R;
            let aside = 0.1 * Vec3::new(rng.f32(), 0.0, rng.f32());
            let above = (0.3 + half.y - depth) * Vec3::Y;
            let turn = Quat::from_axis_angle(Vec3::Y, 6.0 * rng.f32());
            let result = compare_clouds(block, body, Pose3::from_parts(above + aside, turn), R);
            assert!(result.collides);
            assert_eq!(
                result.work.fine.points, 0,
                "{case}: settled by large pixels"
            );
            let (normal, found) = deepest_contact(&result).expect("they touch");
            assert!(
                (found - depth).abs() < 0.05 * depth,
                "{case}: {found} of {depth}"
            );
            assert!(normal.dot(Vec3::Y) > 0.999, "{case}: {normal}");
        }
    }
}

/// A sheet between the two sheets of another body, with space on both sides: bare points do not tell it from the
/// inside of a thick body, and it looks deep wherever pixels are larger than that space. It touches once it is
/// tilted by enough.
#[test]
fn what_lies_between_two_sheets_does_not_collide() {
    let mut rng = fastrand::Rng::with_seed(33);
    for apart in [6.0, 10.0, 20.0] {
        let gap = apart * R;
        let mut points = Vec::new();
        for height in [-gap, gap] {
            let sheet = sampled_plane(1.0, R, &mut rng);
            points.extend(sheet.points.iter().map(|p| *p + height * Vec3::Y));
        }
        let both = cloud_of(points, R);
        let between = sampled_plane(0.6, R, &mut rng).bare_cloud(R);
        for tilt in [0.0, 0.4, 0.8, 1.3, 1.8] {
            // Its edge is 30 radii from the middle. Where that is too little for the tilt, it stands upright.
            let angle = (tilt * gap / 0.3).clamp(0.0, 1.0).asin();
            let turn = Quat::from_axis_angle(Vec3::Z, angle);
            let pose = Pose3::from_parts(Vec3::ZERO, turn);
            let result = compare_clouds(&both, &between, pose, R);
            let expected = tilt > 1.0;
            assert_eq!(result.collides, expected, "{apart} r apart, tilt {tilt}");
        }
    }
}

/// Two boxes with normals, half to four fifths in each other along x, are pushed apart along x only. Large pixels do not look
/// at the other side of the first box: their planes at walls that are seen edge-on told contacts sideways in one of six.
#[test]
fn boxes_in_each_other_have_no_contacts_sideways() {
    let (half, spacing) = (0.1, 0.02);
    for seed in (0..100).step_by(2) {
        let mut rng = fastrand::Rng::with_seed(seed);
        let [a, b] = [0, 1].map(|_| sampled_box(Vec3::splat(half), spacing, &mut rng));
        let depth = 2.0 * half * (0.5 + 0.3 * rng.f32());
        let pose = Pose3::from_translation((2.0 * half - depth) * Vec3::X);
        let result = compare_clouds(&a.cloud(spacing), &b.cloud(spacing), pose, spacing);
        assert!(result.coarser.is_some(), "{seed}: settled by large pixels");
        assert!(!result.patches.is_empty(), "{seed}");
        for patch in &result.patches {
            assert!(patch.normal.x > 0.9, "{seed}, {depth} m: {patch:?}");
        }
    }
}
