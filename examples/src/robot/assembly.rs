//! From a robot's description to rapier's bodies, joints and motors.

use super::Motion;
use super::kinematics::{JointKind, Kinematics};
use super::links::{collision_groups, silent_pairs};
use super::model::Model;
use super::placing::Placement;
use crate::world::{GRAVITY, Stage};
use rapier3d::prelude::*;
use rapier3d_urdf::{UrdfLoaderOptions, UrdfMultibodyOptions, UrdfRobot};
use std::collections::HashMap;
use std::path::Path;
use tldi::glamx::Vec3;

/// Mass per volume of links without a mass of their own, kg/m³: what robot arms weigh by their hull.
const LINK_DENSITY: f32 = 1000.0;
/// Mass in kg of links without mass and surface, and what is added to the inertia of each joint, in
/// kg·m² or kg: gears. It keeps the equations of light links well-conditioned.
const LEAST_MASS: f32 = 1e-3;
const ARMATURE: f32 = 5e-3;
/// Stiffness and damping of the motors of a robot that is fixed, per second² and per second: critically
/// damped, so that a joint is where it should be within a tenth of a second.
const STIFFNESS: f32 = 900.0;
const DAMPING: f32 = 60.0;
/// A robot that stands on its joints: the angle in radians by which a joint gives way under its full effort,
/// and the seconds in which it goes to where it should be. A quadruped whose knees have 120 N·m stands 2 % lower by it; with twice
/// of it, 4 %. The stiffer, the harder feet push that land early.
const GIVE: f32 = 0.3;
const LAG: f32 = 0.02;
/// Damping of wheels' motors, per second: stiff, since rolling over rough points costs torque.
const WHEEL_DAMPING: f32 = 200.0;

/// A robot in rapier's sets.
pub(super) struct Assembled {
    /// The body of each link of the URDF.
    pub(super) links: Vec<RigidBodyHandle>,
    /// Index of the cloud of each of the robot's colliders.
    pub(super) cloud_of_collider: HashMap<ColliderHandle, usize>,
    /// Joints with a motor: index in the URDF, handle.
    driven: Vec<(usize, MultibodyJointHandle)>,
    /// Mass of all links, kg.
    pub(super) mass: f32,
    /// Whether the robot stands on its joints.
    stands: bool,
    /// Effort of motors whose limits the URDF does not tell, N·m or N.
    default_effort: f32,
}

/// Puts the robot into the world: multibody joints, motors, mimic joints, start pose.
pub(super) fn assemble(stage: &mut Stage, model: &Model, placement: &Placement) -> Assembled {
    let Model {
        description: robot,
        build,
        ..
    } = model;
    let world = &mut stage.world;
    let options = UrdfLoaderOptions {
        create_colliders_from_collision_shapes: false,
        create_colliders_from_visual_shapes: false,
        make_roots_fixed: build.is_fixed,
        shift: placement.scan_from_root,
        // Links and joints are found by their index in the URDF.
        squeeze_empty_fixed_links: false,
        // An arm's controller holds it against gravity.
        rigid_body_blueprint: RigidBodyBuilder::dynamic()
            .gravity_scale(if build.is_fixed { 0.0 } else { 1.0 })
            .can_sleep(false),
        ..UrdfLoaderOptions::default()
    };
    let urdf = UrdfRobot::from_robot(&robot.urdf, options, Path::new(""));
    let handles = urdf.insert_using_multibody_joints(
        &mut world.bodies,
        &mut world.colliders,
        &mut world.multibody_joints,
        UrdfMultibodyOptions::empty(),
    );
    let links: Vec<RigidBodyHandle> = handles.links.iter().map(|link| link.body).collect();
    let cloud_of_collider = attach_clouds(stage, model, &links);
    let bodies = &stage.world.bodies;
    let mass: f32 = links.iter().map(|body| bodies[*body].mass()).sum();
    let mut assembled = Assembled {
        links,
        cloud_of_collider,
        driven: Vec::new(),
        mass,
        stands: !build.is_fixed,
        default_effort: mass * GRAVITY * build.size,
    };
    let joints: Vec<_> = handles.joints.iter().map(|joint| joint.joint).collect();
    assembled.set_up_joints(&mut stage.world, &robot.kinematics, &joints, &model.start);
    assembled
}

/// Gives the bodies of the links their clouds as colliders, and masses. Gives the index of each collider's cloud.
fn attach_clouds(
    stage: &mut Stage,
    model: &Model,
    links: &[RigidBodyHandle],
) -> HashMap<ColliderHandle, usize> {
    let Model {
        description: robot,
        clouds,
        ..
    } = model;
    let world = &mut stage.world;
    let silent = silent_pairs(&robot.kinematics, clouds, &model.root_from_link);
    let groups = collision_groups(clouds.len(), &silent);
    let mut cloud_of_collider = HashMap::new();
    for (k, (link, groups)) in clouds.iter().zip(groups).enumerate() {
        let own_mass = robot.urdf.links[link.link].inertial.mass.value > 0.0;
        let collider = (stage.tldi.collider(link.cloud.clone()))
            .density(if own_mass { 0.0 } else { LINK_DENSITY })
            .collision_groups(groups);
        let body = links[link.link];
        let handle = (world.colliders).insert_with_parent(collider, body, &mut world.bodies);
        cloud_of_collider.insert(handle, k);
    }
    for body in links {
        let body = &mut world.bodies[*body];
        body.recompute_mass_properties_from_colliders(&world.colliders);
        if body.mass() <= 0.0 && body.is_dynamic() {
            let inertia = Vec3::splat(LEAST_MASS * 1e-2);
            let least = MassProperties::new(Vector::ZERO, LEAST_MASS, inertia);
            body.set_additional_mass_properties(least, false);
            body.recompute_mass_properties_from_colliders(&world.colliders);
        }
    }
    cloud_of_collider
}

impl Assembled {
    /// Number of joints with a motor.
    pub(super) fn driven_joints(&self) -> usize {
        self.driven.len()
    }

    /// An acceleration-based motor pushes as the link's own inertia asks, without the load that it carries: a
    /// robot that stands on its legs would kneel. Wheels turn evenly by it.
    fn motor_model(&self, kind: JointKind) -> MotorModel {
        if self.stands && kind != JointKind::Continuous {
            MotorModel::ForceBased
        } else {
            MotorModel::AccelerationBased
        }
    }

    /// Motors, couplings and start positions.
    fn set_up_joints(
        &mut self,
        world: &mut PhysicsWorld,
        kinematics: &Kinematics,
        joints: &[Option<MultibodyJointHandle>],
        start: &[f32],
    ) {
        let set = &mut world.multibody_joints;
        let mut a_joint = None;
        for (k, joint) in kinematics.joints.iter().enumerate() {
            let Some(handle) = joints[k].filter(|_| joint.kind.is_driven()) else {
                continue;
            };
            a_joint = Some(handle);
            if let Some((multibody, id)) = set.get_mut(handle)
                && let Some(link) = multibody.link_mut(id)
            {
                link.joint.apply_displacement(&[start[k]]);
                let axis = joint_axis(joint.kind);
                let effort = joint.max_effort.unwrap_or(self.default_effort);
                let data = &mut link.joint.data;
                data.set_motor_model(axis, self.motor_model(joint.kind));
                data.set_motor_max_force(axis, effort);
            }
            let leader = joint.mimic.and_then(|(leader, coeff, offset)| {
                let (_, id1) = set.get(joints[leader]?)?;
                Some((leader, id1, coeff, offset))
            });
            match leader {
                Some((leader, link1, coeff, offset)) => {
                    if let Some((multibody, link2)) = set.get_mut(handle) {
                        multibody.add_dof_coupling(MultibodyDofCoupling {
                            link1,
                            dof1: 0,
                            axis1: joint_axis(kinematics.joints[leader].kind) as usize,
                            link2,
                            dof2: 0,
                            axis2: joint_axis(joint.kind) as usize,
                            coeff,
                            offset,
                        });
                    }
                }
                None => self.driven.push((k, handle)),
            }
        }
        if let Some((multibody, _)) = a_joint.and_then(|handle| set.get_mut(handle)) {
            multibody.forward_kinematics(&world.bodies, true);
            multibody.update_rigid_bodies(&mut world.bodies, true);
            let root_freedom = multibody.root().joint().ndofs();
            multibody.armature_mut().as_mut_slice()[root_freedom..].fill(ARMATURE);
        }
    }

    /// Tells the motors where the joints should be at a time, or how fast they should roll.
    pub(super) fn drive(
        &self,
        world: &mut PhysicsWorld,
        kinematics: &Kinematics,
        motion: &Motion,
        time: f32,
    ) {
        let targets = motion.positions(time);
        for (k, handle) in &self.driven {
            let Some((multibody, id)) = world.multibody_joints.get_mut(*handle) else {
                continue;
            };
            let Some(link) = multibody.link_mut(id) else {
                continue;
            };
            let joint = &kinematics.joints[*k];
            let axis = joint_axis(joint.kind);
            let [stiffness, damping] = match self.motor_model(joint.kind) {
                MotorModel::ForceBased => {
                    let effort = joint.max_effort.unwrap_or(self.default_effort);
                    let stiffness = effort / GIVE;
                    [stiffness, LAG * stiffness]
                }
                MotorModel::AccelerationBased => [STIFFNESS, DAMPING],
            };
            match motion.rolling(*k) {
                Some(speed) => link
                    .joint
                    .data
                    .set_motor_velocity(axis, speed, WHEEL_DAMPING),
                None => link
                    .joint
                    .data
                    .set_motor_position(axis, targets[*k], stiffness, damping),
            };
        }
    }
}

fn joint_axis(kind: JointKind) -> JointAxis {
    if kind == JointKind::Prismatic {
        JointAxis::LinX
    } else {
        JointAxis::AngX
    }
}
