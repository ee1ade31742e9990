//! A deforming cloud gallops over ground that deforms as well.

use anyhow::{Context, bail};
use clap::Parser;
use std::path::PathBuf;
use std::process::ExitCode;
use tldi::glamx::{DVec3, Vec3};
use tldi::{KdTree, PointCloud, VirtualCamera};
use tldi_examples::cli::{Common, UpChoice, ended, positive};
use tldi_examples::gallop::{
    GallopScene, GallopSimulation, GallopSnapshot, Runner, WavyGround, creature,
};
use tldi_examples::output;
use tldi_examples::pictures::{self, ANIMATION_SIZE, Entity, PICTURE_SIZE};
use tldi_examples::recording::{RecordedCamera, Recording, RecordingOption};
use tldi_examples::world::DT;
use tldi_pictures::{BODY_COLORS, Item, painted};
use tldi_sources::{MovingPoints, ReadOptions};

/// A deforming cloud gallops over ground that deforms as well
///
/// Frames are interpolated in time; the last one leads into the first. It runs against the way that
/// its lowest points go, and is red where it touches. Without files, a generated creature is used.
/// Ends with 0 if every step was taken, with 1 if not, with 2 if the options cannot be used.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// Positions: a NumPy array of frames × points × 3 (.npy, .npy.gz) or a folder with a cloud for
    /// each frame, in order of the numbers in their names
    #[arg(long, value_name = "FILE|DIR")]
    frames: Option<PathBuf>,
    /// A mesh with the faces that connect the points (PLY, also as .gz): exact normals
    #[arg(long, value_name = "FILE", requires = "frames")]
    faces: Option<PathBuf>,
    /// Largest extent in metres
    #[arg(long, value_name = "M", default_value_t = 2.0, value_parser = positive, allow_hyphen_values = true)]
    size: f32,
    /// Seconds of a cycle
    #[arg(long, value_name = "S", default_value_t = 0.8, value_parser = positive, allow_hyphen_values = true)]
    cycle: f32,
    /// Speed in m/s; if left out, that of its feet
    #[arg(long, value_name = "V", value_parser = positive, allow_hyphen_values = true)]
    speed: Option<f32>,
    /// Direction against gravity in the frames; auto is y
    #[arg(
        long,
        value_name = "X,Y,Z",
        default_value = "auto",
        allow_hyphen_values = true
    )]
    up: UpChoice,
    /// Number of loose bodies in its way
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u16).range(0..=100))]
    bodies: u16,
    /// Number of steps of 1/60 s; if left out, as long as the run takes, at most 600
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Folder for initial.png, mid.png and final.png
    #[arg(long, value_name = "DIR", default_value = "out/gallop")]
    out: PathBuf,
    /// Also write motion.png, an animated PNG
    #[arg(long, conflicts_with = "no_pictures")]
    animate: bool,
    #[command(flatten)]
    recording: RecordingOption,
    #[command(flatten)]
    common: Common,
}

/// Half the length and half the width of the ground, its waves' height and length, in sizes of what
/// runs.
const GROUND_SIZE: [f32; 2] = [2.6, 0.8];
const WAVE_HEIGHT: f32 = 0.025;
const WAVE_LENGTH: f32 = 0.9;
/// Seconds of an oscillation of the ground.
const WAVE_PERIOD: f32 = 1.6;
/// Points of the ground along the size of what runs.
const GROUND_POINTS: f32 = 64.0;
/// Speed in sizes a second of what does not get anywhere by its feet.
const LEAST_SPEED: f32 = 0.6;
const MOST_STEPS: usize = 600;
/// Distance from a contact up to which it is tinted, as a share of its size.
const TINTED: f32 = 0.06;
const SKIN: [f32; 3] = [166.0, 122.0, 84.0];
const TINT: [f32; 3] = [235.0, 60.0, 30.0];
/// Steps from one picture of the animation to the next, at least.
const ANIMATION_STEPS: usize = 3;

fn main() -> ExitCode {
    ended(run(&Args::parse()))
}

fn run(args: &Args) -> anyhow::Result<()> {
    args.common.check_outputs()?;
    let mut runner = load_runner(args)?;
    let file_size = runner.size();
    if !(file_size.is_finite() && file_size > 0.0) {
        bail!("the frames have no extent: all points coincide");
    }
    let stride = runner.stand(args.up.or_else(|| Vec3::Y), args.size);
    let speed = args.speed.unwrap_or_else(|| match stride / args.cycle {
        by_feet if by_feet > 0.1 * args.size => by_feet,
        _ => LEAST_SPEED * args.size,
    });
    let scene = GallopScene {
        runner,
        size: args.size,
        speed,
        cycle: args.cycle,
        ground: WavyGround {
            half_size: GROUND_SIZE.map(|half| half * args.size),
            spacing: args.size / GROUND_POINTS,
            amplitude: WAVE_HEIGHT * args.size,
            wavelength: WAVE_LENGTH * args.size,
            period: WAVE_PERIOD,
        },
        bodies: usize::from(args.bodies),
        seed: args.common.seed,
    };
    let mut simulation = GallopSimulation::new(scene, args.common.backend.open()?)?;
    let steps = args
        .steps
        .unwrap_or_else(|| simulation.steps_of_run().min(MOST_STEPS));
    let recording = args.recording.start("gallop", Vec3::Y)?;
    let interval = output::picture_interval(steps, ANIMATION_STEPS);
    let shown = args.animate.then_some(interval);
    let snapshots = simulate(&mut simulation, steps, shown, recording)?;
    let report = simulation.report();
    output::publish(&report, DVec3::ZERO, args.common.json.as_deref())?;
    if !args.common.no_pictures {
        draw(&simulation, &snapshots, shown, args)?;
    }
    Ok(())
}

fn load_runner(args: &Args) -> anyhow::Result<Runner> {
    let Some(path) = &args.frames else {
        eprintln!("generating a creature");
        return Ok(creature(args.common.seed)?);
    };
    eprintln!("reading {}", path.display());
    let points = MovingPoints::read(path).context("cannot use the frames")?;
    let Some(path) = &args.faces else {
        return Ok(Runner::new(points));
    };
    let mesh =
        tldi_sources::read(path, &ReadOptions::default()).context("cannot read the faces")?;
    if mesh.faces.is_empty() {
        bail!("{} has no faces", path.display());
    }
    if mesh.points.len() != points.points() {
        bail!(
            "{} has {} points and the frames have {}: its faces belong to others",
            path.display(),
            mesh.points.len(),
            points.points()
        );
    }
    Ok(Runner::with_faces(points, mesh.faces))
}

/// Takes all steps; snapshots before the first, in the middle and after the last or, for an
/// animation, whenever so many steps are `shown` by a picture.
fn simulate(
    simulation: &mut GallopSimulation,
    steps: usize,
    shown: Option<usize>,
    mut recording: Option<Recording>,
) -> anyhow::Result<Vec<GallopSnapshot>> {
    let mut snapshots = vec![simulation.snapshot()];
    let mut middle: Option<GallopSnapshot> = None;
    for step in output::with_progress(1..=steps, "steps") {
        (simulation.step()).with_context(|| format!("step {step} of {steps} failed"))?;
        if let Some(recording) = &mut recording {
            let snapshot = simulation.snapshot();
            let things = entities(simulation, &snapshot.runner, &snapshot);
            recording.show(step as f32 * DT, &things, &snapshot.contacts)?;
            let camera = beside(&snapshot, simulation.size(), PICTURE_SIZE);
            if let Some(camera) = RecordedCamera::of_picture(&camera) {
                recording.camera(&camera)?;
            }
        }
        if shown.is_some_and(|steps| step % steps == 0) {
            snapshots.push(simulation.snapshot());
        }
        // Of the middle third, the moment with the most contacts.
        if (steps / 3..=2 * steps / 3).contains(&step) {
            let snapshot = simulation.snapshot();
            let best = middle.as_ref().map_or(0, |middle| middle.contacts.len());
            if middle.is_none() || snapshot.contacts.len() > best {
                middle = Some(snapshot);
            }
        }
    }
    snapshots.push(simulation.snapshot());
    let place = snapshots.len() / 2;
    snapshots.insert(place, middle.unwrap_or_else(|| simulation.snapshot()));
    Ok(snapshots)
}

fn draw(
    simulation: &GallopSimulation,
    snapshots: &[GallopSnapshot],
    shown: Option<usize>,
    args: &Args,
) -> anyhow::Result<()> {
    let size = simulation.size();
    // The camera goes along, always on the same side.
    let picture = |snapshot: &GallopSnapshot, pixels: [u32; 2]| {
        let runner = tinted(snapshot, TINTED * size)?;
        let things = entities(simulation, &runner, snapshot);
        let scene = pictures::scene(things, Vec3::Y, 0.25 * size);
        Ok(scene.draw(&beside(snapshot, size, pixels), &snapshot.contacts))
    };
    let count = snapshots.len();
    let middle = (count - 1) / 2;
    let stills = [
        ("initial.png", 0),
        ("mid.png", middle),
        ("final.png", count - 1),
    ];
    let stills = stills.map(|(name, k)| (name, picture(&snapshots[k], PICTURE_SIZE)));
    output::write_pictures(&args.out, stills)?;
    if let Some(steps) = shown {
        let moments = snapshots[..middle].iter().chain(&snapshots[middle + 1..]);
        let pictures = moments.map(|snapshot| picture(snapshot, ANIMATION_SIZE));
        output::write_animation(&args.out, steps as f32 * DT, 0, pictures)?;
    }
    eprintln!("pictures are in {}", args.out.display());
    Ok(())
}

/// A camera beside what runs, a little ahead and above.
fn beside(snapshot: &GallopSnapshot, size: f32, pixels: [u32; 2]) -> VirtualCamera {
    // Room for a head that is held as high as the body is long.
    let middle = snapshot.world_from_runner.translation + 0.4 * size * Vec3::Y;
    let eye = middle + size * Vec3::new(0.85, 0.65, 1.55);
    VirtualCamera::perspective(
        eye,
        middle,
        Vec3::Y,
        0.873,
        pixels,
        0.05 * size,
        100.0 * size,
    )
}

/// What runs, red around its contacts.
fn tinted(snapshot: &GallopSnapshot, reach: f32) -> anyhow::Result<PointCloud<'static>> {
    let runner = &snapshot.runner;
    let plain = |color: [f32; 3]| {
        let [r, g, b] = color.map(|c| c as u8);
        [r, g, b, 255]
    };
    if snapshot.contacts.is_empty() {
        return Ok(painted(runner, |_| plain(SKIN))?);
    }
    let contacts = PointCloud::builder(&snapshot.contacts)
        .radius(reach)
        .build()?;
    let tree = KdTree::new(&contacts);
    Ok(painted(runner, |i| {
        let place = snapshot.world_from_runner * runner.point(i);
        let distance = tree
            .nearest(place, reach)
            .map_or(reach, |near| near.distance());
        let strength = (2.0 - 2.0 * distance / reach).min(1.0);
        plain([0, 1, 2].map(|k| SKIN[k] + strength * (TINT[k] - SKIN[k])))
    })?)
}

/// All that is there; `runner` is what runs, in its colours.
fn entities<'a>(
    simulation: &'a GallopSimulation,
    runner: &'a PointCloud<'a>,
    snapshot: &'a GallopSnapshot,
) -> Vec<Entity<'a>> {
    let skin = SKIN.map(|c| c / 255.0);
    let runner = Item::body(runner, snapshot.world_from_runner, skin);
    let ground = Item::scan(&snapshot.ground);
    let clouds = simulation.body_clouds();
    let bodies = pictures::bodies(clouds, &snapshot.world_from_body, &BODY_COLORS[1..]);
    [("ground".to_owned(), ground), ("runner".to_owned(), runner)]
        .into_iter()
        .chain(bodies)
        .collect()
}
