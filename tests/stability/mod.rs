//! The parts of the suite: how a surface is given to each method, worlds, rows, reports, scenes.

mod args;
mod arena;
mod case;
mod chart;
mod host;
mod known;
mod method;
mod model;
mod report;
mod row;
mod runner;
mod scan_spots;
mod scenes;
mod surface;

use args::Args;
use clap::Parser;
use host::RunInfo;
use report::Report;
use std::io::{self, Write};
use std::process::ExitCode;

/// Runs what the command line asks for; the exit code is 1 if a row of ours fails undeclared.
pub(crate) fn main() -> anyhow::Result<ExitCode> {
    let args = Args::parse();
    args.backend.require_available()?;
    let scale = args.scale();
    let cases = args.chosen_cases(&scale)?;
    let methods = args.chosen_methods();
    let started = RunInfo::now(&args);
    let (rows, timings) = runner::run_all(cases, &methods, &args.setup())?;
    let report = Report::new(started, rows, timings);
    report.write_files(&args)?;
    let mut out = io::stdout().lock();
    writeln!(out, "{}", report.markdown())?;
    let undeclared = report.undeclared_failures();
    for row in &undeclared {
        writeln!(out, "FAILED: {row}")?;
    }
    Ok(if undeclared.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}
