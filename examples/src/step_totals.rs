//! What every simulation counts over its steps.

use crate::devices::Devices;
use rapier3d_tldi::prelude::StepReport;
use serde::Serialize;
use std::io::{self, Write};

/// Counts over all steps of a simulation; its report flattens them.
#[derive(Clone, Debug, Default, Serialize)]
pub struct StepTotals {
    /// What compared the clouds.
    #[serde(flatten)]
    pub devices: Devices,
    /// Steps simulated.
    pub steps: usize,
    /// Length of a step in seconds.
    pub dt: f32,
    /// Wall-clock time of the simulation in seconds: new points and steps, without pictures and
    /// without reading files.
    pub wall_seconds: f64,
    /// Simulated time by wall-clock time.
    pub real_time_factor: f64,
    /// Steps with contacts; of which, the simulation says.
    pub contact_steps: usize,
    /// Pairs compared in batches, over all steps.
    pub pairs_batched: usize,
    /// Pairs compared on the spot, over all steps.
    pub pairs_missed: usize,
}

impl StepTotals {
    /// Before the first step of `dt` seconds.
    pub fn new(dt: f32) -> Self {
        Self {
            dt,
            ..Self::default()
        }
    }

    /// Counts a step and whether it had contacts.
    pub fn count(&mut self, report: &StepReport, has_contacts: bool) {
        self.devices.note(report);
        self.steps += 1;
        self.contact_steps += usize::from(has_contacts);
        self.pairs_batched += report.pairs_batched;
        self.pairs_missed += report.pairs_missed;
    }

    /// Adds wall-clock time in seconds for the steps counted so far.
    pub fn add_wall_seconds(&mut self, seconds: f64) {
        self.wall_seconds += seconds;
        let simulated = f64::from(self.dt) * self.steps as f64;
        self.real_time_factor = simulated / self.wall_seconds.max(1e-9);
    }

    /// Writes a line for people.
    pub(crate) fn write_line(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "{} steps of {:.4} s in {:.2} s ({:.1} x real time) on {}; contacts in {} steps; {} pairs \
             batched, {} missed",
            self.steps,
            self.dt,
            self.wall_seconds,
            self.real_time_factor,
            self.devices.backend,
            self.contact_steps,
            self.pairs_batched,
            self.pairs_missed
        )
    }
}
