//! Clouds whose points are far apart in one place and close in another, as of a scanner that stands in one place.

use crate::common::worlds::{TestResult, attached};
use fastrand::Rng;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use std::f32::consts::{FRAC_PI_2, PI, TAU};
use tldi::{Backend, CpuBackend, PairQuery, PairResult, Params, Surface, View};

/// Least distance of the points, metres.
const FINEST: f32 = 0.01;

/// Radii in distances of neighbours on a square grid: 0.65 of that of the seventh neighbour.
const COVER: f32 = 0.92;

/// How much farther apart than [`FINEST`] points are at the coarse end: local radii are 1.6, 2.6 and 4.9 times the
/// mean there, and with radii that are given, since those of neighbours are limited, 15 times.
const RATIOS: [f32; 4] = [3.0, 7.0, 18.0, 80.0];

/// Half the size of all bodies, metres: smaller than coarse points are apart, so that a body has none below it.
const HALF: f32 = 0.025;

/// A cloud of points that are as far apart as `spacing` says, in a random order, without normals or with such from
/// twelve neighbours. The ratio of its spacings is `ratio`.
fn uneven(
    points: Vec<Vector>,
    spacing: impl Fn(Vector) -> f32,
    ratio: f32,
    has_normals: bool,
    rng: &mut Rng,
) -> Result<PointCloud<'static>, CloudError> {
    let mut points = points;
    rng.shuffle(&mut points);
    let mut builder = PointCloud::builder(&points).knn_radii(7, 0.65);
    if ratio > 18.0 {
        let radii: Vec<f32> = points.iter().map(|p| COVER * spacing(*p)).collect();
        builder = builder.radii(radii);
    }
    if has_normals {
        builder = builder.pca_normals(12);
    }
    Ok(builder.build()?.into_owned())
}

/// Extents of a floor along x and z, metres.
const LENGTH: f32 = 4.0;
const WIDTH: f32 = 1.6;

/// Distance of a floor's points at a place, along both axes: [`FINEST`] at x = 0, `ratio` times as far at [`LENGTH`].
fn floor_spacing(x: f32, ratio: f32) -> f32 {
    FINEST * (1.0 + (ratio - 1.0) * x.max(0.0) / LENGTH)
}

/// A level floor; where its rows lie is random.
fn floor(ratio: f32, has_normals: bool, rng: &mut Rng) -> Result<PointCloud<'static>, CloudError> {
    let mut points = Vec::new();
    let mut x = -FINEST * rng.f32();
    while x < LENGTH + ratio * FINEST {
        let spacing = floor_spacing(x, ratio);
        let mut z = -0.5 * WIDTH - spacing * rng.f32();
        while z < 0.5 * WIDTH + spacing {
            points.push(Vector::new(x, 0.0, z));
            z += spacing;
        }
        x += spacing;
    }
    uneven(
        points,
        |p| floor_spacing(p.x, ratio),
        ratio,
        has_normals,
        rng,
    )
}

/// A ball of points.
fn pebble() -> Result<PointCloud<'static>, CloudError> {
    let golden = PI * (3.0 - 5.0f32.sqrt());
    let count = 1500;
    let points = (0..count).map(|k| {
        let y = 1.0 - 2.0 * (k as f32 + 0.5) / count as f32;
        let (s, c) = (golden * k as f32).sin_cos();
        let across = (1.0 - y * y).sqrt();
        HALF * Vector::new(across * c, y, across * s)
    });
    PointCloud::builder(points.collect::<Vec<_>>()).build()
}

/// Drops a body from 3 cm onto a floor near x and asks for it at rest on it after two seconds, never off it by more than
/// the local radius, and half of its own: a body that hovers does not pass.
fn comes_to_rest(
    floor: &PointCloud<'static>,
    body: ColliderBuilder,
    place: Vector,
    local: f32,
    case: &str,
) -> TestResult {
    let off = local.min(0.5 * HALF);
    let (mut world, mut tldi) = attached();
    let floor = PointCloudShape::new(floor.clone());
    world.insert(RigidBodyBuilder::fixed(), cloud_collider(floor));
    // Balls on splats roll a little before they rest.
    let dynamic = RigidBodyBuilder::dynamic().translation(place + (HALF + 0.03) * Vector::Y);
    let (handle, _) = world.insert(dynamic.angular_damping(2.0), body);
    for step in 0..120 {
        let report = tldi.step(&mut world)?;
        assert_eq!(report.pairs_missed, 0, "{case}: step {step}");
        let below = HALF - world.bodies[handle].translation().y;
        assert!(
            below < off,
            "{case}: {below} deep in step {step}, radius {local}"
        );
    }
    let body = &world.bodies[handle];
    let above = body.translation().y - HALF;
    assert!(above < off, "{case}: {above} above");
    // Rapier's threshold for sleep is 0.4 m/s; what rolls is slower still.
    assert!(body.linvel().length() < 0.2, "{case}: {:?}", body.linvel());
    Ok(())
}

/// On closed floors, wherever they are coarse.
#[test]
fn bodies_rest_where_a_floor_is_coarse() -> TestResult {
    for ratio in RATIOS {
        for seed in 0..2 {
            for has_normals in [false, true] {
                let mut rng = Rng::with_seed(seed);
                let floor = floor(ratio, has_normals, &mut rng)?;
                for x in [0.3, 0.5 * LENGTH, LENGTH - 0.3] {
                    for (name, body) in [
                        ("ball", ColliderBuilder::ball(HALF)),
                        ("box", ColliderBuilder::cuboid(HALF, HALF, HALF)),
                        ("pebble", cloud_collider(PointCloudShape::new(pebble()?))),
                    ] {
                        let [dx, z] = [0.2, 0.4].map(|width| width * (rng.f32() - 0.5));
                        let local = COVER * floor_spacing(x, ratio);
                        let case = format!("{name} at {x}, 1:{ratio}, seed {seed}, {has_normals}");
                        comes_to_rest(&floor, body, Vector::new(x + dx, 0.0, z), local, &case)?;
                    }
                }
            }
        }
    }
    Ok(())
}

/// Distance of a shell's points at an angle from its bottom: [`FINEST`] there, `ratio` times as far at its rim.
fn shell_spacing(angle: f32, ratio: f32) -> f32 {
    FINEST * (1.0 + (ratio - 1.0) * angle / FRAC_PI_2)
}

/// Direction at an angle from straight down and one around.
fn direction(angle: f32, around: f32) -> Vector {
    let across = angle.sin();
    Vector::new(across * around.cos(), -angle.cos(), across * around.sin())
}

/// The lower half of a sphere of a metre.
fn shell(ratio: f32, has_normals: bool, rng: &mut Rng) -> Result<PointCloud<'static>, CloudError> {
    let mut points = Vec::new();
    let mut angle = shell_spacing(0.0, ratio) * rng.f32();
    while angle < FRAC_PI_2 {
        let spacing = shell_spacing(angle, ratio);
        let count = (TAU * angle.sin() / spacing).ceil().max(1.0) as usize;
        let turn = rng.f32();
        let around = (0..count).map(|k| TAU * (k as f32 + turn) / count as f32);
        points.extend(around.map(|around| direction(angle, around)));
        angle += spacing;
    }
    let spacing = |p: Vector| shell_spacing((-p.y).clamp(0.0, 1.0).acos(), ratio);
    uneven(points, spacing, ratio, has_normals, rng)
}

/// What is beside an open shell (a gap of up to two local radii, on either side) is at most a local radius deep
/// in it; what it passes through touches it.
#[test]
fn what_is_beside_an_open_shell_is_not_in_it() -> TestResult {
    let body = pebble()?;
    let mut backend = CpuBackend::new();
    let mut results: Vec<PairResult> = Vec::new();
    // Beyond, the shell is not round any more at its rim.
    for ratio in [3.0, 7.0, 18.0] {
        for has_normals in [false, true] {
            let mut rng = Rng::with_seed(5);
            let shell = shell(ratio, has_normals, &mut rng)?;
            let pixel = shell.mean_radius().min(2.0 * HALF / 8.0);
            let params = Params::for_radius(shell.mean_radius()).with_pixel_size(pixel);
            let (mut beside, mut within) = (0, 0);
            for _ in 0..200 {
                let (angle, around) = (0.1 + 1.2 * rng.f32(), TAU * rng.f32());
                let local = COVER * shell_spacing(angle, ratio);
                let off = (2.0 * rng.f32() - 1.0) * (HALF + 2.0 * local);
                let middle = (1.0 + off) * direction(angle, around);
                let query = PairQuery {
                    a: Surface::Cloud(&shell),
                    b: Surface::Cloud(&body),
                    a_from_b: Pose::from_translation(middle),
                    view: View::aimed(),
                    params: params.with_prediction(0.002),
                };
                backend.compare(&[query], &mut results)?;
                let points = results[0].patches.iter().flat_map(|patch| &patch.points);
                let least = points.map(|point| point.gap).reduce(f32::min);
                let case = format!("1:{ratio}, {has_normals}, {off} off at {angle}: {least:?}");
                if off.abs() > HALF {
                    assert!(least.is_none_or(|gap| gap > -local), "{case}");
                    beside += 1;
                } else if off.abs() < 0.5 * HALF {
                    assert!(least.is_some(), "{case}");
                    within += 1;
                }
            }
            assert!(beside > 50 && within > 2, "{beside} {within}");
        }
    }
    Ok(())
}
