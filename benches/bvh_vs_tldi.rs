//! What a frame costs in which all points are new: ours, and what a user would pick instead.

#![allow(
    clippy::print_stdout,
    reason = "a bench's table is its output; progress goes to stderr"
)]

use anyhow::ensure;
use clap::Parser;
use indicatif::ProgressBar;
use peak_alloc::PeakAlloc;
use std::path::PathBuf;
use tldi::CpuBackend;
use tldi::glamx::Pose3;
use tldi_benches::args::{NameArgs, RunArgs};
use tldi_benches::floor::Coordinates;
use tldi_benches::model::Model;
use tldi_benches::peers::{Found, Frame, Method, Peer, TldiPeer, adapter, all_peers};
use tldi_benches::placements::{Placement, Source, bounds};
use tldi_benches::stages::{StageTimes, medians_ms};
use tldi_benches::stopwatch::Stopwatch;
use tldi_benches::stored::{FrameRow, LookedRow, Provenance, StageRow, WorkRow};
use tldi_benches::times::Times;
use tldi_wgpu::BackendChoice;

#[global_allocator]
static MEMORY: PeakAlloc = PeakAlloc;

/// Compares one frame of two clouds, all of whose points are new, by every method: time to build and
/// to query, and what was found. Peers are also measured on only what the bounds cannot exclude.
#[derive(Parser)]
struct Args {
    /// Points of each of the two clouds, several by commas (10000,100000 without; the vertices of a
    /// model, moved a little, where one with faces is given)
    #[arg(long, value_name = "N,N", value_delimiter = ',')]
    points: Vec<usize>,
    /// Take the points from this model in place of a generated body: any format, also gzipped
    #[arg(long, value_name = "FILE")]
    model: Option<PathBuf>,
    /// Frames that each is measured; medians and quartiles are reported
    #[arg(long, value_name = "N", default_value_t = 5)]
    repeats: usize,
    /// Only these placements, several by commas: near-miss, slight, deep, coincident, body on scan
    #[arg(long, value_name = "NAME,NAME", value_delimiter = ',', value_parser = Placement::named)]
    placement: Vec<Placement>,
    #[command(flatten)]
    names: NameArgs,
    /// Measure our method on this backend too
    #[arg(long, value_name = "auto|cpu|gpu", default_value_t = BackendChoice::Cpu)]
    backend: BackendChoice,
    #[command(flatten)]
    run: RunArgs,
}

/// Fewest points of a cloud.
const FEWEST: usize = 100;

/// What is measured, and the threads that it may use.
type Measured = (Box<dyn Peer>, usize);

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    ensure!(
        args.repeats > 0 && args.points.iter().all(|n| *n >= FEWEST),
        "at least one repeat and {FEWEST} points are needed"
    );
    let model = args.model.as_deref().map(Model::read).transpose()?;
    if let Some(model) = &model {
        ensure!(
            model.points.len() >= FEWEST,
            "{} has fewer than {FEWEST} points",
            model.name
        );
    }
    let mut provenance = Provenance::now(None);
    let mut rows = Vec::new();
    for source in sources(&args, model.as_ref()) {
        let is_asked =
            |placement: &Placement| args.placement.is_empty() || args.placement.contains(placement);
        for placement in Placement::ALL.into_iter().filter(is_asked) {
            let mut methods = methods(&args)?;
            let measured = measure(&args, &source, placement, &mut methods)?;
            print(&measured);
            rows.extend(measured);
            let peers = methods.iter().map(|(method, _)| &**method);
            provenance.adapter = adapter(peers).or(provenance.adapter);
        }
    }
    ensure!(
        !rows.is_empty(),
        "no method that --only and --without leave takes such frames: meshes need a --model with faces"
    );
    args.run.store(provenance, rows)?;
    Ok(())
}

fn sources<'a>(args: &Args, model: Option<&'a Model>) -> Vec<Source<'a>> {
    match (model, args.points.is_empty()) {
        (Some(model), true) if !model.faces.is_empty() => vec![Source::Vertices(model)],
        (Some(model), true) => vec![Source::Sampled(model, model.points.len())],
        (Some(model), false) => {
            let of = |n: &usize| Source::Sampled(model, *n);
            args.points.iter().map(of).collect()
        }
        (None, true) => [10_000, 100_000].map(Source::Generated).into(),
        (None, false) => args.points.iter().map(|n| Source::Generated(*n)).collect(),
    }
}

/// All methods, of which some refuse some frames.
fn methods(args: &Args) -> anyhow::Result<Vec<Measured>> {
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let ours = |backend, threads| -> anyhow::Result<Measured> {
        let method = Method::Default { pixel_scale: 1.0 };
        let peer = TldiPeer::new(backend, method, threads)?;
        Ok((Box::new(peer), threads))
    };
    let mut all = vec![ours(Box::new(CpuBackend::new()), 1)?];
    if cores > 1 {
        all.push(ours(Box::new(CpuBackend::new()), cores)?);
    }
    if args.backend != BackendChoice::Cpu {
        all.push(ours(args.backend.open()?, cores)?);
    }
    all.extend(all_peers().into_iter().map(|peer| (peer, 1)));
    let is_kept = |(peer, _): &Measured| args.names.take(&peer.name());
    all.retain(is_kept);
    ensure!(!all.is_empty(), "--only and --without leave no method");
    Ok(all)
}

/// What one method did in the frames of a placement.
#[derive(Clone, Default)]
struct Done {
    found: Vec<Found>,
    stages: Vec<StageTimes>,
    peak_mib: f64,
}

/// Frames of one placement, each by all methods, one after the other, so that a change of the
/// machine's speed meets all alike.
fn measure(
    args: &Args,
    source: &Source,
    placement: Placement,
    methods: &mut Vec<Measured>,
) -> anyhow::Result<Vec<FrameRow>> {
    let radius = source.radius(placement)?;
    let mut all_done = vec![Done::default(); methods.len()];
    let mut floors = Vec::new();
    let mut counts = [0; 2];
    let faces = match source {
        Source::Vertices(model) if placement != Placement::BodyOnScan => {
            Some([&model.faces[..]; 2])
        }
        _ => None,
    };
    let progress = ProgressBar::new((args.repeats + 1) as u64).with_message(placement.name());
    for number in 0..=args.repeats as u64 {
        let [a, b] = source.bodies(placement, radius, args.run.seed + number);
        counts = [a.len(), b.len()];
        let frame = Frame {
            faces,
            ..Frame::new(&a, &b, radius)
        };
        if number == 0 {
            methods.retain(|(method, _)| method.takes(&frame));
        }
        for ((method, _), done) in methods.iter_mut().zip(&mut all_done) {
            // Every method then finds the points in the cache, where they fit.
            floors.push(floor(&frame));
            MEMORY.reset_peak_usage();
            let before = MEMORY.current_usage_as_mb();
            let found = method.compare(&frame);
            let peak_mib = f64::from(MEMORY.peak_usage_as_mb() - before);
            done.peak_mib = done.peak_mib.max(peak_mib);
            // The first frame warms memory up.
            done.found.extend((number > 0).then_some(found));
        }
        // After what is timed, on the same terms.
        for ((method, _), done) in methods.iter_mut().zip(&mut all_done) {
            floor(&frame);
            let stages = method.stages(&frame);
            done.stages.extend(stages.filter(|_| number > 0));
        }
        progress.inc(1);
    }
    progress.finish_and_clear();
    let floor_ms = 1e3 * Times::of(floors).median;
    let row = |((method, threads), done): (&Measured, Done)| FrameRow {
        model: source.name().to_owned(),
        points: counts[0],
        points_b: counts[1],
        placement: placement.name().to_owned(),
        method: method.name(),
        threads: *threads,
        ..done.row(floor_ms)
    };
    Ok(methods.iter().zip(all_done).map(row).collect())
}

impl Done {
    /// The row, without what was compared.
    fn row(&self, floor_ms: f64) -> FrameRow {
        let spread = |part: fn(&Found) -> f64| Times::of(self.found.iter().map(|f| 1e3 * part(f)));
        let total = spread(|found| found.build_seconds + found.query_seconds);
        let last = self.found.last().copied().unwrap_or_default();
        FrameRow {
            model: String::new(),
            points: 0,
            points_b: 0,
            placement: String::new(),
            method: String::new(),
            threads: 0,
            build_ms: spread(|found| found.build_seconds).median,
            query_ms: spread(|found| found.query_seconds).median,
            total_ms: total.median,
            least_ms: total.least,
            quartiles_ms: Some(total.quartiles),
            most_ms: total.most,
            frames: self.found.len(),
            collides: last.collides,
            contacts: last.contacts,
            peak_mib: self.peak_mib,
            floor_ratio: total.median / floor_ms,
            work: last.work.map(WorkRow::from),
            stages: (!self.stages.is_empty()).then(|| stage_rows(&self.stages)),
        }
    }
}

fn stage_rows(runs: &[StageTimes]) -> Vec<StageRow> {
    let row = |(name, ms): (&str, f64)| StageRow {
        name: name.to_owned(),
        ms,
    };
    medians_ms(runs).into_iter().map(row).collect()
}

/// Seconds of one pass over both clouds: moved, and counted where they may touch. The second pass of
/// two, as methods find the points in the cache where they fit.
fn floor(frame: &Frame) -> f64 {
    let overlap = bounds(frame.a).intersection(bounds(frame.b));
    let clouds = [frame.a, frame.b].map(Coordinates::of);
    let pose = Pose3::translation(1e-6, 0.0, 0.0);
    let mut seconds = 0.0;
    for _ in 0..2 {
        let start = Stopwatch::of_thread();
        for cloud in &clouds {
            std::hint::black_box(cloud.moved_into(&pose, overlap));
        }
        seconds = start.seconds();
    }
    seconds
}

fn print(rows: &[FrameRow]) {
    let Some(first) = rows.first() else {
        return;
    };
    println!(
        "\n{}, {} and {} points, {}",
        first.model, first.points, first.points_b, first.placement
    );
    println!(
        "{:<32} {:>7} {:>10} {:>10} {:>10} {:>19} {:>9} {:>9} {:>8} {:>8}",
        "method",
        "threads",
        "build ms",
        "query ms",
        "total ms",
        "quartiles",
        "collides",
        "contacts",
        "MiB",
        "x floor"
    );
    for row in rows {
        let quartiles = row
            .quartiles_ms
            .map(|[lower, upper]| format!("{lower:.3}–{upper:.3}"));
        let quartiles = quartiles.unwrap_or_default();
        println!(
            "{:<32} {:>7} {:>10.3} {:>10.3} {:>10.3} {:>19} {:>9} {:>9} {:>8.1} {:>8.1}",
            row.method,
            row.threads,
            row.build_ms,
            row.query_ms,
            row.total_ms,
            quartiles,
            row.collides,
            row.contacts,
            row.peak_mib,
            row.floor_ratio
        );
    }
    if let Some((row, work)) = rows.iter().find_map(|row| Some((row, row.work?))) {
        print_work(row, &work);
    }
    if let Some((row, stages)) = rows
        .iter()
        .find_map(|row| Some((row, row.stages.as_ref()?)))
    {
        print_stages(row, stages);
    }
}

/// The same at any number of threads.
fn print_work(row: &FrameRow, work: &WorkRow) {
    let looks = work.looks();
    let sum = |part: fn(&LookedRow) -> usize| grouped(looks.iter().map(part).sum());
    let [large, windows, fine] = looks.map(|look| grouped(look.points));
    println!(
        "{}, modelled: {large} + {windows} + {fine} of {} points (large pixels, windows, fine), \
         {} pixels, {} layers; {} points passed a cull",
        row.method,
        grouped(row.points + row.points_b),
        sum(|look| look.pixels),
        sum(|look| look.layers),
        grouped(work.culled)
    );
}

fn print_stages(row: &FrameRow, stages: &[StageRow]) {
    let words = stages
        .iter()
        .map(|stage| format!("{} {:.3}", stage.name, stage.ms));
    let words: Vec<String> = words.collect();
    println!("{}, stages: {} ms", row.method, words.join(", "));
}

/// With a comma between thousands.
fn grouped(number: usize) -> String {
    let digits = number.to_string();
    let mut words = String::new();
    for (k, digit) in digits.chars().enumerate() {
        if k > 0 && (digits.len() - k).is_multiple_of(3) {
            words.push(',');
        }
        words.push(digit);
    }
    words
}
