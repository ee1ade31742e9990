//! Time that a method takes.

use cpu_time::ThreadTime;
use std::time::Instant;

/// Measures from when it was started. Work of one thread is measured in processor time of the thread
/// that started it, so that other programs on the machine count as little as can be; work of several
/// threads or of a GPU by the clock.
pub enum Stopwatch {
    /// Of this thread.
    Processor(ThreadTime),
    /// Of everyone.
    Clock(Instant),
}

impl Stopwatch {
    /// For work that this thread does alone.
    pub fn of_thread() -> Self {
        Self::Processor(ThreadTime::now())
    }

    /// For work of so many threads, this one among them if it is one.
    pub fn of_threads(threads: usize) -> Self {
        match threads {
            1 => Self::of_thread(),
            _ => Self::of_clock(),
        }
    }

    /// For work of a device, for which this thread waits.
    pub fn of_clock() -> Self {
        Self::Clock(Instant::now())
    }

    /// Seconds since the start.
    pub fn seconds(&self) -> f64 {
        match self {
            Self::Processor(start) => start.elapsed().as_secs_f64(),
            Self::Clock(start) => start.elapsed().as_secs_f64(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    /// Waiting is no work of this thread; working is.
    #[test]
    fn waiting_does_not_count() {
        let (thread, clock) = (Stopwatch::of_threads(1), Stopwatch::of_threads(2));
        std::thread::sleep(Duration::from_millis(60));
        let waited = thread.seconds();
        assert!(waited < 0.03 && clock.seconds() >= 0.06, "{waited}");
        let mut sum = 0u64;
        while thread.seconds() < waited + 0.02 {
            sum = std::hint::black_box(sum.wrapping_mul(3) + 1);
        }
        assert!(clock.seconds() >= 0.08);
    }
}
