//! What a run of `lidar_stream` found.

use crate::bodies::PlacedBody;
use crate::output::Report;
use crate::step_totals::StepTotals;
use serde::Serialize;
use std::io::{self, Write};

/// As written to `--json`.
#[derive(Clone, Debug, Serialize)]
pub struct LidarReport {
    /// Counts over all steps; contacts are those of bodies with the sweeps or each other.
    #[serde(flatten)]
    pub totals: StepTotals,
    /// Up direction in the frame of the world.
    pub up: [f32; 3],
    /// Median time from a sweep's points to their contacts, milliseconds.
    pub median_latency_ms: f64,
    /// The longest one.
    pub max_latency_ms: f64,
    /// The sweeps.
    pub sweeps: Vec<SweepReport>,
    /// The bodies.
    pub bodies: Vec<LidarBody>,
}

/// One sweep.
#[derive(Clone, Debug, Serialize)]
pub struct SweepReport {
    /// What it is called.
    pub name: String,
    /// Points that the collider takes of it; with none, it keeps those of the last sweep.
    pub points: usize,
    /// Points that were not finite.
    pub dropped: usize,
    /// Points that were left out since they are on no surface.
    pub flying: usize,
    /// Points beyond the range.
    pub beyond: usize,
    /// Contact points in the first step with it.
    pub contacts: usize,
    /// Time of the collider's new points, milliseconds.
    pub update_ms: f64,
    /// Time of the step, milliseconds.
    pub step_ms: f64,
}

/// One body after the last step.
#[derive(Clone, Debug, Serialize)]
pub struct LidarBody {
    /// Its name, its points and where it is.
    #[serde(flatten)]
    pub placed: PlacedBody,
    /// Height of its lowest point above the place that it was dropped on, metres.
    pub height: f32,
    /// Speed in m/s.
    pub linear_speed: f32,
    /// Whether it fell through.
    pub lost: bool,
}

impl Report for LidarReport {
    fn write_table(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "{:<16} {:>10} {:>10}  place",
            "body", "height mm", "speed m/s"
        )?;
        for body in &self.bodies {
            let [x, y, z] = body.placed.translation;
            let lost = if body.lost { "  LOST" } else { "" };
            writeln!(
                out,
                "{:<16} {:>10.1} {:>10.3}  {x:.2} {y:.2} {z:.2}{lost}",
                body.placed.name,
                1e3 * body.height,
                body.linear_speed
            )?;
        }
        let points: usize = self.sweeps.iter().map(|sweep| sweep.points).sum();
        writeln!(
            out,
            "{} sweeps of {} points (mean); from points to contacts {:.1} ms (median), {:.1} ms at most",
            self.sweeps.len(),
            points / self.sweeps.len().max(1),
            self.median_latency_ms,
            self.max_latency_ms
        )?;
        self.totals.write_line(out)
    }
}
