//! Lets point-cloud bodies fall onto a point-cloud scan and come to rest.

use anyhow::{Context, bail};
use clap::Parser;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use tldi::VirtualCamera;
use tldi::glamx::Vec3;
use tldi_examples::bodies::NamedCloud;
use tldi_examples::cli::{Common, ended, positive};
use tldi_examples::drop::{DropReport, DropSimulation, Snapshot};
use tldi_examples::load::Located;
use tldi_examples::pictures::{self, ANIMATION_SIZE, PICTURE_SIZE};
use tldi_examples::scan::{ScanSource, choose_up, load_scan};
use tldi_examples::scene::BodyShape;
use tldi_examples::spots::{Demand, find_spots};
use tldi_examples::world::DT;
use tldi_examples::{load, output};
use tldi_pictures::{BODY_COLORS, Item, viewpoint};

/// Lets point-cloud bodies fall onto a point-cloud scan and come to rest
///
/// Without files, a generated room and generated bodies are used. Ends with 0 if every step was
/// taken and no body left the scan, with 1 if not, with 2 if the options cannot be used.
#[derive(Parser)]
#[command(version)]
struct Args {
    #[command(flatten)]
    source: ScanSource,
    /// Body to drop, its y axis up; generated shapes if left out
    #[arg(long, value_name = "FILE")]
    body: Option<PathBuf>,
    /// Number of bodies
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(1..=1000))]
    count: u16,
    /// Largest extent of a body in metres; if left out, as in the file where that is plausible
    #[arg(long, value_name = "M", value_parser = positive, allow_hyphen_values = true)]
    size: Option<f32>,
    /// Number of steps of 1/60 s
    #[arg(long, value_name = "N", default_value_t = 300)]
    steps: usize,
    /// Folder for initial.png, mid.png and final.png (and motion.png)
    #[arg(long, value_name = "DIR", default_value = "out/drop")]
    out: PathBuf,
    /// Writes motion.png, too: the fall at half speed, an animated PNG
    #[arg(long, conflicts_with = "no_pictures")]
    animate: bool,
    #[command(flatten)]
    common: Common,
}

/// Distance between the points of a generated body, as a share of its width.
const BODY_SPACING: f32 = 0.025;
/// The step in which `mid.png` is made: bodies have just landed.
const MID_STEP: usize = 15;
/// Steps from one picture of the animation to the next. One doubles the file, four jump while bodies fall.
const ANIMATION_STEPS: usize = 2;
/// Steps that the animation shows: bodies fall for 15 to 20, and rock for as many again.
const ANIMATION_END: usize = 90;
/// Seconds for which a picture of the animation is shown: half speed, since a fall takes a quarter of a second.
const ANIMATION_SECONDS: f32 = 2.0 * ANIMATION_STEPS as f32 * DT;
/// How often the last picture is repeated, so that one sees where bodies end: a second and a half.
const ANIMATION_HOLD: usize = 22;

fn main() -> ExitCode {
    ended(run(&Args::parse()))
}

fn run(args: &Args) -> anyhow::Result<()> {
    args.common.check_outputs()?;
    let Located {
        cloud: scan,
        origin,
    } = load_scan(&args.source, args.common.seed)?;
    let up = choose_up(args.source.up, &scan);
    let bodies = load_bodies(args, scan.mean_radius())?;
    let spots = find_spots(&scan, up, &Demand::of(&bodies, args.common.seed))?;
    let (seed, backend) = (args.common.seed, args.common.backend.open()?);
    let mut simulation = DropSimulation::new(scan, up, bodies, &spots, seed, backend)?;
    let run = simulate(&mut simulation, args)?;
    let report = simulation.report();
    output::publish(&report, origin, args.common.json.as_deref())?;
    if !args.common.no_pictures {
        draw(&simulation, &report, up, &run, &args.out)?;
    }
    let lost: Vec<&str> = report.lost().collect();
    if !lost.is_empty() {
        bail!("fell out of the scan: {}", lost.join(", "));
    }
    Ok(())
}

fn load_bodies(args: &Args, scan_radius: f32) -> anyhow::Result<Vec<NamedCloud>> {
    let mut kinds = match &args.body {
        Some(path) => {
            eprintln!("reading {}", path.display());
            let (name, cloud) = (load::stem(path), load::body_from_file(path)?.cloud);
            vec![NamedCloud { name, cloud }]
        }
        None => (BodyShape::ALL.into_iter())
            .map(|shape| {
                let surface = shape.sample(BODY_SPACING, args.common.seed);
                let (name, cloud) = (shape.name().to_owned(), load::body_from_surface(surface)?);
                Ok(NamedCloud { name, cloud })
            })
            .collect::<anyhow::Result<_>>()?,
    };
    for NamedCloud { name, cloud } in &mut kinds {
        let file_size = cloud.bounds().extents().max_element();
        if !(file_size.is_finite() && file_size > 0.0) {
            bail!("the body {name} has no extent: all its points coincide");
        }
        // Generated bodies have no size of their own: an extent that is taken for none.
        let own_size = match args.body {
            Some(_) => file_size,
            None => f32::INFINITY,
        };
        let default_size = || load::default_size(own_size, scan_radius);
        let size = args.size.unwrap_or_else(default_size);
        let of_file = match args.body {
            Some(_) => format!(" {file_size:.3} in its file,"),
            None => String::new(),
        };
        eprintln!("{name}: {} points,{of_file} {size:.3} m here", cloud.len());
        *cloud = load::resized(cloud, size)?;
    }
    let numbered = |(k, NamedCloud { name, cloud }): (usize, &NamedCloud)| NamedCloud {
        name: format!("{name} {}", k + 1),
        cloud: cloud.clone(),
    };
    let all = kinds.iter().cycle().take(args.count.into());
    Ok(all.enumerate().map(numbered).collect())
}

/// What is drawn of a run.
struct Run {
    /// Before the first step, after [`MID_STEP`] and after the last.
    stills: [Snapshot; 3],
    /// After every [`ANIMATION_STEPS`], up to [`ANIMATION_END`]; empty if no animation is asked for.
    motion: Vec<Snapshot>,
}

/// Takes all steps.
fn simulate(simulation: &mut DropSimulation, args: &Args) -> anyhow::Result<Run> {
    let steps = args.steps;
    let initial = simulation.snapshot();
    let mut mid = initial.clone();
    let mut motion: Vec<Snapshot> = args.animate.then(|| initial.clone()).into_iter().collect();
    for step in output::with_progress(1..=steps, "steps") {
        (simulation.step()).with_context(|| format!("step {step} of {steps} failed"))?;
        if step == MID_STEP.min(steps) {
            mid = simulation.snapshot();
        }
        if args.animate && step <= ANIMATION_END && step % ANIMATION_STEPS == 0 {
            motion.push(simulation.snapshot());
        }
    }
    Ok(Run {
        stills: [initial, mid, simulation.snapshot()],
        motion,
    })
}

fn draw(
    simulation: &DropSimulation,
    report: &DropReport,
    up: Vec3,
    run: &Run,
    folder: &Path,
) -> anyhow::Result<()> {
    let radii = simulation.clouds().map(load::ball_radius);
    let detail = radii.fold(0.0, f32::max);
    let scan = pictures::drawable(simulation.scan())?;
    let scene = |snapshot: &Snapshot| {
        let scan = ("scan".to_owned(), Item::scan(&scan));
        let clouds = simulation.clouds();
        let bodies = pictures::bodies(clouds, &snapshot.scan_from_body, &BODY_COLORS);
        pictures::scene(std::iter::once(scan).chain(bodies), up, detail)
    };
    let picture = |snapshot: &Snapshot, camera: &VirtualCamera| {
        Ok(scene(snapshot).draw(camera, &snapshot.contacts))
    };
    // A body that was lost is looked for where it started, not where it fell to.
    let [initial, _, last] = &run.stills;
    let mut in_sight = last.clone();
    for (k, body) in report.bodies.iter().enumerate() {
        if !body.inside_bounds {
            in_sight.scan_from_body[k] = initial.scan_from_body[k];
        }
    }
    let starts: Vec<Vec3> = (initial.scan_from_body.iter())
        .map(|pose| pose.translation)
        .collect();
    let camera = |size| viewpoint::choose(&scene(&in_sight), &starts, size);
    let large = camera(PICTURE_SIZE);
    let stills = run.stills.iter().map(|snapshot| picture(snapshot, &large));
    let names = ["initial.png", "mid.png", "final.png"];
    output::write_pictures(folder, names.into_iter().zip(stills))?;
    if !run.motion.is_empty() {
        let small = camera(ANIMATION_SIZE);
        let pictures = run.motion.iter().map(|snapshot| picture(snapshot, &small));
        output::write_animation(folder, ANIMATION_SECONDS, ANIMATION_HOLD, pictures)?;
    }
    eprintln!("pictures are in {}", folder.display());
    Ok(())
}
