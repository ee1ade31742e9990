//! A batch on the device, for callers that do not wait.

use super::WgpuBackend;
use super::parts::Run;
use std::future::Future;
use std::pin::Pin;
use std::task::{Context, Poll, Waker};
use tldi::{BackendError, PairQuery, PairResult};

/// A batch that the device compares, begun by [`WgpuBackend::begin`].
///
/// It has its own copies of the queries, and borrows the clouds until it is finished or dropped. It borrows
/// the backend, too: a backend has one batch in flight. Two batches are in flight in two backends,
/// which share the device and its compiled stages (`WgpuBackend::new(gpu.clone())`). A batch that is dropped is forgotten;
/// the backend takes the next one as if it had never been.
///
/// ```compile_fail,E0499
/// # use tldi::PairQuery;
/// # use tldi_wgpu::WgpuBackend;
/// # fn two(backend: &mut WgpuBackend, batch: &[PairQuery]) -> Result<(), tldi::BackendError> {
/// let first = backend.begin(batch)?;
/// let second = backend.begin(batch)?; // the backend is borrowed
/// first.finish()?;
/// # Ok(())
/// # }
/// ```
///
/// It is also a future. In a browser, the device wakes it. Elsewhere, a device only answers who polls it, so the future
/// asks to be polled again at once.
#[derive(Debug)]
#[must_use = "a batch that is dropped has no results"]
pub struct InFlight<'b, 'q> {
    backend: &'b mut WgpuBackend,
    run: Run<'q>,
}

impl<'b, 'q> InFlight<'b, 'q> {
    pub(super) fn new(backend: &'b mut WgpuBackend, run: Run<'q>) -> Self {
        Self { backend, run }
    }

    /// Goes on as far as the device has come, without waiting for it. `true` once the results are there.
    ///
    /// What is the host's is done here: pairs that the CPU compares, contact pixels that become
    /// patches, and a further submission where buffers were too small or a view is missing.
    ///
    /// # Errors
    /// Those of [`Backend::compare`](tldi::Backend::compare).
    pub fn advance(&mut self) -> Result<bool, BackendError> {
        self.backend.advance(&mut self.run, None)
    }

    /// The results, one for each query. Waits for the device, unless [`advance`](Self::advance) said
    /// `true`. A browser cannot wait: use `advance`, or `.await`, there.
    ///
    /// # Errors
    /// Those of [`Backend::compare`](tldi::Backend::compare).
    pub fn finish(mut self) -> Result<Vec<PairResult>, BackendError> {
        while !self.advance()? {
            self.backend.wait_for_answer()?;
        }
        Ok(self.run.take_results())
    }

    fn poll_with(&mut self, waker: &Waker) -> Poll<Result<Vec<PairResult>, BackendError>> {
        match self.backend.advance(&mut self.run, Some(waker)) {
            Err(error) => Poll::Ready(Err(error)),
            Ok(true) => Poll::Ready(Ok(self.run.take_results())),
            Ok(false) => {
                // Nobody else asks the device how far it is.
                if cfg!(not(target_arch = "wasm32")) {
                    waker.wake_by_ref();
                }
                Poll::Pending
            }
        }
    }
}

impl Future for InFlight<'_, '_> {
    type Output = Result<Vec<PairResult>, BackendError>;

    fn poll(self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<Self::Output> {
        self.get_mut().poll_with(context.waker())
    }
}

impl WgpuBackend {
    /// Begins to compare a batch: uploads and submits it, and returns without waiting.
    ///
    /// ```
    /// use tldi::{PairQuery, Params, PointCloud, Surface, View};
    /// use tldi::glamx::{Pose3, Vec3};
    /// use tldi_wgpu::{AdapterChoice, Gpu, WgpuBackend};
    ///
    /// let mut backend = match Gpu::open(AdapterChoice::Any).and_then(WgpuBackend::new) {
    ///     Ok(backend) => backend,
    ///     Err(error) => return Ok(eprintln!("SKIPPED: {error}")),
    /// };
    /// let points: Vec<Vec3> = (0..441)
    ///     .map(|i| Vec3::new((i % 21) as f32 * 0.05, 0.0, (i / 21) as f32 * 0.05))
    ///     .collect();
    /// let sheet = PointCloud::builder(&points).radius(0.05).build()?;
    /// let query = PairQuery {
    ///     a: Surface::Cloud(&sheet),
    ///     b: Surface::Cloud(&sheet),
    ///     a_from_b: Pose3::translation(0.0, 0.02, 0.0),
    ///     view: View::aimed(),
    ///     params: Params::for_radius(0.05),
    /// };
    /// let mut batch = backend.begin(&[query])?;
    /// let mut turns = 0;
    /// while !batch.advance()? {
    ///     turns += 1; // the frame's other work
    ///     std::thread::yield_now();
    /// }
    /// let results = batch.finish()?; // does not wait any more
    /// assert!((results[0].gap.unwrap() - 0.02).abs() < 1e-4);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Those of [`Backend::compare`](tldi::Backend::compare).
    pub fn begin<'q>(&mut self, batch: &[PairQuery<'q>]) -> Result<InFlight<'_, 'q>, BackendError> {
        let left_to_cpu = self.select(batch)?;
        self.start(batch, Vec::new(), left_to_cpu)
    }
}
