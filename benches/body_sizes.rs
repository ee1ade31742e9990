//! What a step takes for one body of any size on clouds of any density, and where the body rests.

#![allow(
    clippy::print_stdout,
    reason = "a bench's table is its output; progress goes to stderr"
)]

use anyhow::ensure;
use clap::Parser;
use indicatif::ProgressBar;
use rapier3d::math::Vector;
use rapier3d::prelude::{ColliderBuilder, PhysicsWorld, RigidBodyBuilder};
use rapier3d_tldi::prelude::*;
use serde::{Deserialize, Serialize};
use tldi::glamx::Vec3;
use tldi_benches::args::RunArgs;
use tldi_benches::stopwatch::Stopwatch;
use tldi_benches::stored::{Measured, Provenance};
use tldi_benches::times::Times;
use tldi_tests::{sampled_box, sampled_plane};

/// A ball, a cuboid and a cloud of a cube, each of several sizes, dropped by a tenth of their size onto flat clouds of
/// several densities. Rapier's length unit and gravity follow the size. Times are processor time of one thread.
#[derive(Parser)]
struct Args {
    /// Sizes of the bodies in metres, several by commas
    #[arg(long, value_name = "M,M", value_delimiter = ',', default_values_t = [0.001, 0.01, 0.1, 1.0, 10.0])]
    sizes: Vec<f32>,
    /// Radii of the clouds' points in metres, several by commas
    #[arg(long, value_name = "M,M", value_delimiter = ',', default_values_t = [0.001, 0.01, 0.1, 1.0])]
    radii: Vec<f32>,
    /// Steps of each body
    #[arg(long, value_name = "N", default_value_t = 120)]
    steps: usize,
    #[command(flatten)]
    run: RunArgs,
}

/// Points along a body of a cloud.
const POINTS_ALONG: f32 = 16.0;

/// Edge of a cloud in sizes of the body, and at least and at most in radii: what is beside a body does not take part,
/// and a square of 400 radii has 160,000 points.
const EDGE: f32 = 4.0;
const EDGE_RADII: [f32; 2] = [24.0, 400.0];

/// The bodies.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
enum Body {
    Ball,
    Cuboid,
    Cloud,
}

/// One body on one cloud.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Row {
    body: Body,
    /// Edge, or diameter, metres.
    size: f32,
    /// Of the cloud's points, metres.
    radius: f32,
    /// Points of the cloud.
    points: usize,
    /// Of all steps, ms.
    median_ms: f64,
    worst_ms: f64,
    /// Most contact pixels of a step.
    contact_pixels: usize,
    /// How deep the body ends up, in radii of the coarser cloud; negative: too high.
    depth_in_radii: f32,
    /// The same in sizes of the body.
    depth_in_sizes: f32,
}

impl Measured for Row {
    const KIND: &'static str = "body_sizes";

    fn fault(&self) -> Option<String> {
        (!self.depth_in_sizes.is_finite()).then(|| "the body is nowhere".to_owned())
    }
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let lengths = || args.sizes.iter().chain(&args.radii);
    ensure!(
        lengths().all(|length| (1e-4..=100.0).contains(length)) && args.steps > 0,
        "sizes and radii must be 0.0001 to 100, with at least one step"
    );
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build()?;
    let progress = ProgressBar::new((3 * args.sizes.len() * args.radii.len()) as u64);
    let mut rows = Vec::new();
    for body in [Body::Ball, Body::Cuboid, Body::Cloud] {
        for &size in &args.sizes {
            for &radius in &args.radii {
                rows.push(pool.install(|| measure(body, size, radius, &args))?);
                progress.inc(1);
            }
        }
    }
    progress.finish_and_clear();
    print(&rows);
    args.run.store(Provenance::now(None), rows)?;
    Ok(())
}

fn measure(body: Body, size: f32, radius: f32, args: &Args) -> anyhow::Result<Row> {
    let mut rng = fastrand::Rng::with_seed(args.run.seed);
    let [least, most] = EDGE_RADII.map(|radii| radii * radius);
    let edge = (EDGE * size).max(least).min(most);
    let floor = sampled_plane(edge, radius, &mut rng).bare_cloud(radius);
    let points = floor.len();
    let half = 0.5 * size;
    let own_radius = size / POINTS_ALONG;
    let mut world = PhysicsWorld::default();
    world.integration_parameters.length_unit = size.min(1.0);
    world.gravity *= size.min(1.0);
    let mut tldi =
        TldiPipeline::with_backend(TldiConfig::default(), Box::new(tldi::CpuBackend::new()))?;
    tldi.attach(&mut world);
    world.insert(RigidBodyBuilder::fixed(), tldi.collider(floor));
    let (collider, coarser) = match body {
        Body::Ball => (ColliderBuilder::ball(half), radius),
        Body::Cuboid => (ColliderBuilder::cuboid(half, half, half), radius),
        Body::Cloud => {
            let samples = sampled_box(Vec3::splat(half), own_radius, &mut rng);
            let cloud = samples.bare_cloud(own_radius);
            (tldi.collider(cloud), radius.max(own_radius))
        }
    };
    let start = Vector::new(0.3 * radius, half + 0.1 * size, 0.3 * radius);
    let (handle, _) = world.insert(RigidBodyBuilder::dynamic().translation(start), collider);
    let (mut times, mut contact_pixels) = (Vec::new(), 0);
    for _ in 0..args.steps {
        let watch = Stopwatch::of_thread();
        let report = tldi.step(&mut world)?;
        times.push(1e3 * watch.seconds());
        contact_pixels = contact_pixels.max(report.contact_pixels);
    }
    let times = Times::of(times);
    let depth = half - world.bodies[handle].translation().y;
    Ok(Row {
        body,
        size,
        radius,
        points,
        median_ms: times.median,
        worst_ms: times.most,
        contact_pixels,
        depth_in_radii: depth / coarser,
        depth_in_sizes: depth / size,
    })
}

fn print(rows: &[Row]) {
    println!(
        "{:<7} {:>7} {:>7} {:>9} {:>10} {:>9} {:>7} {:>10} {:>10}",
        "body",
        "size m",
        "r m",
        "points",
        "median ms",
        "worst ms",
        "pixels",
        "depth / r",
        "depth / size"
    );
    for row in rows {
        println!(
            "{:<7} {:>7} {:>7} {:>9} {:>10.3} {:>9.3} {:>7} {:>10.3} {:>10.3}",
            format!("{:?}", row.body),
            row.size,
            row.radius,
            row.points,
            row.median_ms,
            row.worst_ms,
            row.contact_pixels,
            row.depth_in_radii,
            row.depth_in_sizes,
        );
    }
}
