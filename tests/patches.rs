//! What penetrates anywhere is pushed out there: one deep place must not hide the others.

use std::f32::consts::{FRAC_PI_4, SQRT_2, TAU};
use tldi::glamx::{Pose3, Quat, Vec3};
use tldi::{ContactPatch, ContactPixel, PairResult, Params, PatchScratch, PointCloud, Surface};
use tldi_tests::{
    Samples, compare, compare_clouds, random_pose, sampled_box, sampled_plane, sampled_sphere,
    standard_normal,
};

const R: f32 = 0.012;

/// A box that lies half a radius deep on one side, and two on the other, has support points near all four
/// lower corners.
#[test]
fn a_box_that_lies_deeper_on_one_side_is_held_on_both() {
    let half = R * Vec3::new(5.0, 3.0, 4.0);
    let [shallow, deep] = [0.5 * R, 2.0 * R];
    let tilt = Quat::from_rotation_z(((deep - shallow) / (2.0 * half.x)).asin());
    let mut distances = Vec::new();
    for seed in 0..20 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let floor = sampled_plane(40.0 * R, R, &mut rng).cloud(R);
        let body = sampled_box(half, R, &mut rng).cloud(R);
        let turn = Quat::from_rotation_y(TAU * rng.f32()) * tilt;
        let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, -1.0], [1.0, 1.0]]
            .map(|[x, z]| turn * (half * Vec3::new(x, -1.0, z)));
        let lowest = corners.map(|c| c.y).into_iter().fold(0.0, f32::min);
        let place = Vec3::new(3.0 * R * rng.f32(), -deep - lowest, 3.0 * R * rng.f32());
        let found = compare_clouds(&floor, &body, Pose3::from_parts(place, turn), R);
        let points = || found.patches.iter().flat_map(|patch| &patch.points);
        distances.extend(corners.map(|corner| {
            let from_corner = points().map(|p| p.point_b.distance(place + corner));
            from_corner.fold(f32::INFINITY, f32::min)
        }));
    }
    // A pixel's diagonal. If only what is as deep as the deepest but for a radius supported the box, this
    // were 2.8 R.
    let mean = distances.iter().sum::<f32>() / distances.len() as f32;
    assert!(mean < 1.42 * R, "{} radii from the corners", mean / R);
}

/// A box that lies flat rests on its corners, not on pixels that stand out beyond them.
#[test]
fn a_flat_box_rests_within_its_corners() {
    let half = R * Vec3::new(7.3, 5.0, 6.1);
    let (mut beyond, mut count) = (0.0, 0.0);
    for seed in 0..40 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let floor = sampled_plane(40.0 * R, R, &mut rng).cloud(R);
        let body = sampled_box(half, R, &mut rng).cloud(R);
        let turn = Quat::from_rotation_y(TAU * rng.f32());
        let (x, z) = (3.0 * R * rng.f32(), 3.0 * R * rng.f32());
        let place = Vec3::new(x, half.y - 0.1 * R, z);
        let found = compare_clouds(&floor, &body, Pose3::from_parts(place, turn), R);
        assert_eq!(found.patches.len(), 1, "seed {seed}");
        for point in &found.patches[0].points {
            let from_middle = (turn.inverse() * (point.point_b - place)).abs();
            beyond += from_middle.x - half.x + from_middle.z - half.z;
            count += 2.0;
            assert!((point.gap + 0.1 * R).abs() < 0.05 * R, "seed {seed}");
        }
    }
    // Pixels themselves stand out by 0.3 R here, where samples end a little within the edges.
    let beyond = beyond / count / R;
    assert!(beyond.abs() < 0.25, "{beyond} radii beyond the corners");
}

/// Contact pixels whose normals tell nothing, as a device could return them, are no plane, but not lost either.
#[test]
fn contacts_without_normals_make_one_patch() {
    let mut result = PairResult {
        axes: vec![Vec3::Z],
        contacts: vec![ContactPixel::default()],
        ..PairResult::default()
    };
    PatchScratch::default().reduce(&mut result, &Params::for_radius(R));
    assert_eq!(result.patches.len(), 1);
    assert!(
        result.patches[0]
            .points
            .iter()
            .all(|point| point.gap == 0.0)
    );
}

/// 25 contact pixels of two level faces that overlap by ten radii, or by half a radius. A view that shows a way out of one
/// radius leaves only the latter.
#[test]
fn no_contact_is_deeper_than_the_way_out() {
    let params = Params::for_radius(R);
    let is_kept = |gap: f32, way_out: Option<f32>| {
        let pixels = (0..25).map(|k| {
            let pixel = [k % 5, k / 5];
            let [x, z] = pixel.map(|c| params.pixel_size * (c as f32 + 0.5));
            ContactPixel {
                pixel,
                view: 0,
                point_a: Vec3::new(x, 0.0, z),
                point_b: Vec3::new(x, gap, z),
                normal_a: Vec3::Y,
                normal_b: -Vec3::Y,
                gap,
            }
        });
        let mut result = PairResult {
            axes: vec![-Vec3::Y],
            contacts: pixels.collect(),
            way_out,
            ..PairResult::default()
        };
        PatchScratch::default().reduce(&mut result, &params);
        !result.contacts.is_empty()
    };
    assert!(is_kept(-10.0 * R, None));
    assert!(!is_kept(-10.0 * R, Some(R)));
    assert!(is_kept(-0.5 * R, Some(R)));
    // Surfaces that a view shows apart still touch, within a pixel.
    assert!(is_kept(-0.5 * R, Some(-3.0 * R)));
}

/// Of 20 contact pixels of level faces and some of a floor's edge and the wall behind it, which another view sees better, the
/// latter go. Where there is nothing else they stay.
#[test]
fn faces_that_do_not_face_each_other_touch_only_where_nothing_else_does() {
    let params = Params::for_radius(R);
    let left = |of_faces: i32, of_edge: i32, axes: &[Vec3]| {
        let pixels = (0..of_faces + of_edge).map(|k| {
            let pixel = [k % 5, k / 5];
            let [x, z] = pixel.map(|c| params.pixel_size * (c as f32 + 0.5));
            let place = Vec3::new(x, 0.0, z);
            ContactPixel {
                pixel,
                view: 0,
                point_a: place,
                point_b: place,
                normal_a: if k < of_faces { Vec3::Y } else { Vec3::X },
                normal_b: -Vec3::Y,
                gap: 0.0,
            }
        });
        let mut result = PairResult {
            axes: axes.to_vec(),
            contacts: pixels.collect(),
            ..PairResult::default()
        };
        PatchScratch::default().reduce(&mut result, &params);
        result.contacts.len()
    };
    let both = [-Vec3::Y, -Vec3::X];
    assert_eq!(left(20, 15, &both), 20);
    assert_eq!(left(20, 15, &both[..1]), 35);
    assert_eq!(left(15, 20, &both), 35);
}

/// A ball in a trough that is hardly wider, deep in one of its sides: wherever it is in it, a patch pushes
/// along the normal there.
#[test]
fn a_ball_in_a_trough_is_pushed_from_all_sides() {
    let (ball, trough, off) = (2.2 * R, 2.5 * R, 1.5 * R);
    for degrees in [0.0_f32, 20.0, 35.0, 50.0] {
        let towards = degrees.to_radians();
        let mut contacts = Vec::new();
        for (i, j) in (-4..=4).flat_map(|i| (-2..=2).map(move |j| (i, j))) {
            let sin = (i as f32 + 0.5) * 0.5 * R / trough;
            if sin.abs() >= 0.95 {
                continue;
            }
            // Of a slice of the ball and the trough, by the angle from below.
            let angle = sin.asin();
            let along = Vec3::new(sin, -angle.cos(), 0.0);
            let gap = trough - ball - off * (angle - towards).cos();
            if gap > R {
                continue;
            }
            let place = 0.5 * R * j as f32 * Vec3::Z;
            contacts.push(ContactPixel {
                pixel: [i, j],
                view: 0,
                point_a: place + trough * along,
                point_b: place + (trough - gap) * along,
                normal_a: -along,
                normal_b: along,
                gap,
            });
        }
        let mut found = PairResult {
            axes: [-Vec3::Y].into_iter().collect(),
            contacts: contacts.clone(),
            ..PairResult::default()
        };
        PatchScratch::default().reduce(&mut found, &Params::for_radius(0.5 * R));
        for contact in contacts.iter().filter(|contact| contact.gap < 0.0) {
            let best = found
                .patches
                .iter()
                .map(|patch| patch.normal.dot(contact.normal_a))
                .fold(f32::NEG_INFINITY, f32::max);
            // 30°, within which linked pixels belong to one group, and half of the 14° that its normals may bend.
            assert!(
                best > 0.8,
                "{degrees}°: none pushes at {} within {}°",
                contact.point_a / R,
                best.acos().to_degrees()
            );
        }
    }
}

/// A ball in a groove touches two walls, and what is seen of both at once is no third: at most one patch of
/// 300 pushes more than 5° off both, which takes a rough sample of the crease.
#[test]
fn a_ball_in_a_groove_is_pushed_by_its_walls() {
    let (radius, depth) = (5.0 * R, 0.3 * R);
    let (mut pushing, mut off) = (0, 0);
    for seed in 0..6000 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let mut groove = Samples::default();
        let mut walls = Vec::new();
        for side in [1.0, -1.0] {
            let turn = Quat::from_rotation_z(side * FRAC_PI_4);
            let wall = sampled_plane(30.0 * R, R, &mut rng);
            let wall = wall.moved(&Pose3::from_parts(turn * (side * 15.0 * R * Vec3::X), turn));
            walls.push(wall.normals[0]);
            groove.extend(&wall);
        }
        let turned = Pose3::from_rotation(random_pose(&mut rng, 0.0).rotation);
        let groove = groove.moved(&turned).cloud(R);
        let ball = sampled_sphere(radius, R).moved(&random_pose(&mut rng, 0.0));
        let along = 3.0 * R * (rng.f32() - 0.5);
        let at = turned * Vec3::new(0.0, SQRT_2 * (radius - depth), along);
        let found = compare_clouds(&groove, &ball.cloud(R), Pose3::from_translation(at), R);
        for patch in &found.patches {
            if patch.points.iter().all(|point| point.gap >= 0.0) {
                continue;
            }
            let nearest = (walls.iter())
                .map(|wall| patch.normal.angle_between(turned.rotation * *wall))
                .fold(f32::INFINITY, f32::min);
            pushing += 1;
            off += u32::from(nearest > 5.0_f32.to_radians());
        }
    }
    // Of a gap of 0.3 radii one in a hundred is scatter.
    assert!(pushing >= 11_700, "{pushing} patches for 12,000 contacts");
    assert!(300 * off <= pushing, "{off} of {pushing} patches are off");
}

/// A ball that comes near, of whose gaps only the least are within the prediction (2 R), has one point, straight below it.
#[test]
fn a_ball_that_comes_near_has_one_point() {
    for radius in [10.0 * R, 15.0 * R, 25.0 * R] {
        for seed in 0..12 {
            let mut rng = fastrand::Rng::with_seed(seed);
            let floor = sampled_plane(40.0 * R, R, &mut rng).bare_cloud(R);
            let ball = sampled_sphere(radius, R).bare_cloud(R);
            let gap = R * (1.5 + 0.2 * rng.f32());
            let place = Vec3::new(3.0 * R * rng.f32(), radius + gap, 3.0 * R * rng.f32());
            let found = compare_clouds(&floor, &ball, Pose3::from_parts(place, Quat::IDENTITY), R);
            let points: Vec<_> = found.patches.iter().flat_map(|p| &p.points).collect();
            assert_eq!(points.len(), 1, "{radius} {seed}: {points:?}");
        }
    }
}

/// Where noise leaves open where a ball touches, its contact is as wide as that and holds its lowest point, so that it
/// lies; without noise it is a single point, on which it rolls.
#[test]
fn a_ball_on_noisy_samples_lies_on_several_points() {
    let radius = 8.0 * R;
    let (mut held, mut seen) = (0, 0);
    for seed in 0..300 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let smooth = sampled_plane(30.0 * R, R, &mut rng);
        let ball = sampled_sphere(radius, R).moved(&random_pose(&mut rng, 0.0));
        let place = Vec3::new(2.0 * R * rng.f32(), radius - 0.1 * R, 2.0 * R * rng.f32());
        let ball = ball.cloud(R);
        let find = |floor: &PointCloud| {
            let found = compare_clouds(floor, &ball, Pose3::from_translation(place), R);
            assert_eq!(found.patches.len(), 1, "seed {seed}");
            let patch = &found.patches[0];
            assert!(patch.is_round(), "seed {seed}");
            patch.points.clone()
        };
        assert_eq!(find(&smooth.bare_cloud(R)).len(), 1, "seed {seed}");

        let mut noisy = smooth;
        for point in &mut noisy.points {
            point.y += 0.25 * R * standard_normal(&mut rng);
        }
        let points = find(&noisy.bare_cloud(R));
        assert_eq!(points.len(), 4, "seed {seed}");
        // Each axis from the middle of the points, in half their extent.
        let middle = points.iter().map(|p| p.middle()).sum::<Vec3>() / 4.0;
        for axis in [0, 1].map(|k| points[k].middle() - middle) {
            let off = (place - middle).dot(axis) / axis.length_squared();
            held += usize::from(off.abs() <= 1.0);
            seen += 1;
        }
    }
    // Two standard errors hold 95 % of a normal distribution.
    let share = held as f64 / seen as f64;
    assert!((0.93..0.995).contains(&share), "{share}");
}

/// An egg on a ball: its contact tells both relative radii of curvature, and along which axes, whichever of the two
/// comes first and however far up the gaps are known.
#[test]
fn an_egg_on_a_ball_tells_the_relative_radii() {
    let (half, ball_radius) = (R * Vec3::new(16.0, 8.0, 11.0), 25.0 * R);
    let mut egg = sampled_sphere(1.0, R / half.min_element());
    for (point, normal) in egg.points.iter_mut().zip(&mut egg.normals) {
        *point *= half;
        *normal = (*normal / half).normalize();
    }
    // A spheroid's caps have the radii a² / b and c² / b.
    let curvature = half.y / (half * half) + 1.0 / ball_radius;
    let expected = [curvature.x, curvature.z].map(f32::recip);
    let [mut least, mut most] = [f32::INFINITY, 0.0_f32];
    for seed in 0..40 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let ball = sampled_sphere(ball_radius, R).moved(&random_pose(&mut rng, 0.0));
        let turn = Quat::from_rotation_y(TAU * rng.f32());
        let height = ball_radius + half.y - 0.2 * R * rng.f32();
        let ball_from_egg = Pose3::from_parts(height * Vec3::Y, turn);
        let params = Params::for_radius(R).with_prediction(R * (0.8 + 1.2 * rng.f32()));
        let (egg, ball) = match seed % 4 {
            0 | 1 => (egg.cloud(R), ball.cloud(R)),
            _ => (egg.bare_cloud(R), ball.bare_cloud(R)),
        };
        let (ball, egg) = (Surface::Cloud(&ball), Surface::Cloud(&egg));
        let (found, axes) = if seed % 2 == 0 {
            let found = compare(ball, egg, ball_from_egg, params);
            (found, [turn * Vec3::X, turn * Vec3::Z])
        } else {
            let found = compare(egg, ball, ball_from_egg.inverse(), params);
            (found, [Vec3::X, Vec3::Z])
        };
        assert_eq!(found.patches.len(), 1, "seed {seed}");
        let radii = found.patches[0].relative_radii.expect("a bowl");
        for (axis, expected) in axes.into_iter().zip(expected) {
            let curvature = |r: &Vec3| r.dot(axis).powi(2) / r.length().powi(3);
            let ratio = expected * radii.iter().map(curvature).sum::<f32>();
            (least, most) = (least.min(ratio), most.max(ratio));
        }
    }
    // Curvatures scatter by 1.2 %, of estimated normals about 2 % too much by 1.5 %: four standard deviations. By
    // gaps alone those of small balls are off by up to a fifth, by how far up the gaps are known.
    assert!(least > 0.95 && most < 1.08, "{least} to {most}");
}

/// A cylinder touches along a line, on whose ends it lies: where they are, how deep, and its radius. An edge is no
/// such line, whatever its angles.
#[test]
fn a_cylinder_lies_on_the_ends_of_a_line() {
    let (radius, half) = (12.0 * R, 9.0 * R);
    let cylinder = sampled_cylinder(radius, half, R);
    let (mut squares, mut count) = (0.0, 0);
    for seed in 0..60 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let floor = sampled_plane(50.0 * R, R, &mut rng);
        let yaw = Quat::from_rotation_y(TAU * rng.f32());
        let turn = yaw * Quat::from_rotation_z(TAU * rng.f32());
        let depth = 0.2 * R * rng.f32();
        let place = Vec3::new(R * rng.f32(), radius - depth, R * rng.f32());
        let (floor, body) = match seed % 2 {
            0 => (floor.cloud(R), cylinder.cloud(R)),
            _ => (floor.bare_cloud(R), cylinder.cloud(R)),
        };
        let found = compare_clouds(&floor, &body, Pose3::from_parts(place, turn), R);
        assert_eq!(found.patches.len(), 1, "seed {seed}");
        let patch = &found.patches[0];
        let [across, none] = patch.relative_radii.expect("it rolls");
        assert_eq!((patch.points.len(), none), (2, Vec3::ZERO), "seed {seed}");
        // By (r / R)² / 2 too much, and a scatter of as much.
        assert!((across.length() / radius - 1.0).abs() < 0.02, "{across}");
        let (x, z) = (yaw * Vec3::X, yaw * Vec3::Z);
        assert!(across.normalize().dot(x).abs() > 0.999, "seed {seed}");
        let along = [0, 1].map(|k| (patch.points[k].middle() - place).dot(z));
        // The discs of the outermost samples reach a radius beyond the rim, and pixels are as wide.
        for end in [along[0].min(along[1]) + half, half - along[0].max(along[1])] {
            assert!(end.abs() < 1.5 * R, "seed {seed}: {end}");
        }
        for point in &patch.points {
            let off = (point.middle() - place).dot(x);
            squares += off.powi(2);
            count += 1;
            // Measured: one in 60 is 0.26 r̄ off, and all deviate by 0.085 r̄.
            assert!(off.abs() < 0.3 * R, "seed {seed}: {off}");
            assert!((point.gap + depth).abs() < 0.1 * R, "seed {seed}");
        }

        let half = R * Vec3::new(8.0, 8.0, 10.0);
        let body = sampled_box(half, R, &mut rng).cloud(R);
        let lean = 0.35 + 0.87 * rng.f32();
        let turn = yaw * Quat::from_rotation_z(lean);
        let height = half.x * lean.sin() + half.y * lean.cos() - depth;
        let pose = Pose3::from_parts(place.with_y(height), turn);
        let found = compare_clouds(&floor, &body, pose, R);
        assert!(!found.patches.is_empty(), "seed {seed}");
        assert!(
            found.patches.iter().all(|patch| !patch.is_round()),
            "{seed}"
        );
    }
    let deviation = (squares / count as f32).sqrt();
    assert!(deviation < 0.095 * R, "{deviation}");
}

/// Two balls of one body touch in a spot each.
#[test]
fn a_dumbbell_touches_in_two_spots() {
    let (radius, apart) = (10.0 * R, 14.0 * R);
    for seed in 0..20 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let floor = sampled_plane(60.0 * R, R, &mut rng).cloud(R);
        let ball = sampled_sphere(radius, R);
        let mut body = ball.moved(&Pose3::from_translation(apart * Vec3::X));
        let other = ball.moved(&Pose3::from_translation(-apart * Vec3::X));
        body.extend(&other);
        let turn = Quat::from_rotation_y(TAU * rng.f32()) * Quat::from_rotation_x(TAU * rng.f32());
        let depth = 0.2 * R * rng.f32();
        let place = (radius - depth) * Vec3::Y;
        let found = compare_clouds(&floor, &body.cloud(R), Pose3::from_parts(place, turn), R);
        assert_eq!(found.patches.len(), 2, "seed {seed}");
        for center in [apart, -apart].map(|x| turn * (x * Vec3::X)) {
            let is_below = |patch: &ContactPatch| {
                patch.points.len() == 1
                    && patch.is_round()
                    && patch.points[0].middle().with_y(0.0).distance(center) < 0.1 * R
                    && (patch.points[0].gap + depth).abs() < 0.1 * R
            };
            assert!(found.patches.iter().any(is_below), "seed {seed}");
        }
    }
}

/// A cylinder about the z axis.
fn sampled_cylinder(radius: f32, half: f32, spacing: f32) -> Samples {
    let (mut points, mut normals) = (Vec::new(), Vec::new());
    let around = |radius: f32| (TAU * radius / spacing).ceil().max(1.0) as usize;
    let rows = (2.0 * half / spacing).ceil() as usize;
    for row in 0..=rows {
        for k in 0..around(radius) {
            let turn = (k as f32 + 0.5 * (row % 2) as f32) / around(radius) as f32;
            let (sin, cos) = (TAU * turn).sin_cos();
            let z = half * (2.0 * row as f32 / rows as f32 - 1.0);
            points.push(Vec3::new(radius * cos, radius * sin, z));
            normals.push(Vec3::new(cos, sin, 0.0));
        }
    }
    for ring in (0..)
        .map(|k| k as f32 * spacing)
        .take_while(|r| *r < radius)
    {
        for k in 0..around(ring) {
            let (sin, cos) = (TAU * k as f32 / around(ring) as f32).sin_cos();
            for side in [1.0, -1.0] {
                points.push(Vec3::new(ring * cos, ring * sin, side * half));
                normals.push(side * Vec3::Z);
            }
        }
    }
    Samples { points, normals }
}
