//! The backend that tests run on.

use crate::skip::{REQUIRE_GPU, skip};
use std::sync::Mutex;
use tldi::{Backend, PairQuery, PairResult};
use tldi_wgpu::{AdapterChoice, BackendChoice, Gpu, WgpuBackend};

/// Compares a batch on the backend that the variable `TLDI_BACKEND` asks for, with warm memory: the
/// same tests are run for every backend.
///
/// # Panics
/// If a query is not supported, or a GPU that was asked for is not there.
pub fn compare_batch(batch: &[PairQuery<'_>]) -> Vec<PairResult> {
    // One for each test that runs at the same time. They outlive their threads: a device cannot be dropped with a thread's
    // variables.
    static IDLE: Mutex<Vec<Box<dyn Backend>>> = Mutex::new(Vec::new());
    let idle = || IDLE.lock().expect("nothing panics with the lock held");
    let taken = idle().pop();
    let mut backend =
        taken.unwrap_or_else(|| BackendChoice::Auto.open().expect("the backend is there"));
    let results = compare_on(&mut *backend, batch);
    idle().push(backend);
    results
}

/// Compares a batch on a backend.
///
/// # Panics
/// If a query is not supported.
pub fn compare_on(backend: &mut dyn Backend, batch: &[PairQuery<'_>]) -> Vec<PairResult> {
    let mut results = Vec::new();
    let outcome = backend.compare(batch, &mut results);
    outcome.expect("the queries are supported");
    results
}

/// A GPU backend, on a software driver where there is no GPU; `None` (said loudly) where there is
/// neither.
///
/// # Panics
/// There, if the variable `TLDI_REQUIRE_GPU` is set.
pub fn gpu_backend() -> Option<WgpuBackend> {
    let opened = Gpu::of_process(AdapterChoice::Any).and_then(WgpuBackend::new);
    opened
        .map_err(|error| skip(&error.to_string(), REQUIRE_GPU))
        .ok()
}
