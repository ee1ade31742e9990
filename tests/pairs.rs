//! Whole pairs of clouds against analytic truth: gap, collision, contact normals and support points.

use tldi::glamx::{Pose3, Vec3};
use tldi::{
    CameraPolicy, ContactPoint, PairQuery, PairResult, Params, PointCloud, Surface, View, Work,
    plan,
};
use tldi_tests::{
    Samples, aimed_clouds, compare, compare_batch, compare_clouds, deepest_point, random_pose,
    random_unit, sampled_box, sampled_plane, sampled_sphere,
};

/// Spacing of all samples here, and with radius = spacing a mean radius, in metres.
const R: f32 = 0.01;

fn clouds(a: &PointCloud<'_>, b: &PointCloud<'_>, a_from_b: Pose3) -> PairResult {
    compare_clouds(a, b, a_from_b, R)
}

fn deepest_normal(result: &PairResult) -> Vec3 {
    result.patches[0].normal
}

fn least_patch_gap(result: &PairResult) -> f32 {
    deepest_point(result).expect("there is a patch").0
}

/// A ball that is nearly out of reach touches below its middle, although few of its pixels are within the prediction.
/// What is beyond is no contact, but the gap is told.
#[test]
fn a_ball_at_the_prediction_touches_in_its_lowest_point() {
    let mut rng = fastrand::Rng::with_seed(3);
    let radius = 0.05;
    let sphere = sampled_sphere(radius, R);
    let plane = sampled_plane(0.3, R, &mut rng);
    for cloud in [Samples::cloud, Samples::bare_cloud] {
        let (plane, ball) = (cloud(&plane, R), cloud(&sphere, R));
        for case in 0..40 {
            let within = 0.2 + 0.7 * case as f32 / 40.0;
            for (gap, is_contact) in [(within * R, true), ((within + 1.0) * R, false)] {
                let mut pose = random_pose(&mut rng, 0.0);
                let aside = 0.1 * Vec3::new(rng.f32() - 0.5, 0.0, rng.f32() - 0.5);
                pose.translation = aside + Vec3::Y * (radius + gap);
                let result = compare(
                    Surface::Cloud(&plane),
                    Surface::Cloud(&ball),
                    pose,
                    Params::for_radius(R).with_prediction(R),
                );
                let what = format!("case {case}, gap {} r: {result:?}", gap / R);
                let found = result.gap.expect(&what);
                assert!((found - gap).abs() < 0.2 * R, "{what}");
                assert!(result.contacts.iter().all(|c| c.gap <= R), "{what}");
                if !is_contact {
                    assert!(result.patches.is_empty(), "{what}");
                    continue;
                }
                let [patch] = &result.patches[..] else {
                    panic!("{what}");
                };
                let [point] = &patch.points[..] else {
                    panic!("{what}");
                };
                // As in `spheres`, to a pixel.
                assert!(point.middle().with_y(0.0).distance(aside) < R, "{what}");
            }
        }
    }
}

/// Two spheres of 0.1 and 0.07 m, from 1.5 r̄ apart to 3 r̄ deep, from random directions, with and
/// without given normals.
#[test]
fn spheres() {
    let (ra, rb) = (0.1, 0.07);
    let (big, small) = (sampled_sphere(ra, R), sampled_sphere(rb, R));
    let mut rng = fastrand::Rng::with_seed(1);
    let mut wrong = 0;
    let mut sum_aside = 0.0;
    for cloud in [Samples::cloud, Samples::bare_cloud] {
        let (a, b) = (cloud(&big, R), cloud(&small, R));
        for _ in 0..300 {
            let gap = (1.5 - 4.5 * rng.f32()) * R;
            let direction = random_unit(&mut rng);
            let mut pose = random_pose(&mut rng, 0.0);
            pose.translation = direction * (ra + rb + gap);
            let result = clouds(&a, &b, pose);
            // Splats of 1 r̄ blur a contact of this curvature (1/0.1 + 1/0.07 per metre) by
            // 0.1 r̄; the rest is the sampling.
            let (found, place) = deepest_point(&result).expect("there is a patch");
            let error = (found - gap).abs();
            assert!(
                error < 0.2 * R,
                "gap {gap}, direction {direction}: off by {error}"
            );
            sum_aside += place.distance(direction * (ra + 0.5 * gap));
            check_points(&result, |p| {
                [p.length() - ra, p.distance(pose.translation) - rb]
            });
            let angle = deepest_normal(&result)
                .angle_between(direction)
                .to_degrees();
            assert!(
                angle < 3.0,
                "gap {gap}, direction {direction}: normal off by {angle}°"
            );
            if gap.abs() > 0.3 * R {
                wrong += usize::from(result.collides != (gap < 0.0));
            }
            if gap.abs() > 0.5 * R {
                assert_eq!(
                    result.collides,
                    gap < 0.0,
                    "gap {gap}, direction {direction}"
                );
            }
        }
    }
    // The gap is flat around its middle (1 r̄ aside it is 0.1 r̄ wider): its least is found to a
    // pixel.
    let mean_aside = sum_aside / 600.0;
    assert!(mean_aside < R, "{mean_aside} m aside on average");
    // Closer than half a radius the pixel grid may decide otherwise, once in a hundred.
    assert!(wrong <= 6, "{wrong} of 600 wrong between 0.3 and 0.5 r̄");
}

/// Every contact's points lie on the two surfaces, on one ray of the view or along the normal.
/// `distances` gives those of a point to the surfaces, signed, metres.
fn check_points(result: &PairResult, distances: impl Fn(Vec3) -> [f32; 2]) {
    for contact in &result.contacts {
        let apart = contact.point_b - contact.point_a;
        let aside = apart.reject_from(result.axes[contact.view as usize]);
        assert!(aside.length() < 1e-5, "{contact:?}");
        let off = [distances(contact.point_a)[0], distances(contact.point_b)[1]];
        // Splats end on the surface but for their slope.
        assert!(off[0].abs().max(off[1].abs()) < 0.1 * R, "{contact:?}");
    }
    for patch in &result.patches {
        for point in &patch.points {
            let along = point.point_a + point.gap * patch.normal;
            assert!(along.distance(point.point_b) < 1e-6, "{point:?}");
            let off = [distances(point.point_a)[0], distances(point.point_b)[1]];
            // As above, and smoothing over 3 × 3 pixels.
            assert!(off[0].abs().max(off[1].abs()) < 0.25 * R, "{point:?}");
        }
    }
}

/// A box flat on a plane: exact gap and normal, support points at the corners, whatever the yaw;
/// without normals down to what a sheet allows, and as deep as the box reaches with them.
#[test]
fn box_on_plane() {
    let mut rng = fastrand::Rng::with_seed(2);
    let half = Vec3::new(0.1, 0.06, 0.15);
    let plane = sampled_plane(0.8, R, &mut rng);
    let boxed = sampled_box(half, R, &mut rng);
    for (cloud, gaps, least_cosine) in [
        // Exact normals: what is left is the fixed-point step.
        (
            Samples::cloud as fn(&Samples, f32) -> _,
            [0.01, 0.002, -0.002, -0.03],
            0.999_99,
        ),
        // Estimated normals bend at the box's edges: 1° on the whole face.
        (Samples::bare_cloud, [0.01, 0.002, -0.002, -0.01], 0.999_8),
    ] {
        let (plane, boxed): (PointCloud, PointCloud) = (cloud(&plane, R), cloud(&boxed, R));
        for gap in gaps {
            for yaw in [0.0f32, 0.3, 0.8] {
                let pose = Pose3::new(Vec3::new(0.013, half.y + gap, -0.021), Vec3::Y * yaw);
                let result = clouds(&plane, &boxed, pose);
                let flat = result
                    .patches
                    .iter()
                    .find(|p| p.points.len() == 4)
                    .expect("a face rests on four points");
                assert!(
                    flat.normal.y > least_cosine,
                    "gap {gap}, yaw {yaw}: {flat:?}"
                );
                for corner in [[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]] {
                    let corner = pose * (half * Vec3::new(corner[0], -1.0, corner[1]));
                    let middle = |p: &ContactPoint| 0.5 * (p.point_a + p.point_b);
                    let nearest = flat
                        .points
                        .iter()
                        .min_by(|p, q| {
                            middle(p)
                                .distance(corner)
                                .total_cmp(&middle(q).distance(corner))
                        })
                        .expect("there are four");
                    // The diagonal of one and a half pixels, and half the gap. Without true
                    // normals the splats at the edges mix in the side walls, for 3 pixels, and the
                    // fit of the gaps reaches 2 pixels farther.
                    let (reach, tolerance) = match boxed.normals() {
                        Some(_) => (2.2 * R, 0.02 * R),
                        None => (6.2 * R, 0.05 * R),
                    };
                    let limit = reach + 0.5 * gap.abs();
                    assert!(
                        middle(nearest).distance(corner) < limit,
                        "{nearest:?} {corner}"
                    );
                    assert!(
                        (nearest.gap - gap).abs() < tolerance,
                        "gap {gap}: {nearest:?}"
                    );
                }
            }
        }
    }
}

/// A box that is smaller than the distance of the floor's points is modelled at its own scale, and the floor's layers merge
/// at theirs: points that are a quarter of their distance higher and lower than their mean are one surface between. (Were
/// it two, all gaps would be those of the upper one.)
#[test]
fn a_box_smaller_than_the_spacing_of_a_rough_floor() {
    let mut rng = fastrand::Rng::with_seed(14);
    let half = Vec3::splat(8.0 * R);
    let spacing = 20.0 * R;
    let boxed = sampled_box(half, R, &mut rng).bare_cloud(R);
    let rough: Vec<Vec3> = (0..24 * 24)
        .map(|k| (k / 24 - 12, k % 24 - 12))
        .map(|(i, j)| {
            let height = if (i + j) % 2 == 0 { 0.25 } else { -0.25 };
            spacing * Vec3::new(i as f32, height, j as f32)
        })
        .collect();
    let floor = PointCloud::builder(rough).radius(spacing).build();
    let floor = floor.expect("valid points");
    let params = Params::for_radius(plan::largest_pixel(boxed.bounds().extents(), R));
    for _ in 0..20 {
        let place = spacing * Vec3::new(rng.f32(), 0.0, rng.f32()) + half.y * Vec3::Y;
        let pose = Pose3::new(place, Vec3::Y * rng.f32());
        let (a, b) = (Surface::Cloud(&floor), Surface::Cloud(&boxed));
        let gap = least_patch_gap(&compare(a, b, pose, params));
        assert!(gap.abs() < 0.2 * spacing, "{place}: {}", gap / spacing);
    }
}

/// The bounds of a floor hold its surface only: a tall box is seen to its bottom far below them.
#[test]
fn a_box_deep_in_a_floor() {
    let mut rng = fastrand::Rng::with_seed(9);
    let half = Vec3::new(0.1, 0.4, 0.1);
    let plane = sampled_plane(0.8, R, &mut rng).cloud(R);
    let boxed = sampled_box(half, R, &mut rng).cloud(R);
    let depth = 25.0 * R;
    let on_top = Pose3::new(Vec3::Y * (half.y - depth), Vec3::Y * 0.3);
    for (a, b, pose) in [(&plane, &boxed, on_top), (&boxed, &plane, on_top.inverse())] {
        let gap = least_patch_gap(&clouds(a, b, pose));
        // Faces with exact normals: what is left is the fixed-point step.
        assert!((gap + depth).abs() < 0.02 * R, "{gap}");
    }
}

/// A bump under a face is no error of its rim: the face is supported there.
#[test]
fn a_face_on_a_bump() {
    let mut rng = fastrand::Rng::with_seed(8);
    for height in [0.7 * R, 0.9 * R] {
        let mut floor = sampled_plane(0.4, R, &mut rng);
        let top = Vec3::new(0.02, 0.0, -0.01);
        for (point, normal) in floor.points.iter_mut().zip(&mut floor.normals) {
            let off = *point - top;
            // A sphere's cap, 2.5 r̄ wide on each side.
            let radius = (6.25 * R * R + height * height) / (2.0 * height);
            let rise = (radius * radius - off.length_squared()).max(0.0).sqrt() - radius + height;
            if off.length() < 2.5 * R && rise > 0.0 {
                *point += rise * Vec3::Y;
                *normal = (off + (radius - height + rise) * Vec3::Y).normalize();
            }
        }
        let body = sampled_box(Vec3::splat(0.06), R, &mut rng);
        for [floor, body] in [
            [floor.cloud(R), body.cloud(R)],
            [floor.bare_cloud(R), body.bare_cloud(R)],
        ] {
            let result = clouds(&floor, &body, Pose3::translation(0.0, 0.06, 0.0));
            let (gap, middle) = deepest_point(&result).expect("touches");
            // Pixels and fits blunt it, as they blunt edges.
            assert!(
                (-height - 0.1 * R..-0.4 * height).contains(&gap),
                "{height}: {gap}"
            );
            assert!(middle.with_y(0.0).distance(top) < 1.5 * R, "{middle}");
        }
    }
}

/// A box in a corner touches floor and wall, each with its own normal: a cube, which one view
/// between both sees, and a slab, whose narrow side takes a view of its own.
#[test]
fn corner() {
    for seed in 0..40 {
        in_a_corner(fastrand::Rng::with_seed(seed));
    }
}

fn in_a_corner(mut rng: fastrand::Rng) {
    let mut room = sampled_plane(0.8, R, &mut rng);
    for (p, n) in room.points.iter_mut().zip(&mut room.normals) {
        if p.x < 0.0 {
            // Fold one half up into a wall at x = 0.
            *p = Vec3::new(0.0, -p.x, p.z);
            *n = Vec3::X;
        }
    }
    for half in [Vec3::splat(0.1), Vec3::new(0.1, 0.04, 0.1)] {
        let boxed = sampled_box(half, R, &mut rng).cloud(R);
        let pose = Pose3::from_translation(half - Vec3::new(0.003, 0.005, 0.1));
        let result = clouds(&room.cloud(R), &boxed, pose);
        assert!(result.axes.len() <= 2, "{half}: {:?}", result.axes);
        for (axis, gap) in [(Vec3::X, -0.003), (Vec3::Y, -0.005)] {
            let patch = result
                .patches
                .iter()
                // Pixels in the corner itself mix floor and wall: up to 4° on these few.
                .find(|p| p.normal.dot(axis) > 0.9976)
                .unwrap_or_else(|| panic!("no patch along {axis}: {:?}", result.patches));
            for point in &patch.points {
                assert!(
                    (point.gap - gap).abs() < 0.3 * R,
                    "{half} {axis}: {point:?}"
                );
            }
        }
    }
}

/// A body that is wholly behind a sheet has nothing to do with it; one that straddles it is pushed
/// back to the side where its middle is.
#[test]
fn a_sheet_is_no_volume() {
    let mut rng = fastrand::Rng::with_seed(4);
    let sheet = sampled_plane(0.6, R, &mut rng).bare_cloud(R);
    let ball = sampled_sphere(0.06, R);
    for body in [ball.cloud(R), ball.bare_cloud(R)] {
        let behind = clouds(&sheet, &body, Pose3::translation(0.0, -0.06 - 3.0 * R, 0.0));
        assert!(
            !behind.collides && behind.patches.is_empty(),
            "{:?}",
            behind.patches
        );
        // The second is deeper than layers merge: what is behind the sheet counts up to the middle.
        for (side, height) in [(1.0, 0.03), (-1.0, 0.03), (1.0, 0.01), (-1.0, 0.01)] {
            let deep = clouds(&sheet, &body, Pose3::translation(0.0, side * height, 0.0));
            assert!(deep.collides);
            assert!(deepest_normal(&deep).y * side > 0.99, "{:?}", deep.patches);
            assert!(
                (least_patch_gap(&deep) + 0.06 - height).abs() < 0.45 * R,
                "{:?}",
                deep.patches
            );
        }
    }
}

/// Under a dome there is no volume either, though its bounds have their middle there.
#[test]
fn a_dome_is_hollow() {
    let mut dome = sampled_sphere(0.2, R);
    dome.points.retain(|p| p.y > 0.05);
    let dome = dome.bare_cloud(R);
    let ball = sampled_sphere(0.04, R).bare_cloud(R);
    let under = clouds(&dome, &ball, Pose3::translation(0.0, 0.16 - 5.0 * R, 0.0));
    assert!(!under.collides && under.patches.is_empty(), "{under:?}");
}

/// Of a body that was scanned from below only, deeper in a sheet than layers merge, the middle of
/// the bounds tells that it reaches through the sheet.
#[test]
fn an_open_body_reaches_to_its_middle() {
    let mut rng = fastrand::Rng::with_seed(8);
    let sheet = sampled_plane(0.6, R, &mut rng).bare_cloud(R);
    let mut bowl = sampled_sphere(0.06, R);
    bowl.points.retain(|p| p.y < 0.0);
    // More of it is below the sheet than above: that it fell is what tells.
    let bowl = bowl.bare_cloud(R);
    let falling = PairQuery {
        view: View::Aim {
            policy: CameraPolicy::default(),
            motion: -0.05 * Vec3::Y,
            last_axis: None,
        },
        ..aimed_clouds(&sheet, &bowl, Pose3::translation(0.0, 0.015, 0.0), R)
    };
    let deep = &compare_batch(&[falling])[0];
    assert!(deepest_normal(deep).y > 0.99, "{:?}", deep.patches);
    let gap = least_patch_gap(deep);
    assert!((gap + 0.045).abs() < 0.45 * R, "{gap}");
}

/// Two faces that have sunk into each other as a whole cross nowhere; their normals tell that the
/// solids behind them overlap.
#[test]
fn faces_beyond_each_other_collide() {
    let mut rng = fastrand::Rng::with_seed(6);
    let floor = sampled_plane(0.4, R, &mut rng);
    let upturned = floor.moved(&Pose3::rotation(Vec3::X * std::f32::consts::PI));
    let pose = Pose3::translation(0.0, -3.0 * R, 0.0);
    let result = clouds(&floor.cloud(R), &upturned.cloud(R), pose);
    assert!(result.collides);
    assert!((least_patch_gap(&result) + 3.0 * R).abs() < 0.02 * R);
    let above = clouds(&floor.cloud(R), &upturned.cloud(R), pose.inverse());
    assert!(!above.collides, "{above:?}");
}

/// A sheet upright in another one pierces it, though each is edge-on where the other is flat.
#[test]
fn sheets_that_cross_at_right_angles_collide() {
    let mut rng = fastrand::Rng::with_seed(7);
    // Off the borders of the pixels, at which a sheet that is seen edge-on may part.
    let sheet = sampled_plane(0.4, R, &mut rng).moved(&Pose3::translation(0.0, 0.003, 0.0));
    let sheet = sheet.bare_cloud(R);
    let quarter = Vec3::X * std::f32::consts::FRAC_PI_2;
    for (height, crosses) in [(0.0, true), (0.1, true), (0.2 + 1.5 * R, false)] {
        let pose = Pose3::new(Vec3::Y * height, quarter);
        let result = clouds(&sheet, &sheet, pose);
        assert_eq!(result.collides, crosses, "{height}");
    }
}

/// What is found of a pair of which points were culled, and no more.
fn culled_only(result: &PairResult) -> PairResult {
    PairResult {
        work: Work {
            culled: result.work.culled,
            ..Work::default()
        },
        ..PairResult::default()
    }
}

/// Pairs out of reach are rejected before any image is built, and say so.
#[test]
fn far_pairs_are_rejected_early() {
    let cloud = sampled_sphere(0.1, R).cloud(R);
    for distance in [0.2 + 6.0 * R, 5.0] {
        let result = clouds(&cloud, &cloud, Pose3::translation(distance, 0.0, 0.0));
        assert_eq!(result, PairResult::default());
    }
    // The bounds overlap, the surfaces are far apart: balls diagonally beside each other, farther
    // than two diagonals of the zone's cells (4 R each).
    let diagonal = Vec3::splat((0.2 + 16.0 * R) / 3.0f32.sqrt());
    let result = clouds(&cloud, &cloud, Pose3::from_translation(diagonal));
    assert_eq!(result, culled_only(&result));
    // Two dumbbells across each other: every ball is in both bounds, and far from the other two.
    let pair_of_balls = |x: f32| {
        let mut balls = Samples::default();
        for sign in [1.0, -1.0] {
            let at = Pose3::translation(sign * x, sign * 0.2, 0.0);
            let ball = sampled_sphere(0.05, R).moved(&at);
            balls.extend(&ball);
        }
        balls.cloud(R)
    };
    let result = clouds(&pair_of_balls(0.2), &pair_of_balls(-0.2), Pose3::IDENTITY);
    assert_eq!(result, culled_only(&result));
}
