//! Bodies on the sweeps of a scanner.

use super::report::{LidarBodyReport, LidarReport, SweepReport};
use super::source::{Sweep, recipe};
use crate::median::median_and_most;
use crate::simulation::NamedCloud;
use crate::spots::Spot;
use crate::step_totals::StepTotals;
use crate::world::{self, DT};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use std::time::Instant;
use tldi::Backend;
use tldi::glamx::{Pose3, Quat, Vec3};

/// Steps from one sweep to the next, at ten sweeps a second.
const STEPS_PER_SWEEP: usize = 6;
/// Mass per volume of the bodies in kg/m³: wood.
const DENSITY: f32 = 500.0;
/// Angular damping, per second: what rolling costs on a real surface.
const ROLLING_RESISTANCE: f32 = 1.0;
/// Height over the surface at the start, metres.
const DROP: f32 = 0.2;

/// What takes part.
pub struct LidarScene {
    /// Bodies, their y axis up.
    pub bodies: Vec<NamedCloud>,
    /// A place for each.
    pub spots: Vec<Spot>,
    /// Against gravity, in the frame of the world.
    pub up: Vec3,
    /// Points farther from the scanner are left out, metres.
    pub range: f32,
}

/// A world with a stream of sweeps and bodies.
pub struct LidarSimulation {
    scene: LidarScene,
    world: PhysicsWorld,
    tldi: TldiPipeline,
    stream: CloudStream,
    bodies: Vec<RigidBodyHandle>,
    totals: StepTotals,
    sweeps: Vec<SweepReport>,
}

impl LidarSimulation {
    /// Places the bodies above their spots.
    ///
    /// # Errors
    /// Those of [`TldiPipeline::with_backend`].
    pub fn new(scene: LidarScene, backend: Box<dyn Backend>) -> anyhow::Result<Self> {
        let (mut world, tldi) = world::attached(scene.up, backend)?;
        let stream = CloudStream::new(&mut world.colliders, recipe())?;
        let upright = Quat::from_rotation_arc(Vec3::Y, scene.up);
        let bodies = (scene.bodies.iter().zip(&scene.spots))
            .map(|(body, spot)| {
                let lift = DROP - body.cloud.bounds().min.y + spot.level as f32;
                let pose = Pose3::from_parts(spot.surface + lift * scene.up, upright);
                let rigid_body = RigidBodyBuilder::dynamic()
                    .pose(pose)
                    .angular_damping(ROLLING_RESISTANCE);
                let collider = tldi.collider(body.cloud.clone()).density(DENSITY);
                world.insert(rigid_body, collider).0
            })
            .collect();
        Ok(Self {
            scene,
            world,
            tldi,
            stream,
            bodies,
            totals: StepTotals::new(DT),
            sweeps: Vec::new(),
        })
    }

    /// Takes a sweep, and the steps until the next one.
    ///
    /// # Errors
    /// Those of the stream and of the steps.
    pub fn take(&mut self, sweep: &Sweep) -> Result<(), TldiError> {
        let start = Instant::now();
        let seen = sweep.within(self.scene.range);
        let taken = self.stream.frame(
            &mut self.tldi,
            &self.world.bodies,
            &mut self.world.colliders,
            seen.as_points(),
            &sweep.world_from_scanner,
        )?;
        let update_ms = milliseconds(start);
        let dropped = sweep.points.iter().filter(|p| !p.is_finite()).count();
        let mut report = SweepReport {
            name: sweep.name.clone(),
            points: taken.points,
            dropped,
            flying: seen.flying,
            beyond: sweep.points.len() - taken.points - dropped - seen.flying,
            contacts: 0,
            update_ms,
            step_ms: 0.0,
        };
        for step in 0..STEPS_PER_SWEEP {
            let start = Instant::now();
            let stepped = self.tldi.step(&mut self.world)?;
            self.totals.count(&stepped, stepped.pairs_in_contact > 0);
            if step == 0 {
                report.step_ms = milliseconds(start);
                report.contacts = self.contacts().count();
            }
            self.totals.add_wall_seconds(start.elapsed().as_secs_f64());
        }
        self.totals.add_wall_seconds(1e-3 * update_ms);
        self.sweeps.push(report);
        Ok(())
    }

    /// The cloud of the last sweep, in the frame of the world.
    pub fn cloud(&self) -> Option<&PointCloud<'static>> {
        let shape = self.world.colliders[self.stream.collider()].shape();
        shape
            .as_shape::<PointCloudShape>()
            .map(PointCloudShape::cloud)
    }

    /// The clouds of the bodies, and where they are.
    pub fn bodies(&self) -> impl Iterator<Item = (&PointCloud<'static>, Pose3)> {
        let poses = self
            .bodies
            .iter()
            .map(|body| *self.world.bodies[*body].position());
        self.scene.bodies.iter().map(|body| &body.cloud).zip(poses)
    }

    /// Contact points in the frame of the world, metres.
    pub fn contacts(&self) -> impl Iterator<Item = Vec3> {
        let contacts = self
            .tldi
            .contacts(&self.world.narrow_phase, &self.world.colliders);
        contacts.map(|contact| contact.point)
    }

    /// What happened so far.
    pub fn report(&self) -> LidarReport {
        let latencies = self.sweeps.iter();
        let latencies = latencies.map(|sweep| sweep.update_ms + sweep.step_ms);
        let [median_latency_ms, max_latency_ms] = median_and_most(latencies);
        LidarReport {
            totals: self.totals.clone(),
            up: self.scene.up.to_array(),
            median_latency_ms,
            max_latency_ms,
            sweeps: self.sweeps.clone(),
            bodies: (0..self.bodies.len())
                .map(|k| self.body_report(k))
                .collect(),
        }
    }

    fn body_report(&self, index: usize) -> LidarBodyReport {
        let (named, spot) = (&self.scene.bodies[index], &self.scene.spots[index]);
        let body = &self.world.bodies[self.bodies[index]];
        let heights = named
            .cloud
            .points()
            .iter()
            .map(|&p| (*body.position() * p).dot(self.scene.up));
        let height = heights.fold(f32::MAX, f32::min) - spot.surface.dot(self.scene.up);
        LidarBodyReport {
            name: named.name.clone(),
            points: named.cloud.len(),
            translation: body.translation().to_array(),
            height,
            linear_speed: body.linvel().length(),
            // Deeper than it is large.
            lost: height < -named.cloud.bounds().extents().max_element(),
        }
    }
}

fn milliseconds(since: Instant) -> f64 {
    1e3 * since.elapsed().as_secs_f64()
}
