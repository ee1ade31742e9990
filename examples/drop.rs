//! Lets point-cloud bodies fall onto a point-cloud scan and come to rest.

use anyhow::{Context, bail};
use clap::Parser;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use tldi::PointCloud;
use tldi::glamx::Vec3;
use tldi_examples::cli::{Common, ended};
use tldi_examples::load::Located;
use tldi_examples::report::DropReport;
use tldi_examples::scan::{ScanSource, choose_up, load_scan, positive};
use tldi_examples::scene::BodyShape;
use tldi_examples::simulation::{DropSimulation, NamedCloud, Snapshot};
use tldi_examples::spots::{Demand, find_spots};
use tldi_examples::world::DT;
use tldi_examples::{load, output};
use tldi_pictures::{BODY_COLORS, Item, Picture, Scene, animation, thinned, viewpoint};

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
/// Radius in mean radii up to which points of the scan are drawn: lone ones, such as a depth
/// camera's flying pixels, have far larger ones and would hide what is behind them.
const LARGEST_DRAWN_RADIUS: f32 = 3.0;
const PICTURE_SIZE: [u32; 2] = [1280, 720];
/// Columns and rows of the animation: a page shows it at this size, and four times the pixels make four times the file.
const ANIMATION_SIZE: [u32; 2] = [640, 360];
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
    let demand = Demand {
        count: bodies.len(),
        body_radius: (bodies.iter())
            .map(|body| load::ball_radius(&body.cloud))
            .fold(0.0, f32::max),
        seed: args.common.seed,
    };
    let spots = find_spots(&scan, up, &demand)?;
    let (seed, backend) = (args.common.seed, args.common.backend.open()?);
    let mut simulation = DropSimulation::new(scan, up, bodies, &spots, seed, backend)?;
    let run = simulate(&mut simulation, args)?;
    let report = simulation.report();
    let json = args.common.json.as_deref();
    output::publish(&report, origin, |out| report.write_table(out), json)?;
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
    let kinds: Vec<(String, PointCloud<'static>)> = match &args.body {
        Some(path) => {
            eprintln!("reading {}", path.display());
            vec![(load::stem(path), load::body_from_file(path)?.cloud)]
        }
        None => (BodyShape::ALL.into_iter())
            .map(|shape| {
                let surface = shape.sample(BODY_SPACING, args.common.seed);
                Ok((shape.name().to_owned(), load::body_from_surface(surface)?))
            })
            .collect::<anyhow::Result<_>>()?,
    };
    let mut bodies = Vec::new();
    for (name, cloud) in kinds {
        let file_size = cloud.bounds().extents().max_element();
        if !(file_size.is_finite() && file_size > 0.0) {
            bail!("the body {name} has no extent: all its points coincide");
        }
        // Generated bodies have no size of their own: an extent that is taken for none.
        let own_size = if args.body.is_some() {
            file_size
        } else {
            f32::INFINITY
        };
        let size = args
            .size
            .unwrap_or_else(|| load::default_size(own_size, scan_radius));
        eprintln!(
            "{name}: {} points, {file_size:.3} in its file, {size:.3} m here",
            cloud.len()
        );
        bodies.push((name, load::resized(&cloud, size)?));
    }
    let count = usize::from(args.count);
    Ok((bodies.iter().cycle().take(count).enumerate())
        .map(|(k, (name, cloud))| NamedCloud {
            name: format!("{name} {}", k + 1),
            cloud: cloud.clone(),
        })
        .collect())
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
    let bar = output::progress_bar(steps, "steps");
    let initial = simulation.snapshot();
    let mut mid = initial.clone();
    let mut motion: Vec<Snapshot> = args.animate.then(|| initial.clone()).into_iter().collect();
    for step in 1..=steps {
        (simulation.step()).with_context(|| format!("step {step} of {steps} failed"))?;
        if step == MID_STEP.min(steps) {
            mid = simulation.snapshot();
        }
        if args.animate && step <= ANIMATION_END && step % ANIMATION_STEPS == 0 {
            motion.push(simulation.snapshot());
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
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
    let clouds = simulation.clouds();
    let radii = clouds.iter().map(|cloud| load::ball_radius(cloud));
    let detail = radii.fold(0.0, f32::max);
    let scan = simulation.scan();
    let most = LARGEST_DRAWN_RADIUS * scan.mean_radius();
    let drawn_scan = thinned(scan, 1, |radius| radius.min(most))?;
    let scene = |snapshot: &Snapshot| {
        let bodies = clouds
            .iter()
            .zip(&snapshot.scan_from_body)
            .zip(BODY_COLORS.iter().cycle());
        let bodies = bodies.map(|((cloud, pose), color)| Item::body(cloud, *pose, *color));
        Scene {
            items: std::iter::once(Item::scan(&drawn_scan))
                .chain(bodies)
                .collect(),
            up,
            detail,
        }
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
    let still_camera = camera(PICTURE_SIZE);
    output::make_folder(folder)?;
    let names = ["initial.png", "mid.png", "final.png"];
    for (snapshot, name) in run.stills.iter().zip(names) {
        let picture = scene(snapshot).draw(&still_camera, &snapshot.contacts);
        output::write_file(&folder.join(name), &picture.to_png()?)?;
    }
    if !run.motion.is_empty() {
        let camera = camera(ANIMATION_SIZE);
        let bar = output::progress_bar(run.motion.len(), "pictures");
        let mut pictures: Vec<Picture> = (run.motion.iter())
            .map(|snapshot| {
                bar.inc(1);
                scene(snapshot).draw(&camera, &snapshot.contacts)
            })
            .collect();
        let last = pictures.last().cloned();
        pictures.extend(std::iter::repeat_n(last, ANIMATION_HOLD).flatten());
        let bytes = animation::to_apng(&pictures, ANIMATION_SECONDS)?;
        output::write_file(&folder.join("motion.png"), &bytes)?;
        bar.finish_and_clear();
    }
    eprintln!("pictures are in {}", folder.display());
    Ok(())
}
