//! Where the links are for given positions of the joints, and back.

use fastrand::Rng;
use std::f32::consts::PI;
use tldi::glamx::{Pose3, Quat, Vec3};

/// How a joint moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum JointKind {
    /// Turns about its axis between limits, radians.
    Revolute,
    /// Turns about its axis without limits.
    Continuous,
    /// Slides along its axis between limits, metres.
    Prismatic,
    /// Does not move.
    Fixed,
    /// Moves in several ways, without a motor.
    Free,
}

impl JointKind {
    /// Whether it has one motion that a motor drives.
    pub fn is_driven(self) -> bool {
        matches!(self, Self::Revolute | Self::Continuous | Self::Prismatic)
    }
}

/// One joint. Positions are radians or metres.
#[derive(Clone, Debug)]
pub struct JointModel {
    /// Name in the URDF.
    pub name: String,
    /// How it moves.
    pub kind: JointKind,
    /// Index of the link that carries it.
    pub parent: usize,
    /// Index of the link that it moves.
    pub child: usize,
    /// From the frame of the joint, which is that of the child at position 0, into the parent's.
    pub parent_from_joint: Pose3,
    /// Unit vector in the frame of the joint.
    pub axis: Vec3,
    /// Least and largest position.
    pub limits: [f32; 2],
    /// Largest torque in N·m or force in N, if the URDF says.
    pub max_effort: Option<f32>,
    /// Largest speed, per second, if the URDF says.
    pub max_speed: Option<f32>,
    /// The joint that it follows, which follows none, with multiplier and offset.
    pub mimic: Option<(usize, f32, f32)>,
}

/// All joints of a robot, its links a tree.
#[derive(Clone, Debug)]
pub struct Kinematics {
    /// As in the URDF.
    pub joints: Vec<JointModel>,
    /// Indices of joints, parents before children.
    order: Vec<usize>,
    root: usize,
    /// The joint that moves each link; none for the root.
    joint_of_link: Vec<Option<usize>>,
}

/// Rounds of the inverse kinematics.
const ROUNDS: usize = 200;
/// Poses from which it starts anew where it ends at limits, and their seed: equal questions get equal
/// answers.
const RESTARTS: usize = 16;
const RESTART_SEED: u64 = 1;
/// Distance from the target, as a share of the chain's length, up to which it counts as reached: along
/// a path, an arm that bends the other way is worse than a little off.
const REACHED: f32 = 0.05;
/// How much of the error must be gone for a far-off pose to be worth going to.
const WORTH_IT: f32 = 0.5;
/// Distance in metres below which nothing is gained any more.
const CLOSE: f32 = 1e-4;
/// Part of a range of motion that is kept free at its ends.
const LIMIT_MARGIN: f32 = 0.02;

impl Kinematics {
    /// The kinematics of `links` links that form a tree.
    pub fn new(links: usize, joints: Vec<JointModel>) -> Self {
        let mut joint_of_link = vec![None; links];
        for (k, joint) in joints.iter().enumerate() {
            joint_of_link[joint.child] = Some(k);
        }
        let root = joint_of_link.iter().position(Option::is_none).unwrap_or(0);
        let mut order = Vec::new();
        let mut open = vec![root];
        while let Some(link) = open.pop() {
            for (k, joint) in joints.iter().enumerate() {
                if joint.parent == link {
                    order.push(k);
                    open.push(joint.child);
                }
            }
        }
        Self {
            joints,
            order,
            root,
            joint_of_link,
        }
    }

    /// The link without a parent.
    pub fn root(&self) -> usize {
        self.root
    }

    /// Whether all joints are reached from the root: links that form a loop are not.
    pub(super) fn is_connected(&self) -> bool {
        self.order.len() == self.joints.len()
    }

    /// Number of links.
    pub fn links(&self) -> usize {
        self.joint_of_link.len()
    }

    /// The joints from the root to a link.
    pub fn chain(&self, link: usize) -> Vec<usize> {
        let mut chain = Vec::new();
        let mut link = link;
        while let Some(joint) = self.joint_of_link[link] {
            chain.push(joint);
            link = self.joints[joint].parent;
        }
        chain.reverse();
        chain
    }

    /// The first link of the rigid group that a link belongs to: those that only fixed joints connect.
    pub fn group(&self, link: usize) -> usize {
        let mut link = link;
        while let Some(joint) = self.joint_of_link[link] {
            if self.joints[joint].kind != JointKind::Fixed {
                break;
            }
            link = self.joints[joint].parent;
        }
        link
    }

    /// Whether two links are one rigid group, or a joint connects their groups.
    pub fn are_adjacent(&self, a: usize, b: usize) -> bool {
        let [a, b] = [a, b].map(|link| self.group(link));
        let carrier = |link: usize| {
            self.joint_of_link[link].map(|joint| self.group(self.joints[joint].parent))
        };
        a == b || carrier(a) == Some(b) || carrier(b) == Some(a)
    }

    /// Positions that are within all limits and nearest to 0, mimic joints following.
    pub fn rest(&self) -> Vec<f32> {
        let mut positions = vec![0.0; self.joints.len()];
        for (position, joint) in positions.iter_mut().zip(&self.joints) {
            *position = joint.clamped(0.0);
        }
        self.follow(&mut positions);
        positions
    }

    /// Sets the positions of joints that mimic others.
    pub fn follow(&self, positions: &mut [f32]) {
        for (k, joint) in self.joints.iter().enumerate() {
            if let Some((leader, multiplier, offset)) = joint.mimic {
                positions[k] = joint.clamped(multiplier * positions[leader] + offset);
            }
        }
    }

    /// The pose of each link, in the frame of the root.
    pub fn poses(&self, positions: &[f32]) -> Vec<Pose3> {
        let mut poses = vec![Pose3::IDENTITY; self.links()];
        for &k in &self.order {
            let joint = &self.joints[k];
            poses[joint.child] =
                poses[joint.parent] * joint.parent_from_joint * joint.motion(positions[k]);
        }
        poses
    }

    /// Positions for which points of `link` are as near as they get to their targets, joint by joint
    /// from the tip to the root (cyclic coordinate descent), from `start` on. Where that ends at the
    /// joints' limits off the first target, it is tried from other poses as well. Each aim is a point
    /// in the frame of the link, its target in the frame of the root, and its weight. Also gives the
    /// distance that is left of the first aim, metres.
    pub fn reach(&self, link: usize, aims: &[Aim], start: &[f32]) -> (Vec<f32>, f32) {
        let chain: Vec<usize> = (self.chain(link).into_iter())
            .filter(|k| self.joints[*k].kind.is_driven() && self.joints[*k].mimic.is_none())
            .collect();
        let lengths = (self.chain(link).into_iter())
            .map(|k| self.joints[k].parent_from_joint.translation.length());
        let tip = aims.first().map_or(0.0, |aim| aim.point.length());
        let reached = REACHED * (lengths.sum::<f32>() + tip);
        let mut rng = Rng::with_seed(RESTART_SEED);
        let mut best = self.descend(link, &chain, aims, start);
        for _ in 0..RESTARTS {
            if best.distance <= reached {
                break;
            }
            let mut elsewhere = start.to_vec();
            for &k in &chain {
                let [low, high] = self.joints[k].limits.map(|end| end.clamp(-PI, PI));
                elsewhere[k] = self.joints[k].clamped(low + rng.f32() * (high - low));
            }
            self.follow(&mut elsewhere);
            let found = self.descend(link, &chain, aims, &elsewhere);
            if found.cost < WORTH_IT * best.cost {
                best = found;
            }
        }
        (best.positions, best.distance)
    }

    /// Cyclic coordinate descent over the joints of `chain`.
    fn descend(&self, link: usize, chain: &[usize], aims: &[Aim], start: &[f32]) -> Descent {
        let mut positions = start.to_vec();
        let mut best = Descent {
            positions: positions.clone(),
            cost: f32::INFINITY,
            distance: f32::INFINITY,
        };
        for _ in 0..ROUNDS {
            for &k in chain.iter().rev() {
                let poses = self.poses(&positions);
                let joint = &self.joints[k];
                let joint_from_root = (poses[joint.parent] * joint.parent_from_joint).inverse();
                let joint_from_link = joint_from_root * poses[link];
                let pairs = aims.iter().map(|aim| {
                    let (from, to) = (joint_from_link * aim.point, joint_from_root * aim.target);
                    (from, to, aim.weight)
                });
                positions[k] = joint.clamped(positions[k] + joint.step_towards(pairs));
                self.follow(&mut positions);
            }
            let pose = self.poses(&positions)[link];
            let off = |aim: &Aim| (pose * aim.point).distance(aim.target);
            let cost = aims
                .iter()
                .map(|aim| aim.weight * off(aim).powi(2))
                .sum::<f32>();
            let gain = best.cost - cost;
            if gain > 0.0 {
                best = Descent {
                    positions: positions.clone(),
                    cost,
                    distance: aims.first().map_or(0.0, off),
                };
            }
            if gain < CLOSE * CLOSE {
                break;
            }
        }
        best
    }
}

/// Where a descent ended.
struct Descent {
    positions: Vec<f32>,
    /// Sum of the weighted squared distances, m².
    cost: f32,
    /// Of the first aim, metres.
    distance: f32,
}

/// A point that is to be brought to a place.
#[derive(Clone, Copy, Debug)]
pub struct Aim {
    /// In the frame of its link, metres.
    pub point: Vec3,
    /// In the frame of the root, metres.
    pub target: Vec3,
    /// How much its squared distance counts.
    pub weight: f32,
}

impl JointModel {
    /// A joint that turns the next link of a chain.
    #[cfg(test)]
    pub(super) fn in_chain(parent: usize, axis: Vec3, at: Vec3) -> Self {
        Self {
            name: format!("joint {parent}"),
            kind: JointKind::Revolute,
            parent,
            child: parent + 1,
            parent_from_joint: Pose3::from_translation(at),
            axis,
            limits: [-2.0, 2.0],
            max_effort: None,
            max_speed: None,
            mimic: None,
        }
    }

    /// The position that is within the limits, and a little off their ends.
    pub fn clamped(&self, position: f32) -> f32 {
        let [lower, upper] = self.limits;
        if !(upper - lower).is_finite() {
            return position.max(lower).min(upper);
        }
        let margin = LIMIT_MARGIN * (upper - lower);
        position.clamp(lower + margin, upper - margin)
    }

    /// From the frame of the child into that of the joint.
    fn motion(&self, position: f32) -> Pose3 {
        match self.kind {
            JointKind::Revolute | JointKind::Continuous => {
                Pose3::from_rotation(Quat::from_axis_angle(self.axis, position))
            }
            JointKind::Prismatic => Pose3::from_translation(position * self.axis),
            JointKind::Fixed | JointKind::Free => Pose3::IDENTITY,
        }
    }

    /// The change of position that brings points closest to their targets, both in the frame of the
    /// joint, by their weights.
    fn step_towards(&self, pairs: impl Iterator<Item = (Vec3, Vec3, f32)>) -> f32 {
        let (mut along, mut across, mut weights) = (0.0, 0.0, 0.0);
        for (from, to, weight) in pairs {
            if self.kind == JointKind::Prismatic {
                along += weight * (to - from).dot(self.axis);
                weights += weight;
            } else {
                let [from, to] = [from, to].map(|p| p.reject_from_normalized(self.axis));
                across += weight * self.axis.dot(from.cross(to));
                along += weight * from.dot(to);
            }
        }
        if self.kind == JointKind::Prismatic {
            return along / weights.max(f32::MIN_POSITIVE);
        }
        if across.hypot(along) < CLOSE * CLOSE {
            return 0.0; // on the axis: turning does nothing
        }
        across.atan2(along)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A turntable with two links of 0.5 m on it.
    fn arm() -> Kinematics {
        Kinematics::new(
            4,
            vec![
                JointModel::in_chain(0, Vec3::Z, Vec3::ZERO),
                JointModel::in_chain(1, Vec3::Y, 0.3 * Vec3::Z),
                JointModel::in_chain(2, Vec3::Y, 0.5 * Vec3::Z),
            ],
        )
    }

    #[test]
    fn poses_follow_the_joints() {
        let quarter = std::f32::consts::FRAC_PI_2;
        let poses = arm().poses(&[quarter / 3.0, quarter, -quarter]);
        // Leant over to x, turned by 30° towards y, and the last link upright again.
        let tip = poses[3] * (0.5 * Vec3::Z);
        let expected = Vec3::new(0.5 * 0.75_f32.sqrt(), 0.25, 0.8);
        assert!((tip - expected).length() < 1e-5, "{tip}");
    }

    #[test]
    fn what_is_in_reach_is_reached_within_limits() {
        let arm = arm();
        let tip = 0.5 * Vec3::Z;
        let aim = |target| Aim {
            point: tip,
            target,
            weight: 1.0,
        };
        for seed in 0..20 {
            let mut rng = Rng::with_seed(seed);
            for _ in 0..50 {
                let there: Vec<f32> = (0..3).map(|_| 3.0 * rng.f32() - 1.5).collect();
                let target = arm.poses(&there)[3] * tip;
                let (found, distance) = arm.reach(3, &[aim(target)], &[0.1, 0.4, 0.4]);
                let reached = arm.poses(&found)[3] * tip;
                assert!((reached.distance(target) - distance).abs() < 1e-5);
                // A twentieth of the arm's 1.3 m.
                assert!(distance < 0.065, "seed {seed}: {target} {distance}");
                assert!(found.iter().all(|p| p.abs() <= 2.0));
            }
        }
        let far = aim(Vec3::new(3.0, 0.0, 0.3));
        let (_, distance) = arm.reach(3, &[far], &[0.0, 0.1, 0.1]);
        assert!((distance - 2.0).abs() < 0.02, "{distance}");
    }

    #[test]
    fn groups_and_neighbours() {
        let mut joints = arm().joints;
        joints[1].kind = JointKind::Fixed;
        let arm = Kinematics::new(4, joints);
        assert_eq!((arm.group(2), arm.group(3)), (1, 3));
        // Links 1 and 2 are one; 0 is joined to them, 3 as well, but 0 not to 3.
        assert!(arm.are_adjacent(0, 2) && arm.are_adjacent(1, 3) && arm.are_adjacent(1, 2));
        assert!(!arm.are_adjacent(0, 3));
    }
}
