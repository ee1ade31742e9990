//! What an error or time budget picks, what that costs and errs; and what a scene costs that is not
//! touched.

#![allow(
    clippy::print_stdout,
    reason = "a bench's table is its output; progress goes to stderr"
)]

use anyhow::ensure;
use clap::Parser;
use indicatif::ProgressBar;
use rapier3d::math::{Pose, Rotation, Vector};
use rapier3d::prelude::{MassProperties, PhysicsWorld, RigidBodyBuilder};
use rapier3d_tldi::prelude::*;
use serde::{Deserialize, Serialize};
use std::time::Duration;
use tldi::glamx::{Pose3, Vec3};
use tldi_benches::args::RunArgs;
use tldi_benches::floor::Coordinates;
use tldi_benches::stopwatch::Stopwatch;
use tldi_benches::stored::{Measured, Provenance};
use tldi_benches::times::Times;
use tldi_tests::{sampled_box, sampled_plane, sampled_sphere};

/// A ball, and a cube on its edge and on its corner, 2 to 10 radii deep in a flat scan: how far the
/// depth is off and what finding it takes, for pixels of several sizes and for budgets. Then one ball
/// on scans of growing size. Times are processor time of one thread.
#[derive(Parser)]
struct Args {
    /// Spacing of the points of the scan and the bodies in metres
    #[arg(long, value_name = "M", default_value_t = 0.002)]
    spacing: f32,
    /// Poses of each body
    #[arg(long, value_name = "N", default_value_t = 9)]
    poses: usize,
    /// Points of the largest scan
    #[arg(long, value_name = "N", default_value_t = 1_000_000)]
    most: usize,
    #[command(flatten)]
    run: RunArgs,
}

/// Radius of the ball and half the edges of the cube, metres.
const SIZE: f32 = 0.1;

/// Edge of the scan that bodies with several settings lie in, metres.
const SCAN: f32 = 0.6;

/// Comparisons of a pose before the one that counts: memory settles, and what a time budget picks.
const WARM: usize = 12;

/// Points of the smallest scan of growing ones.
const FEWEST: usize = 10_000;

/// One setting, or one scan.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    /// What picks the pixels; or the order of the scan's points.
    setting: String,
    /// Of the scan.
    scan_points: usize,
    /// Median of the batch of a step, ms.
    median_ms: f64,
    /// A pass over all points of scan and body in the same run, ms.
    floor_ms: f64,
    /// Median of the depth's absolute error, mm; then that of the 95th percentile.
    median_error_mm: f32,
    p95_error_mm: f32,
    /// Whether no other setting is as fast and errs less (median of all bodies).
    is_on_front: bool,
}

impl Measured for Row {
    const KIND: &'static str = "budgets";

    fn fault(&self) -> Option<String> {
        (self.median_ms.is_nan() || self.median_ms <= 0.0).then(|| "no time was taken".to_owned())
    }
}

/// A body in one pose.
struct Case<'a> {
    body: &'a PointCloud<'static>,
    pose: Pose,
    /// Of its lowest point below the scan's plane, metres.
    depth: f32,
}

/// What one comparison took and found.
struct Outcome {
    seconds: f64,
    error: f32,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    ensure!(
        (0.0005..=0.02).contains(&args.spacing) && args.poses > 0 && args.most >= FEWEST,
        "spacing must be 0.0005 to 0.02, with at least one pose and {FEWEST} points"
    );
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let mut rows = pool.install(|| settings(&args))?;
    print(&rows);
    let scenes = pool.install(|| scenes(&args))?;
    println!();
    print(&scenes);
    rows.extend(scenes);
    args.run.store(Provenance::now(None), rows)?;
    Ok(())
}

/// All settings, from the finest pixels on, then budgets.
fn resolutions() -> Vec<(String, Resolution)> {
    let radii = [0.7, 1.0, 1.5, 2.0, 2.8, 4.0, 4.2, 5.6, 8.0];
    let error = [0.002, 0.004, 0.008, 0.012];
    let time = [1.0, 2.0, 4.0];
    let radii = radii.map(|r| (format!("pixel {r} r"), Resolution::Radii(r)));
    let error = error.map(|e| (format!("error {} mm", 1e3 * e), Resolution::Error(e)));
    let time = time.map(|ms| {
        let budget = Duration::from_secs_f64(1e-3 * ms);
        (format!("time {ms} ms"), Resolution::Time(budget))
    });
    [radii.to_vec(), error.to_vec(), time.to_vec()].concat()
}

fn settings(args: &Args) -> anyhow::Result<Vec<Row>> {
    let mut rng = fastrand::Rng::with_seed(args.run.seed);
    let r = args.spacing;
    let scan = sampled_plane(SCAN, r, &mut rng).bare_cloud(r);
    let ball = sampled_sphere(SIZE, r).bare_cloud(r);
    let cube = sampled_box(Vec3::splat(SIZE), r, &mut rng).bare_cloud(r);
    let edge = Rotation::from_rotation_x(std::f32::consts::FRAC_PI_4);
    let corner = Rotation::from_rotation_arc(Vec3::ONE.normalize(), -Vec3::Y);
    let mut cases = Vec::new();
    for (body, tilt, reach) in [
        (&ball, Rotation::IDENTITY, SIZE),
        (&cube, edge, 2.0f32.sqrt() * SIZE),
        (&cube, corner, 3.0f32.sqrt() * SIZE),
    ] {
        for _ in 0..args.poses {
            let turn = Rotation::from_rotation_y(rng.f32() * std::f32::consts::TAU);
            let depth = r * (2.0 + 8.0 * rng.f32());
            let at = Vector::new(0.1 * rng.f32(), reach - depth, 0.1 * rng.f32());
            let pose = Pose::from_parts(at, turn * tilt);
            cases.push(Case { body, pose, depth });
        }
    }
    let resolutions = resolutions();
    let mut found: Vec<Vec<Outcome>> = resolutions.iter().map(|_| Vec::new()).collect();
    let progress = ProgressBar::new(cases.len() as u64).with_message("settings");
    for case in &cases {
        // Setting by setting within a case, so that a change of the machine's speed meets all alike.
        for ((_, resolution), found) in resolutions.iter().zip(&mut found) {
            found.push(compare(&scan, case, *resolution)?);
        }
        progress.inc(1);
    }
    progress.finish_and_clear();
    let floor_ms = floor_ms(&scan, &cube);
    let mut rows: Vec<Row> = (resolutions.into_iter().zip(&found))
        .map(|((setting, _), outcomes)| row(setting, scan.len(), outcomes, floor_ms))
        .collect();
    for k in 0..rows.len() {
        let own = &rows[k];
        let beats = |other: &Row| {
            other.median_ms < own.median_ms && other.median_error_mm < own.median_error_mm
        };
        rows[k].is_on_front = !rows.iter().any(beats);
    }
    Ok(rows)
}

/// One ball on scans of the same density: its points in random order, and sorted once.
fn scenes(args: &Args) -> anyhow::Result<Vec<Row>> {
    let spacing = 0.01;
    let ball = sampled_sphere(SIZE, spacing).bare_cloud(spacing);
    let mut rows = Vec::new();
    let mut count = FEWEST;
    while count <= args.most {
        let mut rng = fastrand::Rng::with_seed(args.run.seed);
        let edge = spacing * (count as f32).sqrt();
        let mut samples = sampled_plane(edge, spacing, &mut rng);
        rng.shuffle(&mut samples.points);
        let depth = spacing;
        let pose = Pose::from_translation((SIZE - depth) * Vector::Y);
        let body = &ball;
        let case = Case { body, pose, depth };
        let builder = || PointCloud::builder(samples.points.clone()).radius(spacing);
        for (name, scan) in [
            ("random order", builder().build()?),
            ("spatial order", builder().spatial_order().build()?),
        ] {
            let repeats = (0..5).map(|_| compare(&scan, &case, Resolution::default()));
            let outcomes: Vec<Outcome> = repeats.collect::<anyhow::Result<_>>()?;
            let floor_ms = floor_ms(&scan, &ball);
            rows.push(row(name.to_owned(), scan.len(), &outcomes, floor_ms));
        }
        count *= 10;
    }
    Ok(rows)
}

/// Finds the contacts of a body in a fixed scan, as a step does.
fn compare(
    scan: &PointCloud<'static>,
    case: &Case,
    resolution: Resolution,
) -> anyhow::Result<Outcome> {
    let mut world = PhysicsWorld {
        gravity: Vector::ZERO,
        ..PhysicsWorld::default()
    };
    let config = TldiConfig {
        resolution,
        scatter: 0.0,
        ..TldiConfig::default()
    };
    let mut tldi = TldiPipeline::with_backend(config, Box::new(tldi::CpuBackend::new()))?;
    tldi.attach(&mut world);
    world.insert(RigidBodyBuilder::fixed(), tldi.collider(scan.clone()));
    let body = RigidBodyBuilder::dynamic().pose(case.pose);
    // Given, since what it takes to find them is not what is measured.
    let mass = MassProperties::new(Vector::ZERO, 1.0, Vector::splat(0.004));
    let collider = tldi.collider(case.body.clone()).mass_properties(mass);
    world.insert(body, collider);
    let mut seconds = 0.0;
    for _ in 0..WARM {
        let start = Stopwatch::of_thread();
        tldi.prepare(
            world.gravity,
            &world.integration_parameters,
            &world.bodies,
            &world.colliders,
            &world.impulse_joints,
            &world.multibody_joints,
        )?;
        seconds = start.seconds();
    }
    tldi.step(&mut world)?;
    let contacts = tldi.contacts(&world.narrow_phase, &world.colliders);
    let depth = contacts.map(|contact| contact.depth).max_by(f32::total_cmp);
    let error = (depth.unwrap_or(0.0) - case.depth).abs();
    Ok(Outcome { seconds, error })
}

fn row(setting: String, scan_points: usize, outcomes: &[Outcome], floor_ms: f64) -> Row {
    let times = Times::of(outcomes.iter().map(|o| 1e3 * o.seconds));
    let mut errors: Vec<f32> = outcomes.iter().map(|o| o.error).collect();
    errors.sort_by(f32::total_cmp);
    Row {
        setting,
        scan_points,
        median_ms: times.median,
        floor_ms,
        median_error_mm: 1e3 * errors[errors.len() / 2],
        p95_error_mm: 1e3 * errors[errors.len() * 95 / 100],
        is_on_front: false,
    }
}

fn floor_ms(a: &PointCloud, b: &PointCloud) -> f64 {
    let clouds = [a, b].map(|cloud| Coordinates::of(cloud.points()));
    let pass = || {
        let start = Stopwatch::of_thread();
        for cloud in &clouds {
            std::hint::black_box(cloud.moved_into(&Pose3::IDENTITY, a.bounds()));
        }
        1e3 * start.seconds()
    };
    Times::of((0..9).map(|_| pass())).least
}

fn print(rows: &[Row]) {
    println!(
        "{:<14} {:>11} {:>9} {:>9} {:>16} {:>13}  front",
        "setting", "scan points", "step ms", "floor ms", "median error mm", "95 % error mm"
    );
    for row in rows {
        println!(
            "{:<14} {:>11} {:>9.3} {:>9.3} {:>16.3} {:>13.3}  {}",
            row.setting,
            row.scan_points,
            row.median_ms,
            row.floor_ms,
            row.median_error_mm,
            row.p95_error_mm,
            if row.is_on_front { "yes" } else { "" }
        );
    }
}
