//! How long each stage of `tldi` takes of what one thread does.

use crate::distinct::distinct;
use crate::times::Times;
use std::sync::{Arc, Mutex, MutexGuard};
use std::time::{Duration, Instant};
use tracing::span::{Attributes, Id, Record};
use tracing::subscriber::with_default;
use tracing::{Event, Metadata, Subscriber};

/// In place of a stage: what is outside of all.
pub const REST: &str = "rest";

/// Stages in the order in which they first began, and the time of each without that of the stages within it; then the
/// [`REST`]. All together are the time of the whole.
pub type StageTimes = Vec<(&'static str, Duration)>;

/// Runs `run` and tells its stages, of those that this thread itself works on. Telling takes 0.1 µs for each span; after
/// it, a span that nobody asks for takes 0.01 µs, not 0.001.
pub fn staged<R>(run: impl FnOnce() -> R) -> (R, StageTimes) {
    let clock = Clock(Arc::new(Mutex::new(SelfTimes::new(Instant::now()))));
    with_default(clock.clone(), || {
        // Only now: to become the subscriber takes time, too.
        *clock.times() = SelfTimes::new(Instant::now());
        let result = run();
        let times = clock.times().until(Instant::now());
        (result, times)
    })
}

/// Median of each stage over several runs, milliseconds. A stage that does not run takes no time.
pub fn medians_ms(runs: &[StageTimes]) -> Vec<(&'static str, f64)> {
    let mut names = distinct(runs.iter().flatten().map(|(name, _)| *name));
    names.sort_by_key(|name| *name == REST);
    let ms = |run: &StageTimes, name| {
        let own = run.iter().find(|(own, _)| *own == name);
        own.map_or(0.0, |(_, time)| 1e3 * time.as_secs_f64())
    };
    let median = |name| Times::of(runs.iter().map(|run| ms(run, name))).median;
    names.into_iter().map(|name| (name, median(name))).collect()
}

/// Adds up the time in which a stage is the innermost one that runs.
struct SelfTimes {
    /// The rest comes first.
    totals: StageTimes,
    /// Places in `totals` of what runs, the innermost last.
    running: Vec<usize>,
    /// When the innermost one began, or went on.
    since: Instant,
}

impl SelfTimes {
    fn new(start: Instant) -> Self {
        Self {
            totals: vec![(REST, Duration::ZERO)],
            running: vec![0],
            since: start,
        }
    }

    /// Its place in `totals`, which is not 0.
    fn place(&mut self, stage: &'static str) -> usize {
        let known = self.totals.iter().position(|(name, _)| *name == stage);
        known.unwrap_or_else(|| {
            self.totals.push((stage, Duration::ZERO));
            self.totals.len() - 1
        })
    }

    /// The innermost one stops or pauses.
    fn count(&mut self, now: Instant) {
        if let Some(innermost) = self.running.last() {
            self.totals[*innermost].1 += now - self.since;
        }
        self.since = now;
    }

    fn enter(&mut self, place: usize, now: Instant) {
        self.count(now);
        self.running.push(place);
    }

    fn exit(&mut self, now: Instant) {
        self.count(now);
        self.running.pop();
    }

    fn until(&mut self, end: Instant) -> StageTimes {
        self.count(end);
        let mut all = self.totals.clone();
        all.rotate_left(1);
        all
    }
}

/// Takes the spans of `tldi` for its stages.
#[derive(Clone)]
struct Clock(Arc<Mutex<SelfTimes>>);

impl Clock {
    fn times(&self) -> MutexGuard<'_, SelfTimes> {
        self.0.lock().expect("adding up does not panic")
    }
}

impl Subscriber for Clock {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.is_span() && metadata.target().split("::").next() == Some("tldi")
    }

    /// Spans of one stage need no telling apart: each ends before the one around it.
    fn new_span(&self, span: &Attributes<'_>) -> Id {
        Id::from_u64(self.times().place(span.metadata().name()) as u64)
    }

    fn enter(&self, span: &Id) {
        self.times().enter(span.into_u64() as usize, Instant::now());
    }

    fn exit(&self, _: &Id) {
        self.times().exit(Instant::now());
    }

    fn record(&self, _: &Id, _: &Record<'_>) {}

    fn record_follows_from(&self, _: &Id, _: &Id) {}

    fn event(&self, _: &Event<'_>) {}
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ms(count: u64) -> Duration {
        Duration::from_millis(count)
    }

    /// What is within a stage does not count twice, neither in itself nor in the rest.
    #[test]
    fn nested_times_add_up_to_the_whole() {
        let start = Instant::now();
        let mut times = SelfTimes::new(start);
        let at = |count| start + ms(count);
        let [outer, inner] = ["windows", "splat"].map(|name| times.place(name));
        times.enter(outer, at(1));
        times.enter(inner, at(3));
        // Within one of its own name.
        times.enter(inner, at(10));
        times.exit(at(14));
        times.exit(at(20));
        times.enter(inner, at(30));
        times.exit(at(31));
        times.exit(at(50));
        times.enter(inner, at(100));
        times.exit(at(150));
        assert_eq!(times.place("splat"), inner);
        let told = times.until(at(1000));
        // 2 + 10 + 19; 17 + 1 + 50; 1 + 50 + 850.
        let expected = [("windows", ms(31)), ("splat", ms(68)), (REST, ms(901))];
        assert_eq!(told, expected);
        let sum: Duration = told.iter().map(|(_, time)| *time).sum();
        assert_eq!(sum, ms(1000));
    }

    #[test]
    fn medians_are_of_stages() {
        let runs = [
            vec![("cull", ms(1)), (REST, ms(9))],
            vec![("cull", ms(3)), ("zone", ms(5)), (REST, ms(7))],
            vec![("cull", ms(2)), ("zone", ms(4)), (REST, ms(8))],
        ];
        let expected = [("cull", 2.0), ("zone", 4.0), (REST, 8.0)];
        for ((name, median), (own, ms)) in medians_ms(&runs).into_iter().zip(expected) {
            assert_eq!(name, own);
            assert!((median - ms).abs() < 1e-9, "{name}: {median}");
        }
        assert_eq!(medians_ms(&runs).len(), 3);
    }

    /// Spans of others are no stages.
    #[test]
    fn spans_of_others_are_of_the_rest() {
        let ((), times) = staged(|| tracing::trace_span!("foreign").in_scope(|| ()));
        assert!(matches!(&times[..], [(REST, _)]), "{times:?}");
    }
}
