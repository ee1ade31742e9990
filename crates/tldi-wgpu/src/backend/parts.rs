//! A batch in as many parts as the device has room for, each grown and redone where a buffer was
//! too small.

use super::{InFlight, WgpuBackend};
use crate::buffers::most_bytes;
use crate::counters::Counters;
use crate::layout::lives_on_device;
use crate::{GpuError, Traffic};
use std::task::Waker;
use tldi::{Backend, BackendError, PairQuery, PairResult};

/// Times that a part is redone with larger buffers before that counts as a fault: every time at
/// least one of seven has doubled.
const MOST_TRIES: usize = 64;

/// How far a batch is.
pub(super) struct Run<'q> {
    pub(super) batch: Vec<PairQuery<'q>>,
    pub(super) results: Vec<PairResult>,
    /// Pairs that the device does not take, and that are not compared yet.
    pub(super) left_to_cpu: Vec<usize>,
    /// Pairs of each part that is not begun yet, the next one last.
    parts: Vec<Vec<usize>>,
    /// Of the present part: sizes for which there was room, how often it was redone, and what its first
    /// views needed, where further ones are drawn.
    fitting: Option<Counters>,
    tries: usize,
    pub(super) first_views: Option<Counters>,
}

impl Run<'_> {
    /// The results, where the batch is done.
    pub(super) fn take_results(&mut self) -> Vec<PairResult> {
        std::mem::take(&mut self.results)
    }
}

impl std::fmt::Debug for Run<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Run")
            .field("pairs", &self.batch.len())
            .field("parts_left", &self.parts.len())
            .finish_non_exhaustive()
    }
}

/// What has come back of a part.
pub(super) enum Returned {
    /// All, and it is in the results.
    Done,
    /// It needs larger buffers.
    Overflown(Counters),
    /// More was asked for.
    More,
}

impl WgpuBackend {
    /// Begins to compare the selected pairs. Entries of `results` are reused.
    pub(super) fn start<'q>(
        &mut self,
        batch: &[PairQuery<'q>],
        mut results: Vec<PairResult>,
        left_to_cpu: Vec<usize>,
    ) -> Result<InFlight<'_, 'q>, BackendError> {
        // Of a batch that was dropped.
        self.abandon();
        self.gpu.check()?;
        self.pairs_on_cpu = 0;
        self.traffic = Traffic::default();
        self.times.clear();
        results.resize_with(batch.len(), PairResult::default);
        results.iter_mut().for_each(PairResult::clear);
        let mut run = Run {
            batch: batch.to_vec(),
            results,
            left_to_cpu,
            parts: vec![self.upload.pairs_of.clone()],
            fitting: None,
            tries: 0,
            first_views: None,
        };
        self.begin_next_part(&mut run)?;
        Ok(InFlight::new(self, run))
    }

    /// Goes on without waiting; whether the batch is done. Else `waker` is woken when there is more to do.
    pub(super) fn advance(
        &mut self,
        run: &mut Run<'_>,
        waker: Option<&Waker>,
    ) -> Result<bool, BackendError> {
        loop {
            // While the device works.
            self.compare_on_cpu(run)?;
            if self.asked.is_none() && !self.begin_next_part(run)? && run.left_to_cpu.is_empty() {
                return Ok(true);
            }
            let Some(asked) = &self.asked else {
                continue;
            };
            self.gpu.poll()?;
            let times = asked.times.as_ref().map(|times| times.outcome(waker));
            let (Some(outcome), Some(times)) =
                (asked.answer.outcome(waker), times.unwrap_or(Some(Ok(()))))
            else {
                return Ok(false);
            };
            let failed = |error: wgpu::BufferAsyncError| self.gpu.failed(error.to_string());
            outcome.and(times).map_err(failed)?;
            self.go_on(run)?;
        }
    }

    /// Waits until the device has answered.
    ///
    /// # Errors
    /// [`GpuError::TimedOut`] where that takes too long.
    pub(super) fn wait_for_answer(&self) -> Result<(), GpuError> {
        let Some(asked) = &self.asked else {
            return Ok(());
        };
        self.gpu.wait()?;
        // Whoever shares the device may have been the one to see the end of the work.
        for answer in [Some(&asked.answer), asked.times.as_ref()]
            .into_iter()
            .flatten()
        {
            if !answer.wait(self.gpu.patience) {
                return Err(self.gpu.give_up());
            }
        }
        Ok(())
    }

    /// Submits the next part that has pairs, in halves where the device has no room for all of it; whether there is one.
    fn begin_next_part(&mut self, run: &mut Run<'_>) -> Result<bool, BackendError> {
        while let Some(part) = run.parts.pop() {
            if part.is_empty() {
                continue;
            }
            if part != self.upload.pairs_of {
                self.upload.select(&run.batch, part.iter().copied());
            }
            self.times.clear();
            (run.fitting, run.tries, run.first_views) = (None, 0, None);
            let placed = self.place(&run.batch).and_then(|()| self.submit());
            if self.is_submitted(run, placed)? {
                return Ok(true);
            }
        }
        self.traffic.uploaded += self.gpu.take_uploaded();
        Ok(false)
    }

    /// Puts the clouds of the selection on the device, and makes room for what it will need.
    fn place(&mut self, batch: &[PairQuery<'_>]) -> Result<(), GpuError> {
        let (resident, sources) = (&mut self.resident, &mut self.sources);
        self.upload.place(batch, &self.gpu, resident, sources)?;
        let predicted = (self.upload.predicted)
            .with_image_shares(self.shortfall)
            .min(&self.most);
        let grown = self.capacities.grown(&predicted, &self.most)?;
        // Tiles and pixels are cleared, so that there are no more than this part needs.
        let wanted = Counters {
            tiles: predicted.tiles,
            pixels: predicted.pixels,
            ..grown
        };
        self.capacities = self.upload.fitted(wanted, most_bytes(&self.gpu));
        Ok(())
    }

    /// Whether the part was submitted. One that is too large is split, or left to the CPU.
    fn is_submitted(
        &mut self,
        run: &mut Run<'_>,
        outcome: Result<(), GpuError>,
    ) -> Result<bool, BackendError> {
        match outcome {
            Ok(()) => {
                run.fitting = Some(self.capacities);
                return Ok(true);
            }
            Err(GpuError::TooLarge { .. }) => {}
            Err(error) => return Err(error.into()),
        }
        if let Some(former) = run.fitting {
            self.capacities = former;
        }
        let part = self.upload.pairs_of.clone();
        if part.len() > 1 {
            let (first, second) = part.split_at(part.len() / 2);
            run.parts.extend([second.to_vec(), first.to_vec()]);
        } else {
            run.left_to_cpu.extend(&part);
            let reason = "it needs larger buffers than the device allows, and points that live \
                          on the device cannot be left to the CPU: use larger pixels or fewer points";
            check_left(&run.batch, &run.left_to_cpu, reason)?;
        }
        Ok(false)
    }

    /// Takes what the device has answered; redoes the part with larger buffers where it needs them.
    fn go_on(&mut self, run: &mut Run<'_>) -> Result<(), BackendError> {
        let needed = match self.take_answer(run)? {
            Returned::More => return Ok(()),
            Returned::Done => {
                let reason = "a pixel has more than 1024 fragments, and points that live on the device \
                              cannot be left to the CPU: use smaller pixels or fewer points";
                return check_left(&run.batch, &run.left_to_cpu, reason);
            }
            Returned::Overflown(needed) => needed,
        };
        run.tries += 1;
        if run.tries == MOST_TRIES {
            let reason = "its counters never settled".to_owned();
            return Err(self.gpu.failed(reason).into());
        }
        let first_tiles = run.first_views.take().map_or(0, |first| first.tiles);
        let grown = self.capacities.grown(&needed, &self.most);
        let redone = grown.and_then(|grown| {
            // Tiles and pixels share a buffer: no more of them than are needed.
            self.capacities = Counters {
                tiles: needed.tiles.max(first_tiles),
                pixels: self.capacities.pixels.max(needed.pixels),
                ..grown
            };
            self.traffic.redos += 1;
            self.submit()
        });
        self.is_submitted(run, redone).map(|_| ())
    }

    /// Compares what is left to the CPU, and leaves nothing.
    fn compare_on_cpu(&mut self, run: &mut Run<'_>) -> Result<(), BackendError> {
        if run.left_to_cpu.is_empty() {
            return Ok(());
        }
        self.pairs_on_cpu += run.left_to_cpu.len();
        let queries: Vec<PairQuery> = (run.left_to_cpu.iter())
            .map(|&pair| run.batch[pair])
            .collect();
        let mut compared = Vec::new();
        self.cpu.compare(&queries, &mut compared)?;
        for (pair, result) in run.left_to_cpu.drain(..).zip(compared) {
            run.results[pair] = result;
        }
        Ok(())
    }
}

/// Refuses to leave points to the CPU that only the device has.
fn check_left(
    batch: &[PairQuery<'_>],
    left_to_cpu: &[usize],
    reason: &'static str,
) -> Result<(), BackendError> {
    match (left_to_cpu.iter()).find(|&&pair| lives_on_device(&batch[pair])) {
        Some(&pair) => Err(BackendError::Unsupported { pair, reason }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::counters::Counters;
    use crate::testing;
    use tldi::glamx::{Pose3, Vec3};
    use tldi::{Params, PointCloud, Surface, View};

    const R: f32 = 0.05;

    /// Flat sheets of `edge` points a side, one above the other by the shares of `R`.
    fn sheet(edge: usize) -> PointCloud<'static> {
        let position = |i: usize| Vec3::new((i % edge) as f32, 0.0, (i / edge) as f32) * R;
        let positions: Vec<Vec3> = (0..edge * edge).map(position).collect();
        let built = PointCloud::builder(positions).radius(R).build();
        built.expect("the points are valid")
    }

    fn queries<'a>(sheet: &'a PointCloud<'static>, pairs: usize) -> Vec<PairQuery<'a>> {
        let query = |k: usize| PairQuery {
            a: Surface::Cloud(sheet),
            b: Surface::Cloud(sheet),
            a_from_b: Pose3::translation(0.0, R * (k + 1) as f32 / (pairs + 1) as f32, 0.0),
            view: View::aimed(),
            params: Params::for_radius(R),
        };
        (0..pairs).map(query).collect()
    }

    fn compared(backend: &mut WgpuBackend, batch: &[PairQuery<'_>]) -> Vec<PairResult> {
        let mut results = Vec::new();
        let outcome = backend.compare(batch, &mut results);
        outcome.expect("nothing fails");
        results
    }

    /// A batch with more splats than fragments can number is compared in parts, with the same
    /// results; a pair that alone has more is the CPU's, and the next batch the device's again.
    #[test]
    fn batches_with_too_many_splats_are_halved() {
        let Some(gpu) = testing::open() else {
            return;
        };
        let mut backend = WgpuBackend::new(gpu).expect("the stages fit");
        let (small, large) = (sheet(40), sheet(80));
        let mut batch = queries(&small, 7);
        let whole = compared(&mut backend, &batch);
        let of_batch = backend.last.splats;
        // As if a fragment had room for the numbers of two pairs' splats only.
        let most = Counters {
            splats: of_batch / 3,
            ..backend.most
        };
        backend.most = most;
        backend.capacities = backend.capacities.min(&most);
        assert_eq!(whole, compared(&mut backend, &batch));
        assert_eq!(backend.pairs_on_cpu(), 0);
        assert!(backend.capacities.splats <= most.splats);

        batch[3] = queries(&large, 1)[0];
        let results = compared(&mut backend, &batch);
        assert_eq!(backend.pairs_on_cpu(), 1);
        let mut on_cpu = Vec::new();
        let outcome = tldi::CpuBackend::new().compare(&batch[3..4], &mut on_cpu);
        outcome.expect("the CPU takes it");
        assert_eq!(results[3], on_cpu[0]);
        assert_eq!((&results[..3], &results[4..]), (&whole[..3], &whole[4..]));

        batch.remove(3);
        compared(&mut backend, &batch);
        assert_eq!(backend.pairs_on_cpu(), 0);
    }

    /// A batch is not answered where a dropped one still is. Which of both would be read depends on when the device is
    /// asked; a driver that ends one submission before it takes the next seldom shows it.
    #[test]
    fn a_dropped_batch_takes_its_readback_with_it() {
        let Some(gpu) = testing::open() else {
            return;
        };
        let mut backend = WgpuBackend::new(gpu).expect("the stages fit");
        let small = sheet(40);
        let batch = queries(&small, 3);
        let readback = |backend: &mut WgpuBackend| {
            drop(backend.begin(&batch).expect("it is submitted"));
            backend.buffers.readback.get().cloned()
        };
        let of_dropped = readback(&mut backend);
        assert!(of_dropped.is_some() && of_dropped != readback(&mut backend));
        // Batches that end keep it.
        compared(&mut backend, &batch);
        let kept = backend.buffers.readback.get().cloned();
        compared(&mut backend, &batch);
        assert_eq!(backend.buffers.readback.get(), kept.as_ref());
    }

    /// What earlier batches needed does not keep a batch from the device.
    #[test]
    fn a_batch_does_not_suffer_from_earlier_ones() {
        let Some(gpu) = testing::open() else {
            return;
        };
        let mut backend = WgpuBackend::new(gpu).expect("the stages fit");
        let small = sheet(40);
        let batch = queries(&small, 2);
        let cold = compared(&mut backend, &batch);
        // Contacts share a buffer with the pairs: there is room for either.
        backend.capacities.contacts = backend.most.contacts;
        assert_eq!(cold, compared(&mut backend, &batch));
        assert_eq!(backend.pairs_on_cpu(), 0);
    }

    /// A pair that is too large, and whose points only the device has, is refused by its place in the
    /// batch, and the device goes on; so is one that neither takes.
    #[test]
    fn points_of_the_device_are_not_left_to_the_cpu() {
        let Some(gpu) = testing::open() else {
            return;
        };
        let mut backend = WgpuBackend::new(gpu.clone()).expect("the stages fit");
        let (small, large) = (sheet(40), sheet(80));
        let points: Vec<[f32; 4]> = large
            .points()
            .iter()
            .map(|p| p.extend(R).to_array())
            .collect();
        let usage = wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let bytes: &[u8] = bytemuck::cast_slice(&points);
        let buffer = crate::buffers::create(&gpu, "points", usage, bytes.len() as u64);
        let buffer = buffer.expect("there is room");
        gpu.queue.write_buffer(&buffer, 0, bytes);
        let told = tldi::DeviceCloud {
            id: 0,
            len: points.len(),
            bounds: large.bounds(),
            mean_radius: R,
            max_radius: R,
        };
        let on_device = backend.adopt(&buffer, told).expect("it is valid");
        let mut batch = queries(&small, 3);
        batch[2] = PairQuery {
            b: Surface::Device(&on_device),
            ..queries(&large, 1)[0]
        };
        compared(&mut backend, &batch);
        assert_eq!(backend.pairs_on_cpu(), 0);
        let whole = compared(&mut backend, &batch[..2]);
        let of_two = backend.last.splats;

        let refused = |backend: &mut WgpuBackend, batch: &[PairQuery<'_>]| match backend
            .compare(batch, &mut Vec::new())
        {
            Err(BackendError::Unsupported { pair, reason }) => (pair, reason),
            other => panic!("{other:?}"),
        };
        let neither = PairQuery {
            params: Params::paper(R),
            ..batch[2]
        };
        assert_eq!(refused(&mut backend, &[batch[0], neither]).0, 1);
        // Half of what the large pair has.
        backend.most.splats = of_two;
        backend.capacities = backend.capacities.min(&backend.most);
        let (pair, reason) = refused(&mut backend, &batch);
        assert_eq!(pair, 2);
        assert!(reason.contains("larger buffers"), "{reason}");
        assert_eq!(whole, compared(&mut backend, &batch[..2]));
    }

    /// A pair whose first try was too small stays on the device: what it needs fits, though twice of it does not.
    #[test]
    fn a_redo_asks_for_no_more_than_it_needs() {
        let Some(gpu) = testing::open_small(1 << 20) else {
            return;
        };
        let mut backend = WgpuBackend::new(gpu).expect("the stages fit");
        let step = 8.0 * R / 1.2;
        let at = |i: usize| Vec3::new((i % 27) as f32, 0.0, (i / 27) as f32) * step;
        let points: Vec<Vec3> = (0..27 * 27).map(at).collect();
        let normals = vec![Vec3::Y; points.len()];
        let cloud = PointCloud::builder(points).radius(R).normals(normals);
        let cloud = cloud.build().expect("the points are valid");
        let batch = [PairQuery {
            a_from_b: Pose3::translation(0.0, 0.5 * R, 0.0),
            params: Params::for_radius(R).with_pixel_size(R / 1.2),
            ..queries(&cloud, 1)[0]
        }];
        compared(&mut backend, &batch);
        assert_eq!(backend.pairs_on_cpu(), 0);
        assert!(backend.traffic().redos > 0, "the test shows nothing");
    }

    /// Clouds with splats of 140 pixels, and with hundreds of points in the square of a radius.
    #[test]
    fn large_and_crowded_splats_are_the_cpus() {
        let Some(gpu) = testing::open() else {
            return;
        };
        let mut backend = WgpuBackend::new(gpu).expect("the stages fit");
        let with_radius = |radius: f32| {
            let cloud = PointCloud::builder(sheet(40).points().to_vec()).radius(radius);
            cloud.build().expect("the points are valid")
        };
        for (radius, pixel, on_cpu) in [(R, R, 0), (R, R / 140.0, 1), (16.0 * R, 16.0 * R, 1)] {
            let cloud = with_radius(radius);
            let query = PairQuery {
                params: Params::for_radius(radius).with_pixel_size(pixel),
                ..queries(&cloud, 1)[0]
            };
            compared(&mut backend, &[query]);
            assert_eq!(backend.pairs_on_cpu(), on_cpu, "{radius}, {pixel}");
        }
    }

    /// Two backends of one device do not take each other's points.
    #[test]
    fn points_are_those_of_one_backend() {
        let Some(gpu) = testing::open() else {
            return;
        };
        let points: Vec<[f32; 4]> = vec![[0.0, 0.0, 0.0, R]; 8];
        let bytes: &[u8] = bytemuck::cast_slice(&points);
        let buffer = crate::buffers::create(
            &gpu,
            "points",
            wgpu::BufferUsages::COPY_SRC,
            bytes.len() as u64,
        );
        let buffer = buffer.expect("there is room");
        let small = sheet(4);
        let told = tldi::DeviceCloud {
            id: 0,
            len: points.len(),
            bounds: small.bounds(),
            mean_radius: R,
            max_radius: R,
        };
        let mut backends = [0, 1].map(|_| WgpuBackend::new(gpu.clone()).expect("the stages fit"));
        let clouds =
            (backends.each_mut()).map(|b| b.adopt(&buffer, told.clone()).expect("it is valid"));
        let query = PairQuery {
            b: Surface::Device(&clouds[0]),
            ..queries(&small, 1)[0]
        };
        let refused = backends[1].compare(&[query], &mut Vec::new());
        assert!(
            matches!(refused, Err(BackendError::Unsupported { pair: 0, .. })),
            "{refused:?}"
        );
    }
}
