//! The run: both clouds get new points in every step.

use super::ground::WavyGround;
use super::report::{GallopBody, GallopFrame, GallopReport};
use super::runner::Runner;
use super::truth::{Comparisons, TrueBody, TrueDepth, below_ground};
use crate::contact_kinds::{ByKind, ContactKinds, Kind};
use crate::load;
use crate::scene::BodyShape;
use crate::step_totals::StepTotals;
use crate::world::{self, DT, TOUCHING_GAP};
use fastrand::Rng;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use std::time::Instant;
use tldi::Backend;
use tldi::glamx::{Pose3, Quat, Vec3};

/// Mass per volume of the bodies in kg/m³.
const DENSITY: f32 = 150.0;
/// Width of the bodies, and the strip along the run on which they lie, in sizes of what runs.
const BODY_SIZE: f32 = 0.11;
const STRIP: f32 = 0.14;
const BODY_SPACING: f32 = 0.04;

/// What a simulation is made of.
pub struct GallopScene {
    /// What runs, standing on y = 0, x ahead.
    pub runner: Runner,
    /// Its size, metres.
    pub size: f32,
    /// Its speed, m/s.
    pub speed: f32,
    /// Seconds of a cycle.
    pub cycle: f32,
    /// What it runs over.
    pub ground: WavyGround,
    /// Number of loose bodies.
    pub bodies: usize,
    /// Seed of their places.
    pub seed: u64,
}

/// Points, poses and contacts at one moment, in the world's frame.
#[derive(Clone, Debug)]
pub struct GallopSnapshot {
    /// Points of what runs.
    pub runner: PointCloud<'static>,
    /// Where it is.
    pub world_from_runner: Pose3,
    /// Points of the ground.
    pub ground: PointCloud<'static>,
    /// From the frame of each body into the world's.
    pub world_from_body: Vec<Pose3>,
    /// Contact points of what runs.
    pub contacts: Vec<Vec3>,
}

/// The simulation.
pub struct GallopSimulation {
    world: PhysicsWorld,
    tldi: TldiPipeline,
    scene: GallopScene,
    runner: (RigidBodyHandle, ColliderHandle),
    ground: ColliderHandle,
    bodies: Vec<Body>,
    frames: Vec<GallopFrame>,
    mean_radius: f32,
    ground_points: usize,
    totals: StepTotals,
    max_penetration: f32,
    deepest: ContactKinds,
    true_depths: ByKind<Comparisons>,
}

struct Body {
    name: String,
    cloud: PointCloud<'static>,
    truth: TrueBody,
    handle: RigidBodyHandle,
    collider: ColliderHandle,
    start: Vec3,
    kicked: bool,
}

impl GallopSimulation {
    /// Everything at its start.
    ///
    /// # Errors
    /// Where a cloud cannot be made.
    pub fn new(scene: GallopScene, backend: Box<dyn Backend>) -> anyhow::Result<Self> {
        let (mut world, tldi) = world::attached(Vec3::Y, backend)?;
        let (points, normals) = scene.ground.at(0.0);
        let ground_points = points.len();
        // What covers a square grid, with a margin for its slopes.
        let sheet = PointCloud::builder(points)
            .normals(normals)
            .radius(0.8 * scene.ground.spacing);
        let sheet = sheet.build()?.into_owned();
        let ground_radius = sheet.mean_radius();
        let (_, ground) =
            world.insert(RigidBodyBuilder::fixed(), tldi.collider(sheet).density(0.0));

        let (points, normals) = scene.runner.at(0.0);
        let mut builder = PointCloud::builder(points).knn_radii(7, 0.65);
        if let Some(normals) = normals {
            builder = builder.normals(normals);
        }
        let cloud = builder.build()?.into_owned();
        let mean_radius = ground_radius.max(cloud.mean_radius());
        let start = -Vec3::X * (scene.ground.half_size[0] - 0.7 * scene.size);
        let runner = world.insert(
            RigidBodyBuilder::kinematic_velocity_based()
                .translation(start)
                .linvel(Vec3::X * scene.speed),
            // Contacts with the ground, which pushes neither of the two, are found as well.
            tldi.collider(cloud)
                .density(0.0)
                .active_collision_types(ActiveCollisionTypes::all()),
        );
        let bodies = lay_bodies(&mut world, &tldi, &scene)?;
        Ok(Self {
            world,
            tldi,
            scene,
            runner,
            ground,
            bodies,
            frames: Vec::new(),
            mean_radius,
            ground_points,
            totals: StepTotals::new(DT),
            max_penetration: 0.0,
            deepest: ContactKinds::default(),
            true_depths: ByKind::default(),
        })
    }

    /// Steps that the run over the ground takes.
    pub fn steps_of_run(&self) -> usize {
        let way = 2.0 * self.scene.ground.half_size[0] - 1.4 * self.scene.size;
        (way / self.scene.speed.max(1e-3) / DT).ceil() as usize
    }

    /// New points for both, and a step.
    ///
    /// # Errors
    /// Those of the pipeline.
    pub fn step(&mut self) -> Result<(), TldiError> {
        let start = Instant::now();
        let time = (self.totals.steps + 1) as f32 * DT;
        let (points, normals) = self.scene.runner.at(time / self.scene.cycle);
        (self.tldi).deform(&mut self.world, self.runner.1, &points, normals.as_deref())?;
        let (points, normals) = self.scene.ground.at(time);
        (self.tldi).deform(&mut self.world, self.ground, &points, Some(&normals))?;
        let deformed = start.elapsed();
        // Contacts are those of the poses before the step.
        let runner_pose = *self.world.bodies[self.runner.0].position();
        let body_poses: Vec<Pose3> = (self.bodies.iter())
            .map(|body| *self.world.bodies[body.handle].position())
            .collect();
        let report = self.tldi.step(&mut self.world)?;
        let stepped = start.elapsed();
        self.max_penetration = self.max_penetration.max(report.max_penetration);
        let contacts = self.runner_contacts();
        self.totals.count(&report, !contacts.is_empty());
        let all = (self.tldi).contacts(&self.world.narrow_phase, &self.world.colliders);
        let all: Vec<_> = all.collect();
        // Hooves move into bodies; waves only carry them.
        let runner = self.runner.1;
        let kicks = |c: &CloudContact| [c.collider1, c.collider2].contains(&runner);
        let kinds = (self.deepest).count(self.totals.steps, &all, &self.world, kicks);
        self.compare_with_truth(time, &runner_pose, &body_poses, &all, &kinds);
        self.totals.add_wall_seconds(stepped.as_secs_f64());
        for body in &mut self.bodies {
            body.kicked |= contacts
                .iter()
                .any(|c| c.collider1 == body.collider || c.collider2 == body.collider);
        }
        self.frames.push(GallopFrame {
            time,
            contacts: contacts.len(),
            pairs_batched: report.pairs_batched,
            deform_ms: 1e3 * deformed.as_secs_f64(),
            step_ms: 1e3 * (stepped - deformed).as_secs_f64(),
        });
        Ok(())
    }

    /// Compares contacts with the true depths of all pairs, at a time and poses.
    fn compare_with_truth(
        &mut self,
        time: f32,
        runner_pose: &Pose3,
        body_poses: &[Pose3],
        contacts: &[CloudContact],
        kinds: &[Kind],
    ) {
        let step = self.totals.steps;
        let (runner, ground) = (self.runner.1, self.ground);
        let shape = self.world.colliders[runner].shape();
        let Some(shape) = shape.as_shape::<PointCloudShape>() else {
            return;
        };
        let runner_cloud = shape.cloud();
        let mut compare = |pair: [ColliderHandle; 2], truth: f32, without: Kind| {
            let own = contacts.iter().zip(kinds).filter(|(contact, _)| {
                let colliders = [contact.collider1, contact.collider2];
                colliders == pair || colliders == [pair[1], pair[0]]
            });
            let deepest = own.max_by(|a, b| a.0.depth.total_cmp(&b.0.depth));
            let (told, kind) = deepest.map_or((0.0, without), |(contact, kind)| {
                (contact.depth.max(0.0), *kind)
            });
            let truth = truth.max(0.0);
            if told > 0.0 || truth > 0.0 {
                let depth = TrueDepth { told, truth, step };
                self.true_depths.of(kind).count(depth);
            }
        };
        let points = runner_cloud.points().iter().map(|&p| *runner_pose * p);
        let truth = below_ground(&self.scene.ground, time, points);
        compare([runner, ground], truth, Kind::Scripted);
        for (body, pose) in self.bodies.iter().zip(body_poses) {
            let points = body.cloud.points().iter().map(|&p| *pose * p);
            let truth = below_ground(&self.scene.ground, time, points);
            compare([body.collider, ground], truth, Kind::Resting);
            let reach = body.cloud.bounds().extents().length();
            let body_from_runner = pose.inverse() * *runner_pose;
            let truth = (body.truth).depth_of(runner_cloud, &body_from_runner, reach);
            compare([body.collider, runner], truth, Kind::Pushed);
        }
    }

    /// Where what runs touches something.
    fn runner_contacts(&self) -> Vec<CloudContact> {
        let runner = self.runner.1;
        let contacts = self
            .tldi
            .contacts(&self.world.narrow_phase, &self.world.colliders);
        contacts
            .filter(|c| c.collider1 == runner || c.collider2 == runner)
            .filter(|c| c.depth > -TOUCHING_GAP * self.mean_radius)
            .collect()
    }

    /// The clouds of the bodies, each in its own frame.
    pub fn body_clouds(&self) -> impl Iterator<Item = &PointCloud<'static>> {
        self.bodies.iter().map(|body| &body.cloud)
    }

    /// Size of what runs, metres.
    pub fn size(&self) -> f32 {
        self.scene.size
    }

    /// Where everything is now.
    pub fn snapshot(&self) -> GallopSnapshot {
        let cloud = |collider: ColliderHandle| {
            let shape = self.world.colliders[collider].shape();
            let shape = shape.as_shape::<PointCloudShape>();
            shape.expect("it was made of a cloud").cloud().clone()
        };
        GallopSnapshot {
            runner: cloud(self.runner.1),
            world_from_runner: *self.world.bodies[self.runner.0].position(),
            ground: cloud(self.ground),
            world_from_body: (self.bodies.iter())
                .map(|body| *self.world.bodies[body.handle].position())
                .collect(),
            contacts: self
                .runner_contacts()
                .iter()
                .map(|contact| contact.point)
                .collect(),
        }
    }

    /// What happened so far.
    pub fn report(&self) -> GallopReport {
        let [cycle_frames, points] = self.scene.runner.counts();
        GallopReport {
            totals: self.totals.clone(),
            points,
            cycle_frames,
            ground_points: self.ground_points,
            mean_radius: self.mean_radius,
            speed: self.scene.speed,
            max_penetration: self.max_penetration,
            deepest: self.deepest.clone(),
            true_depths: self.true_depths,
            frames: self.frames.clone(),
            bodies: (self.bodies.iter())
                .map(|body| {
                    let place = self.world.bodies[body.handle].translation();
                    GallopBody {
                        name: body.name.clone(),
                        points: body.cloud.len(),
                        translation: place.to_array(),
                        displacement: place.distance(body.start),
                        kicked: body.kicked,
                    }
                })
                .collect(),
        }
    }
}

/// Bodies along the run, over the waves, their y axis up.
fn lay_bodies(
    world: &mut PhysicsWorld,
    tldi: &TldiPipeline,
    scene: &GallopScene,
) -> anyhow::Result<Vec<Body>> {
    let mut rng = Rng::with_seed(scene.seed);
    let size = BODY_SIZE * scene.size;
    let length = scene.ground.half_size[0] - scene.size;
    let mut bodies = Vec::new();
    for k in 0..scene.bodies {
        let shape = BodyShape::ALL[k % BodyShape::ALL.len()];
        let sample = load::body_from_surface(shape.sample(BODY_SPACING, scene.seed))?;
        let cloud = load::resized(&sample, size)?;
        let along = (2.0 * (k as f32 + 0.5) / scene.bodies as f32 - 1.0) * length;
        let place = Vec3::new(
            along,
            scene.ground.amplitude + cloud.bounds().extents().y,
            (2.0 * rng.f32() - 1.0) * STRIP * scene.size,
        );
        let turn = Quat::from_rotation_y(rng.f32() * std::f32::consts::TAU);
        let (handle, collider) = world.insert(
            RigidBodyBuilder::dynamic()
                .pose(Pose3::from_parts(place, turn))
                .angular_damping(0.5),
            tldi.collider(cloud.clone()).density(DENSITY),
        );
        bodies.push(Body {
            name: format!("{} {}", shape.name(), k + 1),
            truth: TrueBody {
                shape,
                center: sample.bounds().center(),
                scale: size / sample.bounds().extents().max_element(),
            },
            cloud,
            handle,
            collider,
            start: place,
            kicked: false,
        });
    }
    Ok(bodies)
}
