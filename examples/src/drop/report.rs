//! What a run of `drop` found.

use crate::bodies::PlacedBody;
use crate::output::Report;
use crate::step_totals::StepTotals;
use serde::Serialize;
use std::io::{self, Write};

/// As written to `--json`.
#[derive(Clone, Debug, Serialize)]
pub struct DropReport {
    /// Counts over all steps; contacts are those of any pair.
    #[serde(flatten)]
    pub totals: StepTotals,
    /// Points of the scan.
    pub scan_points: usize,
    /// Mean point radius in metres of the coarser of scan and bodies.
    pub mean_radius: f32,
    /// Up direction, in the frame of the scan.
    pub up: [f32; 3],
    /// Deepest penetration in metres of the last step's contacts, which are those of the poses before it.
    pub max_penetration: f32,
    /// The bodies, in the order in which they were inserted.
    pub bodies: Vec<DropBody>,
}

/// One body after the last step.
#[derive(Clone, Debug, Serialize)]
pub struct DropBody {
    /// Its name, its points and where it is.
    #[serde(flatten)]
    pub placed: PlacedBody,
    /// Speed in m/s.
    pub linear_speed: f32,
    /// Whether it sleeps.
    pub sleeping: bool,
    /// Simulated seconds after which it fell asleep for good; null while awake.
    pub slept_at_seconds: Option<f32>,
    /// Deepest penetration in metres with anything.
    pub max_penetration: f32,
    /// Whether it is within the bounds of the scan: not beside it and not below it.
    pub inside_bounds: bool,
}

impl DropReport {
    /// Names of the bodies that left the scan.
    pub fn lost(&self) -> impl Iterator<Item = &str> {
        let lost = self.bodies.iter().filter(|body| !body.inside_bounds);
        lost.map(|lost| lost.placed.name.as_str())
    }
}

impl Report for DropReport {
    fn write_table(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "{:<24} {:>8} {:>10} {:>10} {:>14}  place",
            "body", "points", "asleep at", "speed m/s", "penetration mm"
        )?;
        for body in &self.bodies {
            let asleep = match body.slept_at_seconds {
                Some(seconds) => format!("{seconds:.2} s"),
                None => "awake".to_owned(),
            };
            let PlacedBody {
                name,
                points,
                translation: [x, y, z],
            } = &body.placed;
            let lost = if body.inside_bounds { "" } else { "  LOST" };
            writeln!(
                out,
                "{name:<24} {points:>8} {asleep:>10} {:>10.3} {:>14.2}  {x:.2} {y:.2} {z:.2}{lost}",
                body.linear_speed,
                1e3 * body.max_penetration
            )?;
        }
        writeln!(
            out,
            "{} scan points; penetration at the end {:.2} mm (mean radius {:.2} mm)",
            self.scan_points,
            1e3 * self.max_penetration,
            1e3 * self.mean_radius
        )?;
        self.totals.write_line(out)
    }
}
