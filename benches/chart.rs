//! The charts of the benches, from stored results alone.

#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a list of what was drawn is the output, and of what was not goes beside it"
)]

use clap::Parser;
use std::path::PathBuf;
use tldi_benches::charts::draw_all;

/// Draws charts of the results that `accuracy`, `contact_quality` and `bvh_vs_tldi` stored with --json, as SVG and PNG.
/// Nothing is measured.
#[derive(Parser)]
struct Args {
    /// Folder with the results (*.json), or with a folder of results for each kind of chart
    #[arg(long, value_name = "DIR", default_value = concat!(env!("CARGO_MANIFEST_DIR"), "/results"))]
    results: PathBuf,
    /// Folder for the charts, each in the folder of its kind (that of the results without)
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let drawn = draw_all(&args.results, args.out.as_ref().unwrap_or(&args.results))?;
    for file in drawn.files {
        println!("{}", file.display());
    }
    for missing in drawn.skipped {
        eprintln!("{missing}");
    }
    Ok(())
}
