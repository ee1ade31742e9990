//! The parts of the suite: how a surface is given to each method, worlds, rows, reports, scenes.

mod arena;
mod args;
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

/// Runs what the command line asks for; the exit code is 1 if a row of ours fails undeclared, or
/// declared ones fail too often.
pub(crate) fn main() -> anyhow::Result<ExitCode> {
    let args = Args::parse();
    let scale = args.scale();
    let cases = args.chosen_cases(&scale)?;
    let methods = args.chosen_methods();
    let started = RunInfo::now(&args);
    let (rows, timings) = runner::run_all(cases, &methods, &args.setup())?;
    let report = Report::new(started, rows, timings);
    report.write_files(&args)?;
    if let Some(folder) = &args.out {
        chart::draw(&report, folder)?;
    }
    let mut out = io::stdout().lock();
    writeln!(out, "{}", report.summary())?;
    let (undeclared, frequent) = (report.undeclared_failures(), report.frequent_failures());
    for row in &undeclared {
        writeln!(out, "FAILED: {row}")?;
    }
    for failure in &frequent {
        writeln!(out, "FAILED too often: {failure}")?;
    }
    Ok(if undeclared.is_empty() && frequent.is_empty() {
        ExitCode::SUCCESS
    } else {
        ExitCode::FAILURE
    })
}

#[cfg(test)]
mod tests {
    use super::case::{Case, Scale, Setup};
    use super::method::Method;
    use super::runner::run_all;
    use super::scenes::SCENES;
    use rapier3d_tldi::TldiConfig;
    use std::collections::HashSet;
    use tldi_wgpu::BackendChoice;

    fn scale() -> Scale {
        Scale {
            seeds: vec![3],
            long: false,
            drops: 9,
            only_drop: None,
        }
    }

    fn cases_of(scene: &str) -> Vec<Case> {
        let scene = SCENES.iter().find(|known| known.name == scene);
        scene.expect("there is one").all_cases(&scale())
    }

    #[test]
    fn rows_have_names_of_their_own() {
        let mut seen = HashSet::new();
        for case in SCENES.iter().flat_map(|scene| scene.all_cases(&scale())) {
            let name = (case.scene, case.name.clone(), case.seed);
            assert!(seen.insert(name.clone()), "{name:?} occurs twice");
        }
    }

    #[test]
    fn equal_seeds_give_equal_rows() -> anyhow::Result<()> {
        let setup = Setup {
            method: Method::Tldi,
            config: TldiConfig::default(),
            backend: BackendChoice::Cpu,
            trace: false,
            seed: 0,
        };
        for scene in ["bounce", "tunnelling"] {
            let run = || run_all(cases_of(scene), &Method::ALL, &setup);
            let (first, second) = (run()?.0, run()?.0);
            assert_eq!(first, second);
        }
        Ok(())
    }
}
