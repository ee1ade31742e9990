//! How often the reported depth of closed clouds that overlap is far more than the true one.

use anyhow::Context;
use clap::Parser;
use indicatif::{ProgressBar, ProgressStyle};
use std::collections::BTreeMap;
use std::path::PathBuf;
use tldi_tests::{ClosedShape, Overlap, measure_overlaps};

/// Pushes spheres, boxes, capsules and, where they are at hand, models into each other at random; prints for how many
/// the reported depth exceeds three times the least way out plus a point's radius.
#[derive(Parser)]
struct Args {
    /// Write what is falsely deep, and the counts, to this file as JSON
    #[arg(long)]
    json: Option<PathBuf>,
    /// Poses
    #[arg(long, default_value_t = 10_000)]
    poses: u32,
    /// Seed of the poses
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

#[allow(clippy::print_stdout, reason = "the table is what the program is for")]
fn main() -> anyhow::Result<()> {
    let args = Args::parse();
    let mut shapes = ClosedShape::primitives();
    shapes.extend(ClosedShape::models());
    let bar = ProgressBar::new(args.poses.into());
    bar.set_style(ProgressStyle::with_template("{bar:40} {pos}/{len} {eta}")?);
    let overlaps = measure_overlaps(&shapes, args.poses, args.seed, || bar.inc(1));
    bar.finish_and_clear();

    let mut counts = BTreeMap::<(bool, [&str; 2]), [usize; 2]>::new();
    for overlap in &overlaps {
        let mut names = overlap.shapes;
        names.sort_unstable();
        for names in [names, ["all", "all"]] {
            let [poses, falsely_deep] = counts.entry((overlap.with_normals, names)).or_default();
            *poses += 1;
            *falsely_deep += usize::from(overlap.is_falsely_deep());
        }
    }
    for ((with_normals, [a, b]), [poses, falsely_deep]) in &counts {
        let normals = if *with_normals { "normals" } else { "bare" };
        println!("{normals:8} {a:10} × {b:10} {falsely_deep:4} of {poses} falsely deep");
    }
    if let Some(path) = &args.json {
        let falsely_deep: Vec<&Overlap> = (overlaps.iter())
            .filter(|overlap| overlap.is_falsely_deep())
            .collect();
        let poses = |with_normals| {
            (overlaps.iter())
                .filter(|overlap| overlap.with_normals == with_normals)
                .count()
        };
        let report = serde_json::json!({
            "seed": args.seed,
            "poses_with_normals": poses(true),
            "poses_bare": poses(false),
            "falsely_deep": falsely_deep,
        });
        let text = serde_json::to_string_pretty(&report)? + "\n";
        std::fs::write(path, text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(())
}
