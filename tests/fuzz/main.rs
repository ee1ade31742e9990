//! Generated cases that no user should be able to kill the project with: clouds, pairs, casts, queries, worlds.
//!
//! - `PROPTEST_CASES` is the number of cases of each property (default: [`CASES`]).
//! - `PROPTEST_RNG_SEED` is the seed (default: 1). A failure prints the smallest case that still fails.
//! - `FUZZ_CASE_SECONDS` ends the run, with the case, where one takes more processor time, and tells what the slowest
//!   took. For `--test-threads=1`, and not for `cargo test`: time depends on the machine.
//!
//! Each property also tells how many cases got an answer (`shares.rs`): refusals alone would pass it.
//!
//! Readers have theirs in `crates/tldi-sources/tests/hostile_generated.rs`. What ran, and what was found:
//! `docs/robustness.md`.

mod casts;
mod clouds;
mod pairs;
mod shapes;
mod shares;
mod spec;
mod worlds;

use cpu_time::ProcessTime;
use proptest::strategy::Strategy;
use proptest::test_runner::{Config, RngSeed, TestCaseError, TestRunner};
use std::cell::Cell;
use std::fmt::Debug;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::time::{Duration, Instant};

/// How many limits of processor time a case may wait, if it does nothing: a machine has other work, too.
const WAITING: u32 = 30;

/// How often the watchdog looks.
const LOOK: Duration = Duration::from_millis(100);

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
    let slowest = Cell::new(Duration::ZERO);
    let outcome = TestRunner::new(config).run(strategy, |case| {
        let Some(watch) = &watch else {
            return property(case);
        };
        // The watchdog lives as long as the process.
        let _ = watch.send(Some(format!("{case:?}")));
        let start = ProcessTime::now();
        let outcome = property(case);
        slowest.set(slowest.get().max(start.elapsed()));
        let _ = watch.send(None);
        outcome
    });
    if watch.is_some() {
        eprintln!("the slowest case took {:?}", slowest.get());
    }
    if let Err(failure) = outcome {
        panic!("{failure}");
    }
}

fn case_limit() -> Option<Duration> {
    let seconds = std::env::var("FUZZ_CASE_SECONDS").ok()?;
    let seconds = seconds.parse().expect("FUZZ_CASE_SECONDS is a number");
    Some(Duration::from_secs(seconds))
}

/// Gets the case that begins, or `None` where it ended; ends the process where a case takes more than `limit` of its
/// processor time, or hangs.
fn watchdog(limit: Duration) -> Sender<Option<String>> {
    let (sender, receiver) = channel::<Option<String>>();
    std::thread::spawn(move || {
        while let Ok(message) = receiver.recv() {
            let Some(case) = message else { continue };
            let (worked, begun) = (ProcessTime::now(), Instant::now());
            while receiver.recv_timeout(LOOK) == Err(RecvTimeoutError::Timeout) {
                if worked.elapsed() > limit || begun.elapsed() > WAITING * limit {
                    eprintln!("still running after {limit:?}: {case}");
                    std::process::abort();
                }
            }
        }
    });
    sender
}
