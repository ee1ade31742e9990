//! Lets bodies fall onto a scan and records what happens.

use super::report::{DropBody, DropReport};
use crate::bodies::{Body, Material, NamedCloud};
use crate::numbers::range;
use crate::spots::Spot;
use crate::world::{DT, Stage, is_of};
use fastrand::Rng;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use std::f32::consts::TAU;
use std::time::Instant;
use tldi::Backend;
use tldi::glamx::{Pose3, Quat, Vec3};

/// Wood.
const MATERIAL: Material = Material {
    density: 500.0,
    rolling_resistance: 1.0,
};
/// Largest tilt of a body at the start, in radians (5°).
const MAX_TILT: f32 = 0.087;
/// Least and greatest height of a body's lowest point over its place at the start, metres.
const DROP: [f32; 2] = [0.15, 0.3];

/// Poses and contacts at one moment.
#[derive(Clone, Debug)]
pub struct Snapshot {
    /// From the frame of each body into that of the scan.
    pub scan_from_body: Vec<Pose3>,
    /// Points where surfaces touch, in the frame of the scan, metres.
    pub contacts: Vec<Vec3>,
}

/// A simulation of bodies that fall onto a scan. The frame of the scan is that of the world.
pub struct DropSimulation {
    stage: Stage,
    up: Vec3,
    scan: ColliderHandle,
    bodies: Vec<Dropped>,
    /// After the last step, metres.
    penetration: f32,
}

struct Dropped {
    body: Body,
    slept_at_step: Option<usize>,
}

impl DropSimulation {
    /// Places a body over each spot: its y axis along `up`, turned and slightly tilted at random,
    /// its lowest point between 15 and 30 cm above the surface or the room of the bodies below.
    ///
    /// # Errors
    /// Those of [`TldiPipeline::with_backend`].
    pub fn new(
        scan: PointCloud<'static>,
        up: Vec3,
        bodies: Vec<NamedCloud>,
        spots: &[Spot],
        seed: u64,
        backend: Box<dyn Backend>,
    ) -> Result<Self, TldiError> {
        let mut stage = Stage::new(up, backend)?;
        let collider = stage.tldi.collider(scan);
        let (_, scan) = stage.world.insert(RigidBodyBuilder::fixed(), collider);
        let mut rng = Rng::with_seed(seed);
        let radius = NamedCloud::largest_radius(&bodies);
        let bodies = (bodies.into_iter().zip(spots))
            .map(|(named, spot)| {
                let pose = start_pose(&named.cloud, up, spot.base(up, radius, DROP[1]), &mut rng);
                Dropped {
                    body: Body::insert(&mut stage, named, pose, MATERIAL),
                    slept_at_step: None,
                }
            })
            .collect();
        Ok(Self {
            stage,
            up,
            scan,
            bodies,
            penetration: 0.0,
        })
    }

    /// Takes one step of 1/60 s.
    ///
    /// # Errors
    /// Those of [`TldiPipeline::step`].
    pub fn step(&mut self) -> Result<(), TldiError> {
        let start = Instant::now();
        let report = self.stage.step()?;
        let totals = &mut self.stage.totals;
        totals.count(&report, report.pairs_in_contact > 0);
        totals.add_wall_seconds(start.elapsed().as_secs_f64());
        self.penetration = report.max_penetration;
        for Dropped {
            body,
            slept_at_step,
        } in &mut self.bodies
        {
            let is_sleeping = self.stage.world.bodies[body.handle].is_sleeping();
            *slept_at_step = is_sleeping.then(|| slept_at_step.unwrap_or(totals.steps));
        }
        Ok(())
    }

    /// The scan.
    pub fn scan(&self) -> &PointCloud<'static> {
        let scan = self.stage.cloud(self.scan);
        scan.expect("it was made of a cloud")
    }

    /// The clouds of the bodies, each in its own frame.
    pub fn clouds(&self) -> impl Iterator<Item = &PointCloud<'static>> {
        let bodies = self.bodies.iter();
        bodies.map(|dropped| dropped.body.cloud(&self.stage))
    }

    /// Where everything is now.
    pub fn snapshot(&self) -> Snapshot {
        let bodies = self.bodies.iter();
        let contacts = self.stage.touching(self.scan().mean_radius());
        Snapshot {
            scan_from_body: bodies.map(|b| self.stage.pose(b.body.handle)).collect(),
            contacts: contacts.map(|contact| contact.point).collect(),
        }
    }

    /// What happened so far.
    pub fn report(&self) -> DropReport {
        let body_radii = self.clouds().map(PointCloud::mean_radius);
        DropReport {
            totals: self.stage.totals.clone(),
            scan_points: self.scan().len(),
            mean_radius: body_radii.fold(self.scan().mean_radius(), f32::max),
            up: self.up.to_array(),
            max_penetration: self.penetration,
            bodies: self.bodies.iter().map(|b| self.body_report(b)).collect(),
        }
    }

    fn body_report(&self, dropped: &Dropped) -> DropBody {
        let body = &dropped.body;
        let rigid_body = &self.stage.world.bodies[body.handle];
        let own = (self.stage.contacts()).filter(|contact| is_of(contact, body.collider));
        DropBody {
            placed: body.report(&self.stage),
            linear_speed: rigid_body.linvel().length(),
            sleeping: rigid_body.is_sleeping(),
            slept_at_seconds: dropped.slept_at_step.map(|step| step as f32 * DT),
            max_penetration: own.map(|contact| contact.depth).fold(0.0, f32::max),
            inside_bounds: self.is_inside(rigid_body.translation()),
        }
    }

    /// Whether a point is not beside and not below the scan. Above it there is room.
    fn is_inside(&self, point: Vec3) -> bool {
        let (right, forward) = self.up.any_orthonormal_pair();
        let extent = |axis: Vec3| range(self.scan().points().iter().map(|&p| p.dot(axis)));
        let within = |axis: Vec3| {
            let [min, max] = extent(axis);
            (min..=max).contains(&point.dot(axis))
        };
        within(right) && within(forward) && point.dot(self.up) >= extent(self.up)[0]
    }
}

/// From the frame of a body into that of the scan, at the start, over a place.
fn start_pose(cloud: &PointCloud<'_>, up: Vec3, base: Vec3, rng: &mut Rng) -> Pose3 {
    let upright = Quat::from_rotation_arc(Vec3::Y, up);
    let yaw = Quat::from_rotation_y(rng.f32() * TAU);
    let tilt_axis = Quat::from_rotation_y(rng.f32() * TAU) * Vec3::X;
    let tilt = Quat::from_axis_angle(tilt_axis, rng.f32() * MAX_TILT);
    let rotation = upright * tilt * yaw;
    let [lowest, highest] = range(cloud.points().iter().map(|&p| (rotation * p).dot(up)));
    let drop_height = (highest - lowest).clamp(DROP[0], DROP[1]);
    Pose3::from_parts(base + (drop_height - lowest) * up, rotation)
}
