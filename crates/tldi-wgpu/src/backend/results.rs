//! What came back of a batch: what is counted and as many contacts as are expected, then the others if there are more.

use super::WgpuBackend;
use crate::GpuError;
use crate::counters::Counters;
use crate::layout::{CONTACT_WORDS, COUNTERS, PAIR_WORDS};
use crate::readback::Readback;
use std::sync::mpsc;
use tldi::{PairQuery, PairResult};

/// Contacts that are read back in any case: 12 kB, which take no longer than none.
pub(super) const LEAST_EXPECTED: u32 = 256;

/// Share of the last batch's contacts that are read back beyond them: from step to step there are a few more or fewer,
/// and others cost a submission.
const SPARE: u32 = 8;

impl WgpuBackend {
    /// Waits for the batch; fills the results if the buffers held it, and returns what it needed.
    pub(super) fn read_back(
        &mut self,
        batch: &[PairQuery<'_>],
        results: &mut [PairResult],
        left_to_cpu: &mut Vec<usize>,
    ) -> Result<Counters, GpuError> {
        let mut contacts = self.expected_contacts.min(self.capacities.contacts);
        let needed = loop {
            let needed = self.map(contacts, batch, results, left_to_cpu)?;
            if !self.capacities.holds(&needed) || needed.contacts <= contacts {
                break needed;
            }
            self.copy_contacts(contacts, needed.contacts)?;
            contacts = needed.contacts;
        };
        if self.capacities.holds(&needed) {
            for &pair in &self.upload.pairs_of {
                self.patches.reduce_pair(&mut results[pair], &batch[pair]);
            }
            let most = needed.contacts.saturating_add(needed.contacts / SPARE);
            self.expected_contacts = most.max(LEAST_EXPECTED);
        }
        self.last = needed;
        self.times.clear();
        if let Some(timer) = &mut self.timer {
            timer.read(&self.gpu, &mut self.times)?;
        }
        Ok(needed)
    }

    /// Bytes before those of contact `at` in what is read back, and in what is found.
    fn bytes_before(&self, at: u32) -> [u64; 2] {
        let pairs = u64::from(PAIR_WORDS) * self.upload.pairs_of.len() as u64;
        let found = 4 * (pairs + u64::from(CONTACT_WORDS) * u64::from(at));
        [4 * u64::from(COUNTERS) + found, found]
    }

    /// Copies contacts from `from` to before `to` to where the host reads them.
    fn copy_contacts(&mut self, from: u32, to: u32) -> Result<(), GpuError> {
        let (Some(found), Some(readback)) = (self.buffers.found.get(), self.buffers.readback.get())
        else {
            return Err(self.gpu.failed("nothing was submitted".to_owned()));
        };
        let [at, source] = self.bytes_before(from);
        let bytes = self.bytes_before(to)[0] - at;
        let mut encoder = (self.gpu.device).create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(found, source, readback, at, bytes);
        self.gpu.queue.submit([encoder.finish()]);
        self.traffic.submissions += 1;
        self.traffic.read_back += bytes;
        self.gpu.check()
    }

    /// Waits until so many contacts are there for the host, and takes them with the rest.
    fn map(
        &self,
        contacts: u32,
        batch: &[PairQuery<'_>],
        results: &mut [PairResult],
        left_to_cpu: &mut Vec<usize>,
    ) -> Result<Counters, GpuError> {
        let failed = |reason| self.gpu.failed(reason);
        let Some(buffer) = self.buffers.readback.get() else {
            return Err(failed("nothing was submitted".to_owned()));
        };
        let slice = buffer.slice(..self.bytes_before(contacts)[0]);
        let (mapped, answer) = mpsc::channel();
        slice.map_async(wgpu::MapMode::Read, move |result| {
            // Nobody listens any more after an error, which is told already.
            mapped.send(result).unwrap_or_default();
        });
        self.gpu.wait()?;
        // Whoever shares the device may have been the one to see the end of the work.
        let outcome = answer
            .recv_timeout(self.gpu.patience)
            .map_err(|_| self.gpu.give_up())?;
        self.gpu.check()?;
        outcome.map_err(|e| failed(e.to_string()))?;
        let view = slice
            .get_mapped_range()
            .map_err(|e| failed(e.to_string()))?;
        let taken = self.take(bytemuck::cast_slice(&view), batch, results, left_to_cpu);
        drop(view);
        buffer.unmap();
        taken.map_err(|reason| GpuError::BadAnswer {
            adapter: self.gpu.adapter().to_owned(),
            reason,
        })
    }

    /// Fills the results from the words that came back, if the buffers held the batch and all its
    /// contacts are there; what it needed, or what of the words makes no sense.
    fn take(
        &self,
        words: &[u32],
        batch: &[PairQuery<'_>],
        results: &mut [PairResult],
        left_to_cpu: &mut Vec<usize>,
    ) -> Result<Counters, String> {
        let pairs_of = &self.upload.pairs_of;
        let readback = Readback::new(words, pairs_of.len())?;
        let needed = readback.counters();
        if self.capacities.holds(&needed) && readback.has_all_contacts() {
            for (k, &pair) in pairs_of.iter().enumerate() {
                if readback.is_crowded(k) {
                    left_to_cpu.push(pair);
                } else {
                    readback.fill(k, &batch[pair], &mut results[pair])?;
                }
            }
            readback.fill_contacts(pairs_of, batch, results)?;
        }
        Ok(needed)
    }
}
