//! Time that a run may take: what has no room in it any more is left out, and said.

use std::time::Instant;

/// A clock with an end.
#[derive(Debug)]
pub(super) struct Budget {
    start: Instant,
    seconds: f64,
    skipped: Vec<String>,
}

impl Budget {
    /// So many seconds from now on.
    pub(super) fn new(seconds: f64) -> Self {
        Self {
            start: Instant::now(),
            seconds,
            skipped: Vec::new(),
        }
    }

    /// Seconds since the start.
    pub(super) fn elapsed(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }

    /// Whether there is time for what is expected to take so many seconds; notes what there is not.
    pub(super) fn has_time(&mut self, what: &str, expected_seconds: f64) -> bool {
        let has_time = self.elapsed() + expected_seconds <= self.seconds;
        if has_time {
            eprintln!("{:6.1} s: {what}", self.elapsed());
        } else {
            self.skipped.push(what.to_owned());
        }
        has_time
    }

    /// Notes what cannot be measured here, and why.
    pub(super) fn skip(&mut self, what: String) {
        self.skipped.push(what);
    }

    /// What was left out.
    pub(super) fn skipped(self) -> Vec<String> {
        self.skipped
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What does not fit is told, and what fits after it is still done.
    #[test]
    fn what_has_no_room_is_told() {
        let mut budget = Budget::new(1000.0);
        assert!(budget.has_time("short", 1.0));
        assert!(!budget.has_time("long", 1001.0));
        assert!(budget.has_time("short again", 1.0));
        budget.skip("impossible".to_owned());
        assert_eq!(budget.skipped(), ["long", "impossible"]);
    }
}
