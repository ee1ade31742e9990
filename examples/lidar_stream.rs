//! Sweeps of a laser scanner become a collider that is new ten times a second, and bodies land on it.

use anyhow::{Context, bail, ensure};
use clap::Parser;
use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::process::ExitCode;
use tldi::glamx::Vec3;
use tldi::{KdTree, PointCloud};
use tldi_examples::bodies::NamedCloud;
use tldi_examples::cli::{Common, UpChoice, ended, positive};
use tldi_examples::lidar::{LidarReport, LidarSimulation, Scanner, Sweep, SweepSource};
use tldi_examples::pictures::{self, PICTURE_SIZE};
use tldi_examples::scene::BodyShape;
use tldi_examples::spots::{Demand, Spot, find_spots};
use tldi_examples::{load, output};
use tldi_pictures::{BODY_COLORS, Item, viewpoint};

/// Turns sweeps of a laser scanner into a collider that is new ten times a second, and drops bodies on it
///
/// Without a folder, a scanner drives through a generated street. Ends with 0 if every step was taken and
/// no body fell through, with 1 if not, with 2 if the options cannot be used.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// Folder of KITTI's .bin sweeps with a poses.txt; a generated street if left out
    #[arg(long, value_name = "DIR")]
    sweeps: Option<PathBuf>,
    /// Most sweeps to take
    #[arg(long, value_name = "N", default_value = "30")]
    count: NonZeroUsize,
    /// Direction against gravity in the frame of the poses; auto takes the z axis of the first sweep with points
    #[arg(
        long,
        value_name = "X,Y,Z",
        default_value = "auto",
        allow_hyphen_values = true
    )]
    up: UpChoice,
    /// Points farther from the scanner are left out, metres
    #[arg(long, value_name = "M", default_value_t = 12.0, value_parser = positive)]
    range: f32,
    /// Number of bodies
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u16).range(1..=100))]
    bodies: u16,
    /// Largest extent of a body in metres
    #[arg(long, value_name = "M", default_value_t = 0.8, value_parser = positive)]
    size: f32,
    /// Folder for the picture final.png
    #[arg(long, value_name = "DIR", default_value = "out/lidar_stream")]
    out: PathBuf,
    #[command(flatten)]
    common: Common,
}

/// Distance between the points of a body, as a share of its width.
const BODY_SPACING: f32 = 0.03;
/// Bodies are dropped where rings are close to each other, up to this part of the range.
const NEAR: f32 = 0.6;

fn main() -> ExitCode {
    ended(run(&Args::parse()))
}

fn run(args: &Args) -> anyhow::Result<()> {
    args.common.check_outputs()?;
    let source = match &args.sweeps {
        Some(folder) => SweepSource::open(folder)?,
        None => SweepSource::Generated(Scanner::new(args.count.get(), args.common.seed)),
    };
    let count = source.count().min(args.count.get());
    let [(start, first), (_, last)] = source.ends(count)?;
    if start > 0 {
        eprintln!(
            "warning: the {start} sweeps before {} have no points",
            first.name
        );
    }
    let up = (args.up).or_else(|| first.world_from_scanner.rotation * Vec3::Z);
    let (bodies, spots) = place_bodies(args, up, [&first, &last])?;
    let backend = args.common.backend.open()?;
    let mut simulation = LidarSimulation::new(bodies, &spots, up, args.range, backend)?;
    for index in output::with_progress(start..count, "sweeps") {
        let sweep = source.sweep(index)?;
        (simulation.take(&sweep)).with_context(|| format!("sweep {} failed", sweep.name))?;
    }
    let report = simulation.report();
    output::publish(&report, source.origin(), args.common.json.as_deref())?;
    if !args.common.no_pictures {
        draw(args, &simulation, &report)?;
    }
    let lost = report.bodies.iter().filter(|body| body.lost);
    let lost: Vec<&str> = lost.map(|lost| lost.placed.name.as_str()).collect();
    if !lost.is_empty() {
        bail!("fell through the sweeps: {}", lost.join(", "));
    }
    Ok(())
}

/// Bodies, and places for them that the first and the last sweep with points see: where the scanner drives, it loses
/// sight of the ground.
fn place_bodies(
    args: &Args,
    up: Vec3,
    [first, last]: [&Sweep; 2],
) -> anyhow::Result<(Vec<NamedCloud>, Vec<Spot>)> {
    let (first, last) = (near(args, first)?, near(args, last)?);
    let in_last = KdTree::new(&last);
    let stays = |i: &usize| {
        let nearest = in_last.nearest(first.point(*i), f32::INFINITY);
        nearest.is_some_and(|nearest| nearest.distance() <= last.radius(nearest.index))
    };
    let seen: Vec<usize> = (0..first.len()).filter(stays).collect();
    let seen = load::subset(&first, &seen, |p| p, |radius| radius)
        .context("the first and the last sweep have no place in common")?;
    let (count, seed) = (args.bodies.into(), args.common.seed);
    let bodies = NamedCloud::generated(&BodyShape::ALL, count, BODY_SPACING, args.size, seed)?;
    let demand = Demand {
        count: bodies.len(),
        body_radius: 0.5 * args.size,
        seed,
    };
    let spots = find_spots(&seen, up, &demand)?;
    Ok((bodies, spots))
}

/// What a sweep sees near the scanner, in the frame of the world.
fn near(args: &Args, sweep: &Sweep) -> anyhow::Result<PointCloud<'static>> {
    let near = sweep.within(NEAR * args.range);
    ensure!(
        near.points.iter().any(|point| point.is_finite()),
        "no point of sweep {} is nearer than {} m, a part of --range: is the unit metres?",
        sweep.name,
        NEAR * args.range
    );
    near.cloud(sweep.world_from_scanner)
        .with_context(|| format!("sweep {} has no place for a body", sweep.name))
}

fn draw(args: &Args, simulation: &LidarSimulation, report: &LidarReport) -> anyhow::Result<()> {
    let Some(sweep) = simulation.cloud() else {
        return Ok(());
    };
    let poses = simulation.world_from_body();
    let bodies = pictures::bodies(simulation.clouds(), &poses, &BODY_COLORS);
    let things = std::iter::once(("sweep".to_owned(), Item::scan(sweep))).chain(bodies);
    let scene = pictures::scene(things, Vec3::from_array(report.up), args.size);
    let places: Vec<Vec3> = poses.iter().map(|pose| pose.translation).collect();
    let camera = viewpoint::choose(&scene, &places, PICTURE_SIZE);
    let picture = scene.draw(&camera, &simulation.contacts());
    output::write_pictures(&args.out, [("final.png", Ok(picture))])?;
    eprintln!("the picture is {}", args.out.join("final.png").display());
    Ok(())
}
