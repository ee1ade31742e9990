//! Clouds against surfaces known exactly, which are seen by rays.

use tldi::glamx::{Pose3, Vec3};
use tldi::{Aabb, Backend, BackendError, CpuBackend, Params, RayHit, RaySurface, Surface};
use tldi_tests::{
    HalfSpace, aimed, cloud_of, compare, deepest_point, random_pose, random_unit, sampled_box,
    sampled_sphere,
};

/// Spacing of all samples here, and with radius = spacing a mean radius, in metres.
const R: f32 = 0.01;

/// A ball known exactly, to check images made by rays.
struct Ball(f32);

impl RaySurface for Ball {
    fn bounds(&self) -> Aabb {
        Aabb {
            min: Vec3::splat(-self.0),
            max: Vec3::splat(self.0),
        }
    }

    fn crossings(&self, origin: Vec3, direction: Vec3, max_distance: f32, hits: &mut Vec<RayHit>) {
        let along = -origin.dot(direction);
        let squared = self.0 * self.0 - (origin + along * direction).length_squared();
        if squared > 0.0 {
            let half = squared.sqrt();
            for distance in [along - half, along + half] {
                if (0.0..=max_distance).contains(&distance) {
                    let normal = (origin + distance * direction) / self.0;
                    hits.push(RayHit { distance, normal });
                }
            }
        }
    }

    fn project(&self, point: Vec3) -> (f32, Vec3) {
        (point.length() - self.0, point.normalize_or(Vec3::Y))
    }

    fn is_closed(&self) -> bool {
        true
    }
}

/// A cloud wholly inside a solid, deeper than it is wide, is pushed out the shortest way.
#[test]
fn clouds_deep_inside_exact_solids() {
    let radius = 0.08;
    let cloud = sampled_sphere(radius, R).cloud(R);
    let surfaces: [&dyn RaySurface; 2] = [&Ball(0.6), &HalfSpace];
    for (surface, height) in surfaces.into_iter().zip([0.3, -0.3]) {
        let result = compare(
            Surface::Exact(surface),
            Surface::Cloud(&cloud),
            Pose3::translation(0.0, height, 0.0),
            Params::for_radius(R),
        );
        assert!(result.collides);
        assert!(result.patches[0].normal.y > 0.99, "{:?}", result.patches);
        let gap = deepest_point(&result).expect("there is a patch").0;
        assert!((gap + 0.3 + radius).abs() < 0.45 * R, "{gap}");
    }
}

/// The corner of a cube of 60,000 points is found on a half-space, in whatever order the points are: a few of them
/// are near.
#[test]
fn few_points_among_many_are_found() {
    let mut rng = fastrand::Rng::with_seed(8);
    let half = 0.5;
    let mut points = sampled_box(Vec3::splat(half), R, &mut rng).points;
    for shuffled in [false, true] {
        if shuffled {
            rng.shuffle(&mut points);
        }
        let cloud = cloud_of(points.clone(), R);
        for _ in 0..6 {
            let turn = random_pose(&mut rng, 0.0).rotation;
            let lowest = (0..8)
                .map(|k| [1, 2, 4].map(|bit| if k & bit == 0 { half } else { -half }))
                .map(|corner| (turn * Vec3::from(corner)).y)
                .fold(f32::INFINITY, f32::min);
            // Bare corners are felt up to a radius too low.
            let pose = Pose3::from_parts((-lowest - 2.0 * R) * Vec3::Y, turn);
            let result = compare(
                Surface::Exact(&HalfSpace),
                Surface::Cloud(&cloud),
                pose,
                Params::for_radius(R),
            );
            assert!(!result.patches.is_empty(), "{pose:?}");
        }
    }
}

/// A cloud against exact surfaces, in both orders: sphere on ball and sphere on half-space.
#[test]
fn clouds_against_exact_surfaces() {
    let mut rng = fastrand::Rng::with_seed(5);
    let radius = 0.08;
    let cloud = sampled_sphere(radius, R).cloud(R);
    for _ in 0..100 {
        let gap = (1.5 - 4.5 * rng.f32()) * R;
        let direction = random_unit(&mut rng);
        let turn = random_pose(&mut rng, 0.0);
        let mut on_ball = turn;
        on_ball.translation = direction * (0.1 + radius + gap);
        let mut on_ground = turn;
        on_ground.translation = Vec3::new(rng.f32(), radius + gap, rng.f32());
        let cases: [(&dyn RaySurface, Pose3, Vec3); 2] = [
            (&Ball(0.1), on_ball, direction),
            (&HalfSpace, on_ground, Vec3::Y),
        ];
        for (surface, exact_from_cloud, normal) in cases {
            let params = Params::for_radius(R);
            let (exact, cloud) = (Surface::Exact(surface), Surface::Cloud(&cloud));
            let first = compare(exact, cloud, exact_from_cloud, params);
            let second = compare(cloud, exact, exact_from_cloud.inverse(), params);
            let turned = exact_from_cloud.rotation.inverse() * -normal;
            for (result, normal) in [(first, normal), (second, turned)] {
                let found = deepest_point(&result).expect("there is a patch").0;
                let error = (found - gap).abs();
                assert!(
                    error < 0.45 * R,
                    "gap {gap}, normal {normal}: off by {error}"
                );
                let angle = result.patches[0].normal.angle_between(normal).to_degrees();
                assert!(angle < 3.0, "gap {gap}: normal off by {angle}°");
            }
        }
    }
}

/// The half-space, as a part of a terrain with hills: its bounds leave out no point.
struct Valley;

impl RaySurface for Valley {
    fn bounds(&self) -> Aabb {
        Aabb {
            min: Vec3::NEG_INFINITY,
            max: Vec3::INFINITY,
        }
    }

    fn crossings(&self, origin: Vec3, direction: Vec3, max_distance: f32, hits: &mut Vec<RayHit>) {
        HalfSpace.crossings(origin, direction, max_distance, hits);
    }

    fn project(&self, point: Vec3) -> (f32, Vec3) {
        HalfSpace.project(point)
    }

    fn is_closed(&self) -> bool {
        true
    }
}

/// A plate rests on a floor as deep as without stray points, some of them above it. With many, the cells of the space that
/// is left of the gaps between them hold points of the plate and strays.
#[test]
fn stray_points_do_not_hide_a_floor() {
    for seed in 0..8 {
        let mut rng = fastrand::Rng::with_seed(seed);
        let half = Vec3::new(0.1, 0.03, 0.1);
        let plate = sampled_box(half, R, &mut rng).points;
        for strays in [0, 5, 20, 50, 200] {
            let mut points: Vec<Vec3> = (0..strays)
                .map(|k| {
                    let distance = 10.0f32.powf(3.0 * rng.f32());
                    let place = distance * random_unit(&mut rng);
                    match k % 4 {
                        0 => (half * random_unit(&mut rng)).with_y(distance),
                        _ => place.with_y(0.5 + place.y.abs()),
                    }
                })
                .collect();
            points.extend(&plate);
            let cloud = cloud_of(points, R);
            let result = compare(
                Surface::Exact(&Valley),
                Surface::Cloud(&cloud),
                Pose3::translation(0.0, half.y - 0.5 * R, 0.0),
                Params::for_radius(R),
            );
            let case = format!("seed {seed}, {strays} strays");
            let (gap, _) = deepest_point(&result).expect(&case);
            assert!((gap + 0.5 * R).abs() < 0.2 * R, "{case}: {gap}");
            assert!(result.patches[0].normal.y > 0.999, "{case}");
            assert_eq!(result.patches[0].points.len(), 4, "{case}");
        }
    }
}

/// What cannot be compared is refused with the place in the batch.
#[test]
fn unsupported_pairs_are_named() {
    let (ground, ball) = (Surface::Exact(&HalfSpace), Surface::Exact(&Ball(1.0)));
    let query = aimed(ground, ball, Pose3::IDENTITY, Params::for_radius(R));
    let error = CpuBackend::new()
        .compare(&[query], &mut Vec::new())
        .expect_err("no cloud");
    assert!(
        matches!(error, BackendError::Unsupported { pair: 0, .. }),
        "{error}"
    );
}
