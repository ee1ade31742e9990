//! What a frame costs in which all points are new: ours, and what a user would pick instead.

#![allow(
    clippy::print_stdout,
    reason = "a bench's table is its output; progress goes to stderr"
)]

use anyhow::{Context, ensure};
use clap::Parser;
use indicatif::ProgressBar;
use peak_alloc::PeakAlloc;
use rapier3d::parry::partitioning::BvhBuildStrategy;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;
use tldi::glamx::{Pose3, Vec3};
use tldi::{Aabb, Backend, CpuBackend, PairQuery, Params, PointCloud, Surface, View};
use tldi_benches::peers::{
    BitGrid, BvhRebuild, BvhRefit, Culled, Found, Frame, Grid, Peer, VoxelsRebuild,
};
use tldi_benches::{covering_radius, random_body};
use tldi_tests::Host;
use tldi_wgpu::BackendChoice;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Compares one frame of two clouds, all of whose points are new, by every method: seconds to build
/// and to query, and what was found. Every method also gets only what its bounds cannot exclude.
#[derive(Parser)]
struct Args {
    /// Points of each of the two clouds, several by commas
    #[arg(
        long,
        value_name = "N,N",
        value_delimiter = ',',
        default_value = "10000,100000"
    )]
    points: Vec<usize>,
    /// Use the points of this model, at random, in place of a generated body
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Frames that each is measured; medians are told
    #[arg(long, value_name = "N", default_value_t = 5)]
    repeats: usize,
    /// Measure our method on this backend too
    #[arg(long, value_name = "auto|cpu|gpu", default_value_t = BackendChoice::Cpu)]
    backend: BackendChoice,
    /// Seed of the points
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Write the rows to this file as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(Serialize)]
struct Row {
    points: usize,
    placement: &'static str,
    method: String,
    threads: usize,
    build_ms: f64,
    query_ms: f64,
    total_ms: f64,
    /// Slowest total less fastest.
    spread_ms: f64,
    collides: bool,
    contacts: usize,
    peak_mib: f64,
    /// Total over one transform-and-cull pass over both clouds.
    floor_ratio: f64,
}

#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    host: Host,
    adapter: Option<String>,
    model: String,
    rows: Vec<Row>,
}

/// Distance of the bodies' middles along x, in their widths; and by how many radii more.
const PLACEMENTS: [(&str, f32, f32); 4] = [
    ("near-miss", 1.0, 6.0),
    ("slight", 0.97, 0.0),
    ("deep", 0.6, 0.0),
    ("coincident", 0.0, 0.0),
];

/// Ours, as a peer: the clouds are built, then compared.
struct Tldi {
    backend: Box<dyn Backend>,
    threads: rayon::ThreadPool,
}

impl Peer for Tldi {
    fn name(&self) -> String {
        format!("tldi ({})", self.backend.name())
    }

    fn compare(&mut self, frame: &Frame) -> Found {
        let Self { backend, threads } = self;
        threads.install(|| {
            let start = Instant::now();
            let cloud = |points: &[Vec3]| {
                let builder = PointCloud::builder(points.to_vec()).radius(frame.radius);
                builder.build().expect("the points are finite")
            };
            let (a, b) = (cloud(frame.a), cloud(frame.b));
            let built = start.elapsed().as_secs_f64();
            let query = PairQuery {
                a: Surface::Cloud(&a),
                b: Surface::Cloud(&b),
                a_from_b: Pose3::IDENTITY,
                view: View::aimed(),
                params: Params::for_radius(frame.radius),
            };
            let mut results = Vec::new();
            backend
                .compare(&[query], &mut results)
                .expect("clouds are supported");
            Found {
                build_seconds: built,
                query_seconds: start.elapsed().as_secs_f64() - built,
                collides: results[0].collides,
                contacts: results[0].contacts.len(),
            }
        })
    }
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    ensure!(
        args.repeats > 0 && args.points.iter().all(|n| *n >= 100),
        "at least one repeat and 100 points are needed"
    );
    let model = args.model.as_deref().map(tldi_sources_points).transpose()?;
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let mut report = Report {
        host: Host::now(),
        adapter: None,
        model: args
            .model
            .as_ref()
            .and_then(|path| path.file_name())
            .map_or_else(
                || "bumpy ball (generated)".to_owned(),
                |name| name.to_string_lossy().into_owned(),
            ),
        rows: Vec::new(),
    };
    for &points in &args.points {
        for (placement, widths, radii) in PLACEMENTS {
            let rows = measure(
                &args,
                model.as_deref(),
                points,
                (placement, widths, radii),
                cores,
            )?;
            print(&rows);
            report.rows.extend(rows);
        }
    }
    report.adapter = args.backend.open()?.adapter().map(str::to_owned);
    if let Some(path) = &args.json {
        let text = serde_json::to_string_pretty(&report)?;
        std::fs::write(path, text + "\n")
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// The points of a model, scaled to 2 m.
fn tldi_sources_points(path: &std::path::Path) -> anyhow::Result<Vec<Vec3>> {
    let raw = tldi_sources::read(path, &tldi_sources::ReadOptions::default())?;
    Ok(tldi_benches::protocol::normalised(&raw.points))
}

/// `count` points of one frame: of the model, at random with a jitter, or of the generated body.
fn body(model: Option<&[Vec3]>, count: usize, seed: u64) -> Vec<Vec3> {
    let Some(model) = model else {
        return random_body(count, seed);
    };
    let mut rng = fastrand::Rng::with_seed(seed);
    let jitter = 0.2 * covering_radius(model.len(), 8.0);
    (0..count)
        .map(|_| {
            let mut off = || jitter * (rng.f32() - 0.5);
            let offset = Vec3::new(off(), off(), off());
            model[rng.usize(..model.len())] + offset
        })
        .collect()
}

fn measure(
    args: &Args,
    model: Option<&[Vec3]>,
    points: usize,
    (placement, widths, radii): (&'static str, f32, f32),
    cores: usize,
) -> anyhow::Result<Vec<Row>> {
    let radius = covering_radius(points, 4.0 * std::f32::consts::PI);
    let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let tldi = |backend, threads| -> anyhow::Result<Box<dyn Peer>> {
        Ok(Box::new(Tldi {
            backend,
            threads: pool(threads)?,
        }))
    };
    let bvh = |strategy| BvhRebuild { strategy };
    let mut methods: Vec<(Box<dyn Peer>, usize)> = vec![
        (tldi(Box::new(CpuBackend::new()), 1)?, 1),
        (tldi(Box::new(CpuBackend::new()), cores)?, cores),
        (Box::new(bvh(BvhBuildStrategy::Binned)), 1),
        (Box::new(Culled::new(bvh(BvhBuildStrategy::Binned))), 1),
        (Box::new(bvh(BvhBuildStrategy::Ploc)), 1),
        (Box::new(Culled::new(bvh(BvhBuildStrategy::Ploc))), 1),
        (Box::new(BvhRefit::default()), 1),
        (Box::new(VoxelsRebuild::default()), 1),
        (Box::new(Culled::new(VoxelsRebuild::default())), 1),
        (Box::new(Grid::default()), 1),
        (Box::new(Culled::new(Grid::default())), 1),
        (Box::new(BitGrid::default()), 1),
        (Box::new(Culled::new(BitGrid::default())), 1),
    ];
    if args.backend != BackendChoice::Cpu {
        methods.push((tldi(args.backend.open()?, cores)?, cores));
    }
    let mut totals: Vec<Vec<Found>> = vec![Vec::new(); methods.len()];
    let mut peaks = vec![0.0f64; methods.len()];
    let mut floors = Vec::new();
    let progress = ProgressBar::new((args.repeats + 1) as u64).with_message(placement);
    for frame in 0..=args.repeats as u64 {
        let a = body(model, points, args.seed + 2 * frame);
        let mut b = body(model, points, args.seed + 2 * frame + 1);
        let width = bounds(&a).extents().x;
        let shift = (widths * width + radii * radius) * Vec3::X;
        b.iter_mut().for_each(|p| *p += shift);
        let frame_of = Frame {
            a: &a,
            b: &b,
            radius,
        };
        let start = Instant::now();
        std::hint::black_box(floor(&frame_of));
        floors.push(start.elapsed().as_secs_f64());
        for (k, (method, _)) in methods.iter_mut().enumerate() {
            MEMORY.reset_peak_usage();
            let before = MEMORY.current_usage_as_mb();
            let found = method.compare(&frame_of);
            peaks[k] = peaks[k].max(f64::from(MEMORY.peak_usage_as_mb() - before));
            // The first frame warms memory up.
            if frame > 0 {
                totals[k].push(found);
            }
        }
        progress.inc(1);
    }
    progress.finish_and_clear();
    let floor_seconds = median(floors);
    Ok(methods
        .iter()
        .zip(totals)
        .zip(peaks)
        .map(|(((method, threads), all), peak)| {
            let of = |part: fn(&Found) -> f64| median(all.iter().map(part));
            let total = |f: &Found| f.build_seconds + f.query_seconds;
            let (least, most) = all.iter().map(total).fold((f64::MAX, 0.0), |(lo, hi), t| {
                (f64::min(lo, t), f64::max(hi, t))
            });
            let last = all.last().copied().unwrap_or_default();
            Row {
                points,
                placement,
                method: method.name(),
                threads: *threads,
                build_ms: of(|f| f.build_seconds) * 1e3,
                query_ms: of(|f| f.query_seconds) * 1e3,
                total_ms: of(|f| f.build_seconds + f.query_seconds) * 1e3,
                spread_ms: (most - least) * 1e3,
                collides: last.collides,
                contacts: last.contacts,
                peak_mib: peak,
                floor_ratio: of(|f| f.build_seconds + f.query_seconds) / floor_seconds,
            }
        })
        .collect())
}

fn bounds(points: &[Vec3]) -> Aabb {
    points.iter().fold(Aabb::EMPTY, |all, p| all.including(*p))
}

/// One pass over both clouds: moved and counted where they may touch.
fn floor(frame: &Frame) -> usize {
    let overlap = bounds(frame.a).intersection(bounds(frame.b));
    let pose = Pose3::translation(1e-6, 0.0, 0.0);
    let count = |points: &[Vec3]| {
        let inside = points.iter().filter(|p| overlap.contains(pose * **p));
        inside.count()
    };
    count(frame.a) + count(frame.b)
}

fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_unstable_by(f64::total_cmp);
    values[values.len() / 2]
}

fn print(rows: &[Row]) {
    let Some(first) = rows.first() else {
        return;
    };
    println!("\n2 x {} points, {}", first.points, first.placement);
    println!(
        "{:<30} {:>7} {:>10} {:>10} {:>10} {:>9} {:>9} {:>8} {:>8}",
        "method",
        "threads",
        "build ms",
        "query ms",
        "total ms",
        "collides",
        "contacts",
        "MiB",
        "x floor"
    );
    for row in rows {
        println!(
            "{:<30} {:>7} {:>10.3} {:>10.3} {:>10.3} {:>9} {:>9} {:>8.1} {:>8.1}",
            row.method,
            row.threads,
            row.build_ms,
            row.query_ms,
            row.total_ms,
            row.collides,
            row.contacts,
            row.peak_mib,
            row.floor_ratio
        );
    }
}
