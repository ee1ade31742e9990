//! The run: both clouds get new points in every step.

use super::ground::WavyGround;
use super::report::{GallopBody, GallopFrame, GallopReport};
use super::runner::Runner;
use super::truth::{Comparisons, TrueBody, TrueDepth, below_ground};
use crate::bodies::{Body, Material, NamedCloud};
use crate::contact_kinds::{ByKind, ContactKinds, Kind};
use crate::load;
use crate::scene::BodyShape;
use crate::spots::Spot;
use crate::world::{DT, Stage, is_of};
use fastrand::Rng;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use std::f32::consts::TAU;
use std::time::Instant;
use tldi::Backend;
use tldi::glamx::{Pose3, Quat, Vec3};

const MATERIAL: Material = Material {
    density: 150.0,
    rolling_resistance: 0.5,
};
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
    stage: Stage,
    scene: GallopScene,
    runner: (RigidBodyHandle, ColliderHandle),
    ground: ColliderHandle,
    bodies: Vec<LooseBody>,
    frames: Vec<GallopFrame>,
    mean_radius: f32,
    ground_points: usize,
    deepest: ContactKinds,
    true_depths: ByKind<Comparisons>,
}

struct LooseBody {
    body: Body,
    truth: TrueBody,
    kicked: bool,
}

impl GallopSimulation {
    /// Everything at its start.
    ///
    /// # Errors
    /// Where a cloud cannot be made.
    pub fn new(scene: GallopScene, backend: Box<dyn Backend>) -> anyhow::Result<Self> {
        let mut stage = Stage::new(Vec3::Y, backend)?;
        let (points, normals) = scene.ground.at(0.0);
        let ground_points = points.len();
        // What covers a square grid, with a margin for its slopes.
        let sheet = PointCloud::builder(points)
            .normals(normals)
            .radius(0.8 * scene.ground.spacing);
        let sheet = sheet.build()?.into_owned();
        let ground_radius = sheet.mean_radius();
        let sheet = stage.tldi.collider(sheet).density(0.0);
        let (_, ground) = stage.world.insert(RigidBodyBuilder::fixed(), sheet);

        let (points, normals) = scene.runner.at(0.0);
        let mut builder = PointCloud::builder(points).knn_radii(7, 0.65);
        if let Some(normals) = normals {
            builder = builder.normals(normals);
        }
        let cloud = builder.build()?.into_owned();
        let mean_radius = ground_radius.max(cloud.mean_radius());
        let start = -Vec3::X * (scene.ground.half_size[0] - 0.7 * scene.size);
        // Contacts with the ground, which pushes neither of the two, are found as well.
        let collider = (stage.tldi.collider(cloud).density(0.0))
            .active_collision_types(ActiveCollisionTypes::all());
        let runner = stage.world.insert(
            RigidBodyBuilder::kinematic_velocity_based()
                .translation(start)
                .linvel(Vec3::X * scene.speed),
            collider,
        );
        let bodies = lay_bodies(&mut stage, &scene)?;
        Ok(Self {
            stage,
            scene,
            runner,
            ground,
            bodies,
            frames: Vec::new(),
            mean_radius,
            ground_points,
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
        let time = (self.stage.totals.steps + 1) as f32 * DT;
        self.deform(time)?;
        let deformed = start.elapsed();
        // Contacts are those of the poses before the step.
        let world_from_runner = self.stage.pose(self.runner.0);
        let world_from_body = self.world_from_body();
        let report = self.stage.step()?;
        let stepped = start.elapsed();
        let contacts = self.runner_contacts();
        let totals = &mut self.stage.totals;
        totals.count(&report, !contacts.is_empty());
        totals.add_wall_seconds(stepped.as_secs_f64());
        let all: Vec<_> = self.stage.contacts().collect();
        // Hooves move into bodies; waves only carry them.
        let kicks = |contact: &CloudContact| is_of(contact, self.runner.1);
        let (step, world) = (self.stage.totals.steps, &self.stage.world);
        let kinds = self.deepest.count(step, &all, world, kicks);
        self.compare_with_truth(time, &world_from_runner, &world_from_body, &all, &kinds);
        for LooseBody { body, kicked, .. } in &mut self.bodies {
            *kicked |= contacts.iter().any(|contact| is_of(contact, body.collider));
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

    /// New points for both, at a time.
    fn deform(&mut self, time: f32) -> Result<(), TldiError> {
        let Stage { world, tldi, .. } = &mut self.stage;
        let (points, normals) = self.scene.runner.at(time / self.scene.cycle);
        tldi.deform(world, self.runner.1, &points, normals.as_deref())?;
        let (points, normals) = self.scene.ground.at(time);
        tldi.deform(world, self.ground, &points, Some(&normals))
    }

    /// Compares contacts with the true depths of all pairs, at a time and poses.
    fn compare_with_truth(
        &mut self,
        time: f32,
        world_from_runner: &Pose3,
        world_from_body: &[Pose3],
        contacts: &[CloudContact],
        kinds: &[Kind],
    ) {
        let step = self.stage.totals.steps;
        let (runner, ground) = (self.runner.1, self.ground);
        let Some(runner_cloud) = self.stage.cloud(runner) else {
            return;
        };
        let mut compare = |pair: [ColliderHandle; 2], truth: f32, without: Kind| {
            let own = (contacts.iter().zip(kinds))
                .filter(|(contact, _)| pair.iter().all(|collider| is_of(contact, *collider)));
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
        let depth_in_ground = |cloud: &PointCloud<'_>, world_from_cloud: &Pose3| {
            let points = cloud.points().iter().map(|&p| *world_from_cloud * p);
            below_ground(&self.scene.ground, time, points)
        };
        let truth = depth_in_ground(runner_cloud, world_from_runner);
        compare([runner, ground], truth, Kind::Scripted);
        for (LooseBody { body, truth, .. }, pose) in self.bodies.iter().zip(world_from_body) {
            let cloud = body.cloud(&self.stage);
            let in_ground = depth_in_ground(cloud, pose);
            compare([body.collider, ground], in_ground, Kind::Resting);
            let reach = cloud.bounds().extents().length();
            let body_from_runner = pose.inverse() * *world_from_runner;
            let in_body = truth.depth_of(runner_cloud, &body_from_runner, reach);
            compare([body.collider, runner], in_body, Kind::Pushed);
        }
    }

    /// Where what runs touches something.
    fn runner_contacts(&self) -> Vec<CloudContact> {
        let touching = self.stage.touching(self.mean_radius);
        touching.filter(|c| is_of(c, self.runner.1)).collect()
    }

    fn world_from_body(&self) -> Vec<Pose3> {
        let bodies = self.bodies.iter();
        bodies.map(|b| self.stage.pose(b.body.handle)).collect()
    }

    /// The clouds of the bodies, each in its own frame.
    pub fn body_clouds(&self) -> impl Iterator<Item = &PointCloud<'static>> {
        let bodies = self.bodies.iter();
        bodies.map(|loose| loose.body.cloud(&self.stage))
    }

    /// Size of what runs, metres.
    pub fn size(&self) -> f32 {
        self.scene.size
    }

    /// Where everything is now.
    pub fn snapshot(&self) -> GallopSnapshot {
        let cloud = |collider| {
            let cloud = self.stage.cloud(collider);
            cloud.expect("it was made of a cloud").clone()
        };
        let contacts = self.runner_contacts();
        GallopSnapshot {
            runner: cloud(self.runner.1),
            world_from_runner: self.stage.pose(self.runner.0),
            ground: cloud(self.ground),
            world_from_body: self.world_from_body(),
            contacts: contacts.iter().map(|contact| contact.point).collect(),
        }
    }

    /// What happened so far.
    pub fn report(&self) -> GallopReport {
        let [cycle_frames, points] = self.scene.runner.counts();
        GallopReport {
            totals: self.stage.totals.clone(),
            points,
            cycle_frames,
            ground_points: self.ground_points,
            mean_radius: self.mean_radius,
            speed: self.scene.speed,
            max_penetration: self.stage.max_penetration,
            deepest: self.deepest.clone(),
            true_depths: self.true_depths,
            frames: self.frames.clone(),
            bodies: (self.bodies.iter())
                .map(|LooseBody { body, kicked, .. }| GallopBody {
                    placed: body.report(&self.stage),
                    displacement: body.displacement(&self.stage),
                    kicked: *kicked,
                })
                .collect(),
        }
    }
}

/// Bodies along the run, over the waves, their y axis up; above each other where there is no room for all in a row.
fn lay_bodies(stage: &mut Stage, scene: &GallopScene) -> anyhow::Result<Vec<LooseBody>> {
    let mut rng = Rng::with_seed(scene.seed);
    let size = BODY_SIZE * scene.size;
    let length = scene.ground.half_size[0] - scene.size;
    let shapes = BodyShape::ALL.into_iter().cycle().take(scene.bodies);
    let made = (shapes.enumerate())
        .map(|(k, shape)| {
            let sample = load::body_from_surface(shape.sample(BODY_SPACING, scene.seed))?;
            let named = NamedCloud {
                name: format!("{} {}", shape.name(), k + 1),
                cloud: load::resized(&sample, size)?,
            };
            let truth = TrueBody {
                shape,
                center: sample.bounds().center(),
                scale: size / sample.bounds().extents().max_element(),
            };
            Ok((named, truth))
        })
        .collect::<anyhow::Result<Vec<_>>>()?;
    let radius = NamedCloud::largest_radius(made.iter().map(|(named, _)| named));
    let levels = (scene.bodies as f32 * radius / length).ceil() as usize;
    let bodies = (made.into_iter().enumerate()).map(|(k, (named, truth))| {
        let along = (2.0 * (k as f32 + 0.5) / scene.bodies as f32 - 1.0) * length;
        let across = (2.0 * rng.f32() - 1.0) * STRIP * scene.size;
        let spot = Spot {
            surface: Vec3::new(along, scene.ground.amplitude, across),
            level: k % levels,
        };
        let lift = named.cloud.bounds().extents().y;
        let place = spot.base(Vec3::Y, radius, size) + lift * Vec3::Y;
        let turn = Quat::from_rotation_y(rng.f32() * TAU);
        LooseBody {
            body: Body::insert(stage, named, Pose3::from_parts(place, turn), MATERIAL),
            truth,
            kicked: false,
        }
    });
    Ok(bodies.collect())
}
