//! What compared the clouds of a run.

use rapier3d_tldi::prelude::StepReport;
use serde::Serialize;
use tldi::Backend;

/// The backends of all steps so far; reports flatten it.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Devices {
    /// Name of the backend: that of the GPU, if it compared at least once.
    pub backend: String,
    /// Name of the GPU, if it compared at least once.
    pub adapter: Option<String>,
    /// Why the CPU had to do though a GPU would have been taken.
    pub fallback: Option<String>,
}

impl Devices {
    /// What a backend did on its own.
    pub fn of(backend: &dyn Backend) -> Self {
        Self {
            backend: backend.name().to_owned(),
            adapter: backend.adapter().map(str::to_owned),
            fallback: backend.fallback().map(str::to_owned),
        }
    }

    /// Takes note of a step.
    pub fn note(&mut self, report: &StepReport) {
        if report.adapter.is_some() && self.adapter.is_none() {
            self.backend = report.backend.to_string();
            self.adapter = report.adapter.as_deref().map(str::to_owned);
        }
        if self.fallback.is_none() {
            self.fallback = report.fallback.as_deref().map(str::to_owned);
        }
    }
}
