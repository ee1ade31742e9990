//! A batch in as many parts as the device has room for, each grown and redone where a buffer was
//! too small.

use super::{InFlight, WgpuBackend};
use crate::buffers::most_bytes;
use crate::counters::Counters;
use crate::division::lives_on_device;
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
    /// Sizes for which there was room; how often the present part was redone, and what its first
    /// views needed, where further ones are drawn.
    fitting: Counters,
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
            fitting: self.capacities,
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
        self.gpu.wait(Some(asked.submission.clone()))?;
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
            (run.fitting, run.tries, run.first_views) = (self.capacities, 0, None);
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
                run.fitting = self.capacities;
                return Ok(true);
            }
            Err(GpuError::TooLarge { .. } | GpuError::OutOfMemory { .. }) => {}
            Err(error) => return Err(error.into()),
        }
        self.capacities = run.fitting;
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
mod tests;
