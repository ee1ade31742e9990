//! One command for a machine with a GPU: what the card is, what it cannot do faster, whether its answers are right, and
//! how long batches take.

use anyhow::Context;
use clap::Parser;
use std::fs::File;
use std::path::PathBuf;
use tldi_benches::gpu_day::{Report, Settings, print};
use tldi_benches::stored::write_json;

/// Measures the GPU backend in all respects, within nine minutes. What does not fit is left out, and listed.
/// Exit status 1 if an answer is wrong.
#[derive(Parser)]
struct Args {
    /// Small sizes, for a driver that computes on the CPU
    #[arg(long)]
    small: bool,
    /// Seconds after which nothing new is begun
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Points of each body, several by commas
    #[arg(long, value_name = "N,N", value_delimiter = ',')]
    points: Option<Vec<usize>>,
    /// Random pairs that are compared with the CPU's
    #[arg(long, value_name = "N")]
    pairs: Option<u64>,
    /// Times that each is measured
    #[arg(long, value_name = "N")]
    repeats: Option<usize>,
    /// Seed of the points
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Write the results to this file as JSON
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// Folder for pictures, and for points of frames as NumPy files
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let mut settings = match args.small {
        true => Settings::small(),
        false => Settings::full(),
    };
    settings.seed = args.seed;
    settings.seconds = args.seconds.unwrap_or(settings.seconds);
    settings.sizes = args.points.unwrap_or(settings.sizes);
    settings.parity_pairs = args.pairs.unwrap_or(settings.parity_pairs);
    settings.repeats = args.repeats.unwrap_or(settings.repeats);
    anyhow::ensure!(
        settings.repeats > 0
            && settings
                .sizes
                .iter()
                .all(|n| (100..=20_000_000).contains(n)),
        "at least one repeat, and 100 to 20,000,000 points, are needed"
    );
    anyhow::ensure!(
        settings.parity_pairs > 0 && settings.seconds > 0.0,
        "--pairs and --seconds must be above 0: else no answer is checked"
    );
    // Before minutes of measuring.
    if let Some(path) = &args.json {
        let opened = File::options().create(true).append(true).open(path);
        opened.with_context(|| format!("cannot write {}", path.display()))?;
    }
    if let Some(out) = &args.out {
        std::fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    }
    let report = Report::measure(settings, args.out.as_deref())?;
    print(&report);
    if let Some(path) = &args.json {
        write_json(path, &report)?;
    }
    anyhow::ensure!(report.faults.is_empty(), "answers are wrong: see above");
    Ok(())
}
