//! How well the comparison measures the normal and the depth of contacts whose truth is known,
//! against the angle between the motion and the true normal.

mod chart;

use anyhow::Context;
use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::PathBuf;
use tldi_tests::{ACCURACY_ROWS, ANGLE_STEP, PolicyChoice, measure_accuracy};

/// Measures spheres, boxes and ramps against analytic truth; prints a table and draws a chart.
#[derive(Parser)]
struct Args {
    /// Write the rows to this file as JSON
    #[arg(long)]
    json: Option<PathBuf>,
    /// Write contact_accuracy.svg and contact_accuracy.png into this folder; the names of other
    /// camera policies are added
    #[arg(long)]
    out: Option<PathBuf>,
    /// Contacts for each pair, depth range, bin of angles, with and without normals
    #[arg(long, default_value_t = 101, value_parser = clap::value_parser!(u32).range(1..))]
    cases: u32,
    /// Seed of the random places, rotations and depths
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// From where pairs of clouds are looked at
    #[arg(long, value_enum, default_value_t = PolicyChoice::ContactZone)]
    camera_policy: PolicyChoice,
}

#[allow(clippy::print_stdout, reason = "the table is what the program is for")]
fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let bar = ProgressBar::new(ACCURACY_ROWS as u64);
    bar.set_style(ProgressStyle::with_template(
        "{bar:40} {pos}/{len} {msg} {eta}",
    )?);
    let rows = measure_accuracy(
        args.cases as usize,
        args.seed,
        args.camera_policy.into(),
        |row| {
            bar.set_message(row.pair.name());
            bar.inc(1);
        },
    );
    bar.finish_and_clear();
    for row in &rows {
        println!("{row}");
    }
    if let Some(path) = &args.json {
        let report = serde_json::json!({
            "cases": args.cases,
            "seed": args.seed,
            "angle_step_degrees": ANGLE_STEP,
            "rows": rows,
        });
        let text = serde_json::to_string_pretty(&report)? + "\n";
        std::fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    if let Some(folder) = &args.out {
        std::fs::create_dir_all(folder)
            .with_context(|| format!("cannot make {}", folder.display()))?;
        chart::draw(&rows, args.camera_policy.suffix(), folder)?;
    }
    Ok(())
}
