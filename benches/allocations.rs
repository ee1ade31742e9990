//! How often memory is asked for in a frame, once it has settled: for new points of a cloud, and for
//! comparing two.

#![allow(
    clippy::print_stdout,
    reason = "a bench's table is its output; progress goes to stderr"
)]

use anyhow::ensure;
use clap::Parser;
use tldi::glamx::{Pose3, Vec3};
use tldi::{Backend, CpuBackend, PairResult, Params, PointCloud, Surface};
use tldi_benches::placements::{Placement, Source};
use tldi_memory::{Counting, allocations};
use tldi_tests::aimed;

#[global_allocator]
static ALLOCATOR: Counting = Counting::new();

/// Counts allocations per frame of new points, which must be none on one thread.
#[derive(Parser)]
struct Args {
    /// Points of each of the two clouds
    #[arg(long, value_name = "N", default_value_t = 20_000)]
    points: usize,
    /// Seed of the points
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// Different frames, which come again and again.
const FRAMES: u64 = 4;

/// Rounds of frames until memory has settled.
const WARM_ROUNDS: usize = 3;

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    ensure!(args.points >= 100, "at least 100 points are needed");
    ensure!(
        allocations(|| drop(vec![0u8; 100])) > 0,
        "the allocator does not count"
    );
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    println!(
        "{:<14} {:>7} {:>24} {:>22}",
        "placement", "threads", "per frame: new points", "comparison"
    );
    let mut on_one_thread = 0;
    let mut thread_counts = vec![1, cores];
    thread_counts.dedup();
    for threads in thread_counts {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()?;
        for placement in Placement::ALL {
            let [points, comparison] = pool.install(|| settled(&args, placement))?;
            if threads == 1 {
                on_one_thread += points + comparison;
            }
            println!(
                "{:<14} {threads:>7} {:>24.2} {:>22.2}",
                placement.name(),
                points as f64 / FRAMES as f64,
                comparison as f64 / FRAMES as f64
            );
        }
    }
    ensure!(
        on_one_thread == 0,
        "{on_one_thread} allocations in settled frames on one thread"
    );
    Ok(())
}

/// Allocations in a round of frames: for new points, and for comparing.
fn settled(args: &Args, placement: Placement) -> anyhow::Result<[usize; 2]> {
    let source = Source::Generated(args.points);
    let radius = source.radius(placement)?;
    let frames: Vec<[Vec<Vec3>; 2]> = (0..FRAMES)
        .map(|number| source.bodies(placement, radius, args.seed + number))
        .collect();
    let cloud = |points: &[Vec3]| PointCloud::builder(points.to_vec()).radius(radius).build();
    let [a, b] = &frames[0];
    let mut clouds = [cloud(a)?, cloud(b)?];
    let (mut backend, mut results) = (CpuBackend::new(), Vec::<PairResult>::new());
    let mut counts = [0; 2];
    for _ in 0..=WARM_ROUNDS {
        counts = [0; 2];
        for frame in &frames {
            let mut outcome = Ok(());
            counts[0] += allocations(|| {
                outcome = clouds
                    .iter_mut()
                    .zip(frame)
                    .try_for_each(|(cloud, points)| cloud.set_points(points, None));
            });
            outcome?;
            let [a, b] = &clouds;
            let [a, b] = [a, b].map(Surface::Cloud);
            let query = aimed(a, b, Pose3::IDENTITY, Params::for_radius(radius));
            let mut outcome = Ok(());
            counts[1] += allocations(|| outcome = backend.compare(&[query], &mut results));
            outcome?;
        }
    }
    Ok(counts)
}
