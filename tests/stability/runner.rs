//! Runs cases in parallel; rows come in the order of the cases.

use super::case::{Case, Setup, Stop, Verdict};
use super::known::known_cause;
use super::method::Method;
use super::row::Row;
use indicatif::{ProgressBar, ProgressStyle};
use rayon::prelude::*;
use std::collections::BTreeMap;
use std::io::{self, IsTerminal};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::time::Instant;

/// Seconds of one core that each scene took with each method.
pub(crate) type Timings = BTreeMap<(&'static str, Method), f64>;

/// Runs every case with every method.
pub(crate) fn run_all(
    cases: Vec<Case>,
    methods: &[Method],
    setup: &Setup,
) -> anyhow::Result<(Vec<Row>, Timings)> {
    let jobs: Vec<(&Case, Method)> = cases
        .iter()
        .flat_map(|case| methods.iter().map(move |method| (case, *method)))
        .collect();
    let bar = if io::stderr().is_terminal() && !setup.trace {
        ProgressBar::new(jobs.len() as u64)
    } else {
        ProgressBar::hidden()
    };
    bar.set_style(ProgressStyle::with_template(
        "{bar:40} {pos}/{len} rows, {elapsed}, {msg}",
    )?);
    let run = |&(case, method): &(&Case, Method)| {
        bar.set_message(format!("{} / {}", case.scene, case.name));
        let start = Instant::now();
        let row = run_one(case, &Setup { method, ..*setup });
        bar.inc(1);
        (row, start.elapsed().as_secs_f64())
    };
    // Traces of several worlds would mingle.
    let done: Vec<(Row, f64)> = if setup.trace {
        jobs.iter().map(run).collect()
    } else {
        jobs.par_iter().with_max_len(1).map(run).collect()
    };
    bar.finish_and_clear();
    let mut timings = Timings::new();
    for ((case, method), (_, seconds)) in jobs.iter().zip(&done) {
        *timings.entry((case.scene, *method)).or_default() += seconds;
    }
    Ok((done.into_iter().map(|(row, _)| row).collect(), timings))
}

/// Runs one case with one method; a panic is a failure of that row.
fn run_one(case: &Case, setup: &Setup) -> Row {
    let outcome = catch_unwind(AssertUnwindSafe(|| case.run(setup))).unwrap_or_else(|panic| {
        let text = panic
            .downcast_ref::<String>()
            .map(String::as_str)
            .or_else(|| panic.downcast_ref::<&str>().copied())
            .unwrap_or("without a message");
        Err(Stop::Failed(format!("panicked: {text}")))
    });
    let (passed, verdict, reason) = match outcome {
        Ok(verdict) if verdict.failures.is_empty() => (Some(true), verdict, None),
        Ok(verdict) => {
            let texts: Vec<&str> = verdict.failures.iter().map(|f| f.text.as_str()).collect();
            let reason = texts.join("; ");
            (Some(false), verdict, Some(reason))
        }
        Err(Stop::Unfit(why)) => (None, Verdict::default(), Some(format!("n/a: {why}"))),
        Err(Stop::Failed(error)) => (Some(false), Verdict::default(), Some(error)),
    };
    let is_ours = setup.method == Method::Tldi && passed == Some(false);
    let known = is_ours.then(|| known_cause(case.scene, &case.name, &verdict));
    Row {
        scene: case.scene,
        case: case.name.clone(),
        method: setup.method.name(),
        seed: case.seed,
        passed,
        metrics: verdict.metrics,
        reason,
        known_cause: known.flatten(),
    }
}
