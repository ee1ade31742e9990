//! What kind of robot it is, how it starts and where it reaches.

use super::Motion;
use super::kinematics::{Aim, JointKind, Kinematics};
use super::links::LinkCloud;
use super::model::Model;
use super::placing::Placement;
use crate::numbers::range;
use fastrand::Rng;
use tldi::PointCloud;
use tldi::glamx::{Pose3, Vec3};

/// By how much a link must be lower than the root to carry the robot, metres.
const LOWER: f32 = 1e-3;
/// Radius of a base, at least: metres, and a share of the robot's size.
const LEAST_FOOTPRINT: f32 = 0.05;
/// Distance of points along the tip's path, as a share of its reach.
const PATH_STEP: f32 = 0.06;
/// How deep the tip is pushed into what stands there, as a share of its reach.
const PRESS: f32 = 0.03;
/// Places that are touched where nothing loose is in reach.
const TOUCHES: usize = 3;

/// Whether the robot's root is fixed to the scan.
#[derive(clap::ValueEnum, Clone, Copy, Debug, PartialEq, Eq)]
pub enum Base {
    /// Fixed, unless wheels, feet or other links that move are lower than the root.
    Auto,
    /// Fixed: an arm that is screwed down.
    Fixed,
    /// Free: a robot that stands, drives or walks.
    Floating,
}

/// The end of the longest limb.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tip {
    /// Index of its link.
    pub(super) link: usize,
    /// The point that reaches, in the frame of the link, metres.
    pub(super) point: Vec3,
    /// A point behind it, in the frame of the link, a quarter of the reach away: where the link
    /// comes from.
    pub(super) behind: Vec3,
    /// How far it gets from the first joint of its chain, at most, metres.
    pub(super) reach: f32,
    /// Height of that joint over the origin of the root, metres.
    pub(super) shoulder: f32,
}

/// The build of a robot. Lengths in metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Build {
    /// Whether the root is fixed.
    pub(super) is_fixed: bool,
    /// Height of the root's origin over what the robot stands on.
    pub(super) lift: f32,
    /// Radius of what it stands on.
    pub(super) footprint: f32,
    /// Largest extent at rest.
    pub(super) size: f32,
    /// What reaches, where something does.
    pub(super) tip: Option<Tip>,
}

impl Build {
    /// Judges a robot by its links at rest.
    pub(super) fn of(kinematics: &Kinematics, clouds: &[LinkCloud], base: Base) -> Self {
        let poses = kinematics.poses(&kinematics.rest());
        let root = kinematics.root();
        let points_of = |is_meant: &dyn Fn(usize) -> bool| -> Vec<Vec3> {
            (clouds
                .iter()
                .filter(|link| is_meant(kinematics.group(link.link))))
            .flat_map(|link| link.cloud.points().iter().map(|&p| poses[link.link] * p))
            .collect()
        };
        let lowest = |points: &[Vec3]| points.iter().map(|p| p.z).fold(f32::INFINITY, f32::min);
        let (base_points, others) = (points_of(&|g| g == root), points_of(&|g| g != root));
        let all: Vec<Vec3> = base_points.iter().chain(&others).copied().collect();
        let is_fixed = match base {
            Base::Fixed => true,
            Base::Floating => false,
            Base::Auto => base_points.is_empty() || lowest(&base_points) <= lowest(&others) + LOWER,
        };
        let bounds = (all.iter()).fold(tldi::Aabb::EMPTY, |bounds, p| bounds.including(*p));
        let size = bounds.extents().max_element();
        let standing = if is_fixed && !base_points.is_empty() {
            &base_points
        } else {
            &all
        };
        let radius = |p: &Vec3| p.truncate().length();
        let footprint = standing.iter().map(radius).fold(0.0, f32::max);
        Self {
            is_fixed,
            // A base without a surface stands on the ground, and the links above it need no room.
            lift: match is_fixed && base_points.is_empty() {
                true => (-lowest(standing)).max(0.0),
                false => -lowest(standing),
            },
            footprint: footprint.clamp(LEAST_FOOTPRINT.min(0.5 * size), size),
            size,
            tip: if is_fixed {
                tip_of(kinematics, clouds, size)
            } else {
                None
            },
        }
    }

    /// By how much the clouds of links miss their surface between samples, metres.
    pub(super) fn model_error(&self, clouds: &[LinkCloud]) -> f32 {
        let radii = clouds.iter().map(|link| link.cloud.mean_radius());
        0.5 * radii.fold(0.0, f32::max)
    }
}

/// The link with a surface that most joints move, and its point farthest from its joint. No joint slides farther than the
/// robot's size (metres): limits that are larger stand for none.
fn tip_of(kinematics: &Kinematics, clouds: &[LinkCloud], size: f32) -> Option<Tip> {
    let driven = |link: usize| -> Vec<usize> {
        let chain = kinematics.chain(link).into_iter();
        chain
            .filter(|k| kinematics.joints[*k].kind.is_driven())
            .collect()
    };
    let (link, chain) = (clouds.iter())
        .map(|link| (link, driven(link.link)))
        .max_by_key(|(link, chain)| (chain.len(), std::cmp::Reverse(link.link)))?;
    let first = *chain.first()?;
    let point =
        (link.cloud.points().iter().copied()).max_by(|a, b| a.length().total_cmp(&b.length()))?;
    let chain = kinematics.chain(link.link);
    let beyond = chain.iter().skip_while(|k| **k != first).skip(1);
    let reach: f32 = beyond
        .map(|k| {
            let joint = &kinematics.joints[*k];
            let slide = match joint.kind {
                JointKind::Prismatic => {
                    let [low, high] = joint.limits.map(f32::abs);
                    low.max(high).min(size)
                }
                _ => 0.0,
            };
            joint.parent_from_joint.translation.length() + slide
        })
        .sum();
    let rest = kinematics.poses(&kinematics.rest());
    let carrier = &kinematics.joints[first];
    let shoulder = rest[carrier.parent] * carrier.parent_from_joint.translation;
    let reach = reach + point.length();
    Some(Tip {
        link: link.link,
        point,
        behind: point - BEHIND * reach * point.normalize_or(Vec3::Z),
        reach,
        shoulder: shoulder.z,
    })
}

/// Distance of the point behind the tip, as a share of the reach, and how much less it counts.
const BEHIND: f32 = 0.25;
const BEHIND_WEIGHT: f32 = 0.15;

impl Tip {
    /// Brings the tip to a target in the frame of the root, from above and from the robot's side, so
    /// that it points at what it touches.
    fn aims(&self, target: Vec3) -> [Aim; 2] {
        let outward = target.reject_from_normalized(Vec3::Z).normalize_or(Vec3::X);
        let pointing = (outward - 1.7 * Vec3::Z).normalize();
        [
            Aim {
                point: self.point,
                target,
                weight: 1.0,
            },
            Aim {
                point: self.behind,
                target: target - BEHIND * self.reach * pointing,
                weight: BEHIND_WEIGHT,
            },
        ]
    }
}

/// Where the joints are at the start: the tip in front and up, or at rest.
pub(super) fn start_pose(kinematics: &Kinematics, build: &Build) -> Vec<f32> {
    let rest = kinematics.rest();
    let Some(tip) = build.tip else {
        return rest;
    };
    // A little bent: a stretched arm does not know which way to bend.
    let bent: Vec<f32> = (kinematics.joints.iter().zip(&rest))
        .map(|(joint, rest)| {
            let [low, high] = joint.limits;
            let middle = if (high - low).is_finite() {
                0.5 * (low + high)
            } else {
                *rest
            };
            rest + 0.3 * (middle - rest).clamp(-1.5, 1.5)
        })
        .collect();
    let ahead = Vec3::new(0.4 * tip.reach, 0.0, tip.shoulder + 0.35 * tip.reach);
    kinematics.reach(tip.link, &tip.aims(ahead), &bent).0
}

/// The reaching motion through the bodies, or onto the scan where there are none; a gait for a robot
/// that is not fixed.
pub(super) fn plan_motion(
    model: &Model,
    placement: &Placement,
    scan: &PointCloud<'_>,
    up: Vec3,
    body_size: f32,
    seed: u64,
) -> Motion {
    let kinematics = &model.description.kinematics;
    let Some(tip) = model.build.tip else {
        let radius =
            |link: usize| wheel_radius(kinematics, &model.clouds, &model.root_from_link, link);
        return Motion::gait(kinematics, &model.start, radius);
    };
    let root_from_scan = placement.scan_from_root.inverse();
    let home = model.root_from_link[tip.link] * tip.point;
    let mut corners = vec![home];
    if placement.bodies.is_empty() {
        for touch in touchable(scan, &root_from_scan, &tip, seed) {
            let into = (touch - tip.shoulder * Vec3::Z).normalize_or(Vec3::X);
            let [before, pressed] = [-0.15, PRESS].map(|way| touch + way * tip.reach * into);
            corners.extend([before, pressed, before]);
        }
    }
    for (k, surface) in placement.bodies.iter().enumerate() {
        let middle = root_from_scan * (*surface + 0.3 * body_size * up);
        let side = if k % 2 == 0 { 1.0 } else { -1.0 };
        let across = side * Vec3::Z.cross(middle).normalize_or(Vec3::Y);
        let over = 0.8 * body_size.max(0.12 * tip.reach) * Vec3::Z;
        let [before, after] = [-1.6, 1.3].map(|share| middle + share * body_size * across);
        corners.extend([before + over, before, after, after + over]);
        // Then down onto what it stood on.
        let ground = root_from_scan * *surface;
        corners.extend([
            ground + over,
            ground - PRESS * tip.reach * Vec3::Z,
            ground + over,
        ]);
    }
    corners.push(home);
    let path = polyline(&corners, PATH_STEP * tip.reach);
    let stations = path.into_iter().map(|target| tip.aims(target));
    Motion::reaching(kinematics, tip.link, stations, &model.start)
}

/// The radius in metres of a link that is a wheel: with what is fixed to it, it reaches the robot's lowest points, up to half
/// that radius.
fn wheel_radius(
    kinematics: &Kinematics,
    clouds: &[LinkCloud],
    root_from_link: &[Pose3],
    link: usize,
) -> Option<f32> {
    let lowest = |cloud: &LinkCloud| {
        let points = cloud.cloud.points().iter();
        range(points.map(|&p| (root_from_link[cloud.link] * p).z))[0]
    };
    let ground = clouds.iter().map(lowest).fold(f32::INFINITY, f32::min);
    (clouds
        .iter()
        .filter(|cloud| kinematics.group(cloud.link) == link))
    .filter_map(|cloud| {
        let mut extents = cloud.cloud.bounds().extents().to_array();
        extents.sort_by(f32::total_cmp);
        let radius = 0.5 * extents[1];
        (lowest(cloud) <= ground + 0.5 * radius).then_some(radius)
    })
    .max_by(f32::total_cmp)
}

/// Points of the scan in front of the robot and in reach, in the frame of the root.
fn touchable(scan: &PointCloud<'_>, root_from_scan: &Pose3, tip: &Tip, seed: u64) -> Vec<Vec3> {
    let mut points: Vec<Vec3> = (scan.points().iter().map(|&p| *root_from_scan * p))
        .filter(|p| {
            let distance = (*p - tip.shoulder * Vec3::Z).length() / tip.reach;
            (0.4..0.75).contains(&distance) && p.x > 0.3 * tip.reach
        })
        .collect();
    Rng::with_seed(seed).shuffle(&mut points);
    points.truncate(TOUCHES);
    points
}

/// Points along the lines between corners, the first corner left out.
fn polyline(corners: &[Vec3], step: f32) -> Vec<Vec3> {
    let mut path = Vec::new();
    for pair in corners.windows(2) {
        let pieces = (pair[0].distance(pair[1]) / step).ceil().max(1.0) as usize;
        for k in 1..=pieces {
            path.push(pair[0].lerp(pair[1], k as f32 / pieces as f32));
        }
    }
    path
}

#[cfg(test)]
mod tests {
    use super::super::kinematics::JointModel;
    use super::*;

    /// A link whose surface is the corners of a cube 20 cm wide.
    fn cube(link: usize) -> LinkCloud {
        let corners =
            (0..8).map(|k| Vec3::new((k & 1) as f32, (k >> 1 & 1) as f32, (k >> 2) as f32));
        let points: Vec<Vec3> = corners.map(|p| 0.2 * p - Vec3::splat(0.1)).collect();
        LinkCloud {
            link,
            name: String::new(),
            cloud: PointCloud::builder(points).radius(0.1).build().unwrap(),
        }
    }

    /// A joint of the root with this child, which is there in the frame of the root.
    fn joint(kind: JointKind, child: usize, place: Vec3, limit: f32) -> JointModel {
        JointModel {
            name: String::new(),
            kind,
            parent: 0,
            child,
            parent_from_joint: Pose3::from_translation(place),
            axis: Vec3::Y,
            limits: [-limit, limit],
            max_effort: None,
            max_speed: None,
            mimic: None,
        }
    }

    /// A wheel and a fan on one axis, and a joint that moves nothing: only the wheel rolls.
    #[test]
    fn what_reaches_the_ground_rolls() {
        let turning = |child, z| joint(JointKind::Continuous, child, z * Vec3::Z, f32::INFINITY);
        let joints = vec![turning(1, -0.2), turning(2, 0.3), turning(3, -0.2)];
        let kinematics = Kinematics::new(4, joints);
        let clouds = [cube(0), cube(1), cube(2)];
        let rest = kinematics.rest();
        let poses = kinematics.poses(&rest);
        let radius = |link| wheel_radius(&kinematics, &clouds, &poses, link);
        let motion = Motion::gait(&kinematics, &rest, radius);
        let rolling = [0, 1, 2].map(|k| motion.rolling(k).is_some());
        assert_eq!(rolling, [true, false, false]);
    }

    /// Limits of a kilometre are those of a slide that has none.
    #[test]
    fn a_slide_reaches_no_farther_than_the_robot_is_large() {
        let mut joints = vec![
            joint(JointKind::Revolute, 1, Vec3::Z, 1.0),
            joint(JointKind::Prismatic, 2, 0.5 * Vec3::Z, 1e3),
        ];
        joints[1].parent = 1;
        let kinematics = Kinematics::new(3, joints);
        let clouds = [cube(0), cube(1), cube(2)];
        let build = Build::of(&kinematics, &clouds, Base::Fixed);
        // From the lowest corner at −0.1 m to the highest at 1.6 m.
        assert!((build.size - 1.7).abs() < 1e-5, "{build:?}");
        let reach = build.tip.unwrap().reach;
        let expected = 0.5 + 1.7 + 0.1 * 3.0_f32.sqrt();
        assert!((reach - expected).abs() < 1e-4, "{reach}");
    }
}
