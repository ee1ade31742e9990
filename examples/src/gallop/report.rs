//! What a run of `gallop` found.

use super::truth::Comparisons;
use crate::bodies::PlacedBody;
use crate::contact_kinds::{ByKind, ContactKinds};
use crate::numbers::median_and_most;
use crate::output::Report;
use crate::step_totals::StepTotals;
use serde::Serialize;
use std::io::{self, Write};

/// As written to `--json`.
#[derive(Clone, Debug, Serialize)]
pub struct GallopReport {
    /// Counts over all steps; a frame is a step, contacts are those of what runs.
    #[serde(flatten)]
    pub totals: StepTotals,
    /// Points of what runs.
    pub points: usize,
    /// Frames of its cycle, as read.
    pub cycle_frames: usize,
    /// Points of the ground.
    pub ground_points: usize,
    /// Mean point radius in metres of the coarser of both.
    pub mean_radius: f32,
    /// Speed of the run, m/s.
    pub speed: f32,
    /// Deepest penetration in metres over all steps.
    pub max_penetration: f32,
    /// The deepest contacts after a step, by kind.
    pub deepest: ContactKinds,
    /// What contacts say beside how deep things truly are, by kind: hooves, waves and bodies have known shapes.
    pub true_depths: ByKind<Comparisons>,
    /// Every step.
    pub frames: Vec<GallopFrame>,
    /// Loose bodies.
    pub bodies: Vec<GallopBody>,
}

/// One step. Times are milliseconds of wall-clock time.
#[derive(Clone, Debug, Serialize)]
pub struct GallopFrame {
    /// Simulated time in seconds.
    pub time: f32,
    /// Contact points of what runs: with the ground and with bodies.
    pub contacts: usize,
    /// Pairs compared.
    pub pairs_batched: usize,
    /// New points for what runs and for the ground, interpolation and normals included.
    pub deform_ms: f64,
    /// The step: batch, contacts, solver.
    pub step_ms: f64,
}

/// One loose body.
#[derive(Clone, Debug, Serialize)]
pub struct GallopBody {
    /// Its name, its points and where it is.
    #[serde(flatten)]
    pub placed: PlacedBody,
    /// How far it was moved, metres.
    pub displacement: f32,
    /// Whether what runs touched it.
    pub kicked: bool,
}

impl Report for GallopReport {
    fn write_table(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "{} points in {} frames of a cycle run at {:.2} m/s over {} points of ground",
            self.points, self.cycle_frames, self.speed, self.ground_points
        )?;
        for body in &self.bodies {
            let kicked = if body.kicked { ", kicked" } else { "" };
            writeln!(
                out,
                "{:<22} moved {:.3} m{kicked}",
                body.placed.name, body.displacement
            )?;
        }
        let median =
            |value: fn(&GallopFrame) -> f64| median_and_most(self.frames.iter().map(value))[0];
        let contacts: usize = self.frames.iter().map(|frame| frame.contacts).sum();
        writeln!(
            out,
            "median step: {:.2} ms for new points, {:.2} ms for contacts and solver; {contacts} contact points",
            median(|frame| frame.deform_ms),
            median(|frame| frame.step_ms)
        )?;
        self.deepest.write_lines(out)?;
        for (name, of_kind) in self.true_depths.each() {
            let Comparisons {
                compared,
                mean_error,
                worst: Some(worst),
            } = of_kind
            else {
                continue;
            };
            writeln!(
                out,
                "{name} depths: {:.2} mm off in the mean of {compared}, at most {:.2} in place of {:.2} mm in step {}",
                1e3 * mean_error,
                1e3 * worst.told,
                1e3 * worst.truth,
                worst.step
            )?;
        }
        self.totals.write_line(out)
    }
}
