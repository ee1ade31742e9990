//! What a frame of a stream costs, from its points to its contacts.

#![allow(
    clippy::print_stdout,
    reason = "a bench's table is its output; progress goes to stderr"
)]

use anyhow::ensure;
use clap::Parser;
use fastrand::Rng;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use rapier3d_tldi::{CloudRecipe, RadiusRule};
use std::time::Instant;
use tldi::CpuBackend;

/// Streams frames of 0 to N points of a floor with bodies on it, and prints how long they take
#[derive(Parser)]
struct Args {
    /// Frames of each recipe
    #[arg(long, value_name = "N", default_value_t = 1000)]
    frames: usize,
    /// Most points of a frame
    #[arg(long, value_name = "N", default_value_t = 300_000)]
    points: usize,
    /// Seed of counts and points
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
}

/// Half the width of the floor, metres.
const HALF_WIDTH: f32 = 3.0;
/// Deviation of the points along the normal, metres.
const NOISE: f32 = 0.002;

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    ensure!(args.frames > 0, "at least one frame is needed");
    let global = CloudRecipe {
        radii: RadiusRule::Global(0.02),
        ..CloudRecipe::default()
    };
    let neighbors = CloudRecipe::default();
    let normals = CloudRecipe {
        pca_neighbors: Some(12),
        ..neighbors
    };
    println!(
        "{:<28} {:>7} {:>10} {:>9} {:>9} {:>9}   milliseconds a frame",
        "recipe", "frames", "points", "p50", "p99", "most"
    );
    for (name, recipe) in [
        ("one radius", global),
        ("radii of 7 neighbours", neighbors),
        ("and normals of 12", normals),
    ] {
        let (points, mut times) = stream(&args, recipe)?;
        times.sort_by(f64::total_cmp);
        let share = |share: f64| times[((times.len() - 1) as f64 * share).round() as usize];
        println!(
            "{name:<28} {:>7} {points:>10} {:>9.2} {:>9.2} {:>9.2}",
            times.len(),
            share(0.5),
            share(0.99),
            share(1.0)
        );
    }
    Ok(())
}

/// Points in all, and milliseconds of each frame: the stream and the step.
fn stream(args: &Args, recipe: CloudRecipe) -> anyhow::Result<(usize, Vec<f64>)> {
    let mut world = PhysicsWorld::default();
    let backend = Box::new(CpuBackend::new());
    let mut tldi = TldiPipeline::with_backend(TldiConfig::default(), backend)?;
    tldi.attach(&mut world);
    let mut stream = CloudStream::new(&mut world.colliders, recipe)?;
    let start = |k: usize| Vector::new(0.5 * k as f32 - 1.0, 0.3, 0.0);
    let balls: Vec<RigidBodyHandle> = (0..5)
        .map(|k| {
            let body = RigidBodyBuilder::dynamic().translation(start(k));
            world.insert(body, ColliderBuilder::ball(0.2)).0
        })
        .collect();
    let sensor = Pose::from_translation(2.0 * Vector::Y);
    let mut rng = Rng::with_seed(args.seed);
    let (mut seen, mut points, mut times) = (Vec::new(), 0, Vec::new());
    for _ in 0..args.frames {
        let count = rng.usize(..=args.points);
        seen.clear();
        seen.extend((0..count).map(|_| {
            let mut across = || HALF_WIDTH * (2.0 * rng.f32() - 1.0);
            let (x, z) = (across(), across());
            Vector::new(x, NOISE * (2.0 * rng.f32() - 1.0) - 2.0, z)
        }));
        let begin = Instant::now();
        let taken = stream.frame(
            &mut tldi,
            &world.bodies,
            &mut world.colliders,
            &seen,
            &sensor,
        )?;
        tldi.step(&mut world)?;
        times.push(1e3 * begin.elapsed().as_secs_f64());
        ensure!(
            taken.points == count,
            "{count} points became {}",
            taken.points
        );
        points += count;
        // What falls through a floor of few points is laid back.
        for (k, ball) in balls.iter().enumerate() {
            if world.bodies[*ball].translation().y < 0.0 {
                world.bodies[*ball].set_translation(start(k), true);
                world.bodies[*ball].set_linvel(Vector::ZERO, true);
            }
        }
    }
    Ok((points, times))
}
