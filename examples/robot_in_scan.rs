//! A robot whose links are point clouds moves in a scan that is a point cloud.

use anyhow::{Context, bail};
use clap::Parser;
use clap::builder::ArgPredicate;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use tldi::glamx::{DVec3, Vec3};
use tldi::{PointCloud, VirtualCamera};
use tldi_examples::cli::{Common, Triple, ended, within};
use tldi_examples::load::Located;
use tldi_examples::pictures::{self, ANIMATION_SIZE, Entity, PICTURE_SIZE};
use tldi_examples::recording::{RecordedCamera, Recording, RecordingOption};
use tldi_examples::robot::{
    BUILT_IN, Base, Description, MeshFolders, Motion, RobotScene, RobotSimulation, RobotSnapshot,
    Walk, quadruped,
};
use tldi_examples::scan::{ScanSource, choose_up, load_scan};
use tldi_examples::terrain::{Ground, Terrain};
use tldi_examples::world::DT;
use tldi_examples::{load, output};
use tldi_pictures::{BODY_COLORS, Item, Scene, viewpoint};

/// A robot whose links are point clouds moves in a scan that is a point cloud
///
/// An arm reaches through loose bodies and onto the scan; a robot on wheels or legs drives or steps.
/// Without files, a built-in arm and a generated room are used. Ends with 0 if every step was taken
/// and the robot did not fall out of the scan, with 1 if not, with 2 if the options cannot be used.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// Robot; links become clouds of their collision, else their visual geometry
    #[arg(long, value_name = "FILE")]
    urdf: Option<PathBuf>,
    /// Folder with packages that the URDF names as package://NAME/…; may be given several times
    #[arg(long, value_name = "DIR", requires = "urdf")]
    packages: Vec<PathBuf>,
    /// Built-in robot, where no file is given; on a terrain the quadruped
    #[arg(
        long,
        value_enum,
        default_value_t = BuiltIn::Arm,
        default_value_if("terrain", ArgPredicate::IsPresent, "quadruped"),
        conflicts_with = "urdf"
    )]
    robot: BuiltIn,
    /// Generated rough ground with all the faults of a scan; the robot stands, walks and is measured
    #[arg(long, value_enum, conflicts_with_all = ["scan", "up", "place", "own_camera"])]
    terrain: Option<Ground>,
    #[command(flatten)]
    source: ScanSource,
    /// Where the robot stands, in the frame of the scan, metres; found if left out
    #[arg(long, value_name = "X,Y,Z", allow_hyphen_values = true)]
    place: Option<Triple>,
    /// Whether the robot's root is fixed to the scan
    #[arg(long, value_enum, default_value_t = Base::Auto)]
    base: Base,
    /// Loose bodies in the reach of an arm, at most
    #[arg(long, value_name = "N", default_value_t = 3)]
    bodies: usize,
    /// Number of steps of 1/60 s; if left out, as long as the motion takes, at most 20 s
    #[arg(long, value_name = "N")]
    steps: Option<usize>,
    /// Standard deviation of the scan's points in metres, for the self-filter
    #[arg(long, value_name = "M", default_value_t = 0.003, value_parser = within(0.0, 1.0), allow_hyphen_values = true)]
    sensor_noise: f32,
    /// The scan comes anew 30 times a second, from a camera that sees the robot too
    #[arg(long)]
    own_camera: bool,
    /// Leave points of the scan that lie on the robot where they are
    #[arg(long)]
    no_self_filter: bool,
    /// Folder for initial.png, mid.png (most contacts), hardest.png (largest force) and final.png
    #[arg(long, value_name = "DIR", default_value = "out/robot_in_scan")]
    out: PathBuf,
    /// Also write motion.png, an animated PNG
    #[arg(long, conflicts_with = "no_pictures")]
    animate: bool,
    #[command(flatten)]
    recording: RecordingOption,
    #[command(flatten)]
    common: Common,
}

/// Robots that need no file.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
enum BuiltIn {
    /// An arm with a gripper.
    Arm,
    /// Twelve joints, 50 kg.
    Quadruped,
}

/// Steps from one picture of the animation to the next.
const ANIMATION_STEPS: usize = 6;
/// Seconds of a motion without an end, and at most of any.
const LONGEST_SECONDS: f32 = 20.0;
const ENDLESS_SECONDS: f32 = 8.0;
/// Colours of links, and of links that touch something.
const LINK_COLORS: [[f32; 3]; 2] = [[0.90, 0.90, 0.88], [0.30, 0.34, 0.40]];
const TOUCHING_COLOR: [f32; 3] = [0.92, 0.30, 0.16];

fn main() -> ExitCode {
    ended(run(&Args::parse()))
}

fn run(args: &Args) -> anyhow::Result<()> {
    args.common.check_outputs()?;
    let robot = load_robot(args)?;
    let terrain = args
        .terrain
        .map(|ground| Terrain::new(ground, args.common.seed));
    let (scan, origin, up) = match &terrain {
        Some(terrain) => {
            let scan = load::scan_from_surface(terrain.scan())?;
            (scan, DVec3::ZERO, Vec3::Z)
        }
        None => {
            let Located { cloud, origin } = load_scan(&args.source, args.common.seed)?;
            let up = choose_up(args.source.up, &cloud);
            (cloud, origin, up)
        }
    };
    let scene = RobotScene {
        scan,
        up,
        base: args.base,
        at: (args.place.map(|Triple(place)| (place - origin).as_vec3()))
            .or(args.terrain.map(|_| Vec3::ZERO)),
        facing: args.terrain.map(|_| Vec3::X),
        terrain,
        motion: Walk::of(&robot.kinematics).map(Motion::Walk),
        bodies: args.bodies,
        sensor_noise: args.sensor_noise,
        own_camera: args.own_camera,
        self_filter: !args.no_self_filter,
        seed: args.common.seed,
        robot,
    };
    let mut simulation = RobotSimulation::new(scene, args.common.backend.open()?)?;
    if simulation.report().driven_joints == 0 {
        eprintln!("the robot has no joint that moves: it just stands there");
    }
    let mut recording = args.recording.start("robot_in_scan", up)?;
    if let Some(recording) = &mut recording {
        record_start(recording, &simulation, up)?;
    }
    let (snapshots, interval, hardest) = simulate(&mut simulation, args.steps, recording)?;
    let report = simulation.report();
    output::publish(&report, origin, args.common.json.as_deref())?;
    if !args.common.no_pictures {
        draw(&simulation, up, (&snapshots, interval), &hardest, args)?;
    }
    if let Some(link) = simulation.thrown_out() {
        bail!(
            "link {link} was thrown out of the scan in step {}: do the robot's links start inside it, or is the robot's own image in it?",
            report.totals.steps
        );
    }
    if !simulation.is_on_scan() {
        bail!("the robot fell out of the scan");
    }
    Ok(())
}

fn load_robot(args: &Args) -> anyhow::Result<Description> {
    let robot = match &args.urdf {
        Some(path) => {
            eprintln!("reading {}", path.display());
            Description::from_file(path, &args.packages)
                .with_context(|| format!("cannot use the robot {}", path.display()))?
        }
        None => {
            let text = match args.robot {
                BuiltIn::Arm => BUILT_IN,
                BuiltIn::Quadruped => &quadruped(),
            };
            Description::from_text(text, &MeshFolders::new(Path::new(""), &[]))?
        }
    };
    for warning in &robot.warnings {
        eprintln!("warning: {warning}");
    }
    Ok(robot)
}

/// Takes all steps, up to that in which a link is thrown out. Gives snapshots before the first and after every few
/// steps, how many these are, and a snapshot of the moment in which a link is pushed most.
fn simulate(
    simulation: &mut RobotSimulation,
    steps: Option<usize>,
    mut recording: Option<Recording>,
) -> anyhow::Result<(Vec<RobotSnapshot>, usize, RobotSnapshot)> {
    let seconds = match simulation.motion_seconds() {
        seconds if seconds.is_finite() => (seconds + 0.5).min(LONGEST_SECONDS),
        _ => ENDLESS_SECONDS,
    };
    let steps = steps.unwrap_or((seconds / DT).ceil() as usize);
    let interval = output::picture_interval(steps, ANIMATION_STEPS);
    let mut snapshots = vec![simulation.snapshot()];
    let mut hardest = (0.0, simulation.snapshot());
    for step in output::with_progress(1..=steps, "steps") {
        (simulation.step()).with_context(|| format!("step {step} of {steps} failed"))?;
        if let Some(recording) = &mut recording {
            let snapshot = simulation.snapshot();
            let things = entities(simulation, simulation.scan(), &snapshot);
            recording.show(step as f32 * DT, &things, &snapshot.contacts)?;
        }
        if step % interval == 0 || step == steps {
            snapshots.push(simulation.snapshot());
        }
        if simulation.largest_force() > hardest.0 {
            hardest = (simulation.largest_force(), simulation.snapshot());
        }
        if simulation.thrown_out().is_some() {
            snapshots.push(simulation.snapshot());
            break;
        }
    }
    Ok((snapshots, interval, hardest.1))
}

/// The start, and a camera that sees the robot well.
fn record_start(
    recording: &mut Recording,
    simulation: &RobotSimulation,
    up: Vec3,
) -> anyhow::Result<()> {
    let (scan, snapshot) = (simulation.scan(), simulation.snapshot());
    let things = entities(simulation, scan, &snapshot);
    recording.show(0.0, &things, &snapshot.contacts)?;
    let scene = scene_of(simulation, scan, up, &snapshot);
    let camera = viewpoint::choose(&scene, &[], PICTURE_SIZE);
    if let Some(camera) = RecordedCamera::of_picture(&camera) {
        recording.camera(&camera)?;
    }
    Ok(())
}

fn draw(
    simulation: &RobotSimulation,
    up: Vec3,
    (snapshots, interval): (&[RobotSnapshot], usize),
    hardest: &RobotSnapshot,
    args: &Args,
) -> anyhow::Result<()> {
    let drawn_scan = pictures::drawable(simulation.scan())?;
    let [initial, last] = [&snapshots[0], &snapshots[snapshots.len() - 1]];
    // The moment with the most contacts is the one worth a picture.
    let most_contacts = (snapshots.iter()).max_by_key(|snapshot| snapshot.contacts.len());
    let mid = most_contacts.unwrap_or(last);
    let places: Vec<Vec3> = (snapshots.iter().step_by(4))
        .flat_map(|snapshot| snapshot.scan_from_link.iter().map(|pose| pose.translation))
        .collect();
    let scene = |snapshot: &RobotSnapshot| scene_of(simulation, &drawn_scan, up, snapshot);
    let camera = |size| viewpoint::choose(&scene(initial), &places, size);
    let picture = |snapshot: &RobotSnapshot, camera: &VirtualCamera| {
        Ok(scene(snapshot).draw(camera, &snapshot.contacts))
    };
    let large = camera(PICTURE_SIZE);
    let stills = [
        ("initial.png", picture(initial, &large)),
        ("mid.png", picture(mid, &large)),
        ("hardest.png", picture(hardest, &large)),
        ("final.png", picture(last, &large)),
    ];
    output::write_pictures(&args.out, stills)?;
    if args.animate {
        let small = camera(ANIMATION_SIZE);
        let pictures = snapshots.iter().map(|snapshot| picture(snapshot, &small));
        output::write_animation(&args.out, interval as f32 * DT, 0, pictures)?;
    }
    eprintln!("pictures are in {}", args.out.display());
    Ok(())
}

/// All that is there.
fn entities<'a>(
    simulation: &'a RobotSimulation,
    scan: &'a PointCloud<'a>,
    snapshot: &RobotSnapshot,
) -> Vec<Entity<'a>> {
    let links = simulation.links().iter().enumerate().map(|(k, link)| {
        let color = match snapshot.link_touches[k] {
            true => TOUCHING_COLOR,
            false => LINK_COLORS[k % 2],
        };
        let item = Item::body(&link.cloud, snapshot.scan_from_link[k], color);
        (format!("robot/{}", link.name), item)
    });
    let clouds = simulation.loose_clouds();
    let bodies = pictures::bodies(clouds, &snapshot.scan_from_body, &BODY_COLORS[1..]);
    let scan = std::iter::once(("scan".to_owned(), Item::scan(scan)));
    scan.chain(links).chain(bodies).collect()
}

fn scene_of<'a>(
    simulation: &'a RobotSimulation,
    drawn_scan: &'a PointCloud<'a>,
    up: Vec3,
    snapshot: &RobotSnapshot,
) -> Scene<'a> {
    let sizes = (simulation.links().iter()).map(|link| link.cloud.bounds().extents().length());
    let detail = 0.3 * sizes.fold(0.0, f32::max);
    pictures::scene(entities(simulation, drawn_scan, snapshot), up, detail)
}
