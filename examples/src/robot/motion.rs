//! What the motors are told to do.

use super::Walk;
use super::kinematics::{Aim, JointKind, Kinematics};
use std::f32::consts::{PI, TAU};

/// Positions of all joints at a time.
#[derive(Clone, Debug)]
pub struct Waypoint {
    /// Seconds since the start.
    pub time: f32,
    /// Radians or metres, one for each joint of the URDF.
    pub positions: Vec<f32>,
}

/// A motion of all joints.
#[derive(Clone, Debug)]
pub enum Motion {
    /// From waypoint to waypoint, stopping at none but the last.
    Path(Vec<Waypoint>),
    /// Wheels roll, and the joints of limbs swing about a pose, every other limb half a period later.
    Gait {
        /// The pose.
        pose: Vec<f32>,
        /// Amplitude of each joint, radians or metres.
        amplitudes: Vec<f32>,
        /// Phase of each joint, radians.
        phases: Vec<f32>,
        /// Speed of each joint that rolls, rad/s.
        rolling: Vec<Option<f32>>,
    },
    /// The quadruped stands and walks.
    Walk(Walk),
}

/// Share of the URDF's speed limits that is used.
const SPEED_SHARE: f32 = 0.5;
/// Speeds where the URDF gives none, rad/s and m/s.
const DEFAULT_SPEED: [f32; 2] = [1.0, 0.2];
/// Steps per second of a gait.
const STEP_RATE: f32 = 1.0;
/// Amplitude of a gait: radians or metres, and at most this part of the joint's range.
const SWING: [f32; 2] = [0.3, 0.1];
/// Seconds in which a gait begins.
const RAMP: f32 = 1.0;
/// Speed over ground of a robot on wheels, m/s.
const ROLLING_SPEED: f32 = 0.25;

impl Motion {
    /// Rest at `start`, then bring points of `link` to one set of targets after the other. Joints move
    /// at half of the speed that the URDF allows.
    pub fn reaching(
        kinematics: &Kinematics,
        link: usize,
        stations: impl Iterator<Item = [Aim; 2]>,
        start: &[f32],
    ) -> Self {
        let mut path = vec![Waypoint {
            time: 0.0,
            positions: start.to_vec(),
        }];
        for aims in stations {
            let last = &path[path.len() - 1];
            let (positions, _) = kinematics.reach(link, &aims, &last.positions);
            let seconds = (kinematics
                .joints
                .iter()
                .zip(&positions)
                .zip(&last.positions))
            .map(|((joint, to), from)| {
                let slides = joint.kind == JointKind::Prismatic;
                let default = DEFAULT_SPEED[usize::from(slides)];
                (to - from).abs() / (SPEED_SHARE * joint.max_speed.unwrap_or(default))
            })
            .fold(0.02, f32::max);
            let time = last.time + seconds;
            path.push(Waypoint { time, positions });
        }
        Self::Path(path)
    }

    /// Wheels, which have a radius in metres, roll forward (along x of the root), limbs step on the spot.
    pub fn gait(
        kinematics: &Kinematics,
        pose: &[f32],
        wheel_radius: impl Fn(usize) -> Option<f32>,
    ) -> Self {
        let joints = &kinematics.joints;
        let limb = |k: usize| {
            let chain = kinematics.chain(joints[k].child);
            chain.into_iter().find(|j| joints[*j].kind.is_driven())
        };
        let mut limbs: Vec<usize> = (0..joints.len()).filter_map(limb).collect();
        limbs.sort_unstable();
        limbs.dedup();
        let phase = |k: usize| {
            let limb = limb(k).and_then(|limb| limbs.iter().position(|l| *l == limb));
            let depth = kinematics.chain(joints[k].child).len() as f32;
            // Lower joints swing a little later, against the upper ones.
            PI * limb.unwrap_or(0) as f32 + 0.5 * PI * depth
        };
        let amplitude = |k: usize| {
            let joint = &joints[k];
            let range = joint.limits[1] - joint.limits[0];
            match joint.kind {
                JointKind::Revolute | JointKind::Prismatic => SWING[0].min(SWING[1] * range),
                _ => 0.0,
            }
        };
        let poses = kinematics.poses(pose);
        let rolling = |k: usize| {
            let joint = &joints[k];
            let axis = (poses[joint.parent] * joint.parent_from_joint).rotation * joint.axis;
            // A wheel's axle points to the side; what turns about the vertical swivels freely.
            match joint.kind {
                JointKind::Continuous if axis.y.abs() > 0.5 => {
                    let radius = wheel_radius(joint.child)?;
                    Some(ROLLING_SPEED / radius.max(1e-3) * axis.y.signum())
                }
                JointKind::Continuous => Some(0.0),
                _ => None,
            }
        };
        let all = || 0..joints.len();
        Self::Gait {
            pose: pose.to_vec(),
            amplitudes: all().map(amplitude).collect(),
            phases: all().map(phase).collect(),
            rolling: all().map(rolling).collect(),
        }
    }

    /// Seconds that the motion takes; a gait goes on for ever.
    pub fn seconds(&self) -> f32 {
        match self {
            Self::Path(path) => path.last().map_or(0.0, |waypoint| waypoint.time),
            Self::Gait { .. } => f32::INFINITY,
            Self::Walk(walk) => walk.seconds(),
        }
    }

    /// Where the joints should be at a time.
    pub fn positions(&self, time: f32) -> Vec<f32> {
        match self {
            Self::Path(path) => {
                let next = path.partition_point(|waypoint| waypoint.time <= time);
                let ends = path
                    .get(next.saturating_sub(1))
                    .zip(path.get(next).or(path.last()));
                let Some((from, to)) = ends else {
                    return Vec::new();
                };
                let seconds = to.time - from.time;
                let t = if seconds > 0.0 {
                    (time - from.time) / seconds
                } else {
                    0.0
                };
                (from.positions.iter().zip(&to.positions))
                    .map(|(from, to)| from + (to - from) * t)
                    .collect()
            }
            Self::Gait {
                pose,
                amplitudes,
                phases,
                ..
            } => {
                let strength = (time / RAMP).min(1.0);
                let swing = |k: usize| {
                    let angle = TAU * STEP_RATE * time + phases[k];
                    strength * amplitudes[k] * (angle.sin() - phases[k].sin())
                };
                (pose.iter().enumerate())
                    .map(|(k, p)| p + swing(k))
                    .collect()
            }
            Self::Walk(walk) => walk.positions(time),
        }
    }

    /// The speed at which a joint is to roll, if it does.
    pub fn rolling(&self, joint: usize) -> Option<f32> {
        match self {
            Self::Path(_) | Self::Walk(_) => None,
            Self::Gait { rolling, .. } => rolling[joint],
        }
    }
}
