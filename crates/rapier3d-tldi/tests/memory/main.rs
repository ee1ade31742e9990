//! How much memory steps take. The memory of all threads is counted, so tests run one at a time.

#[path = "../common/mod.rs"]
mod common;

mod body_sizes;
mod outliers;
mod step_allocations;
mod stream_memory;

use std::sync::{Mutex, MutexGuard, PoisonError};
use tldi_memory::Counting;

/// Four times what any test here may hold.
#[global_allocator]
static ALLOCATOR: Counting = Counting::limited(1 << 30);

/// Keeps the other tests waiting.
fn alone() -> MutexGuard<'static, ()> {
    static LOCK: Mutex<()> = Mutex::new(());
    LOCK.lock().unwrap_or_else(PoisonError::into_inner)
}
