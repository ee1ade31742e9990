//! Generated cases that no user should be able to kill the project with: clouds, pairs, casts, queries, worlds.
//!
//! - `PROPTEST_CASES` is the number of cases of each property (default: [`CASES`]).
//! - `PROPTEST_RNG_SEED` is the seed (default: 1). A failure prints the smallest case that still fails.
//! - `FUZZ_CASE_SECONDS` ends the run, with the case, where one takes longer. Not for `cargo test`: time depends
//!   on the machine.
//!
//! Readers have theirs in `crates/tldi-sources/tests/hostile_generated.rs`. What ran, and what was found:
//! `docs/robustness.md`.

mod casts;
mod clouds;
mod pairs;
mod shapes;
mod spec;
mod worlds;

use proptest::strategy::Strategy;
use proptest::test_runner::{Config, RngSeed, TestCaseError, TestRunner};
use std::fmt::Debug;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::Duration;

/// Cases of each property where `PROPTEST_CASES` is not set.
const CASES: u32 = 1000;

/// Runs `property` on generated cases; panics with the smallest case that fails.
fn check<S: Strategy>(strategy: &S, property: impl Fn(S::Value) -> Result<(), TestCaseError>)
where
    S::Value: Debug + Clone,
{
    let from_environment = Config::default();
    let is_set = |name| std::env::var_os(name).is_some();
    let config = Config {
        cases: match is_set("PROPTEST_CASES") {
            true => from_environment.cases,
            false => CASES,
        },
        rng_seed: match is_set("PROPTEST_RNG_SEED") {
            true => from_environment.rng_seed,
            false => RngSeed::Fixed(1),
        },
        failure_persistence: None,
        max_shrink_iters: 2000,
        ..from_environment
    };
    let watch = case_limit().map(watchdog);
    let outcome = TestRunner::new(config).run(strategy, |case| {
        if let Some(watch) = &watch {
            // The watchdog lives as long as the process.
            let _ = watch.send(Some(format!("{case:?}")));
        }
        let outcome = property(case);
        if let Some(watch) = &watch {
            let _ = watch.send(None);
        }
        outcome
    });
    if let Err(failure) = outcome {
        panic!("{failure}");
    }
}

fn case_limit() -> Option<Duration> {
    let seconds = std::env::var("FUZZ_CASE_SECONDS").ok()?;
    let seconds = seconds.parse().expect("FUZZ_CASE_SECONDS is a number");
    Some(Duration::from_secs(seconds))
}

/// Gets the case that begins, or `None` where it ended; ends the process where the next message is late.
fn watchdog(limit: Duration) -> Sender<Option<String>> {
    let (sender, receiver) = channel::<Option<String>>();
    std::thread::spawn(move || {
        while let Ok(message) = receiver.recv() {
            let Some(case) = message else { continue };
            if receiver.recv_timeout(limit) == Err(RecvTimeoutError::Timeout) {
                eprintln!("still running after {limit:?}: {case}");
                std::process::abort();
            }
        }
    });
    sender
}
