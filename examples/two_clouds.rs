//! Asks about two clouds once: do they collide, what is the gap, where do they touch.

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use tldi::glamx::{DVec3, Pose3};
use tldi_examples::cli::{Common, PoseArgument, Triple, ended};
use tldi_examples::load::Located;
use tldi_examples::pictures::{ANIMATION_SIZE, PICTURE_SIZE};
use tldi_examples::query::{Answer, CloudQuery};
use tldi_examples::scene::BodyShape;
use tldi_examples::{load, output, query_pictures, section_picture};

/// Asks about two clouds once: do they collide, what is the gap, where do they touch
///
/// Writes pictures of both layered depth images, of the contact zone and of the contact pixels.
/// Coordinates and results are in the unit of the files, taken for metres, in the frame of A.
/// Ends with 0 if the query was answered, whatever the answer.
#[derive(Parser)]
#[command(version)]
struct Args {
    /// First cloud (PLY, PCD, XYZ or CSV, also as .gz) or mesh (PLY, STL, OBJ, DAE)
    #[arg(requires = "b")]
    a: Option<PathBuf>,
    /// Second cloud; without files, two generated ones
    b: Option<PathBuf>,
    /// Pose of B in the frame of A: metres, then degrees about the fixed axes x, y, z
    #[arg(long, value_name = "X,Y,Z[,RX,RY,RZ]", allow_hyphen_values = true)]
    pose: Option<PoseArgument>,
    /// Velocity of B relative to A in m/s: also asks where they meet
    #[arg(
        long,
        value_name = "X,Y,Z",
        default_value = "0,0,0",
        allow_hyphen_values = true
    )]
    velocity: Triple,
    /// Folder for scene.png, zone.png, layers.png, section.png and pixels.png
    #[arg(long, value_name = "DIR", default_value = "out/two_clouds")]
    out: PathBuf,
    /// Also write motion.png, an animated PNG of B on its way along the velocity
    #[arg(long, conflicts_with = "no_pictures", requires = "velocity")]
    animate: bool,
    #[command(flatten)]
    common: Common,
}

/// Widths in metres of the generated clouds, and the distance of their points.
const GENERATED_SIZES: [f32; 2] = [0.4, 0.3];
const GENERATED_SPACING: f32 = 0.013;
/// Pose of the second generated cloud: a star that lies on a ring.
const GENERATED_POSE: &str = "0,0.1,0,0,25,0";
/// Ratio of sizes from which two files are suspected to have different units.
const UNLIKE_SIZES: f32 = 100.0;
/// Pictures of a motion, and how long each is shown, in seconds.
const MOTION_PICTURES: usize = 24;
const MOTION_PICTURE_SECONDS: f32 = 0.06;

fn main() -> ExitCode {
    let args = Args::parse();
    if args.animate && args.velocity.0 == DVec3::ZERO {
        let message = "--animate shows B on its way: give a --velocity that is not zero";
        (Args::command().error(ErrorKind::ValueValidation, message)).exit();
    }
    ended(run(&args))
}

fn run(args: &Args) -> anyhow::Result<()> {
    args.common.check_outputs()?;
    let (query, origin) = load_query(args)?;
    let mut backend = args.common.backend.open()?;
    let answer = query.ask(&mut *backend)?;
    output::publish(&answer.report, origin, args.common.json.as_deref())?;
    if !args.common.no_pictures {
        draw(&query, &answer, &args.out)?;
    }
    if args.animate {
        animate(args, &query)?;
    }
    Ok(())
}

/// What to ask, and the origin of A in its file.
fn load_query(args: &Args) -> anyhow::Result<(CloudQuery, DVec3)> {
    let (a, b, default_pose) = match (&args.a, &args.b) {
        (Some(a), Some(b)) => (load_cloud(a)?, load_cloud(b)?, PoseArgument::IDENTITY),
        _ => {
            let [a, b] = [BodyShape::Torus, BodyShape::Star];
            let [size_a, size_b] = GENERATED_SIZES;
            let seed = args.common.seed;
            let (a, b) = (generate(a, size_a, seed)?, generate(b, size_b, seed)?);
            (a, b, GENERATED_POSE.parse()?)
        }
    };
    let [size_a, size_b] = [&a, &b].map(|body| body.cloud.bounds().extents().max_element());
    if size_a.max(size_b) > UNLIKE_SIZES * size_a.min(size_b) {
        eprintln!("warning: A is {size_a:.3} in size and B {size_b:.3}: have they the same unit?");
    }
    let query = CloudQuery {
        a: a.cloud,
        b: b.cloud,
        a_from_b: (args.pose.unwrap_or(default_pose)).between(a.origin, b.origin),
        velocity: args.velocity.0.as_vec3(),
    };
    Ok((query, a.origin))
}

fn load_cloud(path: &Path) -> anyhow::Result<Located> {
    eprintln!("reading {}", path.display());
    load::body_from_file(path)
}

fn generate(shape: BodyShape, size: f32, seed: u64) -> anyhow::Result<Located> {
    let cloud = load::body_from_surface(shape.sample(GENERATED_SPACING, seed))?;
    Ok(Located {
        cloud: load::resized(&cloud, size)?,
        origin: DVec3::ZERO,
    })
}

fn draw(query: &CloudQuery, answer: &Answer, folder: &Path) -> anyhow::Result<()> {
    let camera = query_pictures::camera(query, PICTURE_SIZE);
    let zone = query_pictures::zone(query, answer, &camera)?;
    let pictures = [
        ("scene.png", query_pictures::scene(query, answer, &camera)),
        ("layers.png", query_pictures::layers(query, answer)),
        ("section.png", section_picture::section(query, answer)),
        ("zone.png", zone),
        ("pixels.png", query_pictures::contact_pixels(query, answer)),
    ];
    output::write_pictures(folder, pictures.map(|(name, picture)| (name, Ok(picture))))?;
    eprintln!("pictures are in {}", folder.display());
    Ok(())
}

/// Asks again along the motion, up to the meeting or for a second.
fn animate(args: &Args, query: &CloudQuery) -> anyhow::Result<()> {
    let mut backend = args.common.backend.open()?;
    let end = (query.ask(&mut *backend)?.report.impact).map_or(1.0, |impact| impact.time_seconds);
    let camera = query_pictures::camera(query, ANIMATION_SIZE);
    let pictures = (0..MOTION_PICTURES).map(|k| {
        let time = end * k as f32 / (MOTION_PICTURES - 1) as f32;
        let moved = Pose3::from_translation(query.velocity * time) * query.a_from_b;
        let later = CloudQuery {
            a: query.a.clone(),
            b: query.b.clone(),
            a_from_b: moved,
            velocity: query.velocity,
        };
        let answer = later.ask(&mut *backend)?;
        Ok(query_pictures::scene(&later, &answer, &camera))
    });
    output::write_animation(&args.out, MOTION_PICTURE_SECONDS, 0, pictures)
}
