//! How well methods find normals and depths of contacts, and how long it takes: ours, and what a user would
//! pick instead.

#![allow(
    clippy::print_stdout,
    reason = "a bench's table is its output; progress goes to stderr"
)]

use anyhow::ensure;
use clap::Parser;
use indicatif::ProgressBar;
use tldi_benches::accuracy::Contender;
use tldi_benches::args::RunArgs;
use tldi_benches::contact_quality::{Plan, measure};
use tldi_benches::peers::{Culled, Grid, Peer, TriMeshPeer, VoxelsRebuild, adapter};
use tldi_benches::stored::{ContactRow, Provenance};
use tldi_tests::{ContactPair, Regime};
use tldi_wgpu::BackendChoice;

/// Compares clouds of spheres, boxes and ramps without normals, all of whose points are new, with the
/// true normal and depth of their contact, by every method that tells its deepest contact.
#[derive(Parser)]
struct Args {
    /// Contacts for each pair of shapes and depth range
    #[arg(long, value_name = "N", default_value_t = 51)]
    cases: usize,
    /// Edge of the default's pixels in radii, several by commas
    #[arg(
        long,
        value_name = "S,S",
        value_delimiter = ',',
        default_value = "0.7,1,1.5,2,3"
    )]
    pixel_scale: Vec<f32>,
    /// Peers' radii of balls and half edges of voxels in units of the spacing, several by commas
    #[arg(
        long,
        value_name = "S,S",
        value_delimiter = ',',
        default_value = "0.25,0.35,0.5,0.7,1"
    )]
    peer_radius: Vec<f32>,
    /// Tell no method how the bodies move
    #[arg(long)]
    without_motion: bool,
    /// Where clouds are compared, on one thread
    #[arg(long, value_name = "auto|cpu|gpu", default_value_t = BackendChoice::Cpu)]
    backend: BackendChoice,
    #[command(flatten)]
    run: RunArgs,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let scales = || args.pixel_scale.iter().chain(&args.peer_radius);
    ensure!(args.cases > 0, "at least one case is needed");
    ensure!(
        scales().all(|s| s.is_finite() && *s > 0.0),
        "pixel scales and peers' radii must be positive"
    );
    let mut contenders = contenders(&args)?;
    let count = Regime::ALL.len() * ContactPair::ALL.len() * args.cases;
    let progress = ProgressBar::new(count as u64);
    let plan = Plan {
        pairs: &ContactPair::ALL,
        cases: args.cases,
        seed: args.run.seed,
        tells_motion: !args.without_motion,
    };
    let rows = measure(&mut contenders, &plan, || progress.inc(1));
    progress.finish_and_clear();
    print(&rows);
    let adapter = adapter(contenders.iter().map(|contender| &*contender.peer));
    args.run.store(Provenance::now(adapter), rows)?;
    Ok(())
}

/// Every method with every of its settings.
fn contenders(args: &Args) -> anyhow::Result<Vec<Contender>> {
    let mut all = Vec::new();
    for &pixel_scale in &args.pixel_scale {
        all.push(Contender::ours(args.backend.open()?, pixel_scale, 0.0)?);
    }
    let mut add = |peer: Box<dyn Peer>, scale| all.push(Contender::new(peer, scale));
    for &scale in &args.peer_radius {
        add(Box::new(Culled::new(Grid::telling_deepest())), Some(scale));
        add(Box::new(Culled::new(VoxelsRebuild::default())), Some(scale));
    }
    add(Box::new(Culled::new(TriMeshPeer::rebuilt())), None);
    add(Box::new(Culled::new(TriMeshPeer::outward())), None);
    Ok(all)
}

fn print(rows: &[ContactRow]) {
    println!(
        "{:<15} {:<8} {:<40} {:>5} {:>6} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>9}",
        "pair",
        "regime",
        "variant",
        "pixel",
        "radius",
        "missed %",
        "> 90° %",
        "normal °",
        "95 %",
        "depth r",
        "95 %",
        "median ms"
    );
    let scale = |value: Option<f32>| value.map_or_else(|| "-".to_owned(), |v| v.to_string());
    let error = |value: Option<f64>| value.map_or_else(|| "inf".to_owned(), |v| format!("{v:.3}"));
    for row in rows {
        println!(
            "{:<15} {:<8} {:<40} {:>5} {:>6} {:>8.1} {:>8.1} {:>8} {:>8} {:>8} {:>8} {:>9.3}",
            row.pair.map_or("all", ContactPair::name),
            row.regime.name(),
            row.variant,
            scale(row.pixel_scale),
            scale(row.radius_scale),
            row.missed_pct,
            row.wrong_side_pct,
            error(row.normal_median_deg),
            error(row.normal_p95_deg),
            error(row.depth_median_radii),
            error(row.depth_p95_radii),
            row.median_ms
        );
    }
}
