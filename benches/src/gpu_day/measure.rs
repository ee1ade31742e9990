//! A whole run: measures part after part, then draws.

use super::budget::Budget;
use super::workloads::Workloads;
use super::{Correctness, Floors, KIND, Kind, Report, Scene, Settings, card, frames, host_costs};
use crate::charts::gpu_day::draw;
use crate::placements::{Placement, Source};
use crate::stored::Provenance;
use std::path::Path;
use tldi::{Backend, ContactPixel, CpuBackend};
use tldi_wgpu::{Gpu, WgpuBackend};

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
        let backend = WgpuBackend::new(gpu.clone())?;
        let report = Self {
            kind: KIND.to_owned(),
            provenance: Provenance::now(Some(&backend)),
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
            let shown = contacts_of_both(gpu)?;
            draw(&report, &shown.contacts, shown.radius, out)?;
        }
        Ok(report)
    }
}

/// What a picture shows of both backends.
struct Shown {
    /// Name of the backend, and its contact pixels.
    contacts: [(&'static str, Vec<ContactPixel>); 2],
    /// Mean radius, metres.
    radius: f32,
}

/// A small body in a scan on both backends.
fn contacts_of_both(gpu: Gpu) -> anyhow::Result<Shown> {
    let (placement, points) = (Placement::BodyOnScan, 100_000);
    let scene = Scene::new(placement, points, Kind::Bare, 1)?;
    let pixels = |backend: &mut dyn Backend| -> anyhow::Result<Vec<ContactPixel>> {
        let mut results = Vec::new();
        backend.compare(&[scene.query()], &mut results)?;
        Ok(std::mem::take(&mut results[0].contacts))
    };
    let on_device = pixels(&mut WgpuBackend::new(gpu)?)?;
    let on_cpu = pixels(&mut CpuBackend::without_first_look())?;
    let radius = Source::Generated(points).radius(placement)?;
    Ok(Shown {
        contacts: [("device", on_device), ("CPU", on_cpu)],
        radius,
    })
}
