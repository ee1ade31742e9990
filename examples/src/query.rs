//! One query about two clouds: do they collide, how far apart are they, where do they touch.

use crate::devices::Devices;
use crate::output::Report;
use crate::world::DT;
use anyhow::Context;
use rapier3d::parry::query::QueryDispatcher;
use rapier3d_tldi::prelude::*;
use serde::Serialize;
use std::io::{self, Write};
use std::time::Instant;
use tldi::glamx::{Pose3, Vec3};
use tldi::{Backend, CpuBackend, ImpactQuery, PairQuery, PairResult, Params, Surface, View};

/// Two clouds and how they are placed.
pub struct CloudQuery {
    /// The cloud whose frame is that of the answer.
    pub a: PointCloud<'static>,
    /// The other cloud.
    pub b: PointCloud<'static>,
    /// From the frame of `b` into that of `a`.
    pub a_from_b: Pose3,
    /// Velocity of `b` relative to `a`, in the frame of `a`, m/s.
    pub velocity: Vec3,
}

/// What a query found.
pub struct Answer {
    /// For people and machines.
    pub report: QueryReport,
    /// All of it, with the contact pixels.
    pub result: PairResult,
    /// Parameters of the comparison.
    pub params: Params,
}

/// What is written to `--json`. Points and normals are in the frame of the first cloud, metres.
#[derive(Clone, Debug, Serialize)]
pub struct QueryReport {
    /// Whether the surfaces intersect, or the solids overlap where the normals tell.
    pub collides: bool,
    /// Least signed gap in metres; negative: penetration. Along the view where both clouds are seen
    /// in one pixel, else the distance between the nearest points' discs.
    pub gap: Option<f32>,
    /// Points for a solver, within `prediction` of each other.
    pub contacts: Vec<ContactReport>,
    /// First meeting along the velocity; null without one.
    pub impact: Option<ImpactReport>,
    /// Numbers of points.
    pub points: [usize; 2],
    /// Mean point radius of the coarser cloud, metres.
    pub mean_radius: f32,
    /// Gap in metres up to which contacts are reported.
    pub prediction: f32,
    /// Pixels in which the surfaces are that close or penetrate.
    pub contact_pixels: usize,
    /// Directions of the views, from `b` towards `a`.
    pub axes: Vec<[f32; 3]>,
    /// What compared the clouds.
    #[serde(flatten)]
    pub devices: Devices,
    /// Wall-clock time of the comparison in seconds.
    pub wall_seconds: f64,
}

/// A contact point.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ContactReport {
    /// Midway between the surfaces.
    pub point: [f32; 3],
    /// Unit normal from the first cloud towards the second.
    pub normal: [f32; 3],
    /// Penetration in metres; negative: gap.
    pub depth: f32,
}

/// The first meeting of two clouds that approach each other.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct ImpactReport {
    /// Seconds until then.
    pub time_seconds: f32,
    /// Way of the second cloud until then, metres.
    pub distance: f32,
    /// Where they meet.
    pub point: [f32; 3],
    /// Unit normal there, from the first cloud towards the second.
    pub normal: [f32; 3],
}

impl CloudQuery {
    /// Asks `backend`.
    ///
    /// # Errors
    /// Those of the backend.
    pub fn ask(&self, backend: &mut dyn Backend) -> anyhow::Result<Answer> {
        let mean_radius = self.a.mean_radius().max(self.b.mean_radius());
        let params = Params::for_radius(mean_radius);
        let query = PairQuery {
            a: Surface::Cloud(&self.a),
            b: Surface::Cloud(&self.b),
            a_from_b: self.a_from_b,
            view: View::Aim {
                policy: CameraPolicy::AllDirections,
                // As far as in a step.
                motion: self.velocity * DT,
                last_axis: None,
            },
            params,
        };
        let start = Instant::now();
        let mut results = Vec::new();
        (backend.compare(&[query], &mut results)).context("the clouds cannot be compared")?;
        let wall_seconds = start.elapsed().as_secs_f64();
        let result = results.pop().unwrap_or_default();
        let report = QueryReport {
            collides: result.collides,
            gap: match result.gap {
                Some(gap) => Some(gap),
                None => self.distance()?,
            },
            contacts: contact_points(&result),
            impact: self.impact(params)?,
            points: [self.a.len(), self.b.len()],
            mean_radius,
            prediction: params.prediction,
            contact_pixels: result.contacts.len(),
            axes: result.axes.iter().map(Vec3::to_array).collect(),
            devices: Devices::of(backend),
            wall_seconds,
        };
        // The grid of the contact pixels.
        let pixel_size = params.pixel_size * result.coarser.unwrap_or(1.0);
        let params = params.with_pixel_size(pixel_size);
        Ok(Answer {
            report,
            result,
            params,
        })
    }

    /// Distance in metres of clouds that no pixel shows together.
    fn distance(&self) -> Result<Option<f32>, TldiError> {
        let dispatcher = TldiPipeline::new(TldiConfig::default())?.dispatcher();
        let [a, b] = [&self.a, &self.b].map(|cloud| PointCloudShape::new(cloud.clone()));
        let found = dispatcher.distance(&self.a_from_b, &a, &b);
        Ok(found.ok().map(|found| found.distance))
    }

    fn impact(&self, params: Params) -> anyhow::Result<Option<ImpactReport>> {
        let speed = self.velocity.length();
        if speed == 0.0 {
            return Ok(None);
        }
        // As far as there is anything to meet.
        let bounds = self.b.bounds().transformed(&self.a_from_b);
        let whole = self.a.bounds().merged(bounds);
        let motion = self.velocity * (whole.extents().length() / speed);
        let impact = CpuBackend::new()
            .impact(&ImpactQuery {
                a: Surface::Cloud(&self.a),
                b: Surface::Cloud(&self.b),
                a_from_b: self.a_from_b,
                motion,
                touching: 0.0,
                core_only: false,
                penetration: None,
                turned: &[],
                params,
            })
            .context("the motion cannot be followed: is the velocity sensible?")?;
        Ok(impact.map(|impact| ImpactReport {
            time_seconds: impact.distance / speed,
            distance: impact.distance,
            point: impact.point.to_array(),
            normal: impact.normal.to_array(),
        }))
    }
}

fn contact_points(result: &PairResult) -> Vec<ContactReport> {
    (result.patches.iter())
        .flat_map(|patch| {
            patch.points.iter().map(|point| ContactReport {
                point: point.middle().to_array(),
                normal: patch.normal.to_array(),
                depth: -point.gap,
            })
        })
        .collect()
}

impl Report for QueryReport {
    fn write_table(&self, out: &mut dyn Write) -> io::Result<()> {
        let [a, b] = self.points;
        writeln!(
            out,
            "{a} and {b} points, mean radius {:.2} mm",
            1e3 * self.mean_radius
        )?;
        let verdict = if self.collides {
            "collide"
        } else {
            "do not collide"
        };
        let gap = match self.gap {
            Some(gap) if gap < 0.0 => format!("{:.2} mm deep", -1e3 * gap),
            Some(gap) => format!("gap {:.2} mm", 1e3 * gap),
            None => "no gap known".to_owned(),
        };
        writeln!(out, "the clouds {verdict}: {gap}")?;
        if let Some(impact) = &self.impact {
            let [x, y, z] = impact.point;
            writeln!(
                out,
                "they meet after {:.3} s and {:.3} m, at {x:.3} {y:.3} {z:.3}",
                impact.time_seconds, impact.distance
            )?;
        }
        writeln!(
            out,
            "{:>28} {:>23} {:>9}",
            "contact at (m)", "normal", "depth mm"
        )?;
        for contact in &self.contacts {
            let [x, y, z] = contact.point;
            let [nx, ny, nz] = contact.normal;
            writeln!(
                out,
                "{x:>10.4} {y:>8.4} {z:>8.4} {nx:>9.3} {ny:>6.3} {nz:>6.3} {:>9.2}",
                1e3 * contact.depth
            )?;
        }
        writeln!(
            out,
            "{} contact pixels in {} views, {:.2} ms on {}",
            self.contact_pixels,
            self.axes.len(),
            1e3 * self.wall_seconds,
            self.devices.backend
        )
    }
}
