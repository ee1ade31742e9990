//! A logger that counts the crate's warnings. One test a binary: the log is one for a process.

use log::{Level, LevelFilter, Log, Metadata, Record};
use std::sync::atomic::{AtomicUsize, Ordering};

static COUNT: AtomicUsize = AtomicUsize::new(0);

struct Counter;

impl Log for Counter {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.level() <= Level::Warn && metadata.target().starts_with("rapier3d_tldi")
    }

    fn log(&self, record: &Record<'_>) {
        if self.enabled(record.metadata()) {
            assert!(record.args().to_string().contains("TldiPipeline::attach"));
            COUNT.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn flush(&self) {}
}

/// Counts from now on.
pub(crate) fn listen() {
    log::set_logger(&Counter).expect("one test a binary");
    log::set_max_level(LevelFilter::Warn);
}

/// Warnings so far.
pub(crate) fn count() -> usize {
    COUNT.load(Ordering::Relaxed)
}
