//! What a run of `depth_camera` found.

use crate::bodies::PlacedBody;
use crate::contact_kinds::ContactKinds;
use crate::numbers::median_and_most;
use crate::output::Report;
use crate::step_totals::StepTotals;
use serde::Serialize;
use std::io::{self, Write};

/// As written to `--json`.
#[derive(Clone, Debug, Serialize)]
pub struct DepthReport {
    /// Counts over all steps; contacts are those of any pair.
    #[serde(flatten)]
    pub totals: StepTotals,
    /// Frames per second of the camera, in simulated time.
    pub frame_rate: f32,
    /// Up direction, in the frame of the world.
    pub up: [f32; 3],
    /// Deepest penetration in metres over all steps.
    pub max_penetration: f32,
    /// The deepest contacts after a step, by kind.
    pub deepest: ContactKinds,
    /// Frames that are listed but not there, without a pose, or without a point before the first that has some.
    pub missing_frames: Vec<String>,
    /// Median of the `latency_ms` of the frames that are not `held`.
    pub median_latency_ms: f64,
    /// Largest of them.
    pub max_latency_ms: f64,
    /// The frames, in the order in which they came.
    pub frames: Vec<FrameReport>,
    /// The bodies.
    pub bodies: Vec<DepthBody>,
}

/// One frame. Times are milliseconds of wall-clock time.
#[derive(Clone, Debug, Default, Serialize)]
pub struct FrameReport {
    /// Name of the file.
    pub name: String,
    /// Whether it is the frame before once more: it counts in no median.
    pub held: bool,
    /// Points.
    pub points: usize,
    /// Pixels without a measurement.
    pub empty_pixels: usize,
    /// Pixels dropped at jumps in depth.
    pub flying_pixels: usize,
    /// Points of earlier frames that are remembered.
    pub remembered_points: usize,
    /// Reading and decoding the file; not part of the latency, as a camera does not do it.
    pub decode_ms: f64,
    /// Points, radii and normals from depths.
    pub unproject_ms: f64,
    /// Making the cloud and giving it to the collider.
    pub update_ms: f64,
    /// The step that follows: batch, contacts, solver.
    pub step_ms: f64,
    /// From the depth image to the contacts: the three times above.
    pub latency_ms: f64,
    /// Pairs in contact after that step.
    pub contacts: usize,
}

/// One body after the last step.
#[derive(Clone, Debug, Serialize)]
pub struct DepthBody {
    /// Its name, its points and where it is.
    #[serde(flatten)]
    pub placed: PlacedBody,
    /// How far it is from where it first came to rest or, if it never did, from its start, metres: its
    /// height is that over the surface below, which drifts with the poses of the frames. Null where no
    /// surface is below.
    pub displacement: Option<f32>,
    /// Speed in the world, m/s.
    pub linear_speed: f32,
    /// Mean speed over the last quarter of a second relative to the surface below, m/s; null where none
    /// is below.
    pub speed_over_surface: Option<f32>,
    /// Whether it sleeps.
    pub sleeping: bool,
    /// Simulated seconds after which it was first slower than 3 cm/s, over a quarter of a second and
    /// relative to the surface below; null if it never was.
    pub first_rested_at_seconds: Option<f32>,
}

/// A number of a frame.
type Column<'a> = &'a dyn Fn(&FrameReport) -> f64;

impl Report for DepthReport {
    fn write_table(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(out, "{:<22} {:>10} {:>10}", "of a frame", "median", "most")?;
        let rows: [(&str, Column<'_>); 7] = [
            ("points", &|f| f.points as f64),
            ("flying pixels", &|f| f.flying_pixels as f64),
            ("decode ms", &|f| f.decode_ms),
            ("unproject ms", &|f| f.unproject_ms),
            ("update ms", &|f| f.update_ms),
            ("step ms", &|f| f.step_ms),
            ("latency ms", &|f| f.latency_ms),
        ];
        for (name, value) in rows {
            let [median, most] = median_and_most(self.frames.iter().filter(|f| !f.held).map(value));
            let digits = if name.ends_with("ms") { 2 } else { 0 };
            writeln!(out, "{name:<22} {median:>10.digits$} {most:>10.digits$}")?;
        }
        writeln!(
            out,
            "{:<22} {:>10} {:>10} {:>12}",
            "body", "rests at", "speed m/s", "moved since m"
        )?;
        for body in &self.bodies {
            let rested =
                (body.first_rested_at_seconds).map_or("never".to_owned(), |s| format!("{s:.2} s"));
            let number =
                |value: Option<f32>| value.map_or("none below".to_owned(), |n| format!("{n:.3}"));
            writeln!(
                out,
                "{:<22} {rested:>10} {:>10} {:>12}",
                body.placed.name,
                number(body.speed_over_surface),
                number(body.displacement)
            )?;
        }
        writeln!(out, "{} frames", self.frames.len())?;
        self.deepest.write_lines(out)?;
        self.totals.write_line(out)
    }
}
