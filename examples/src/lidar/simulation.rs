//! Bodies on the sweeps of a scanner.

use super::report::{LidarBody, LidarReport, SweepReport};
use super::source::{Sweep, recipe};
use crate::bodies::{Body, Material, NamedCloud};
use crate::numbers::{median_and_most, range};
use crate::spots::Spot;
use crate::world::Stage;
use rapier3d_tldi::prelude::*;
use std::time::Instant;
use tldi::Backend;
use tldi::glamx::{Pose3, Quat, Vec3};

/// Steps from one sweep to the next, at ten sweeps a second.
const STEPS_PER_SWEEP: usize = 6;
/// Wood.
const MATERIAL: Material = Material {
    density: 500.0,
    rolling_resistance: 1.0,
};
/// Height of a body's lowest point over its place at the start, metres.
const DROP: f32 = 0.2;

/// A world with a stream of sweeps and bodies.
pub struct LidarSimulation {
    stage: Stage,
    stream: CloudStream,
    up: Vec3,
    /// Points farther from the scanner are left out, metres.
    range: f32,
    /// Each with the place that it was dropped on.
    bodies: Vec<(Body, Vec3)>,
    sweeps: Vec<SweepReport>,
}

impl LidarSimulation {
    /// Places the bodies above their spots, their y axis along `up`. Points farther than `range` metres from the scanner
    /// are left out.
    ///
    /// # Errors
    /// Those of [`TldiPipeline::with_backend`].
    pub fn new(
        bodies: Vec<NamedCloud>,
        spots: &[Spot],
        up: Vec3,
        range: f32,
        backend: Box<dyn Backend>,
    ) -> anyhow::Result<Self> {
        let mut stage = Stage::new(up, backend)?;
        let stream = CloudStream::new(&mut stage.world.colliders, recipe())?;
        let upright = Quat::from_rotation_arc(Vec3::Y, up);
        let radius = NamedCloud::largest_radius(&bodies);
        let bodies = (bodies.into_iter().zip(spots))
            .map(|(named, spot)| {
                let lift = DROP - named.cloud.bounds().min.y;
                let pose = Pose3::from_parts(spot.base(up, radius, DROP) + lift * up, upright);
                let body = Body::insert(&mut stage, named, pose, MATERIAL);
                (body, spot.surface)
            })
            .collect();
        Ok(Self {
            stage,
            stream,
            up,
            range,
            bodies,
            sweeps: Vec::new(),
        })
    }

    /// Takes a sweep, and the steps until the next one. A sweep without points in range is passed over: the last surface
    /// stays.
    ///
    /// # Errors
    /// Those of the stream and of the steps.
    pub fn take(&mut self, sweep: &Sweep) -> Result<(), TldiError> {
        let start = Instant::now();
        let seen = sweep.within(self.range);
        let points = if seen.points.iter().any(|point| point.is_finite()) {
            let taken = self.stream.frame(
                &mut self.stage.tldi,
                &self.stage.world.bodies,
                &mut self.stage.world.colliders,
                seen.as_points(),
                &sweep.world_from_scanner,
            )?;
            taken.points
        } else {
            0
        };
        let update_ms = milliseconds(start);
        let dropped = sweep.points.iter().filter(|p| !p.is_finite()).count();
        let mut report = SweepReport {
            name: sweep.name.clone(),
            points,
            dropped,
            flying: seen.flying,
            beyond: sweep.points.len() - points - dropped - seen.flying,
            contacts: 0,
            update_ms,
            step_ms: 0.0,
        };
        for step in 0..STEPS_PER_SWEEP {
            let start = Instant::now();
            let stepped = self.stage.step()?;
            let has_contacts = stepped.pairs_in_contact > 0;
            self.stage.totals.count(&stepped, has_contacts);
            if step == 0 {
                report.step_ms = milliseconds(start);
                report.contacts = self.contacts().len();
            }
            let seconds = start.elapsed().as_secs_f64();
            self.stage.totals.add_wall_seconds(seconds);
        }
        self.stage.totals.add_wall_seconds(1e-3 * update_ms);
        self.sweeps.push(report);
        Ok(())
    }

    /// The cloud of the last sweep, in the frame of the world.
    pub fn cloud(&self) -> Option<&PointCloud<'static>> {
        self.stage.cloud(self.stream.collider())
    }

    /// The clouds of the bodies, each in its own frame.
    pub fn clouds(&self) -> impl Iterator<Item = &PointCloud<'static>> {
        let bodies = self.bodies.iter();
        bodies.map(|(body, _)| body.cloud(&self.stage))
    }

    /// From the frames of the bodies into that of the world.
    pub fn world_from_body(&self) -> Vec<Pose3> {
        let bodies = self.bodies.iter();
        bodies
            .map(|(body, _)| self.stage.pose(body.handle))
            .collect()
    }

    /// Points where surfaces touch, in the frame of the world, metres.
    pub fn contacts(&self) -> Vec<Vec3> {
        let radius = self.cloud().map_or(0.0, PointCloud::mean_radius);
        let contacts = self.stage.touching(radius);
        contacts.map(|contact| contact.point).collect()
    }

    /// What happened so far.
    pub fn report(&self) -> LidarReport {
        let latencies = self.sweeps.iter();
        let latencies = latencies.map(|sweep| sweep.update_ms + sweep.step_ms);
        let [median_latency_ms, max_latency_ms] = median_and_most(latencies);
        LidarReport {
            totals: self.stage.totals.clone(),
            up: self.up.to_array(),
            median_latency_ms,
            max_latency_ms,
            sweeps: self.sweeps.clone(),
            bodies: (self.bodies.iter())
                .map(|(body, place)| self.body_report(body, *place))
                .collect(),
        }
    }

    fn body_report(&self, body: &Body, place: Vec3) -> LidarBody {
        let world_from_body = self.stage.pose(body.handle);
        let cloud = body.cloud(&self.stage);
        let points = cloud.points().iter();
        let [lowest, _] = range(points.map(|&p| (world_from_body * p).dot(self.up)));
        let height = lowest - place.dot(self.up);
        LidarBody {
            placed: body.report(&self.stage),
            height,
            linear_speed: self.stage.world.bodies[body.handle].linvel().length(),
            // Deeper than it is large.
            lost: height < -cloud.bounds().extents().max_element(),
        }
    }
}

fn milliseconds(since: Instant) -> f64 {
    1e3 * since.elapsed().as_secs_f64()
}
