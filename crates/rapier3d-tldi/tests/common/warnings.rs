//! A logger that counts the crate's warnings. One test a binary: the log is one for a process.

use log::{Level, LevelFilter, Log, Metadata, Record};
use std::sync::OnceLock;
use std::sync::atomic::{AtomicUsize, Ordering};

static COUNT: AtomicUsize = AtomicUsize::new(0);

/// What each warning has to name.
static REMEDY: OnceLock<&str> = OnceLock::new();

struct Counter;

impl Log for Counter {
    fn enabled(&self, metadata: &Metadata<'_>) -> bool {
        metadata.level() <= Level::Warn && metadata.target().starts_with("rapier3d_tldi")
    }

    fn log(&self, record: &Record<'_>) {
        if self.enabled(record.metadata()) {
            let remedy = REMEDY.get().expect("set before the logger");
            assert!(record.args().to_string().contains(remedy));
            COUNT.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn flush(&self) {}
}

/// Counts from now on warnings, all of which name `remedy`.
pub(crate) fn listen(remedy: &'static str) {
    REMEDY.set(remedy).expect("one test a binary");
    log::set_logger(&Counter).expect("one test a binary");
    log::set_max_level(LevelFilter::Warn);
}

/// Warnings so far.
pub(crate) fn count() -> usize {
    COUNT.load(Ordering::Relaxed)
}
