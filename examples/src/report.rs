//! Results as JSON and as a table.

use crate::devices::Devices;
use serde::Serialize;
use std::io::{self, Write};

/// What a run of `drop` found, as written to `--json`.
#[derive(Clone, Debug, Serialize)]
pub struct DropReport {
    /// What compared the clouds.
    #[serde(flatten)]
    pub devices: Devices,
    /// Steps simulated.
    pub steps: usize,
    /// Length of a step in seconds.
    pub dt: f32,
    /// Wall-clock time of the simulation in seconds.
    pub wall_seconds: f64,
    /// Simulated time by wall-clock time.
    pub real_time_factor: f64,
    /// Points of the scan.
    pub scan_points: usize,
    /// Mean point radius in metres of the coarser of scan and bodies.
    pub mean_radius: f32,
    /// Up direction, in the frame of the scan.
    pub up: [f32; 3],
    /// Steps with at least one pair in contact.
    pub contact_steps: usize,
    /// Deepest penetration in metres after the last step.
    pub max_penetration: f32,
    /// Pairs compared in batches, over all steps.
    pub pairs_batched: usize,
    /// Pairs compared on the spot, over all steps.
    pub pairs_missed: usize,
    /// The bodies, in the order in which they were inserted.
    pub bodies: Vec<BodyReport>,
}

/// One body after the last step.
#[derive(Clone, Debug, Serialize)]
pub struct BodyReport {
    /// What it is, and its number.
    pub name: String,
    /// Number of points.
    pub points: usize,
    /// Position of the middle of its bounds, in the frame of the scan, metres.
    pub translation: [f32; 3],
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
        lost.map(|body| body.name.as_str())
    }

    /// Writes the results as a table for people.
    ///
    /// # Errors
    /// Those of writing.
    pub fn write_table(&self, out: &mut impl Write) -> io::Result<()> {
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
            let [x, y, z] = body.translation;
            let lost = if body.inside_bounds { "" } else { "  LOST" };
            writeln!(
                out,
                "{:<24} {:>8} {:>10} {:>10.3} {:>14.2}  {x:.2} {y:.2} {z:.2}{lost}",
                body.name,
                body.points,
                asleep,
                body.linear_speed,
                1e3 * body.max_penetration
            )?;
        }
        writeln!(
            out,
            "{} steps of {:.4} s in {:.2} s ({:.1} x real time) on {}; {} scan points; \
             {} pairs batched, {} missed; penetration at the end {:.2} mm (mean radius {:.2} mm)",
            self.steps,
            self.dt,
            self.wall_seconds,
            self.real_time_factor,
            self.devices.backend,
            self.scan_points,
            self.pairs_batched,
            self.pairs_missed,
            1e3 * self.max_penetration,
            1e3 * self.mean_radius
        )
    }
}
