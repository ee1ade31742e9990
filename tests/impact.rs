//! Straight motions against analytic truth: where they end, and what does not stop them.

use rapier3d::prelude::{Ball, Cuboid, HalfSpace, SharedShape, Vector};
use rapier3d_tldi::ExactShape;
use tldi::glamx::{Pose3, Quat, Vec3};
use tldi::{CpuBackend, Impact, ImpactQuery, Params, Penetration, PointCloud, Room, Surface};
use tldi_tests::{
    Samples, cloud_of, random_pose, random_unit, sampled_box, sampled_plane, sampled_sphere,
};

/// Spacing of all samples here, and with radius = spacing a mean radius, in metres.
const R: f32 = 0.01;

fn query<'a>(a: Surface<'a>, b: Surface<'a>, a_from_b: Pose3, motion: Vec3) -> ImpactQuery<'a> {
    ImpactQuery {
        a,
        b,
        a_from_b,
        motion,
        touching: 0.0,
        core_only: false,
        penetration: None,
        turned: &[],
        params: Params::for_radius(R),
    }
}

fn clouds<'a>(
    a: &'a PointCloud<'a>,
    b: &'a PointCloud<'a>,
    a_from_b: Pose3,
    motion: Vec3,
) -> ImpactQuery<'a> {
    query(Surface::Cloud(a), Surface::Cloud(b), a_from_b, motion)
}

fn impact(query: &ImpactQuery) -> Option<Impact> {
    CpuBackend::new().impact(query).expect("it is supported")
}

/// How far a ball moves along `direction` until its middle, now at `from`, is `distance` metres
/// from the origin.
fn way_to_ball(from: Vec3, direction: Vec3, distance: f32) -> Option<f32> {
    let along = -from.dot(direction);
    let squared = distance * distance - (from + along * direction).length_squared();
    (squared >= 0.0).then(|| along - squared.sqrt())
}

/// Balls, one of them a cloud or exact, hit off centre and missed, from all directions.
#[test]
fn balls() {
    let (ra, rb) = (0.1, 0.07);
    let (big, small) = (sampled_sphere(ra, R), sampled_sphere(rb, R));
    let mut rng = fastrand::Rng::with_seed(1);
    let (exact_a, exact_b) = (Ball::new(ra), Ball::new(rb));
    let (exact_a, exact_b) = (ExactShape(&exact_a), ExactShape(&exact_b));
    for cloud in [Samples::cloud, Samples::bare_cloud] {
        let (a, b) = (cloud(&big, R), cloud(&small, R));
        let pairs = [
            (Surface::Cloud(&a), Surface::Cloud(&b)),
            (Surface::Exact(&exact_a), Surface::Cloud(&b)),
            (Surface::Cloud(&a), Surface::Exact(&exact_b)),
        ];
        for (a, b) in pairs {
            for _ in 0..100 {
                let direction = random_unit(&mut rng);
                let aside = rng.f32() * 1.3 * (ra + rb);
                let offset = aside * random_unit(&mut rng).reject_from(direction).normalize();
                let mut pose = random_pose(&mut rng, 0.0);
                pose.translation = offset - (0.3 + 5.0 * rng.f32()) * direction;
                let found = impact(&query(a, b, pose, 8.0 * direction));
                let truth = way_to_ball(pose.translation, direction, ra + rb);
                match (found, truth) {
                    (Some(found), Some(truth)) => {
                        let normal = (pose.translation + truth * direction).normalize();
                        // A ray stands for a pixel: aside by half its diagonal, the surface is
                        // met so much later or earlier, times the slope of both.
                        let cosine = -normal.dot(direction);
                        let slope = (1.0 - cosine * cosine).sqrt() / cosine;
                        let error = found.distance - truth;
                        let limit = (0.2 + 0.8 * slope) * R;
                        assert!(error.abs() < limit, "{error} at {aside} aside");
                        let angle = found.normal.angle_between(normal).to_degrees();
                        assert!(angle < 10.0 || cosine < 0.5, "{angle}° at {aside} aside");
                        let off = found.point.length() - ra;
                        assert!(
                            off.abs() < 0.25 * R || cosine < 0.5,
                            "{off} off the surface"
                        );
                    }
                    // Splats reach half a pixel's diagonal beyond a silhouette.
                    (Some(_), None) => assert!(aside < ra + rb + 2.0 * R, "hit at {aside} aside"),
                    (None, Some(_)) => assert!(aside > ra + rb - R, "missed at {aside} aside"),
                    (None, None) => {}
                }
            }
        }
    }
}

/// Pieces of a motion share a room: with pixels of a 500th of a radius each gets less of it than the one before, and tells
/// so. The distances stay within a pixel of the truth.
#[test]
fn pieces_share_a_room() {
    let (ra, rb) = (0.1, 0.07);
    let (a, b) = (sampled_sphere(ra, R), sampled_sphere(rb, R));
    let (a, b) = (a.cloud(R), b.cloud(R));
    let exact = Ball::new(ra);
    let exact = ExactShape(&exact);
    let above = Pose3::from_translation(0.5 * Vec3::Y);
    for a in [Surface::Cloud(&a), Surface::Exact(&exact)] {
        let usual = query(a, Surface::Cloud(&b), above, -Vec3::Y);
        let tiny = ImpactQuery {
            params: Params::for_radius(R).with_pixel_size(R / 500.0),
            ..usual
        };
        let (backend, mut room) = (CpuBackend::new(), Room::default());
        let coarser: Vec<f32> = (0..4)
            .map(|_| {
                let found = backend.impact_within(&tiny, &mut room);
                let found = found.expect("it is supported").expect("the balls meet");
                let error = found.distance - (0.5 - ra - rb);
                assert!(error.abs() < R, "{error}");
                found.coarser.expect("there is no room for such pixels")
            })
            .collect();
        assert!(
            coarser.is_sorted() && coarser[3] > 1.2 * coarser[0],
            "{coarser:?}"
        );
        assert_eq!(room.coarser(), Some(coarser[3]));
        // A motion of its own has a room of its own, with enough of the usual pixels.
        assert_eq!(impact(&usual).expect("the balls meet").coarser, None);
    }
}

/// A sheet of one layer of points, with and without normals, stops a small box from either side,
/// at any angle and any length of the motion.
#[test]
fn sheets_stop_what_comes_from_either_side() {
    let mut rng = fastrand::Rng::with_seed(2);
    let sheet = sampled_plane(1.0, R, &mut rng);
    let boxed = sampled_box(Vec3::splat(0.02), R, &mut rng);
    let corner = 0.02 * 3.0f32.sqrt();
    for cloud in [Samples::cloud, Samples::bare_cloud] {
        let (a, b) = (cloud(&sheet, R), cloud(&boxed, R));
        for _ in 0..400 {
            let side = if rng.bool() { 1.0 } else { -1.0 };
            let yaw = Quat::from_rotation_y(rng.f32() * std::f32::consts::TAU);
            // Down to 2° from grazing.
            let incidence = rng.f32() * 88.0f32.to_radians();
            let direction = yaw * Vec3::new(incidence.sin(), -side * incidence.cos(), 0.0);
            let target = 0.2 * random_unit(&mut rng).with_y(0.0);
            let before = 0.1 + 5.0 * rng.f32();
            let mut pose = random_pose(&mut rng, 0.0);
            pose.translation = target - before * direction;
            let motion = (before + 0.4 + 50.0 * rng.f32()) * direction;
            for core_only in [false, true] {
                let found = impact(&ImpactQuery {
                    core_only,
                    ..clouds(&a, &b, pose, motion)
                });
                let height = pose.translation.y.abs();
                let found = found.unwrap_or_else(|| {
                    panic!("passes at {incidence} from {height} m, core {core_only}")
                });
                // Where the motion is over the sheet at all when the box meets it.
                let left = side * (pose.translation + found.distance * direction).y;
                let over_sheet = (pose.translation + found.distance * direction).abs();
                if over_sheet.max_element() < 0.45 {
                    // The middle of the box stays on its side.
                    assert!(left > 0.0, "stops {left} m behind the sheet");
                    assert!(left < corner + 2.0 * R, "stops {left} m before the sheet");
                }
            }
        }
    }
}

/// A box sliding on a rough floor passes where only its core counts, and stops at a wall.
#[test]
fn only_the_core_passes_over_roughness() {
    let mut rng = fastrand::Rng::with_seed(3);
    let mut floor = sampled_plane(2.0, R, &mut rng);
    for point in &mut floor.points {
        point.y += 0.5 * R * (rng.f32() - 0.5);
    }
    let boxed = sampled_box(Vec3::splat(0.1), R, &mut rng).cloud(R);
    let wall = sampled_plane(0.5, R, &mut rng).moved(&Pose3::from_parts(
        0.6 * Vec3::X,
        Quat::from_rotation_z(std::f32::consts::FRAC_PI_2),
    ));
    let pose = Pose3::translation(0.0, 0.1, 0.0);
    // As gravity bends the first step of a fall at 10 m/s.
    let motion = Vec3::new(0.9, -0.003, 0.0);
    let cast = |floor: &PointCloud, core_only| {
        impact(&ImpactQuery {
            core_only,
            ..clouds(floor, &boxed, pose, motion)
        })
    };
    let bare = floor.cloud(R);
    assert_eq!(cast(&bare, true), None);
    assert!(cast(&bare, false).is_some(), "the floor is not rough");
    floor.extend(&wall);
    let met = cast(&floor.cloud(R), true).expect("the wall is met");
    assert!((met.distance - 0.5).abs() < 0.2 * R, "{met:?}");
    assert!(met.normal.x < -0.99, "{met:?}");
}

/// What touches at the beginning is passed by what only slides along it or goes, and met by what
/// goes on towards it.
#[test]
fn what_touches_is_met_only_head_on() {
    let mut rng = fastrand::Rng::with_seed(4);
    let floor = sampled_plane(0.6, R, &mut rng).bare_cloud(R);
    let wall = sampled_plane(0.6, R, &mut rng).moved(&Pose3::from_parts(
        0.2 * Vec3::X,
        Quat::from_rotation_z(std::f32::consts::FRAC_PI_2),
    ));
    let mut room = sampled_plane(0.6, R, &mut rng);
    room.extend(&wall);
    let room = room.bare_cloud(R);
    let ball = sampled_sphere(0.05, R).cloud(R);
    let start = Pose3::translation(0.0, 0.051, 0.0);
    let cast = |cloud, motion, touching| {
        impact(&ImpactQuery {
            touching,
            core_only: true,
            ..clouds(cloud, &ball, start, motion)
        })
        .map(|impact| impact.distance)
    };
    let (down, along) = (-Vec3::Y, Vec3::new(1.0, -0.005, 0.0));
    let met = cast(&floor, down, 0.2 * R).expect("it goes on downwards");
    assert!(met < 0.2 * R, "{met}");
    assert_eq!(cast(&floor, 0.002 * down, 0.2 * R), None);
    assert_eq!(cast(&floor, along, 0.2 * R), None);
    assert_eq!(cast(&floor, -down, 0.2 * R), None);
    let met = cast(&room, along, 0.2 * R).expect("the wall");
    assert!((met - 0.15).abs() < 0.2 * R, "{met}");
}

/// What is inside a solid may leave it, and meets what else there is.
#[test]
fn what_is_inside_leaves() {
    let mut rng = fastrand::Rng::with_seed(5);
    let solid = sampled_box(Vec3::splat(0.2), R, &mut rng);
    let ball = sampled_sphere(0.05, R).cloud(R);
    let pose = Pose3::translation(0.0, 0.18, 0.0);
    let up = 2.0 * Vec3::Y;
    let alone = solid.cloud(R);
    let found = impact(&clouds(&alone, &ball, pose, up));
    assert_eq!(found, None);
    let mut with_lid = solid.clone();
    let lid = sampled_plane(0.6, R, &mut rng).moved(&Pose3::translation(0.0, 1.0, 0.0));
    with_lid.extend(&lid);
    let with_lid = with_lid.cloud(R);
    let found = impact(&clouds(&with_lid, &ball, pose, up));
    let met = found.expect("the lid is met from behind").distance;
    assert!((met - 0.77).abs() < 0.2 * R, "{met}");
}

/// Unbounded and closed exact shapes, in both orders.
#[test]
fn exact_shapes() {
    let mut rng = fastrand::Rng::with_seed(6);
    let boxed = sampled_box(Vec3::splat(0.1), R, &mut rng).bare_cloud(R);
    let ground = SharedShape::new(HalfSpace::new(Vector::Y));
    let cuboid = Cuboid::new(Vec3::splat(0.1));
    let plane = sampled_plane(1.0, R, &mut rng).bare_cloud(R);
    let (ground, cuboid) = (ExactShape(&*ground), ExactShape(&cuboid));
    let motion = Vec3::new(0.3, -3.0, 0.1);
    let pose = Pose3::translation(-0.1, 1.3, 0.0);
    // The plane moves as the box would stand still: both in the frame of what is at rest.
    let pairs = [
        (
            Surface::Exact(&ground),
            Surface::Cloud(&boxed),
            pose,
            motion,
        ),
        (
            Surface::Cloud(&plane),
            Surface::Exact(&cuboid),
            pose,
            motion,
        ),
        (
            Surface::Exact(&cuboid),
            Surface::Cloud(&plane),
            pose.inverse(),
            -motion,
        ),
    ];
    for (a, b, pose, motion) in pairs {
        for core_only in [false, true] {
            let found = impact(&ImpactQuery {
                core_only,
                ..query(a, b, pose, motion)
            });
            let truth = 1.2 * motion.length() / 3.0;
            let error = found.expect("they meet").distance - truth;
            assert!(error.abs() < 0.2 * R, "{error}");
        }
    }
}

/// What moves on passes a flying pixel, but not a wire, and meets the sheet behind it.
#[test]
fn lone_points_are_passed() {
    let mut rng = fastrand::Rng::with_seed(4);
    let ball = sampled_sphere(0.05, R).cloud(R);
    let lone = Vec3::new(0.0, 0.2, 0.0);
    let wire = (-10..=10).map(|k| lone + k as f32 * R * Vec3::X);
    for (beside, height) in [(vec![lone], 0.0), (wire.collect(), 0.2)] {
        let mut points = sampled_plane(0.4, R, &mut rng).points;
        points.extend(beside);
        let cloud = cloud_of(points, R);
        let start = Pose3::translation(0.0, 0.4, 0.0);
        let found = impact(&clouds(&cloud, &ball, start, -0.5 * Vec3::Y));
        let found = found.expect("the sheet is in the way");
        let off = found.distance - (0.35 - height);
        assert!(off.abs() < R, "{height}: off by {off}");
    }
}

/// Flying pixels before all of the pixels that count of a small ball hide nothing.
#[test]
fn what_lone_points_hide_is_met() {
    let mut rng = fastrand::Rng::with_seed(6);
    let ball = sampled_sphere(3.0 * R, R).cloud(R);
    let mut points = sampled_plane(0.4, R, &mut rng).points;
    let corners = [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]];
    let above =
        |(k, [x, z]): (usize, [f32; 2])| R * Vec3::new(0.8 * x, 6.0 + 6.0 * k as f32, 0.8 * z);
    points.extend(corners.into_iter().enumerate().map(above));
    let cloud = cloud_of(points, R);
    for core_only in [false, true] {
        let found = impact(&ImpactQuery {
            core_only,
            ..clouds(&cloud, &ball, Pose3::translation(0.0, 0.5, 0.0), -Vec3::Y)
        });
        let found = found.expect("the sheet is behind the lone points");
        let off = found.distance - (0.5 - 3.0 * R);
        assert!(off.abs() < R, "off by {off}");
    }
}

/// A small ball that comes in obliquely at speed, its rim first, is not let in as deep as its rim is
/// wide; what is beside its way is passed all the same.
#[test]
fn the_rim_of_what_is_fast_is_met() {
    let mut rng = fastrand::Rng::with_seed(5);
    let radius = 5.0 * R;
    let ball = sampled_sphere(radius, R).cloud(R);
    let floor = sampled_plane(2.0, R, &mut rng).bare_cloud(R);
    let (sin, cos) = 70f32.to_radians().sin_cos();
    let start = Pose3::translation(-0.5 * sin / cos, 0.5, 0.0);
    let cast = |motion: Vec3| {
        impact(&ImpactQuery {
            core_only: true,
            ..clouds(&floor, &ball, start, motion)
        })
    };
    let met = cast(2.0 * Vec3::new(sin, -cos, 0.0)).expect("the floor is met");
    let depth = radius - (start.translation.y - met.distance * cos);
    // All of a rim of three pixels would let it in by 1.9.
    assert!(depth < 1.3 * R, "{depth}");
    // Half a point radius beside the edge of the floor.
    let beside = Pose3::translation(1.0 + radius + 0.5 * R, 0.5, 0.0);
    let passed = impact(&ImpactQuery {
        core_only: true,
        ..clouds(&floor, &ball, beside, -Vec3::Y)
    });
    assert_eq!(passed, None);
}

/// What is in a sheet passes it on the way to the side where it belongs, if it is no farther from it than it
/// is in it, and meets what is behind.
#[test]
fn what_is_in_a_sheet_leaves_it() {
    let mut rng = fastrand::Rng::with_seed(7);
    let radius = 5.0 * R;
    let ball = sampled_sphere(radius, R);
    let sheet = sampled_plane(1.0, R, &mut rng);
    let above = sheet.points.iter().map(|p| p + 0.4 * Vec3::Y);
    let both: Vec<Vec3> = sheet.points.iter().copied().chain(above).collect();
    let sheets = cloud_of(both, R);
    for ball in [ball.cloud(R), ball.bare_cloud(R)] {
        let way = |from: f32, direction: Vec3, penetration: Option<Penetration>| {
            let found = impact(&ImpactQuery {
                penetration,
                ..clouds(
                    &sheets,
                    &ball,
                    Pose3::translation(0.0, from, 0.0),
                    direction,
                )
            });
            found.expect("there is a sheet").distance
        };
        let deep = |normal: Vec3, depth: f32| Some(Penetration { normal, depth });
        let below = -2.0 * radius;
        let in_it = deep(Vec3::Y, 3.0 * radius);
        for (from, direction, penetration, expected) in [
            (below, Vec3::Y, None, radius),
            (below, Vec3::Y, in_it, 0.4 + radius),
            // It is farther from this sheet than it is in one.
            (below, Vec3::Y, deep(Vec3::Y, 0.5 * radius), radius),
            // It belongs on the other side, or comes from the right one.
            (below, Vec3::Y, deep(-Vec3::Y, 3.0 * radius), radius),
            (-below, -Vec3::Y, in_it, radius),
        ] {
            let off = way(from, direction, penetration) - expected;
            assert!(off.abs() < 0.3 * R, "{off}: {direction}, {penetration:?}");
        }
    }
}

/// A bar in any pose over a floor without end: where its lowest point meets the floor, or that the motion ends before.
#[test]
fn bars_over_exact_floors() {
    let mut rng = fastrand::Rng::with_seed(9);
    let half = Vec3::new(0.3, 0.05, 0.1);
    let samples = sampled_box(half, R, &mut rng);
    let (plane, block) = (HalfSpace::new(Vector::Y), Cuboid::new(Vector::splat(20.0)));
    let (plane, block) = (ExactShape(&plane), ExactShape(&block));
    for cloud in [Samples::cloud, Samples::bare_cloud] {
        let bar = cloud(&samples, R);
        for case in 0..200 {
            let mut pose = random_pose(&mut rng, 0.0);
            let corner = (pose.rotation.inverse() * Vec3::Y).signum() * half;
            let gap = (1.0 + 5.0 * rng.f32()) * R;
            pose.translation.y = (pose.rotation * corner).y + gap;
            let down = (random_unit(&mut rng) - 2.0 * Vec3::Y).normalize();
            let truth = gap / -down.y;
            let (floor, middle) = [(&plane, 0.0), (&block, -20.0)][case % 2];
            let floor = Surface::Exact(floor);
            pose.translation.y -= middle;
            let length = truth + 4.0 * R * (rng.f32() - 0.5).signum();
            let found = impact(&query(floor, Surface::Cloud(&bar), pose, length * down));
            match found {
                // Splats reach up to a radius beyond a corner, and rays pass it at up to half a diagonal of a pixel.
                Some(found) => {
                    let late = found.distance - truth;
                    assert!(length > truth, "met {late} m late, after the motion's end");
                    assert!((-R..1.5 * R).contains(&late), "{late} m late");
                }
                None => assert!(length < truth, "passes by {} m", length - truth),
            }
        }
    }
}

/// A bar tips over about its lower end. Its middle falls, and in a motion without a turn so would its end; but that stays
/// on the floor, unless later poses take it under.
#[test]
fn what_turns_meets_what_it_goes_into() {
    let mut rng = fastrand::Rng::with_seed(10);
    let half = Vec3::new(0.2, 0.03, 0.1);
    let samples = sampled_box(half, R, &mut rng);
    let ground = sampled_plane(1.0, R, &mut rng);
    let plane = HalfSpace::new(Vector::Y);
    let exact = Surface::Exact(&ExactShape(&plane));
    for cloud in [Samples::cloud, Samples::bare_cloud] {
        let (bar, floor) = (cloud(&samples, R), cloud(&ground, R));
        for floor in [exact, Surface::Cloud(&floor)] {
            let lower_end = Vec3::new(-half.x, -half.y, 0.0);
            let turned_by = |angle: f32| {
                let turn = Quat::from_rotation_z(angle);
                Pose3::from_parts(0.1 * R * Vec3::Y - turn * lower_end, turn)
            };
            let (from, to) = (0.5, 0.3);
            let mut motion = turned_by(to).translation - turned_by(from).translation;
            let mut poses = [1, 2, 3, 4].map(|k| turned_by(from + 0.25 * k as f32 * (to - from)));
            let start = turned_by(0.5 * (from + to)).rotation;
            let seen = |motion: Vec3, turned: &[Pose3]| {
                impact(&ImpactQuery {
                    touching: 0.2 * R,
                    core_only: true,
                    turned,
                    ..query(
                        floor,
                        Surface::Cloud(&bar),
                        Pose3::from_parts(turned_by(from).translation, start),
                        motion,
                    )
                })
            };
            assert!(seen(motion, &[]).is_some(), "its end seems to fall");
            assert_eq!(seen(motion, &poses), None);
            motion.y -= 3.0 * R;
            for (k, pose) in poses.iter_mut().enumerate() {
                pose.translation.y -= 0.75 * (k + 1) as f32 * R;
            }
            assert!(seen(motion, &poses).is_some(), "its end goes under");
        }
    }
}
