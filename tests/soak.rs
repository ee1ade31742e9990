//! Runs a world for as long as is asked, in cycles that all do the same: clouds stream, bodies come and go, colliders
//! get other shapes and points. Memory and work of a cycle must stay what they were.

#![allow(
    clippy::print_stdout,
    reason = "a table is the output; progress goes to stderr"
)]

use anyhow::ensure;
use clap::Parser;
use indicatif::ProgressBar;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use rapier3d_tldi::{CloudRecipe, RadiusRule, sample_shape};
use serde::Serialize;
use std::path::PathBuf;
use std::time::Instant;
use tldi_memory::{Counting, held};
use tldi_wgpu::{AdapterChoice, AutoBackend, BackendChoice, Gpu, WgpuBackend};

#[global_allocator]
static ALLOCATOR: Counting = Counting::new();

/// Runs a world with streaming clouds, bodies that are added and removed, and colliders whose shapes are swapped;
/// fails if a step does, or if memory or work grow.
#[derive(Parser)]
struct Args {
    /// Steps
    #[arg(long, value_name = "N", default_value_t = 100_000)]
    steps: usize,
    /// Seed of points and bodies
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Write one row for each tenth of the run to this file as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Begin on a GPU, or a driver that imitates one, and lose it after its first contacts: the CPU must go on
    #[arg(long)]
    lose_device: bool,
}

/// Steps of a cycle, at whose end all bodies are gone.
const CYCLE: usize = 250;

/// Steps between two bodies.
const EVERY: usize = 10;

/// Steps for which a body stays.
const STAYS: usize = 80;

/// Points of a frame of the stream: a floor with a point every 5 cm.
const EDGE: usize = 60;
const SPACING: f32 = 0.05;

/// Cycles in which memory settles.
const WARM: usize = 8;

/// Bytes that may be kept besides those for each body: rapier's tables grow in steps.
const SLACK: isize = 64 << 10;

/// Bytes that may be kept of a body that is gone, in the mean: 2.3 were measured over 20,000 bodies.
const PER_BODY: isize = 8;

/// Cycles that are compared together. An odd number of bodies comes and goes, so they take other places in rapier's tables, and
/// are solved in another order, in every second cycle: its work differs by 11 %.
const ROUND: usize = 2;

/// By how much the work of a tenth of the run may differ from that of the first. Measured: 0.5 % over 1,000,000 steps.
const WORK: f64 = 0.02;

/// What a number of cycles took.
#[derive(Clone, Debug, Default, Serialize)]
struct Part {
    cycles: usize,
    /// Bodies that came and went.
    bodies: usize,
    /// Bytes that were taken at the end of its last cycle, when all bodies were gone.
    live_bytes: usize,
    /// Pairs that were compared, and pixels in which surfaces were close, of a cycle in the mean.
    pairs: f64,
    contact_pixels: f64,
    /// Seconds of a cycle in the mean. Printed, not asserted.
    seconds: f64,
}

struct Soak {
    world: PhysicsWorld,
    tldi: TldiPipeline,
    stream: CloudStream,
    /// Bodies in the world, the oldest first.
    bodies: Vec<(RigidBodyHandle, ColliderHandle)>,
    shapes: Vec<SharedShape>,
    seed: u64,
    /// The device that compares, until it is lost.
    gpu: Option<Gpu>,
}

impl Soak {
    fn new(seed: u64, lose_device: bool) -> anyhow::Result<Self> {
        let mut world = PhysicsWorld::default();
        let gpu = (lose_device.then(|| Gpu::open(AdapterChoice::Any))).transpose()?;
        let backend = match &gpu {
            Some(gpu) => Box::new(AutoBackend::with_gpu(WgpuBackend::new(gpu.clone())?, 0)),
            None => BackendChoice::Cpu.open()?,
        };
        let tldi = TldiPipeline::with_backend(TldiConfig::default(), backend)?;
        tldi.attach(&mut world);
        let recipe = CloudRecipe {
            radii: RadiusRule::Global(SPACING),
            ..CloudRecipe::default()
        };
        let stream = CloudStream::new(&mut world.colliders, recipe)?;
        let solids = [
            SharedShape::ball(0.12),
            SharedShape::cuboid(0.1, 0.12, 0.14),
            SharedShape::capsule_y(0.1, 0.08),
        ];
        let mut shapes = solids.to_vec();
        for solid in &solids {
            let cloud = sample_shape(&**solid, 0.5 * SPACING)?;
            shapes.push(SharedShape::new(PointCloudShape::new(cloud)));
        }
        Ok(Self {
            world,
            tldi,
            stream,
            bodies: Vec::new(),
            shapes,
            seed,
            gpu,
        })
    }

    /// Whether there was a device to lose.
    fn lose_device(&mut self) -> bool {
        let gpu = self.gpu.take();
        gpu.inspect(|gpu| gpu.device().destroy()).is_some()
    }

    /// The same in every cycle.
    fn cycle(&mut self, part: &mut Part) -> anyhow::Result<()> {
        let mut rng = fastrand::Rng::with_seed(self.seed);
        let start = Instant::now();
        let (mut pairs, mut pixels) = (0, 0);
        for step in 0..CYCLE {
            let frame: Vec<Vector> = (0..EDGE * EDGE)
                .map(|k| {
                    let at = [k % EDGE, k / EDGE].map(|c| c as f32 - 0.5 * EDGE as f32);
                    SPACING * Vector::new(at[0], 0.05 * rng.f32(), at[1])
                })
                .collect();
            self.stream.frame(
                &mut self.tldi,
                &self.world.bodies,
                &mut self.world.colliders,
                &frame,
                &Pose::IDENTITY,
            )?;
            if step % EVERY == 0 && step + STAYS < CYCLE {
                let mut spread = || 1.6 * (rng.f32() - 0.5);
                let at = Vector::new(spread(), 0.4, spread());
                let body = RigidBodyBuilder::dynamic()
                    .translation(at)
                    .linvel(-2.0 * Vector::Y)
                    .angvel(Vector::new(spread(), spread(), spread()))
                    .ccd_enabled(step % (3 * EVERY) == 0);
                let shape = self.shapes[rng.usize(..self.shapes.len())].clone();
                let collider = ColliderBuilder::new(shape).density(500.0);
                self.bodies.push(self.world.insert(body, collider));
                part.bodies += 1;
            }
            if step % EVERY == EVERY / 2 && !self.bodies.is_empty() {
                let (_, collider) = self.bodies[rng.usize(..self.bodies.len())];
                let shape = self.shapes[rng.usize(..self.shapes.len())].clone();
                let collider = self.world.colliders.get_mut(collider);
                collider.expect("a body's collider").set_shape(shape);
            }
            if step >= STAYS && step % EVERY == 0 && !self.bodies.is_empty() {
                let (body, _) = self.bodies.remove(0);
                self.world.remove_body(body);
            }
            // The device has found contacts.
            let is_lost = pixels > 0 && self.lose_device();
            let report = self.tldi.step(&mut self.world)?;
            let (on_gpu, is_told) = (&*report.backend == "gpu", report.fallback.is_some());
            ensure!(
                on_gpu == self.gpu.is_some() && (!is_lost || is_told),
                "step {step}: on {}, {:?}",
                report.backend,
                report.fallback
            );
            pairs += report.pairs_batched;
            pixels += report.contact_pixels;
        }
        while let Some((body, _)) = self.bodies.pop() {
            self.world.remove_body(body);
        }
        part.cycles += 1;
        part.pairs += pairs as f64;
        part.contact_pixels += pixels as f64;
        part.seconds += start.elapsed().as_secs_f64();
        part.live_bytes = held();
        Ok(())
    }
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let cycles = args.steps.div_ceil(CYCLE);
    ensure!(
        cycles >= 2 * WARM,
        "at least {} steps: memory settles in the first {}",
        2 * WARM * CYCLE,
        WARM * CYCLE
    );
    let mut soak = Soak::new(args.seed, args.lose_device)?;
    let progress = ProgressBar::new(cycles as u64).with_message("cycles");
    let mut settling = Part::default();
    for _ in 0..WARM {
        soak.cycle(&mut settling)?;
        progress.inc(1);
    }
    let rounds = (cycles - WARM) / ROUND;
    let parts = rounds.min(10);
    let mut measured: Vec<Part> = Vec::with_capacity(parts);
    for k in 0..parts {
        let mut part = Part::default();
        for _ in ROUND * (k * rounds / parts)..ROUND * ((k + 1) * rounds / parts) {
            soak.cycle(&mut part)?;
            progress.inc(1);
        }
        let count = part.cycles as f64;
        for sum in [&mut part.pairs, &mut part.contact_pixels, &mut part.seconds] {
            *sum /= count;
        }
        measured.push(part);
    }
    progress.finish_and_clear();
    ensure!(
        soak.gpu.is_none(),
        "no pair was in contact: the device was not lost"
    );
    println!("cycles  bodies  KiB live  pairs  contact pixels  ms a step");
    for part in &measured {
        println!(
            "{:>6} {:>7} {:>9} {:>6.0} {:>15.0} {:>10.3}",
            part.cycles,
            part.bodies,
            part.live_bytes >> 10,
            part.pairs,
            part.contact_pixels,
            1e3 * part.seconds / CYCLE as f64
        );
    }
    if let Some(path) = &args.json {
        std::fs::write(path, serde_json::to_string_pretty(&measured)?)?;
    }
    check(&settling, &measured)
}

/// Whether memory and work stayed what they were.
fn check(settling: &Part, measured: &[Part]) -> anyhow::Result<()> {
    let [first, .., last] = measured else {
        return Ok(());
    };
    let bodies: usize = measured.iter().map(|part| part.bodies).sum();
    let grown = last.live_bytes as isize - settling.live_bytes as isize;
    println!(
        "{grown} B more than when memory had settled: {:.1} for each of {bodies} bodies",
        grown as f64 / bodies as f64
    );
    ensure!(
        grown <= SLACK + PER_BODY * bodies as isize,
        "memory grew by {grown} B over {bodies} bodies"
    );
    ensure!(first.contact_pixels > 0.0, "no bodies were in contact");
    for part in measured {
        let differs = |of: f64, first: f64| (of - first).abs() > WORK * first;
        ensure!(
            !differs(part.pairs, first.pairs)
                && !differs(part.contact_pixels, first.contact_pixels),
            "work changed: {part:?} of {first:?}"
        );
    }
    Ok(())
}
