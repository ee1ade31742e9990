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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;
    use tldi::glamx::{Pose3, Vec3};
    use tldi::{Backend, DeviceCloud, Params, PointCloud, Surface, View};

    const R: f32 = 0.05;

    /// A part that is redone has the points that its batch began with, although the caller's buffer holds others by then.
    #[test]
    fn a_redone_part_keeps_its_points() {
        let Some(gpu) = testing::open() else {
            return;
        };
        let mut backend = WgpuBackend::new(gpu.clone()).expect("the stages fit");
        let position = |i: usize| Vec3::new((i % 40) as f32, 0.0, (i / 40) as f32) * R;
        let positions: Vec<Vec3> = (0..1600).map(position).collect();
        let words = |height: f32| -> Vec<[f32; 4]> {
            let raised = positions.iter().map(|p| *p + height * Vec3::Y);
            raised.map(|p| p.extend(R).to_array()).collect()
        };
        let sheet = PointCloud::builder(&positions).radius(R).build();
        let sheet = sheet.expect("the points are valid");
        let usage = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let buffer = crate::buffers::create(&gpu, "points", usage, 16 * 1600);
        let buffer = buffer.expect("there is room");
        let write = |height: f32| {
            let words = words(height);
            gpu.queue
                .write_buffer(&buffer, 0, bytemuck::cast_slice(&words));
            gpu.queue.submit([]);
        };
        let told = DeviceCloud {
            id: 0,
            len: 1600,
            bounds: sheet.bounds().loosened(R),
            mean_radius: R,
            max_radius: R,
        };
        let on_device = backend.adopt(&buffer, told).expect("it is valid");
        let query = PairQuery {
            a: Surface::Cloud(&sheet),
            b: Surface::Device(&on_device),
            a_from_b: Pose3::translation(0.0, 0.2 * R, 0.0),
            view: View::aimed(),
            params: Params::for_radius(R),
        };
        write(0.0);
        let mut expected = Vec::new();
        let outcome = backend.compare(&[query], &mut expected);
        outcome.expect("the device takes it");

        let batch = backend.begin(&[query]).expect("it is submitted");
        // The next frame, and as if the contacts of this one had had no room.
        write(0.5 * R);
        batch.backend.capacities.contacts = 1;
        let found = batch.finish().expect("nothing fails");
        assert!(found == expected, "{:?}", found[0].gap);
        assert_eq!(backend.traffic().redos, 1);
    }
}
