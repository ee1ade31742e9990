//! Bodies on a surface that a depth camera sees anew in every frame.

use super::report::{DepthBody, DepthReport, FrameReport};
use super::source::TimedFrame;
use crate::bodies::{Body, Material, NamedCloud};
use crate::contact_kinds::ContactKinds;
use crate::load;
use crate::numbers::{median, median_and_most};
use crate::spots::Spot;
use crate::world::{DT, Stage};
use anyhow::Context;
use fastrand::Rng;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use std::collections::VecDeque;
use std::f32::consts::TAU;
use std::time::Instant;
use tldi::Backend;
use tldi::glamx::{Pose3, Quat, Vec3};
use tldi_sources::depth::{DepthCamera, DepthMemory};

/// Steps from one frame to the next.
const STEPS_PER_FRAME: usize = 2;
/// Seconds from one frame to the next: 30 frames a second.
pub const FRAME_SECONDS: f32 = STEPS_PER_FRAME as f32 * DT;
const MATERIAL: Material = Material {
    density: 300.0,
    rolling_resistance: 1.0,
};
/// Height of a body over its spot at the start, metres.
const DROP: f32 = 0.08;

/// Mean speed in m/s, relative to the surface below, below which a body rests, and over how many frames:
/// a surface that is new in every frame does not let it sleep.
const REST_SPEED: f32 = 0.03;
const REST_FRAMES: usize = 8;

/// Frames of a quarter of a second: what they saw through and is there now has moved in. With half as many a slow hand
/// counts as still; with twice as many, what stopped moves on.
const MOVED_FRAMES: usize = 8;

/// What a simulation is made of.
pub struct DepthScene {
    /// The camera.
    pub camera: DepthCamera,
    /// Against gravity, unit length.
    pub up: Vec3,
    /// Bodies, their y axis up.
    pub bodies: Vec<NamedCloud>,
    /// Where they are dropped.
    pub spots: Vec<Spot>,
    /// Frames whose points are remembered where the present one does not see.
    pub memory: usize,
    /// Seed of the bodies' turns.
    pub seed: u64,
}

/// Poses and contacts at one moment.
#[derive(Clone, Debug)]
pub struct DepthSnapshot {
    /// What the collider is.
    pub frame: PointCloud<'static>,
    /// From the frame of each body into that of the world.
    pub world_from_body: Vec<Pose3>,
    /// Points where surfaces touch, metres.
    pub contacts: Vec<Vec3>,
}

/// The simulation.
pub struct DepthSimulation {
    stage: Stage,
    camera: DepthCamera,
    up: Vec3,
    surface: ColliderHandle,
    bodies: Vec<Followed>,
    memory: DepthMemory,
    /// What the last frames saw, and from where, the newest last.
    former: VecDeque<(DepthCamera, Pose3)>,
    frames: Vec<FrameReport>,
    deepest: ContactKinds,
}

/// A body, and where it was.
struct Followed {
    body: Body,
    /// Radius in metres of a ball around it.
    radius: f32,
    /// Where it started or, once it has come to rest, where it first did; see `places`.
    home: Vec3,
    /// Where it was after the last frames, the newest last, its height over the surface below.
    places: VecDeque<Vec3>,
    first_rested_at_step: Option<usize>,
}

impl DepthSimulation {
    /// Bodies over their spots, and a first frame.
    ///
    /// # Errors
    /// Where the frame holds no points, or another number of depths than the camera has pixels.
    pub fn new(
        scene: DepthScene,
        first: &TimedFrame,
        backend: Box<dyn Backend>,
    ) -> anyhow::Result<Self> {
        let DepthScene { mut camera, up, .. } = scene;
        let points = camera.points(&first.depths, &first.world_from_camera)?;
        let cloud = points.into_builder().build()?.into_owned();
        let mut stage = Stage::new(up, backend)?;
        // Its mass is never asked for: it is fixed.
        let collider = stage.tldi.collider(cloud).density(0.0);
        let (_, surface) = stage.world.insert(RigidBodyBuilder::fixed(), collider);
        let mut rng = Rng::with_seed(scene.seed);
        let upright = Quat::from_rotation_arc(Vec3::Y, up);
        let radius = NamedCloud::largest_radius(&scene.bodies);
        let bodies = (scene.bodies.into_iter().zip(&scene.spots))
            .map(|(named, spot)| {
                let turn = Quat::from_rotation_y(rng.f32() * TAU);
                let lift = 0.5 * named.cloud.bounds().extents().y + DROP;
                let place = spot.base(up, radius, DROP) + lift * up;
                let pose = Pose3::from_parts(place, upright * turn);
                let radius = load::ball_radius(&named.cloud);
                let surface = stage.cloud(surface).map_or(&[][..], PointCloud::points);
                let below = height_below(surface, pose.translation, radius, up);
                Followed {
                    body: Body::insert(&mut stage, named, pose, MATERIAL),
                    radius,
                    home: pose.translation - below.unwrap_or(0.0) * up,
                    places: VecDeque::new(),
                    first_rested_at_step: None,
                }
            })
            .collect();
        Ok(Self {
            stage,
            camera,
            up,
            surface,
            bodies,
            memory: DepthMemory::new(scene.memory),
            former: VecDeque::new(),
            frames: Vec::new(),
            deepest: ContactKinds::default(),
        })
    }

    /// A frame arrives and becomes the surface; then time goes on until the next. A frame without points is passed over:
    /// the last surface stays.
    ///
    /// # Errors
    /// Those of the pipeline, and a frame of another size than the camera's.
    pub fn take_frame(&mut self, frame: &TimedFrame) -> anyhow::Result<()> {
        let start = Instant::now();
        let points = (self.camera).points(&frame.depths, &frame.world_from_camera)?;
        let unprojected = start.elapsed();
        let mut report = FrameReport {
            name: frame.name.clone(),
            held: (self.frames.last()).is_some_and(|last| last.name == frame.name),
            points: points.points.len(),
            empty_pixels: points.empty,
            flying_pixels: points.flying,
            decode_ms: 1e3 * frame.decode_seconds,
            unproject_ms: 1e3 * unprojected.as_secs_f64(),
            ..FrameReport::default()
        };
        let whole = (self.memory).complete(points, &self.camera, &frame.world_from_camera);
        report.remembered_points = whole.points.len() - report.points;
        if !whole.points.is_empty() {
            let cloud = whole.into_builder().build()?.into_owned();
            let Stage { world, tldi, .. } = &mut self.stage;
            tldi.set_cloud(world, self.surface, cloud)?;
        }
        let updated = start.elapsed();
        report.contacts = self.step()?;
        let stepped = start.elapsed();
        report.update_ms = 1e3 * (updated - unprojected).as_secs_f64();
        report.step_ms = 1e3 * (stepped - updated).as_secs_f64();
        report.latency_ms = 1e3 * stepped.as_secs_f64();
        self.frames.push(report);
        for _ in 1..STEPS_PER_FRAME {
            self.step()?;
        }
        let seconds = start.elapsed().as_secs_f64();
        self.stage.totals.add_wall_seconds(seconds);
        self.follow();
        if self.former.len() == MOVED_FRAMES {
            self.former.pop_front();
        }
        let camera_from_world = frame.world_from_camera.inverse();
        self.former
            .push_back((self.camera.clone(), camera_from_world));
        Ok(())
    }

    /// Notes where the bodies are relative to the surface below them, which drifts with the poses of the
    /// frames, and which of them rest.
    fn follow(&mut self) {
        let surface = (self.stage.cloud(self.surface)).map_or(&[][..], PointCloud::points);
        for body in &mut self.bodies {
            let place = self.stage.pose(body.body.handle).translation;
            let Some(below) = height_below(surface, place, body.radius, self.up) else {
                body.places.clear();
                continue;
            };
            body.places.push_back(place - below * self.up);
            if body.places.len() <= REST_FRAMES {
                continue;
            }
            if body.places.len() > REST_FRAMES + 1 {
                body.places.pop_front();
            }
            if body.first_rested_at_step.is_none() && body.speed() < REST_SPEED {
                body.first_rested_at_step = Some(self.stage.totals.steps);
                body.home = place - below * self.up;
            }
        }
    }

    /// One step; gives the pairs in contact.
    fn step(&mut self) -> Result<usize, TldiError> {
        let report = self.stage.step()?;
        let has_contacts = report.pairs_in_contact > 0;
        self.stage.totals.count(&report, has_contacts);
        let contacts: Vec<_> = self.stage.contacts().collect();
        let moved_in = |contact: &CloudContact| {
            // Where the surface is: up to half the depth beyond the middle between the two.
            let into_body = if contact.collider1 == self.surface {
                contact.normal
            } else {
                -contact.normal
            };
            let place = contact.point + 0.5 * contact.depth * into_body;
            let mut former = self.former.iter();
            former.any(|(camera, from_world)| camera.sees_through(place, from_world))
        };
        let (step, world) = (self.stage.totals.steps, &self.stage.world);
        self.deepest.count(step, &contacts, world, moved_in);
        Ok(report.pairs_in_contact)
    }

    /// The clouds of the bodies, each in its own frame.
    pub fn clouds(&self) -> impl Iterator<Item = &PointCloud<'static>> {
        let bodies = self.bodies.iter();
        bodies.map(|body| body.body.cloud(&self.stage))
    }

    /// Where everything is now, with every `step`-th point of the frame.
    ///
    /// # Errors
    /// None that a frame gives which was taken.
    pub fn snapshot(&self, step: usize) -> anyhow::Result<DepthSnapshot> {
        let surface = self
            .stage
            .cloud(self.surface)
            .context("the frame is a cloud")?;
        // The fewer points, the larger their discs, so that they cover as much.
        let grown = |radius| radius * (step as f32).sqrt();
        let frame = tldi_pictures::thinned(surface, step, grown)?;
        let bodies = self.bodies.iter();
        let contacts = self.stage.touching(frame.mean_radius());
        Ok(DepthSnapshot {
            world_from_body: bodies.map(|b| self.stage.pose(b.body.handle)).collect(),
            contacts: contacts.map(|contact| contact.point).collect(),
            frame,
        })
    }

    /// What happened so far.
    pub fn report(&self, missing_frames: Vec<String>) -> DepthReport {
        let new = self.frames.iter().filter(|frame| !frame.held);
        let latencies = new.map(|frame| frame.latency_ms);
        let [median_latency_ms, max_latency_ms] = median_and_most(latencies);
        DepthReport {
            totals: self.stage.totals.clone(),
            frame_rate: 1.0 / FRAME_SECONDS,
            up: self.up.to_array(),
            max_penetration: self.stage.max_penetration,
            deepest: self.deepest.clone(),
            missing_frames,
            median_latency_ms,
            max_latency_ms,
            frames: self.frames.clone(),
            bodies: self.bodies.iter().map(|b| self.body_report(b)).collect(),
        }
    }

    fn body_report(&self, followed: &Followed) -> DepthBody {
        let Followed { body, places, .. } = followed;
        let rigid_body = &self.stage.world.bodies[body.handle];
        DepthBody {
            placed: body.report(&self.stage),
            displacement: (places.back()).map(|place| place.distance(followed.home)),
            linear_speed: rigid_body.linvel().length(),
            speed_over_surface: (!places.is_empty()).then(|| followed.speed()),
            sleeping: rigid_body.is_sleeping(),
            first_rested_at_seconds: followed.first_rested_at_step.map(|step| step as f32 * DT),
        }
    }
}

impl Followed {
    /// Mean speed, m/s, over the last frames, relative to the surface below.
    fn speed(&self) -> f32 {
        let ways = self.places.front().zip(self.places.back());
        let frames = self.places.len().saturating_sub(1).max(1);
        let way = ways.map_or(0.0, |(first, last)| first.distance(*last));
        way / (frames * STEPS_PER_FRAME) as f32 / DT
    }
}

/// Median height along `up`, metres, of the surface in a column below a body; `None` where there is none.
fn height_below(surface: &[Vec3], body: Vec3, radius: f32, up: Vec3) -> Option<f32> {
    let near = (surface.iter().map(|point| *point - body)).filter(|from| {
        let height = from.dot(up);
        (-2.0 * radius..0.0).contains(&height)
            && from.length_squared() - height * height < 0.25 * radius * radius
    });
    Some(body.dot(up) + median(near.map(|from| from.dot(up)))?)
}
