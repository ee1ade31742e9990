//! Threads that are measured.

use rayon::{ThreadPool, ThreadPoolBuildError, ThreadPoolBuilder};

/// So many workers; several are each kept on a core of their own. Some kernels, those of virtual machines above all, pack
/// threads of short work on one core, and two of them then take as long as one.
pub fn workers(count: usize) -> Result<ThreadPool, ThreadPoolBuildError> {
    let cores = core_affinity::get_core_ids().unwrap_or_default();
    ThreadPoolBuilder::new()
        .num_threads(count)
        .start_handler(move |worker| {
            if 1 < count && count <= cores.len() {
                core_affinity::set_for_current(cores[worker]);
            }
        })
        .build()
}
