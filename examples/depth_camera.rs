//! Depth frames become a collider that is new in every frame; bodies rest on it and are pushed.

use anyhow::{Context, bail};
use clap::Parser;
use std::path::PathBuf;
use std::process::ExitCode;
use tldi::glamx::{Pose3, Vec3};
use tldi::{PointCloud, VirtualCamera};
use tldi_examples::cli::{Common, RangeArgument, UpChoice, ended};
use tldi_examples::depth::{
    DepthScene, DepthSimulation, DepthSnapshot, FRAME_SECONDS, FrameSource, GeneratedCamera,
    camera_up,
};
use tldi_examples::recording::{RecordedCamera, Recording, RecordingOption};
use tldi_examples::scan::{positive, within};
use tldi_examples::scene::BodyShape;
use tldi_examples::simulation::NamedCloud;
use tldi_examples::spots::{Demand, NoSpot, Spot, find_spots_where};
use tldi_examples::{load, output};
use tldi_pictures::{BODY_COLORS, Item, Picture, Scene, viewpoint};
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
    /// Seconds for which the first frame stays, so that the bodies land before things move
    #[arg(long, value_name = "S", default_value_t = 1.5, value_parser = within(0.0, 3600.0), allow_hyphen_values = true)]
    hold: f32,
    /// How often the frames are shown
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..))]
    loops: u16,
    /// Remember the points of this many frames where the present one does not see
    #[arg(long, value_name = "N", default_value_t = 0)]
    memory: usize,
    /// Standard deviation of depth at 1 m, metres; it grows with the square of the range
    #[arg(long, value_name = "M", default_value_t = SensorModel::default().noise, value_parser = positive, allow_hyphen_values = true)]
    sensor_noise: f32,
    /// Nearest and farthest depth that is believed, metres; 0.3,8 if left out
    #[arg(long, value_name = "NEAR,FAR", allow_hyphen_values = true)]
    range: Option<RangeArgument>,
    /// Direction against gravity in the world of the poses; auto finds it in the first frame
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
/// Width in metres of a body of the generated sequence.
const GENERATED_BODY_SIZE: f32 = 0.14;
/// Width of a body that is not given one: a share of the median distance, smaller by a factor until there is
/// place, and at least this many mean radii of a frame.
const SIZE_SHARE: f32 = 0.08;
const SHRINKING: f32 = 0.8;
const BODY_RADII: f32 = 8.0;
/// Room around a place that must be in view in the last frame, in body radii.
const ROOM_IN_VIEW: f32 = 2.5;
const BODY_SPACING: f32 = 0.03;
const PICTURE_SIZE: [u32; 2] = [1280, 720];
const ANIMATION_SIZE: [u32; 2] = [640, 360];
/// Frames from one picture of the animation to the next.
const ANIMATION_FRAMES: usize = 3;
/// Of the points of a frame, one in as many is kept for the animation.
const ANIMATION_POINT_STEP: usize = 4;

fn main() -> ExitCode {
    ended(run(&Args::parse()))
}

fn run(args: &Args) -> anyhow::Result<()> {
    args.common.check_outputs()?;
    let (source, missing) = open(args)?;
    let model = SensorModel {
        noise: args.sensor_noise,
        range: (args.range).map_or(SensorModel::default().range, |RangeArgument(range)| range),
        ..SensorModel::default()
    };
    let mut camera = DepthCamera::new(source.intrinsics(), model);
    let first = source.frame(0)?;
    let seen = camera.points(&first.depths, &first.world_from_camera);
    if seen.points.is_empty() {
        bail!(
            "{} has no measurement between {} and {} m: is the depth unit right? Else give a --range",
            first.name,
            model.range[0],
            model.range[1]
        );
    }
    let cloud = seen.into_builder().build()?.into_owned();
    let up = match args.up {
        UpChoice::Given(up) => up,
        UpChoice::Auto => {
            let normals = cloud.normals().unwrap_or_default();
            let up = camera_up(normals, &first.world_from_camera)?;
            let [x, y, z] = up.direction.to_array();
            eprintln!(
                "up is {x:.3},{y:.3},{z:.3}: {:.0} % of the normals say so, and at most {:.0} % as much speaks for \
                 another; --up X,Y,Z sets it",
                100.0 * up.share,
                100.0 * up.rival
            );
            up.direction
        }
    };
    let (bodies, spots) = place_bodies(&source, &camera, &cloud, up, args)?;
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
    let snapshots = simulate(&mut simulation, &source, recording, args)?;
    let report = simulation.report(missing);
    let json = args.common.json.as_deref();
    output::publish(
        &report,
        source.origin(),
        |out| report.write_table(out),
        json,
    )?;
    if !args.common.no_pictures {
        draw(&simulation, up, &snapshots, args)?;
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
        let names = &missing[..missing.len().min(3)].join(", ");
        eprintln!(
            "warning: {} frames of poses.txt are not there, or have no pose: {names} …",
            missing.len()
        );
    }
    Ok((FrameSource::Folder(sequence), missing))
}

/// Bodies, and where they are dropped. Where their size is not given, it is as large as the distance of
/// what is seen suggests, or smaller until each has a place of its own.
fn place_bodies(
    source: &FrameSource,
    camera: &DepthCamera,
    first: &PointCloud<'_>,
    up: Vec3,
    args: &Args,
) -> anyhow::Result<(Vec<NamedCloud>, Vec<Spot>)> {
    if args.count == 0 {
        return Ok((Vec::new(), Vec::new()));
    }
    let make_bodies = |size: f32| {
        let (count, seed) = (args.count.into(), args.common.seed);
        NamedCloud::generated(&BodyShape::WHOLE, count, BODY_SPACING, size, seed)
    };
    let least = BODY_RADII * first.mean_radius();
    if matches!(source, FrameSource::Generated(_)) {
        let size = args.size.unwrap_or(GENERATED_BODY_SIZE.max(least));
        let spots = GeneratedCamera::spots();
        if usize::from(args.count) <= spots.len() {
            return Ok((make_bodies(size)?, spots));
        }
    }
    let frame = source.frame(source.len() - 1)?;
    let mut camera = camera.clone();
    camera.points(&frame.depths, &frame.world_from_camera);
    let view = LastView {
        camera: &camera,
        camera_from_world: frame.world_from_camera.inverse(),
    };
    let distance = view.median_depth(first);
    let mut size = args.size.unwrap_or(least.max(SIZE_SHARE * distance));
    loop {
        let bodies = make_bodies(size)?;
        let spots = view.spots(first, up, &bodies, distance, args.common.seed);
        let each_has_its_own = |spots: &Vec<Spot>| spots.iter().all(|spot| spot.level == 0);
        let smaller = SHRINKING * size;
        if args.size.is_some() || smaller < least || spots.as_ref().is_ok_and(each_has_its_own) {
            return Ok((bodies, spots?));
        }
        size = smaller;
    }
}

/// Where the camera is in the last frame: what it does not see there cannot hold a body.
struct LastView<'a> {
    camera: &'a DepthCamera,
    camera_from_world: Pose3,
}

impl LastView<'_> {
    fn depth(&self, point: Vec3) -> f32 {
        (self.camera_from_world * point).z
    }

    /// Median depth in metres of the points.
    fn median_depth(&self, cloud: &PointCloud<'_>) -> f32 {
        let mut depths: Vec<f32> = cloud
            .points()
            .iter()
            .copied()
            .map(|point| self.depth(point))
            .collect();
        let middle = depths.len() / 2;
        *(depths.select_nth_unstable_by(middle, f32::total_cmp).1)
    }

    /// Places in view, with the room around them; nearer than `distance` metres if there are enough,
    /// where depths are sharper, and anywhere if there are none.
    fn spots(
        &self,
        first: &PointCloud<'_>,
        up: Vec3,
        bodies: &[NamedCloud],
        distance: f32,
        seed: u64,
    ) -> Result<Vec<Spot>, NoSpot> {
        let radii = bodies.iter().map(|body| load::ball_radius(&body.cloud));
        let demand = Demand {
            count: bodies.len(),
            body_radius: radii.fold(0.0, f32::max),
            seed,
        };
        let (u, v) = up.any_orthonormal_pair();
        let room = ROOM_IN_VIEW * demand.body_radius;
        // Some pixels are empty: half of those on the way to the sides must show the surface.
        let is_in_view = |place: Vec3| {
            let at = |k: f32| [u, -u, v, -v].map(|side| place + k * side);
            let is_inside = |p: &Vec3| self.camera.is_in_view(*p, &self.camera_from_world);
            let disc: Vec<Vec3> = (1..=4)
                .flat_map(|k| at(0.25 * k as f32 * demand.body_radius))
                .collect();
            let seen = disc
                .iter()
                .filter(|p| self.camera.sees(**p, &self.camera_from_world));
            at(room).iter().all(is_inside) && 2 * seen.count() >= disc.len()
        };
        let near = find_spots_where(first, up, &demand, |place| {
            is_in_view(place) && self.depth(place) <= distance
        });
        match near {
            Ok(spots) if spots.iter().all(|spot| spot.level == 0) => Ok(spots),
            // What holds bodies now may all be gone in the end.
            _ => find_spots_where(first, up, &demand, is_in_view)
                .or_else(|_| find_spots_where(first, up, &demand, |_| true)),
        }
    }
}

/// Shows all frames; snapshots before the first, at three fifths and after the last or, for an
/// animation, after every [`ANIMATION_FRAMES`].
fn simulate(
    simulation: &mut DepthSimulation,
    source: &FrameSource,
    mut recording: Option<Recording>,
    args: &Args,
) -> anyhow::Result<Vec<DepthSnapshot>> {
    let held = (args.hold / FRAME_SECONDS).round() as usize;
    let shown = source.len() * usize::from(args.loops);
    let all = held + shown;
    let bar = output::progress_bar(all, "frames");
    let mut snapshots = vec![simulation.snapshot(1)?];
    let order = std::iter::repeat_n(0, held).chain((0..shown).map(|k| k % source.len()));
    for (k, index) in order.enumerate() {
        let frame = source.frame(index)?;
        (simulation.take_frame(&frame)).with_context(|| format!("{} failed", frame.name))?;
        if let Some(recording) = &mut recording {
            let snapshot = simulation.snapshot(ANIMATION_POINT_STEP)?;
            let clouds: Vec<&PointCloud<'static>> = simulation.clouds().collect();
            let entities = entities(&clouds, &snapshot);
            recording.show(k as f32 * FRAME_SECONDS, &entities, &snapshot.contacts)?;
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
        } else if args.animate && k % ANIMATION_FRAMES == 0 {
            snapshots.push(simulation.snapshot(ANIMATION_POINT_STEP)?);
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(snapshots)
}

fn draw(
    simulation: &DepthSimulation,
    up: Vec3,
    snapshots: &[DepthSnapshot],
    args: &Args,
) -> anyhow::Result<()> {
    let clouds: Vec<&PointCloud<'static>> = simulation.clouds().collect();
    let picture = |snapshot: &DepthSnapshot, camera: &VirtualCamera| -> Picture {
        scene_of(&clouds, up, snapshot).draw(camera, &snapshot.contacts)
    };
    let [initial, last] = [&snapshots[0], &snapshots[snapshots.len() - 1]];
    // Bodies that fell off are not followed.
    let start = &initial.world_from_body;
    let near =
        |pose: &Pose3| (start.iter()).any(|from| from.translation.distance(pose.translation) < 1.0);
    let places: Vec<Vec3> = (snapshots.iter())
        .flat_map(|snapshot| snapshot.world_from_body.iter())
        .filter(|pose| near(pose))
        .map(|pose| pose.translation)
        .collect();
    let camera = |size| {
        let shown = scene_of(&clouds, up, initial);
        viewpoint::choose(&shown, &places, size)
    };
    output::make_folder(&args.out)?;
    let large = camera(PICTURE_SIZE);
    let mid = &snapshots[(snapshots.len() * 3 / 5).min(snapshots.len() - 2)];
    for (snapshot, name) in [
        (initial, "initial.png"),
        (mid, "mid.png"),
        (last, "final.png"),
    ] {
        output::write_file(&args.out.join(name), &picture(snapshot, &large).to_png()?)?;
    }
    if args.animate {
        let small = camera(ANIMATION_SIZE);
        let pictures = snapshots
            .iter()
            .map(|snapshot| Ok(picture(snapshot, &small)));
        let seconds = ANIMATION_FRAMES as f32 * FRAME_SECONDS;
        output::write_animation(&args.out, seconds, pictures)?;
    }
    eprintln!("pictures are in {}", args.out.display());
    Ok(())
}

/// All that is there, by name.
fn entities<'a>(
    clouds: &[&'a PointCloud<'static>],
    snapshot: &'a DepthSnapshot,
) -> Vec<(String, Item<'a>)> {
    let frame = Item::scan(&snapshot.frame);
    let colors = BODY_COLORS.iter().cycle();
    let bodies = clouds.iter().zip(&snapshot.world_from_body).zip(colors);
    let bodies = bodies.enumerate().map(|(k, ((cloud, pose), color))| {
        let name = format!("bodies/{}", k + 1);
        (name, Item::body(cloud, *pose, *color))
    });
    std::iter::once(("frame".to_owned(), frame))
        .chain(bodies)
        .collect()
}

fn scene_of<'a>(
    clouds: &[&'a PointCloud<'static>],
    up: Vec3,
    snapshot: &'a DepthSnapshot,
) -> Scene<'a> {
    let items = entities(clouds, snapshot).into_iter();
    let sizes = clouds.iter().map(|cloud| cloud.bounds().extents().length());
    Scene {
        items: items.map(|(_, item)| item).collect(),
        up,
        detail: sizes.fold(0.1, f32::max),
    }
}
