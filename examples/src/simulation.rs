//! Lets bodies fall onto a scan and records what happens.

use crate::load;
use crate::report::{BodyReport, DropReport};
use crate::scene::BodyShape;
use crate::spots::Spot;
use crate::step_totals::StepTotals;
use crate::world::{self, DT, TOUCHING_GAP};
use fastrand::Rng;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use std::time::Instant;
use tldi::Backend;
use tldi::glamx::{Pose3, Quat, Vec3};

/// Mass per volume of the bodies in kg/m³: wood.
const DENSITY: f32 = 500.0;
/// Angular damping of the bodies, per second: what rolling costs on a real surface, which rapier
/// does not model.
const ROLLING_RESISTANCE: f32 = 1.0;
/// Largest tilt of a body at the start, in radians (5°).
const MAX_TILT: f32 = 0.087;

/// A cloud and a name for it.
#[derive(Clone, Debug)]
pub struct NamedCloud {
    /// Name for reports.
    pub name: String,
    /// The cloud, centred on its origin.
    pub cloud: PointCloud<'static>,
}

impl NamedCloud {
    /// Generated bodies, one shape after the other, numbered from 1. Their largest extent is `size` metres, and the
    /// distance of their points the part `spacing` of a width.
    ///
    /// # Errors
    /// [`CloudError`] if a cloud cannot have that size.
    pub fn generated(
        shapes: &[BodyShape],
        count: usize,
        spacing: f32,
        size: f32,
        seed: u64,
    ) -> Result<Vec<Self>, CloudError> {
        (shapes.iter().cycle().take(count).enumerate())
            .map(|(k, shape)| {
                let cloud = load::body_from_surface(shape.sample(spacing, seed))?;
                Ok(Self {
                    name: format!("{} {}", shape.name(), k + 1),
                    cloud: load::resized(&cloud, size)?,
                })
            })
            .collect()
    }
}

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
    world: PhysicsWorld,
    tldi: TldiPipeline,
    up: Vec3,
    scan: PointCloud<'static>,
    bodies: Vec<Body>,
    totals: StepTotals,
    max_penetration: f32,
}

struct Body {
    named: NamedCloud,
    handle: RigidBodyHandle,
    collider: ColliderHandle,
    slept_at_step: Option<usize>,
}

impl DropSimulation {
    /// Places a body over each spot: its y axis along `up`, turned and slightly tilted at random,
    /// its lowest point between 15 and 30 cm above the surface.
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
        let (mut world, tldi) = world::attached(up, backend)?;
        world.insert(RigidBodyBuilder::fixed(), tldi.collider(scan.clone()));
        let mut rng = Rng::with_seed(seed);
        let bodies = bodies
            .into_iter()
            .zip(spots)
            .map(|(named, spot)| {
                let pose = start_pose(&named.cloud, up, spot, &mut rng);
                let (handle, collider) = world.insert(
                    RigidBodyBuilder::dynamic()
                        .pose(pose)
                        .angular_damping(ROLLING_RESISTANCE),
                    tldi.collider(named.cloud.clone()).density(DENSITY),
                );
                Body {
                    named,
                    handle,
                    collider,
                    slept_at_step: None,
                }
            })
            .collect();
        Ok(Self {
            world,
            tldi,
            up,
            scan,
            bodies,
            totals: StepTotals::new(DT),
            max_penetration: 0.0,
        })
    }

    /// Takes one step of 1/60 s.
    ///
    /// # Errors
    /// Those of [`TldiPipeline::step`].
    pub fn step(&mut self) -> Result<(), TldiError> {
        let start = Instant::now();
        let report = self.tldi.step(&mut self.world)?;
        self.totals.count(&report, report.pairs_in_contact > 0);
        self.totals.add_wall_seconds(start.elapsed().as_secs_f64());
        self.max_penetration = report.max_penetration;
        for body in &mut self.bodies {
            body.slept_at_step = if self.world.bodies[body.handle].is_sleeping() {
                body.slept_at_step.or(Some(self.totals.steps))
            } else {
                None
            };
        }
        Ok(())
    }

    /// The scan.
    pub fn scan(&self) -> &PointCloud<'static> {
        &self.scan
    }

    /// The clouds of the bodies, each in its own frame.
    pub fn clouds(&self) -> Vec<&PointCloud<'static>> {
        self.bodies.iter().map(|body| &body.named.cloud).collect()
    }

    /// Where everything is now.
    pub fn snapshot(&self) -> Snapshot {
        let pose = |body: &Body| *self.world.bodies[body.handle].position();
        Snapshot {
            scan_from_body: self.bodies.iter().map(pose).collect(),
            contacts: (self.contacts())
                .filter(|contact| contact.depth > -TOUCHING_GAP * self.scan.mean_radius())
                .map(|contact| contact.point)
                .collect(),
        }
    }

    fn contacts(&self) -> impl Iterator<Item = CloudContact> {
        self.tldi
            .contacts(&self.world.narrow_phase, &self.world.colliders)
    }

    /// What happened so far.
    pub fn report(&self) -> DropReport {
        let body_radii = self
            .bodies
            .iter()
            .map(|body| body.named.cloud.mean_radius());
        DropReport {
            totals: self.totals.clone(),
            scan_points: self.scan.len(),
            mean_radius: body_radii.fold(self.scan.mean_radius(), f32::max),
            up: self.up.to_array(),
            max_penetration: self.max_penetration,
            bodies: self
                .bodies
                .iter()
                .map(|body| self.body_report(body))
                .collect(),
        }
    }

    fn body_report(&self, body: &Body) -> BodyReport {
        let rigid_body = &self.world.bodies[body.handle];
        let deepest = self
            .contacts()
            .filter(|c| c.collider1 == body.collider || c.collider2 == body.collider)
            .fold(0.0, |deepest, contact| f32::max(deepest, contact.depth));
        BodyReport {
            name: body.named.name.clone(),
            points: body.named.cloud.len(),
            translation: rigid_body.translation().to_array(),
            linear_speed: rigid_body.linvel().length(),
            sleeping: rigid_body.is_sleeping(),
            slept_at_seconds: body.slept_at_step.map(|step| step as f32 * DT),
            max_penetration: deepest,
            inside_bounds: self.is_inside(rigid_body.translation()),
        }
    }

    /// Whether a point is not beside and not below the scan. Above it there is room.
    fn is_inside(&self, point: Vec3) -> bool {
        let (right, forward) = self.up.any_orthonormal_pair();
        let range = |axis: Vec3| {
            let along = self.scan.points().iter().map(|&p| p.dot(axis));
            along.fold((f32::MAX, f32::MIN), |(min, max), a| {
                (min.min(a), max.max(a))
            })
        };
        let within = |axis: Vec3| {
            let (min, max) = range(axis);
            (min..=max).contains(&point.dot(axis))
        };
        within(right) && within(forward) && point.dot(self.up) >= range(self.up).0
    }
}

/// From the frame of a body into that of the scan, at the start.
fn start_pose(cloud: &PointCloud<'_>, up: Vec3, spot: &Spot, rng: &mut Rng) -> Pose3 {
    let upright = Quat::from_rotation_arc(Vec3::Y, up);
    let yaw = Quat::from_rotation_y(rng.f32() * std::f32::consts::TAU);
    let tilt_axis = Quat::from_rotation_y(rng.f32() * std::f32::consts::TAU) * Vec3::X;
    let tilt = Quat::from_axis_angle(tilt_axis, rng.f32() * MAX_TILT);
    let rotation = upright * tilt * yaw;
    let heights = cloud.points().iter().map(|&p| (rotation * p).dot(up));
    let (lowest, highest) = heights.fold((f32::MAX, f32::MIN), |(min, max), h| {
        (min.min(h), max.max(h))
    });
    let drop_height = (highest - lowest).clamp(0.15, 0.3);
    let level_height = spot.level as f32 * (1.2 * (highest - lowest) + drop_height);
    let lift = drop_height + level_height - lowest;
    Pose3::from_parts(spot.surface + lift * up, rotation)
}
