//! What a run of `robot_in_scan` found.

use super::StandingReport;
use crate::bodies::PlacedBody;
use crate::output::Report;
use crate::step_totals::StepTotals;
use serde::Serialize;
use std::io::{self, Write};

/// As written to `--json`.
#[derive(Clone, Debug, Serialize)]
pub struct RobotReport {
    /// Counts over all steps; contacts are those of the robot with the scan or a loose body.
    #[serde(flatten)]
    pub totals: StepTotals,
    /// Points of the scan.
    pub scan_points: usize,
    /// Points of the scan, or of the last frame of the robot's camera, that lay on the robot and
    /// were taken out.
    pub self_filtered_points: usize,
    /// Mean point radius in metres of the scan.
    pub mean_radius: f32,
    /// Up direction, in the frame of the scan.
    pub up: [f32; 3],
    /// Whether the robot's root is fixed to the scan.
    pub base_fixed: bool,
    /// Position of the root in the frame of the scan after the last step, metres.
    pub base: [f32; 3],
    /// Joints with a motor.
    pub driven_joints: usize,
    /// The links that have a surface.
    pub links: Vec<LinkReport>,
    /// Number of `links`.
    pub link_count: usize,
    /// Deepest penetration in metres over all steps and contacts of clouds.
    pub max_penetration: f32,
    /// How it stood, where the true ground is known.
    pub standing: Option<StandingReport>,
    /// Loose bodies.
    pub bodies: Vec<LooseBodyReport>,
    /// What of the URDF could not be used.
    pub warnings: Vec<String>,
}

/// One link.
#[derive(Clone, Debug, Serialize)]
pub struct LinkReport {
    /// Name in the URDF.
    pub name: String,
    /// Number of points.
    pub points: usize,
    /// Steps in which it touched the scan, a loose body or another link.
    pub contact_steps: usize,
    /// Largest normal force of its contacts in one step, without friction, N.
    pub max_force: f32,
    /// Mean normal force over the steps with contact, N.
    pub mean_force: f32,
    /// When that largest force was, and what pushed; null if nothing touched it.
    pub hardest: Option<Hardest>,
}

/// When a link was pushed most.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Hardest {
    /// Number of the step, from 1.
    pub step: usize,
    /// What pushed most in it: the scan, a loose body or another link.
    pub against: String,
}

/// One loose body.
#[derive(Clone, Debug, Serialize)]
pub struct LooseBodyReport {
    /// Its name, its points and where it is.
    #[serde(flatten)]
    pub placed: PlacedBody,
    /// How far it was moved, metres.
    pub displacement: f32,
    /// Whether the robot touched it.
    pub touched: bool,
    /// Whether it sleeps.
    pub sleeping: bool,
}

impl Report for RobotReport {
    fn write_table(&self, out: &mut dyn Write) -> io::Result<()> {
        writeln!(
            out,
            "{:<28} {:>8} {:>14} {:>12} {:>12}  most pushed by",
            "link", "points", "contact steps", "max force N", "mean force N"
        )?;
        for link in &self.links {
            let hardest = (link.hardest.as_ref()).map_or(String::new(), |hardest| {
                format!("{} in step {}", hardest.against, hardest.step)
            });
            writeln!(
                out,
                "{:<28} {:>8} {:>14} {:>12.1} {:>12.1}  {hardest}",
                link.name, link.points, link.contact_steps, link.max_force, link.mean_force
            )?;
        }
        for loose in &self.bodies {
            let PlacedBody { name, points, .. } = &loose.placed;
            let way = loose.displacement;
            let touched = match loose.touched {
                true => ", touched by the robot",
                false => "",
            };
            writeln!(out, "{name:<28} {points:>8} moved {way:.3} m{touched}")?;
        }
        writeln!(
            out,
            "{} scan points, without {} on the robot; contacts at most {:.2} mm deep",
            self.scan_points,
            self.self_filtered_points,
            1e3 * self.max_penetration
        )?;
        if let Some(standing) = &self.standing {
            standing.write_line(out)?;
        }
        self.totals.write_line(out)
    }
}
