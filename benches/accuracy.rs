//! The paper's accuracy protocol on any mesh: how often the answer from points alone differs from the
//! mesh's own.

#![allow(
    clippy::print_stdout,
    reason = "a bench's table is its output; progress goes to stderr"
)]

use anyhow::{Context, ensure};
use clap::Parser;
use indicatif::ProgressBar;
use std::path::PathBuf;
use tldi::glamx::Vec3;
use tldi::{CpuBackend, PointCloud};
use tldi_benches::accuracy::{Contender, Copies, TOLD, Truth, measure};
use tldi_benches::args::{NameArgs, RunArgs};
use tldi_benches::mesh_truth::ExactMesh;
use tldi_benches::model::Model;
use tldi_benches::peers::{Frame, Method, TldiPeer, adapter, all_peers};
use tldi_benches::protocol::{ALL_CASES, Case, cases};
use tldi_benches::stored::{AccuracyRow, Provenance};
use tldi_tests::standard_normal;
use tldi_wgpu::BackendChoice;

/// Compares two copies of a model at 31 distances and 900 rotations (Radwan, Ohrhallinger, Wimmer,
/// Graphics Interface 2014), from their points alone, with the exact answer of their meshes.
#[derive(Parser)]
struct Args {
    /// A mesh, PLY with faces, also gzipped (a bumpy ball is generated without)
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Split every face into four, so many times (at most 5): the same surface with four times the points each
    #[arg(long, value_name = "N", default_value_t = 0)]
    subdivide: u32,
    /// An even sample of this many of the 27,900 cases
    #[arg(long, value_name = "N", default_value_t = 930)]
    cases: usize,
    /// Standard deviation of noise on the points, in mean radii, several by commas
    #[arg(long, value_name = "S,S", value_delimiter = ',', default_value = "0")]
    noise: Vec<f32>,
    /// Which methods (may be given several times; paper and default without)
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
    /// Factor of the points' radii for the paper and the default (splat scale), several by commas
    #[arg(long, value_name = "S,S", value_delimiter = ',', default_value = "1")]
    radius_scale: Vec<f32>,
    /// Peers' radii of balls and half edges of voxels in mean radii, several by commas
    #[arg(
        long,
        value_name = "S,S",
        value_delimiter = ',',
        default_value = "0.15,0.25,0.35,0.5,0.7,1"
    )]
    peer_radius: Vec<f32>,
    #[command(flatten)]
    names: NameArgs,
    /// Where clouds are compared, on one thread
    #[arg(long, value_name = "auto|cpu|gpu", default_value_t = BackendChoice::Cpu)]
    backend: BackendChoice,
    /// Folder in which the truth of each mesh is kept, so that it is tested once
    #[arg(long, value_name = "DIR", default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/../target/truth"))]
    truth: PathBuf,
    #[command(flatten)]
    run: RunArgs,
}

#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum VariantChoice {
    /// Cylinders, a perspective camera, range overlap: the paper's.
    Paper,
    /// Ours.
    Default,
    /// Ours, told how large the noise is.
    Told,
    /// What a user would pick instead, with every radius.
    Peers,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    check(&args)?;
    let model = match &args.model {
        Some(path) => Model::read(path)?,
        None => Model::generated(20_000),
    };
    ensure!(
        !model.faces.is_empty(),
        "{} has no faces: the truth needs a mesh",
        model.name
    );
    let mesh = ExactMesh::new(&model.points, &model.faces);
    let all: Vec<Case> = cases(args.cases).collect();
    let mut kept = Truth::open(&args.truth, &model);
    let progress = ProgressBar::new(all.len() as u64).with_message("truth");
    let truth: Vec<bool> = progress
        .wrap_iter(all.iter())
        .map(|case| kept.of(case, &mesh))
        .collect();
    progress.finish_and_clear();
    kept.save()
        .with_context(|| format!("cannot keep the truth in {}", args.truth.display()))?;
    let model = model.subdivided(args.subdivide);
    print_head(&model, all.len());
    let mut rows = Vec::new();
    let mut provenance = Provenance::now(None);
    for &noise in &args.noise {
        let a = noisy(&model.points, noise, args.run.seed)?;
        let b = noisy(&model.points, noise, args.run.seed + 1)?;
        let copies = Copies {
            model: &model,
            clouds: [&a, &b],
            noise,
        };
        let mut contenders = contenders(&args, &model, a.noise())?;
        let progress = ProgressBar::new(all.len() as u64).with_message("cases");
        let measured = measure(&mut contenders, &copies, &mesh, &all, &truth, || {
            progress.inc(1);
        });
        progress.finish_and_clear();
        measured.iter().for_each(print);
        rows.extend(measured);
        let peers = contenders.iter().map(|contender| &*contender.peer);
        provenance.adapter = adapter(peers).or(provenance.adapter);
    }
    args.run.store(provenance, rows)?;
    Ok(())
}

fn check(args: &Args) -> anyhow::Result<()> {
    let are_positive = |all: &[f32]| all.iter().all(|s| s.is_finite() && *s > 0.0);
    ensure!(args.cases > 0, "at least one case is needed");
    ensure!(
        args.subdivide <= 5,
        "--subdivide is at most 5: every time there are four times as many points"
    );
    ensure!(
        args.noise.iter().all(|s| s.is_finite() && *s >= 0.0),
        "noise is a standard deviation: it must be finite and not negative"
    );
    ensure!(
        are_positive(&args.pixel_scale)
            && are_positive(&args.radius_scale)
            && are_positive(&args.peer_radius),
        "pixel scales, radius scales and peers' radii must be positive"
    );
    ensure!(
        args.rho.iter().all(|r| (0.0..=1.0).contains(r))
            && args.resolution.iter().all(|n| (16..=8192).contains(n)),
        "rho must be within 0 and 1, resolutions within 16 and 8192"
    );
    // The last of a sweep must not end what others have measured.
    let only_told = |&variant: &VariantChoice| variant == VariantChoice::Told;
    ensure!(
        args.variant.is_empty()
            || !args.variant.iter().all(only_told)
            || args.noise.iter().all(|s| *s > 0.0),
        "--variant told needs noise above 0 in all of --noise: else there is nothing to tell"
    );
    Ok(())
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
    let builder = PointCloud::builder(moved).knn_radii(7, 0.65);
    Ok(builder.noise(sigma).build()?)
}

/// Every method with every of its settings; `noise` is the standard deviation that some get, metres.
fn contenders(args: &Args, model: &Model, noise: f32) -> anyhow::Result<Vec<Contender>> {
    let has = |choice| match args.variant.is_empty() {
        true => matches!(choice, VariantChoice::Paper | VariantChoice::Default),
        false => args.variant.contains(&choice),
    };
    let mut all = Vec::new();
    if has(VariantChoice::Paper) {
        all.extend(of_paper(args)?);
    }
    if has(VariantChoice::Default) {
        all.extend(ours(args, "default", 0.0)?);
    }
    // Without noise there is nothing to tell.
    if has(VariantChoice::Told) && noise > 0.0 {
        all.extend(ours(args, TOLD, noise)?);
    }
    if has(VariantChoice::Peers) {
        all.extend(peers(args, model));
    }
    ensure!(
        !all.is_empty(),
        "no peer is left: of --only and --without, which choose among peers alone"
    );
    Ok(all)
}

fn of_paper(args: &Args) -> anyhow::Result<Vec<Contender>> {
    let mut all = Vec::new();
    for &rho in &args.rho {
        for &resolution in &args.resolution {
            for &scale in &args.radius_scale {
                // No other backend has this variant.
                let backend = Box::new(CpuBackend::new());
                let peer = TldiPeer::new(backend, Method::Paper { rho, resolution }, 1)?;
                all.push(Contender {
                    variant: "paper".to_owned(),
                    rho: Some(rho),
                    resolution: Some(resolution),
                    ..Contender::new(Box::new(peer), Some(scale))
                });
            }
        }
    }
    Ok(all)
}

/// The default, told noise of that standard deviation, metres.
fn ours(args: &Args, variant: &str, noise: f32) -> anyhow::Result<Vec<Contender>> {
    let mut all = Vec::new();
    for &pixel_scale in &args.pixel_scale {
        for &scale in &args.radius_scale {
            all.push(Contender {
                variant: variant.to_owned(),
                radius_scale: Some(scale),
                ..Contender::ours(args.backend.open()?, pixel_scale, noise)?
            });
        }
    }
    Ok(all)
}

fn peers(args: &Args, model: &Model) -> Vec<Contender> {
    let frame = Frame {
        faces: Some([&model.faces, &model.faces]),
        ..Frame::new(&model.points, &model.points, 1.0)
    };
    let taken = |scale: Option<f32>| {
        let peers = all_peers().into_iter();
        peers
            .filter(|peer| peer.takes(&frame) && args.names.take(&peer.name()))
            // Meshes have no radius to be tuned.
            .filter(|peer| peer.needs_faces() == scale.is_none())
            .map(|peer| Contender::new(peer, scale))
            .collect::<Vec<_>>()
    };
    let scales = args.peer_radius.iter().copied().map(Some);
    scales.chain([None]).flat_map(taken).collect()
}

fn print_head(model: &Model, cases: usize) {
    println!(
        "{}: {} points, {cases} of {ALL_CASES} cases, one thread",
        model.name,
        model.points.len(),
    );
    println!(
        "{:<32} {:>5} {:>6} {:>6} {:>6} {:>6} {:>8} {:>8} {:>8} {:>10} {:>9}",
        "variant",
        "rho",
        "image",
        "pixel",
        "radius",
        "noise",
        "FN %",
        "FP %",
        "error %",
        "worst FN r",
        "median ms"
    );
}

fn print(row: &AccuracyRow) {
    let optional = |value: Option<String>| value.unwrap_or_else(|| "-".to_owned());
    println!(
        "{:<32} {:>5} {:>6} {:>6} {:>6} {:>6} {:>8.3} {:>8.3} {:>8.3} {:>10.3} {:>9.3}",
        row.variant,
        optional(row.rho.map(|v| v.to_string())),
        optional(row.resolution.map(|v| v.to_string())),
        optional(row.pixel_scale.map(|v| v.to_string())),
        optional(row.radius_scale.map(|v| v.to_string())),
        row.noise,
        row.false_negative_pct,
        row.false_positive_pct,
        row.error_pct,
        row.worst_false_negative_mean_radii,
        row.median_ms
    );
}
