//! Device time of each stage of the GPU backend, the bytes that it must move, and how that compares
//! with the device's copy bandwidth; and the time from points that are on the device to contacts on
//! the host.

#![allow(
    clippy::print_stdout,
    reason = "a bench's table is its output; progress goes to stderr"
)]

use clap::Parser;
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;
use tldi::glamx::Pose3;
use tldi::{Backend, CpuBackend, PairResult, Params, PointCloud, Surface};
use tldi_benches::stored::write_json;
use tldi_benches::times::Times;
use tldi_benches::{BUMP, bumpy_sheet};
use tldi_tests::{Host, aimed};
use tldi_wgpu::{AdapterChoice, Gpu, WgpuBackend, copy_bandwidth};

/// Times the stages of the GPU backend with two sheets of random points in shallow contact.
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
    /// Times that each is measured; medians are reported
    #[arg(long, value_name = "N", default_value_t = 9)]
    repeats: usize,
    /// Give the clouds normals (without, the backend estimates them)
    #[arg(long)]
    normals: bool,
    /// Seed of the points
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Write the rows to this file as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    host: Host,
    adapter: String,
    /// Bytes per second, read plus written, of a copy from buffer to buffer.
    copy_bytes_per_second: f64,
    normals: bool,
    rows: Vec<Row>,
}

#[derive(Serialize)]
struct Row {
    /// Of each cloud.
    points: usize,
    contacts: usize,
    /// From the call to the contacts on the host, clouds on the device.
    resident_ms: f64,
    /// The same with both clouds new.
    uploaded_ms: f64,
    /// The CPU backend with all its threads.
    cpu_ms: f64,
    /// Both clouds read once at the copy bandwidth.
    floor_ms: f64,
    stages: Vec<StageRow>,
}

#[derive(Serialize)]
struct StageRow {
    stage: &'static str,
    /// `None` where the device has no timestamps.
    device_ms: Option<f64>,
    /// What the stage must read and write at least, each element once.
    bytes: u64,
    /// Device time over the time of these bytes at the copy bandwidth.
    floor_ratio: Option<f64>,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    anyhow::ensure!(
        args.repeats > 0 && args.points.iter().all(|n| *n >= 100),
        "at least one repeat and 100 points are needed"
    );
    let gpu = Gpu::of_process(AdapterChoice::Any)?;
    let bandwidth = copy_bandwidth(&gpu)?;
    println!("{}: copies {:.1} GB/s", gpu.adapter(), bandwidth * 1e-9);
    let mut report = Report {
        host: Host::now(),
        adapter: gpu.adapter().to_owned(),
        copy_bytes_per_second: bandwidth,
        normals: args.normals,
        rows: Vec::new(),
    };
    for &points in &args.points {
        let row = measure(&gpu, points, &args, bandwidth)?;
        print(&row);
        report.rows.push(row);
    }
    if let Some(path) = &args.json {
        write_json(path, &report)?;
    }
    Ok(())
}

fn measure(gpu: &Gpu, points: usize, args: &Args, bandwidth: f64) -> anyhow::Result<Row> {
    let cloud = |seed| bumpy_sheet(points, args.normals, seed);
    let (mut a, mut b) = (cloud(args.seed), cloud(args.seed + 1));
    let mut timed = WgpuBackend::new(gpu.clone())?;
    let has_times = timed.measure_stages();
    let (mut plain, mut cpu) = (WgpuBackend::new(gpu.clone())?, CpuBackend::new());
    let mut results = Vec::new();
    for backend in [&mut timed as &mut dyn Backend, &mut plain, &mut cpu] {
        compare(backend, &a, &b, &mut results)?;
    }
    let (mut resident, mut uploaded, mut on_cpu) = (vec![], vec![], vec![]);
    let mut stage_seconds: Vec<Vec<f64>> = Vec::new();
    for repeat in 0..args.repeats as u64 {
        // The plain backend knows the clouds; then they are new.
        resident.push(compare(&mut plain, &a, &b, &mut results)?);
        compare(&mut timed, &a, &b, &mut results)?;
        stage_seconds.push(timed.stage_times().iter().map(|t| t.seconds).collect());
        on_cpu.push(compare(&mut cpu, &a, &b, &mut results)?);
        (a, b) = (
            cloud(args.seed + 2 * repeat + 2),
            cloud(args.seed + 2 * repeat + 3),
        );
        uploaded.push(compare(&mut plain, &a, &b, &mut results)?);
        eprintln!("{points} points: {} of {}", repeat + 1, args.repeats);
    }
    let needed = timed.needed_bytes();
    let stage = |(k, &(stage, bytes)): (usize, &(&'static str, u64))| {
        let seconds = has_times.then(|| Times::of(stage_seconds.iter().map(|all| all[k])).median);
        StageRow {
            stage,
            device_ms: seconds.map(|s| s * 1e3),
            bytes,
            floor_ratio: seconds.map(|s| s * bandwidth / bytes.max(1) as f64),
        }
    };
    Ok(Row {
        points,
        contacts: results[0].contacts.len(),
        resident_ms: Times::of(resident).median * 1e3,
        uploaded_ms: Times::of(uploaded).median * 1e3,
        cpu_ms: Times::of(on_cpu).median * 1e3,
        floor_ms: 32.0 * points as f64 / bandwidth * 1e3,
        stages: needed.iter().enumerate().map(stage).collect(),
    })
}

/// Seconds of one comparison of the sheets, half a bump above each other.
fn compare(
    backend: &mut dyn Backend,
    a: &PointCloud,
    b: &PointCloud,
    results: &mut Vec<PairResult>,
) -> anyhow::Result<f64> {
    let params = Params::for_radius(a.mean_radius());
    let pose = Pose3::translation(0.1, 0.5 * BUMP, 0.0);
    let query = aimed(Surface::Cloud(a), Surface::Cloud(b), pose, params);
    let start = Instant::now();
    backend.compare(&[query], results)?;
    Ok(start.elapsed().as_secs_f64())
}

fn print(row: &Row) {
    println!(
        "\n2 x {} points, {} contact pixels: {:.3} ms on the device's points, {:.3} ms with upload, \
         {:.3} ms on the CPU; reading both once {:.4} ms",
        row.points, row.contacts, row.resident_ms, row.uploaded_ms, row.cpu_ms, row.floor_ms
    );
    println!(
        "{:<16} {:>10} {:>12} {:>8}",
        "stage", "ms", "MiB", "x floor"
    );
    let optional = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.3}"));
    for stage in &row.stages {
        println!(
            "{:<16} {:>10} {:>12.3} {:>8}",
            stage.stage,
            optional(stage.device_ms),
            stage.bytes as f64 / f64::from(1 << 20),
            optional(stage.floor_ratio)
        );
    }
    let sum: f64 = row.stages.iter().filter_map(|s| s.device_ms).sum();
    println!(
        "{:<16} {:>10.3} {:>21} x reading both once",
        "all",
        sum,
        format!("{:.1}", sum / row.floor_ms)
    );
}
