//! What came back of a part: what is counted and as many contacts as are expected, then the others if there are more,
//! and further views where some are missing.

use super::WgpuBackend;
use super::parts::{Returned, Run};
use crate::GpuError;
use crate::counters::Counters;
use crate::division::lives_on_device;
use crate::readback::Readback;
use tldi::{PairQuery, PairResult};

/// Contacts that are read back in any case: 12 kB, which take no longer than none. Half or twice: no test fails.
pub(super) const LEAST_EXPECTED: u32 = 256;

/// Share of the last batch's contacts, or images, that are expected beyond them: from step to step there are a few
/// more or fewer, and others cost a submission. Half or twice: no test fails.
const SPARE: u32 = 8;

/// What is known of a part when it has come back.
struct Taken {
    needed: Counters,
    /// Whether a pair has no crossing yet, and wants to be looked at from all directions.
    wants_further: bool,
    /// Whether the results are filled.
    is_complete: bool,
}

impl WgpuBackend {
    /// Takes what has come back: fills the results, if it is all there, or asks for what is missing.
    pub(super) fn take_answer(&mut self, run: &mut Run<'_>) -> Result<Returned, GpuError> {
        let Some(asked) = self.asked.take() else {
            return Err(self.gpu.failed("nothing was submitted".to_owned()));
        };
        if let (Some(_), Some(timer)) = (&asked.times, &self.timer) {
            timer.take(&self.gpu, &mut self.times)?;
        }
        let Taken {
            needed,
            wants_further,
            is_complete,
        } = self.read(asked.contacts, run)?;
        if !self.capacities.holds(&needed) {
            self.times.clear();
            return Ok(Returned::Overflown(needed));
        }
        let missing = asked.contacts..needed.contacts;
        if wants_further {
            run.first_views = Some(needed);
            // Spare views find contacts, too, behind those of the first ones.
            let [from, to] = [
                asked.contacts.min(needed.contacts),
                asked.contacts.max(needed.contacts),
            ];
            self.submit_further(from..to)?;
            return Ok(Returned::More);
        }
        if !is_complete {
            self.submit_copy(missing)?;
            return Ok(Returned::More);
        }
        for &pair in &self.upload.pairs_of {
            let query = &run.batch[pair];
            let hides = self.patches.reduce_pair(&mut run.results[pair], query);
            if hides && !lives_on_device(query) {
                run.left_to_cpu.push(pair);
            }
        }
        let with_spare = |count: u32| count.saturating_add(count / SPARE);
        self.expected_contacts = with_spare(needed.contacts).max(LEAST_EXPECTED);
        self.last = needed.max(&run.first_views.unwrap_or_default());
        let share = self.last.image_shares(&self.upload.predicted);
        self.shortfall = match share > 1.0 {
            true => share * (1.0 + 1.0 / SPARE as f32),
            false => 1.0,
        };
        Ok(Returned::Done)
    }

    /// Reads what the device made readable.
    fn read(&self, contacts: u32, run: &mut Run<'_>) -> Result<Taken, GpuError> {
        let failed = |reason| self.gpu.failed(reason);
        let Some(buffer) = self.buffers.readback.get() else {
            return Err(failed("nothing was submitted".to_owned()));
        };
        let slice = buffer.slice(..self.read_bytes(contacts));
        let view = slice
            .get_mapped_range()
            .map_err(|e| failed(e.to_string()))?;
        let Run {
            batch,
            results,
            left_to_cpu,
            first_views,
            ..
        } = run;
        let words = bytemuck::cast_slice(&view);
        let taken = self.take(words, first_views.is_some(), batch, results, left_to_cpu);
        drop(view);
        buffer.unmap();
        taken.map_err(|reason| GpuError::BadAnswer {
            adapter: self.gpu.adapter().to_owned(),
            reason,
        })
    }

    /// Fills the results from the words that came back, if the buffers held the part, all its contacts are there,
    /// and no view is missing; or says what of the words makes no sense.
    fn take(
        &self,
        words: &[u32],
        has_further: bool,
        batch: &[PairQuery<'_>],
        results: &mut [PairResult],
        left_to_cpu: &mut Vec<usize>,
    ) -> Result<Taken, String> {
        let pairs_of = &self.upload.pairs_of;
        let readback = Readback::new(words, pairs_of.len())?;
        let needed = readback.counters();
        let mut pairs = pairs_of.iter().enumerate();
        let wants_further =
            !has_further && pairs.any(|(k, &pair)| readback.wants_further(k, &batch[pair]));
        let is_complete =
            self.capacities.holds(&needed) && readback.has_all_contacts() && !wants_further;
        if is_complete {
            for (k, &pair) in pairs_of.iter().enumerate() {
                if readback.is_crowded(k) {
                    left_to_cpu.push(pair);
                } else {
                    readback.fill(k, &batch[pair], &mut results[pair])?;
                }
            }
            readback.fill_contacts(pairs_of, batch, results)?;
        }
        Ok(Taken {
            needed,
            wants_further,
            is_complete,
        })
    }
}
