//! A robot of clouds moves in a scan.

use super::assembly::{Assembled, assemble};
use super::description::Description;
use super::links::{LinkCloud, world_groups};
use super::loose_bodies::{LooseBody, lay_bodies, loose_size};
use super::model::Model;
use super::own_camera::OwnCamera;
use super::placing::Site;
use super::plan::{Base, plan_motion};
use super::report::{LinkReport, RobotReport};
use super::self_filter::SelfFilter;
use super::standing::Standing;
use super::tally::{self, LinkTally};
use super::{Motion, count};
use crate::load;
use crate::numbers::range;
use crate::terrain::Terrain;
use crate::world::{DT, GRAVITY, Stage, is_of};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use std::time::Instant;
use tldi::Backend;
use tldi::glamx::{Pose3, Vec3};

/// Steps from one frame of the robot's camera to the next: 30 frames a second.
const STEPS_PER_FRAME: usize = 2;
/// Speed in m/s at which penetrations are pushed out: an arm that motors press into a scan does not
/// jump back.
const PUSH_OUT_SPEED: f32 = 0.5;
/// Frequency in Hz at which contacts give way under a robot that is not fixed: feet sink in less than at rapier's 30 and
/// 60. Substeps of 1/240 s allow no more than 120.
const CONTACT_FREQUENCY: f32 = 120.0;
/// Height of a robot that is not fixed over its surface at the start, metres.
const ROBOT_DROP: f32 = 0.005;
/// Distance from the middle of the scan, in its diagonals, at which a robot is lost.
const FAR_AWAY: f32 = 10.0;

/// What a simulation is made of.
pub struct RobotScene {
    /// Fixed surroundings; its frame is that of the world.
    pub scan: PointCloud<'static>,
    /// Against gravity, unit length.
    pub up: Vec3,
    /// The robot.
    pub robot: Description,
    /// How it stands.
    pub base: Base,
    /// Where it stands, if not to be found; in the frame of the scan, metres.
    pub at: Option<Vec3>,
    /// The level direction that it faces, if not to be found.
    pub facing: Option<Vec3>,
    /// The true ground, where it is known: how the robot stands on it is measured.
    pub terrain: Option<Terrain>,
    /// What it does, if not to be planned.
    pub motion: Option<Motion>,
    /// Loose bodies in its reach, at most.
    pub bodies: usize,
    /// Standard deviation of the scan's points, metres.
    pub sensor_noise: f32,
    /// Whether the scan comes anew 30 times a second from a camera that also sees the robot.
    pub own_camera: bool,
    /// Whether what lies on the robot is taken out of the scan.
    pub self_filter: bool,
    /// Seed of all choices.
    pub seed: u64,
}

/// Poses and contacts at one moment.
#[derive(Clone, Debug)]
pub struct RobotSnapshot {
    /// From the frame of each link cloud into that of the scan.
    pub scan_from_link: Vec<Pose3>,
    /// Whether each link touches something.
    pub link_touches: Vec<bool>,
    /// From the frame of each loose body into that of the scan.
    pub scan_from_body: Vec<Pose3>,
    /// Points where surfaces touch, in the frame of the scan, metres.
    pub contacts: Vec<Vec3>,
}

/// The simulation.
pub struct RobotSimulation {
    stage: Stage,
    scan: PointCloud<'static>,
    scan_collider: ColliderHandle,
    up: Vec3,
    model: Model,
    assembled: Assembled,
    tally: Vec<LinkTally>,
    loose: Vec<LooseBody>,
    motion: Motion,
    filter: Option<SelfFilter>,
    own_camera: Option<OwnCamera>,
    self_filtered: usize,
    standing: Option<Standing>,
}

impl RobotSimulation {
    /// Samples the links, finds a place, lays the bodies, and plans the motion.
    ///
    /// # Errors
    /// Where there is no place, or a cloud cannot be made.
    pub fn new(scene: RobotScene, backend: Box<dyn Backend>) -> anyhow::Result<Self> {
        let RobotScene { scan, up, seed, .. } = scene;
        let scan_radius = scan.mean_radius();
        let model = Model::new(scene.robot, scene.base, scan_radius)?;
        let is_fixed = model.build.is_fixed;
        let loose_size = loose_size(scan_radius);
        let site = Site {
            footprint: model.build.footprint,
            lift: model.build.lift + if is_fixed { 0.0 } else { ROBOT_DROP },
            reach: model.build.tip.map_or(0.0, |tip| tip.reach),
            body_radius: 0.6 * loose_size,
            bodies: if is_fixed { scene.bodies } else { 0 },
            facing: scene.facing,
            seed,
        };
        let placement = model.place(&scan, up, &site, scene.at)?;
        let scan_from_link = model.scan_from_link(&placement.scan_from_root);

        let filter = scene.self_filter.then(|| model.filter(scene.sensor_noise));
        let at_start = filter.as_ref().filter(|_| is_fixed);
        let (scan, self_filtered) = cleaned(&scan, at_start, &scan_from_link)?;

        let mut stage = Stage::new(up, backend)?;
        soften(&mut stage.world.integration_parameters, is_fixed);
        let scan_shape = if scene.own_camera {
            // Every frame has other points: one radius for all, and normals found on the way.
            let bare = PointCloud::builder(scan.points().to_vec());
            bare.radius(scan_radius).build()?.into_owned()
        } else {
            scan.clone()
        };
        let collider = stage
            .tldi
            .collider(scan_shape)
            .collision_groups(world_groups());
        let (_, scan_collider) = stage.world.insert(RigidBodyBuilder::fixed(), collider);
        let assembled = assemble(&mut stage, &model, &placement);
        let loose = lay_bodies(&mut stage, up, loose_size, &placement, seed)?;
        let motion = (scene.motion)
            .unwrap_or_else(|| plan_motion(&model, &placement, &scan, up, loose_size, seed));
        let standing = scene.terrain.map(|terrain| {
            let links = model.clouds.iter().map(|link| scan_from_link[link.link]);
            let (root, weight) = (placement.scan_from_root, GRAVITY * assembled.mass);
            let links: Vec<Pose3> = links.collect();
            Standing::new(terrain, &scan, &model.clouds, &root, &links, weight)
        });
        let camera = || OwnCamera::new(scene.sensor_noise, seed);
        Ok(Self {
            standing,
            tally: vec![LinkTally::default(); model.clouds.len()],
            own_camera: scene.own_camera.then(camera),
            stage,
            scan,
            scan_collider,
            up,
            model,
            assembled,
            loose,
            motion,
            filter,
            self_filtered,
        })
    }

    /// Seconds that the planned motion takes; infinite for one that goes on for ever.
    pub fn motion_seconds(&self) -> f32 {
        self.motion.seconds()
    }

    /// Takes one step of 1/60 s.
    ///
    /// # Errors
    /// Those of the pipeline.
    pub fn step(&mut self) -> anyhow::Result<()> {
        let start = Instant::now();
        if self.stage.totals.steps.is_multiple_of(STEPS_PER_FRAME) {
            self.take_frame()?;
        }
        let time = self.stage.totals.steps as f32 * DT;
        (self.assembled).drive(
            &mut self.stage.world,
            &self.model.description.kinematics,
            &self.motion,
            time,
        );
        let report = self.stage.step()?;
        let seconds = start.elapsed().as_secs_f64();
        let touches = self.count_contacts();
        self.observe_standing();
        self.stage.totals.count(&report, touches);
        self.stage.totals.add_wall_seconds(seconds);
        Ok(())
    }

    /// What the robot's camera sees becomes the scan, without the robot.
    fn take_frame(&mut self) -> anyhow::Result<()> {
        let Some(camera) = &mut self.own_camera else {
            return Ok(());
        };
        let links = self.assembled.links.iter();
        let world_from_link: Vec<Pose3> = links.map(|body| self.stage.pose(*body)).collect();
        let mut frame = camera.frame(&self.scan, &self.model.clouds, &world_from_link);
        if let Some(filter) = &self.filter {
            let on_robot = filter.on_robot(&frame, &world_from_link)?;
            self.self_filtered = count(&on_robot);
            let mut on = on_robot.into_iter();
            frame.retain(|_| !on.next().unwrap_or(false));
        }
        let Stage { world, tldi, .. } = &mut self.stage;
        tldi.set_points(world, self.scan_collider, &frame, None)?;
        Ok(())
    }

    /// Adds to the tallies; gives whether the robot touches the scan or a loose body.
    fn count_contacts(&mut self) -> bool {
        let link_of =
            |collider: ColliderHandle| self.assembled.cloud_of_collider.get(&collider).copied();
        let name_of = |collider: ColliderHandle| {
            let is_it = |loose: &&LooseBody| loose.body.collider == collider;
            match (self.loose.iter().find(is_it), link_of(collider)) {
                (Some(loose), _) => loose.body.name.clone(),
                (None, Some(link)) => self.model.clouds[link].name.clone(),
                (None, None) => "scan".to_owned(),
            }
        };
        let (step, world) = (self.stage.totals.steps + 1, &self.stage.world);
        let touched = tally::count(&mut self.tally, step, world, link_of, name_of);
        for loose in &mut self.loose {
            loose.touched |= touched.contains(&loose.body.collider);
        }
        !touched.is_empty()
    }

    /// Normal force in N on the link that was pushed most in the last step.
    pub fn largest_force(&self) -> f32 {
        let forces = self.tally.iter().map(|tally| tally.force);
        forces.fold(0.0, f32::max)
    }

    fn observe_standing(&mut self) {
        let (links, root) = (self.scan_from_link(), self.root());
        let Some(standing) = &mut self.standing else {
            return;
        };
        let contacts = (self.stage.contacts())
            .filter(|contact| is_of(contact, self.scan_collider))
            .map(|contact| (contact.point, contact.depth));
        let forces: Vec<f32> = self.tally.iter().map(|tally| tally.force).collect();
        standing.observe(
            &self.scan,
            &self.model.clouds,
            &root,
            &links,
            contacts,
            &forces,
        );
    }

    /// Where the root is.
    fn root(&self) -> Pose3 {
        let root = self.model.description.kinematics.root();
        self.stage.pose(self.assembled.links[root])
    }

    fn scan_from_link(&self) -> Vec<Pose3> {
        let pose = |link: &LinkCloud| self.stage.pose(self.assembled.links[link.link]);
        self.model.clouds.iter().map(pose).collect()
    }

    /// The scan without what lay on the robot at the start.
    pub fn scan(&self) -> &PointCloud<'static> {
        &self.scan
    }

    /// The robot's links.
    pub fn links(&self) -> &[LinkCloud] {
        &self.model.clouds
    }

    /// The clouds of the loose bodies, each in its own frame.
    pub fn loose_clouds(&self) -> impl Iterator<Item = &PointCloud<'static>> {
        self.loose.iter().map(|loose| loose.body.cloud(&self.stage))
    }

    /// Where everything is now.
    pub fn snapshot(&self) -> RobotSnapshot {
        let loose = self.loose.iter();
        let link_of = &self.assembled.cloud_of_collider;
        let is_robots = |contact: &CloudContact| {
            let mut colliders = [contact.collider1, contact.collider2].into_iter();
            colliders.any(|collider| link_of.contains_key(&collider))
        };
        RobotSnapshot {
            scan_from_link: self.scan_from_link(),
            link_touches: self.tally.iter().map(|tally| tally.touches).collect(),
            scan_from_body: loose.map(|b| self.stage.pose(b.body.handle)).collect(),
            contacts: (self.stage.touching(self.scan.mean_radius()))
                .filter(is_robots)
                .map(|contact| contact.point)
                .collect(),
        }
    }

    /// What happened so far.
    pub fn report(&self) -> RobotReport {
        let links: Vec<LinkReport> = (self.model.clouds.iter().zip(&self.tally))
            .map(|(link, tally)| tally.report(&link.name, link.cloud.len()))
            .collect();
        RobotReport {
            totals: self.stage.totals.clone(),
            scan_points: self.scan.len(),
            self_filtered_points: self.self_filtered,
            mean_radius: self.scan.mean_radius(),
            up: self.up.to_array(),
            base_fixed: self.model.build.is_fixed,
            base: self.root().translation.to_array(),
            driven_joints: self.assembled.driven_joints(),
            link_count: links.len(),
            links,
            max_penetration: self.stage.max_penetration,
            standing: (self.standing.as_ref()).map(|standing| standing.report().clone()),
            bodies: (self.loose.iter())
                .map(|loose| loose.report(&self.stage))
                .collect(),
            warnings: self.model.description.warnings.clone(),
        }
    }

    /// The name of a link that is too far from the scan to come back.
    pub fn thrown_out(&self) -> Option<&str> {
        let bounds = self.scan.bounds();
        let farthest = FAR_AWAY * bounds.extents().length().max(self.model.build.size);
        let is_lost = |pose: &Pose3| {
            let distance = pose.translation.distance(bounds.center());
            distance.is_nan() || distance > farthest
        };
        let lost = self.scan_from_link().iter().position(is_lost)?;
        Some(&self.model.clouds[lost].name)
    }

    /// Whether the robot is fixed or still on the scan: not below its lowest point.
    pub fn is_on_scan(&self) -> bool {
        if self.model.build.is_fixed {
            return true;
        }
        let [lowest, _] = range(self.scan.points().iter().map(|&p| p.dot(self.up)));
        self.root().translation.dot(self.up) >= lowest - 0.1
    }
}

/// A scan without points on no surface and, where there is a filter, without those on the robot; and the number of the
/// latter.
fn cleaned(
    scan: &PointCloud<'_>,
    filter: Option<&SelfFilter>,
    scan_from_link: &[Pose3],
) -> Result<(PointCloud<'static>, usize), CloudError> {
    let on_robot = match filter {
        Some(filter) => filter.on_robot(scan.points(), scan_from_link)?,
        None => vec![false; scan.len()],
    };
    let on_surface = load::on_surfaces(scan);
    let kept: Vec<usize> = (0..scan.len())
        .filter(|i| on_surface[*i] && !on_robot[*i])
        .collect();
    let scan = load::subset(scan, &kept, |p| p, |r| r)?;
    Ok((scan, count(&on_robot)))
}

/// Contacts that give way as motors and feet need it.
fn soften(parameters: &mut IntegrationParameters, is_fixed: bool) {
    parameters.normalized_max_corrective_velocity = PUSH_OUT_SPEED;
    if !is_fixed {
        // Feet hold by friction while they are pushed out, too.
        parameters.friction_in_bias_pass = true;
        parameters.contact_softness.natural_frequency = CONTACT_FREQUENCY;
        parameters.static_contact_softness.natural_frequency = CONTACT_FREQUENCY;
    }
}
