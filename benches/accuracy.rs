//! The paper's accuracy protocol on any mesh: how often the answer from points alone differs from the
//! mesh's own.

#![allow(
    clippy::print_stdout,
    reason = "a bench's table is its output; progress goes to stderr"
)]

use anyhow::{Context, ensure};
use clap::Parser;
use indicatif::ProgressBar;
use serde::Serialize;
use std::path::{Path, PathBuf};
use std::time::Instant;
use tldi::glamx::Vec3;
use tldi::{Backend, PairQuery, PairResult, Params, PointCloud, Surface, View, VirtualCamera};
use tldi_benches::mesh_truth::ExactMesh;
use tldi_benches::protocol::{ALL_CASES, Case, cases, normalised};
use tldi_tests::{Host, standard_normal};
use tldi_wgpu::BackendChoice;

/// Compares two copies of a model at 31 distances and 900 rotations (Radwan, Ohrhallinger, Wimmer,
/// Graphics Interface 2014), from their points alone, with the exact answer of their meshes.
#[derive(Parser)]
struct Args {
    /// A mesh, PLY with faces, also gzipped (a bumpy ball is generated without)
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// An even sample of this many of the 27,900 cases
    #[arg(long, value_name = "N", default_value_t = 930)]
    cases: usize,
    /// Standard deviation of noise on the points, in mean radii, several by commas
    #[arg(long, value_name = "S,S", value_delimiter = ',', default_value = "0")]
    noise: Vec<f32>,
    /// Which methods (may be given several times; both without)
    #[arg(long, value_enum)]
    variant: Vec<VariantChoice>,
    /// Compression of the paper's depth ranges, several by commas
    #[arg(
        long,
        value_name = "R,R",
        value_delimiter = ',',
        default_value = "0.05"
    )]
    rho: Vec<f32>,
    /// Edge of the paper's image in pixels, several by commas
    #[arg(
        long,
        value_name = "N,N",
        value_delimiter = ',',
        default_value = "1024"
    )]
    resolution: Vec<u32>,
    /// Edge of the default's pixels in mean radii, several by commas
    #[arg(long, value_name = "S,S", value_delimiter = ',', default_value = "1")]
    pixel_scale: Vec<f32>,
    /// Where clouds are compared
    #[arg(long, value_name = "auto|cpu|gpu", default_value_t = BackendChoice::Auto)]
    backend: BackendChoice,
    /// Seed of the noise
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Write the rows to this file as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum VariantChoice {
    /// Cylinders, a perspective camera, range overlap: the paper's.
    Paper,
    /// Ours.
    Default,
}

/// One method with its settings.
#[derive(Clone, Copy)]
struct Method {
    name: &'static str,
    /// ρ of the paper.
    rho: Option<f32>,
    /// Edge of the paper's image in pixels.
    resolution: Option<u32>,
    /// Edge of the default's pixels in mean radii.
    pixel_scale: Option<f32>,
}

#[derive(Serialize)]
struct Row {
    model: String,
    points: usize,
    cases: usize,
    variant: &'static str,
    backend: String,
    rho: Option<f32>,
    resolution: Option<u32>,
    pixel_scale: Option<f32>,
    noise: f32,
    false_negative_pct: f64,
    false_positive_pct: f64,
    error_pct: f64,
    /// Of the cases that the mesh says to be collisions.
    colliding_pct: f64,
    /// How far, along x, the copies of the worst false negative must be moved apart until the
    /// meshes are free of each other, in mean radii: at least its depth.
    worst_false_negative_mean_radii: f32,
    median_ms: f64,
}

#[derive(Serialize)]
struct Report {
    #[serde(flatten)]
    host: Host,
    rows: Vec<Row>,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    ensure!(args.cases > 0, "at least one case is needed");
    ensure!(
        args.noise.iter().all(|s| s.is_finite() && *s >= 0.0),
        "noise is a standard deviation: it must be finite and not negative"
    );
    ensure!(
        args.pixel_scale.iter().all(|s| s.is_finite() && *s > 0.0)
            && args.rho.iter().all(|r| (0.0..=1.0).contains(r))
            && args.resolution.iter().all(|n| (16..=8192).contains(n)),
        "pixel scales must be positive, rho within 0 and 1, resolutions within 16 and 8192"
    );
    let (name, points, faces) = model(args.model.as_deref())?;
    let points = normalised(&points);
    let mesh = ExactMesh::new(&points, &faces);
    let all: Vec<Case> = cases(args.cases).collect();
    let progress = ProgressBar::new(all.len() as u64).with_message("truth");
    let truth: Vec<bool> = progress
        .wrap_iter(all.iter())
        .map(|case| mesh.intersects(&mesh, &case.a_from_b))
        .collect();
    progress.finish_and_clear();
    let mut backend = args.backend.open()?;
    let mut report = Report {
        host: Host::now(),
        rows: Vec::new(),
    };
    println!(
        "{name}: {} points, {} of {ALL_CASES} cases\n{:<8} {:>5} {:>6} {:>6} {:>6} {:>8} {:>8} {:>8} {:>10} {:>9}",
        points.len(),
        all.len(),
        "variant",
        "rho",
        "pixels",
        "scale",
        "noise",
        "FN %",
        "FP %",
        "error %",
        "worst FN r",
        "median ms"
    );
    for &noise in &args.noise {
        let clouds = [0, 1].map(|k| noisy(&points, noise, args.seed + k));
        let [a, b] = match clouds {
            [Ok(a), Ok(b)] => [a, b],
            [Err(e), _] | [_, Err(e)] => return Err(e),
        };
        for method in methods(&args) {
            let row = measure(
                &mut *backend,
                [&a, &b],
                &mesh,
                &all,
                &truth,
                method,
                noise,
                &name,
            )?;
            print(&row);
            report.rows.push(row);
        }
    }
    if let Some(path) = &args.json {
        let text = serde_json::to_string_pretty(&report)?;
        std::fs::write(path, text + "\n")
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}

/// Name, points and faces of the model.
fn model(path: Option<&Path>) -> anyhow::Result<(String, Vec<Vec3>, Vec<[u32; 3]>)> {
    let Some(path) = path else {
        let (points, faces) = tldi_benches::bumpy_ball(20_000);
        return Ok(("bumpy ball (generated)".to_owned(), points, faces));
    };
    let raw = tldi_sources::read(path, &tldi_sources::ReadOptions::default())?;
    ensure!(
        !raw.faces.is_empty(),
        "{} has no faces: the truth needs a mesh",
        path.display()
    );
    let name = path
        .file_name()
        .map_or_else(String::new, |n| n.to_string_lossy().into_owned());
    Ok((name, raw.points, raw.faces))
}

/// The points with noise of σ = `noise` mean radii on every coordinate, and radii of their own.
fn noisy(points: &[Vec3], noise: f32, seed: u64) -> anyhow::Result<PointCloud<'static>> {
    let clean = PointCloud::builder(points.to_vec())
        .knn_radii(7, 0.65)
        .build()?;
    if noise == 0.0 {
        return Ok(clean);
    }
    let mut rng = fastrand::Rng::with_seed(seed);
    let sigma = noise * clean.mean_radius();
    let mut normal = || sigma * standard_normal(&mut rng);
    let moved: Vec<Vec3> = points
        .iter()
        .map(|p| *p + Vec3::new(normal(), normal(), normal()))
        .collect();
    Ok(PointCloud::builder(moved).knn_radii(7, 0.65).build()?)
}

fn methods(args: &Args) -> Vec<Method> {
    let has = |v| args.variant.is_empty() || args.variant.contains(&v);
    let mut all = Vec::new();
    if has(VariantChoice::Paper) {
        for &rho in &args.rho {
            all.extend(args.resolution.iter().map(|&resolution| Method {
                name: "paper",
                rho: Some(rho),
                resolution: Some(resolution),
                pixel_scale: None,
            }));
        }
    }
    if has(VariantChoice::Default) {
        all.extend(args.pixel_scale.iter().map(|&scale| Method {
            name: "default",
            rho: None,
            resolution: None,
            pixel_scale: Some(scale),
        }));
    }
    all
}

/// A case as the method compares it.
fn query<'a>(a: &'a PointCloud, b: &'a PointCloud, case: &Case, method: Method) -> PairQuery<'a> {
    let radius = a.mean_radius();
    let (view, params) = match method.resolution {
        Some(pixels) => {
            // The paper's camera.
            let camera = VirtualCamera::perspective(
                4.0 * Vec3::Z,
                Vec3::ZERO,
                Vec3::Y,
                std::f32::consts::FRAC_PI_2,
                [pixels; 2],
                1.0,
                6.0,
            );
            let params = Params {
                rho: method.rho.unwrap_or(0.05),
                ..Params::paper(radius)
            };
            (View::Fixed(camera), params)
        }
        None => {
            let pixel = method.pixel_scale.unwrap_or(1.0) * radius;
            (
                View::aimed(),
                Params::for_radius(radius).with_pixel_size(pixel),
            )
        }
    };
    PairQuery {
        a: Surface::Cloud(a),
        b: Surface::Cloud(b),
        a_from_b: case.a_from_b,
        view,
        params,
    }
}

#[allow(clippy::too_many_arguments, reason = "one call, of one place")]
fn measure(
    backend: &mut dyn Backend,
    [a, b]: [&PointCloud; 2],
    mesh: &ExactMesh,
    all: &[Case],
    truth: &[bool],
    method: Method,
    noise: f32,
    model: &str,
) -> anyhow::Result<Row> {
    let mut results: Vec<PairResult> = Vec::new();
    let (mut missed, mut invented, mut worst) = (0, 0, 0.0f32);
    let mut seconds = Vec::new();
    let progress = ProgressBar::new(all.len() as u64).with_message(method.name);
    for (case, &collides) in progress.wrap_iter(all.iter().zip(truth)) {
        let query = query(a, b, case, method);
        let start = Instant::now();
        backend.compare(&[query], &mut results)?;
        seconds.push(start.elapsed().as_secs_f64());
        if collides && !results[0].collides {
            missed += 1;
            worst = worst.max(way_out(mesh, case) / a.mean_radius());
        }
        invented += usize::from(!collides && results[0].collides);
    }
    progress.finish_and_clear();
    seconds.sort_unstable_by(f64::total_cmp);
    let share = |count: usize| 100.0 * count as f64 / all.len() as f64;
    Ok(Row {
        model: model.to_owned(),
        points: a.len(),
        cases: all.len(),
        variant: method.name,
        backend: backend.name().to_owned(),
        rho: method.rho,
        resolution: method.resolution,
        pixel_scale: method.pixel_scale,
        noise,
        false_negative_pct: share(missed),
        false_positive_pct: share(invented),
        error_pct: share(missed + invented),
        colliding_pct: share(truth.iter().filter(|t| **t).count()),
        worst_false_negative_mean_radii: worst,
        median_ms: seconds[seconds.len() / 2] * 1e3,
    })
}

/// Distance along x after which the meshes of a case are free of each other, within a thousandth.
fn way_out(mesh: &ExactMesh, case: &Case) -> f32 {
    let (mut inside, mut outside) = (0.0, 0.05);
    let meets = |x: f32| {
        let mut pose = case.a_from_b;
        pose.translation.x += x;
        mesh.intersects(mesh, &pose)
    };
    while meets(outside) && outside < 4.0 {
        (inside, outside) = (outside, 2.0 * outside);
    }
    while outside - inside > 1e-3 * outside {
        let middle = 0.5 * (inside + outside);
        if meets(middle) {
            inside = middle;
        } else {
            outside = middle;
        }
    }
    outside
}

fn print(row: &Row) {
    let optional = |value: Option<String>| value.unwrap_or_else(|| "-".to_owned());
    println!(
        "{:<8} {:>5} {:>6} {:>6} {:>6} {:>8.3} {:>8.3} {:>8.3} {:>10.3} {:>9.3}",
        row.variant,
        optional(row.rho.map(|v| v.to_string())),
        optional(row.resolution.map(|v| v.to_string())),
        optional(row.pixel_scale.map(|v| v.to_string())),
        row.noise,
        row.false_negative_pct,
        row.false_positive_pct,
        row.error_pct,
        row.worst_false_negative_mean_radii,
        row.median_ms
    );
}
