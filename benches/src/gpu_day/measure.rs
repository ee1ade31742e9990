//! A whole run: measures part after part, then draws.

use super::budget::Budget;
use super::workloads::Workloads;
use super::{Correctness, Floors, KIND, Report, Settings, Shown, card, frames, host_costs};
use crate::charts::gpu_day::draw;
use crate::stored::Provenance;
use std::path::Path;

impl Report {
    /// Measures everything, and writes points of frames and pictures into `out`, if that is given.
    ///
    /// # Errors
    /// Where there is no device, or it fails. Wrong answers are no error, but [`faults`](Self::faults).
    pub fn measure(settings: Settings, out: Option<&Path>) -> anyhow::Result<Self> {
        let mut budget = Budget::new(settings.seconds);
        let (gpu, card) = card::open()?;
        let floors = Floors::measure(&gpu, settings.copy_bytes, &mut budget)?;
        let correctness = Correctness::measure(
            &gpu,
            settings.parity_pairs,
            settings.equal_batches,
            &mut budget,
        )?;
        let host_costs = host_costs::measure(&gpu, settings.host_cost_points, &mut budget)?;
        let mut frames = Vec::new();
        if let Some(out) = out
            && budget.has_time("points of frames", 5.0)
        {
            let most = settings.sizes.iter().copied().filter(|n| *n <= 1_000_000);
            let points = most.max().unwrap_or(10_000);
            frames = frames::dump(&out.join("frames"), points, settings.seed)?;
        }
        let all = Workloads::new(&gpu, settings.repeats, settings.seed, floors.bandwidth())?;
        let workloads = all.measure(&settings.sizes, &settings.batches, &mut budget)?;
        let report = Self {
            kind: KIND.to_owned(),
            provenance: Provenance::now(Some(card.name.clone())),
            seconds: budget.elapsed(),
            skipped: budget.skipped(),
            card,
            floors,
            faults: correctness.faults(),
            correctness,
            host_costs,
            workloads,
            frames,
            settings,
        };
        if let Some(out) = out {
            draw(&report, &Shown::of(gpu)?, out)?;
        }
        Ok(report)
    }
}
