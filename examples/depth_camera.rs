//! Depth frames become a collider that is new in every frame; bodies rest on it and are pushed.

use anyhow::Context;
use clap::Parser;
use std::path::PathBuf;
use std::process::ExitCode;
use tldi::glamx::{Pose3, Vec3};
use tldi::{PointCloud, VirtualCamera};
use tldi_examples::cli::{Common, RangeArgument, UpChoice, ended, positive, within};
use tldi_examples::depth::{
    DepthScene, DepthSimulation, DepthSnapshot, FRAME_SECONDS, FirstSeen, FrameSource,
    GeneratedCamera, WantedBodies, camera_up,
};
use tldi_examples::output;
use tldi_examples::pictures::{self, ANIMATION_SIZE, Entity, PICTURE_SIZE};
use tldi_examples::recording::{RecordedCamera, Recording, RecordingOption};
use tldi_pictures::{BODY_COLORS, Item, Scene, viewpoint};
use tldi_sources::depth::{DepthCamera, DepthSequence, SensorModel};

/// Depth frames become a collider that is new in every frame; bodies rest on it and are pushed
///
/// Frames come at 30 a second of simulated time. Without a folder, a generated sequence is used: a
/// ball is moved across a low table. Ends with 0 if every frame was taken, with 1 if not, with 2 if
/// the options cannot be used.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// Folder with intrinsics.txt (width height fx fy cx cy depth_unit_metres), poses.txt (file, then
    /// the 4×4 camera-to-world matrix row by row, metres) and the 16-bit grey PNG files it lists
    #[arg(long, value_name = "DIR")]
    frames: Option<PathBuf>,
    /// Number of bodies
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u16).range(0..=100))]
    count: u16,
    /// Width of the bodies in metres; if left out, what the frames resolve
    #[arg(long, value_name = "M", value_parser = positive, allow_hyphen_values = true)]
    size: Option<f32>,
    /// Seconds for which the first frame with points stays, so that the bodies land before things move
    #[arg(long, value_name = "S", default_value_t = 1.5, value_parser = within(0.0, 3600.0), allow_hyphen_values = true)]
    hold: f32,
    /// Remember the points of this many frames where the present one does not see
    #[arg(long, value_name = "N", default_value_t = 0)]
    memory: usize,
    /// Standard deviation of depth at 1 m, metres; it grows with the square of the range
    #[arg(long, value_name = "M", default_value_t = SensorModel::default().noise, value_parser = positive, allow_hyphen_values = true)]
    sensor_noise: f32,
    /// Nearest and farthest depth that is believed, metres; 0.3,8 if left out
    #[arg(long, value_name = "NEAR,FAR", allow_hyphen_values = true)]
    range: Option<RangeArgument>,
    /// Direction against gravity in the world of the poses; auto finds it in the first frame with points
    #[arg(
        long,
        value_name = "X,Y,Z",
        default_value = "auto",
        allow_hyphen_values = true
    )]
    up: UpChoice,
    /// Folder for initial.png, mid.png and final.png
    #[arg(long, value_name = "DIR", default_value = "out/depth_camera")]
    out: PathBuf,
    /// Also write motion.png, an animated PNG
    #[arg(long, conflicts_with = "no_pictures")]
    animate: bool,
    #[command(flatten)]
    recording: RecordingOption,
    #[command(flatten)]
    common: Common,
}

/// Frames of the generated sequence.
const GENERATED_FRAMES: usize = 150;
/// Frames from one picture of the animation to the next, at least.
const ANIMATION_FRAMES: usize = 3;
/// Of the points of a frame, one in as many is kept for the animation.
const ANIMATION_POINT_STEP: usize = 4;

fn main() -> ExitCode {
    ended(run(&Args::parse()))
}

fn run(args: &Args) -> anyhow::Result<()> {
    args.common.check_outputs()?;
    let (source, mut missing) = open(args)?;
    let model = SensorModel {
        noise: args.sensor_noise,
        range: (args.range).map_or(SensorModel::default().range, |RangeArgument(range)| range),
        ..SensorModel::default()
    };
    let mut camera = DepthCamera::new(source.intrinsics(), model);
    let FirstSeen {
        index: start,
        frame: first,
        cloud,
        empty,
    } = source.first_seen(&mut camera)?;
    if start > 0 {
        eprintln!(
            "warning: the {start} frames before {} have no points",
            first.name
        );
        missing.extend(empty);
    }
    let cloud = cloud.into_builder().build()?.into_owned();
    let up = match args.up {
        UpChoice::Given(up) => up,
        UpChoice::Auto => find_up(&cloud, &first.world_from_camera)?,
    };
    let wanted = WantedBodies {
        count: args.count.into(),
        size: args.size,
        seed: args.common.seed,
    };
    let (bodies, spots) = wanted.placed(&source, camera.clone(), &cloud, up)?;
    let scene = DepthScene {
        camera,
        up,
        bodies,
        spots,
        memory: args.memory,
        seed: args.common.seed,
    };
    let mut simulation = DepthSimulation::new(scene, &first, args.common.backend.open()?)?;
    let recording = args.recording.start("depth_camera", up)?;
    let (snapshots, interval) = simulate(&mut simulation, &source, start, recording, args)?;
    let report = simulation.report(missing);
    output::publish(&report, source.origin(), args.common.json.as_deref())?;
    if !args.common.no_pictures {
        draw(&simulation, up, &snapshots, interval, args)?;
    }
    Ok(())
}

/// The frames, and those that are missing.
fn open(args: &Args) -> anyhow::Result<(FrameSource, Vec<String>)> {
    let Some(folder) = &args.frames else {
        eprintln!("generating depth frames");
        let camera = GeneratedCamera {
            frames: GENERATED_FRAMES,
            seed: args.common.seed,
        };
        return Ok((FrameSource::Generated(camera), Vec::new()));
    };
    let sequence = DepthSequence::open(folder)
        .with_context(|| format!("cannot use the frames in {}", folder.display()))?;
    eprintln!("{} frames in {}", sequence.frames.len(), folder.display());
    let missing = sequence.missing.clone();
    if !missing.is_empty() {
        let names = missing[..missing.len().min(3)].join(", ");
        let more = if missing.len() > 3 { " …" } else { "" };
        eprintln!(
            "warning: {} frames of poses.txt are not there, or have no pose: {names}{more}",
            missing.len()
        );
    }
    Ok((FrameSource::Folder(sequence), missing))
}

/// The direction that is up in what a frame shows, which is told.
fn find_up(frame: &PointCloud<'_>, world_from_camera: &Pose3) -> anyhow::Result<Vec3> {
    let up = camera_up(frame.normals().unwrap_or_default(), world_from_camera)?;
    let [x, y, z] = up.direction.to_array();
    eprintln!(
        "up is {x:.3},{y:.3},{z:.3}: {:.0} % of the normals say so, and at most {:.0} % as much speaks for \
         another; --up X,Y,Z sets it",
        100.0 * up.share,
        100.0 * up.rival
    );
    Ok(up.direction)
}

/// Shows all frames from `start` on; snapshots before the first, at three fifths and after the last or, for an
/// animation, after every few frames; and how many these are.
fn simulate(
    simulation: &mut DepthSimulation,
    source: &FrameSource,
    start: usize,
    mut recording: Option<Recording>,
    args: &Args,
) -> anyhow::Result<(Vec<DepthSnapshot>, usize)> {
    let held = (args.hold / FRAME_SECONDS).round() as usize;
    let all = held + source.count() - start;
    let interval = output::picture_interval(all, ANIMATION_FRAMES);
    let mut snapshots = vec![simulation.snapshot(1)?];
    let order = std::iter::repeat_n(start, held).chain(start..source.count());
    for (k, index) in output::with_progress(order.enumerate(), "frames") {
        let frame = source.frame(index)?;
        (simulation.take_frame(&frame)).with_context(|| format!("{} failed", frame.name))?;
        if let Some(recording) = &mut recording {
            let snapshot = simulation.snapshot(ANIMATION_POINT_STEP)?;
            let things = entities(simulation, &snapshot);
            recording.show((k + 1) as f32 * FRAME_SECONDS, &things, &snapshot.contacts)?;
            let intrinsics = source.intrinsics();
            recording.camera(&RecordedCamera {
                size: intrinsics.size.map(|n| n as f32),
                focal: intrinsics.focal,
                center: intrinsics.center.map(|c| c + 0.5),
                scene_from_camera: frame.world_from_camera,
            })?;
        }
        if k == all * 3 / 5 || k + 1 == all {
            snapshots.push(simulation.snapshot(1)?);
        } else if args.animate && k % interval == 0 {
            snapshots.push(simulation.snapshot(ANIMATION_POINT_STEP)?);
        }
    }
    Ok((snapshots, interval))
}

fn draw(
    simulation: &DepthSimulation,
    up: Vec3,
    snapshots: &[DepthSnapshot],
    interval: usize,
    args: &Args,
) -> anyhow::Result<()> {
    let picture = |snapshot: &DepthSnapshot, camera: &VirtualCamera| {
        Ok(scene_of(simulation, up, snapshot).draw(camera, &snapshot.contacts))
    };
    let [initial, last] = [&snapshots[0], &snapshots[snapshots.len() - 1]];
    // Bodies that fell off are not followed.
    let start = &initial.world_from_body;
    let near =
        |pose: &Pose3| (start.iter()).any(|from| from.translation.distance(pose.translation) < 1.0);
    let mut places: Vec<Vec3> = (snapshots.iter())
        .flat_map(|snapshot| snapshot.world_from_body.iter())
        .filter(|pose| near(pose))
        .map(|pose| pose.translation)
        .collect();
    // Without bodies, all of the surface is to be seen.
    if places.is_empty() {
        places.extend(initial.frame.points());
    }
    let camera = |size| viewpoint::choose(&scene_of(simulation, up, initial), &places, size);
    let large = camera(PICTURE_SIZE);
    let mid = &snapshots[(snapshots.len() * 3 / 5).min(snapshots.len() - 2)];
    let stills = [
        ("initial.png", picture(initial, &large)),
        ("mid.png", picture(mid, &large)),
        ("final.png", picture(last, &large)),
    ];
    output::write_pictures(&args.out, stills)?;
    if args.animate {
        let small = camera(ANIMATION_SIZE);
        let pictures = snapshots.iter().map(|snapshot| picture(snapshot, &small));
        let seconds = interval as f32 * FRAME_SECONDS;
        output::write_animation(&args.out, seconds, 0, pictures)?;
    }
    eprintln!("pictures are in {}", args.out.display());
    Ok(())
}

/// All that is there.
fn entities<'a>(simulation: &'a DepthSimulation, snapshot: &'a DepthSnapshot) -> Vec<Entity<'a>> {
    let frame = ("frame".to_owned(), Item::scan(&snapshot.frame));
    let bodies = pictures::bodies(simulation.clouds(), &snapshot.world_from_body, &BODY_COLORS);
    std::iter::once(frame).chain(bodies).collect()
}

fn scene_of<'a>(
    simulation: &'a DepthSimulation,
    up: Vec3,
    snapshot: &'a DepthSnapshot,
) -> Scene<'a> {
    let sizes = (simulation.clouds()).map(|cloud| cloud.bounds().extents().length());
    let detail = sizes.fold(0.1, f32::max);
    pictures::scene(entities(simulation, snapshot), up, detail)
}
