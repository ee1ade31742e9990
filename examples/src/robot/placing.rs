//! Where in a scan a robot stands, and what is in its reach.

use crate::spots::level_places;
use fastrand::Rng;
use std::f32::consts::FRAC_PI_4;
use thiserror::Error;
use tldi::PointCloud;
use tldi::glamx::{Pose3, Quat, Vec3};

/// What a robot needs. Lengths in metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Site {
    /// Radius of what it stands on.
    pub(super) footprint: f32,
    /// Height of the root's origin over what it stands on.
    pub(super) lift: f32,
    /// How far its tip gets from its base; 0: it does not reach.
    pub(super) reach: f32,
    /// Radius of the bodies that are laid into its reach.
    pub(super) body_radius: f32,
    /// How many.
    pub(super) bodies: usize,
    /// The level direction that it faces; found where it is left out.
    pub(super) facing: Option<Vec3>,
    /// Seed of the choice.
    pub(super) seed: u64,
}

/// A place for a robot.
#[derive(Clone, Debug)]
pub(super) struct Placement {
    /// From the frame of the root (z up) into that of the scan.
    pub(super) scan_from_root: Pose3,
    /// Surface points under the bodies, in the frame of the scan.
    pub(super) bodies: Vec<Vec3>,
}

/// There is nowhere to stand.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error(
    "the scan has no level place without holes of {diameter:.2} m for the robot: give --place, --up if the direction is wrong, or --scan-scale if the scan is not in metres"
)]
pub(super) struct NoPlace {
    /// Diameter of what was looked for.
    pub(super) diameter: f32,
}

/// Places that are tried.
const CANDIDATES: usize = 96;
/// Of these, those with most in reach that are tried against the robot's own volume.
const FINALISTS: usize = 12;
/// Horizontal distances from the base at which things are in reach, and heights over and below
/// its foot, in reaches.
const RING: [f32; 2] = [0.35, 0.7];
const LEVELS: [f32; 2] = [-0.25, 0.4];
/// Radius of the level disc around a body, in its radii: with room to push it, else just for it.
const DISC_RADII: [f32; 2] = [2.8, 1.0];
/// Least distance of two bodies, in their radii.
const APART: f32 = 3.5;

/// Chooses a place on `scan`: level and without holes, with much in reach, and where few points of
/// the scan are in the robot's way: `in_the_way` counts them for a pose of the root. With `at`, the
/// robot stands there and only turns.
pub(super) fn place(
    scan: &PointCloud<'_>,
    up: Vec3,
    site: &Site,
    at: Option<Vec3>,
    in_the_way: impl Fn(&Pose3) -> usize,
) -> Result<Placement, NoPlace> {
    let no_place = NoPlace {
        diameter: 2.0 * site.footprint,
    };
    let mut bases = match at {
        Some(at) => vec![at],
        None => level_places(scan, up, site.footprint),
    };
    Rng::with_seed(site.seed).shuffle(&mut bases);
    bases.truncate(CANDIDATES);
    let surfaces = surfaces_for_bodies(scan, up, site);
    let directions = directions(up, site);
    let mut options: Vec<(f32, Placement)> = Vec::new();
    for base in bases {
        let reachable = in_reach(&surfaces, base, up, site);
        for forward in &directions {
            let bodies = in_front(&reachable, base, *forward, site);
            let level = bodies.iter().map(|b| (*b - base).dot(up)).sum::<f32>();
            // Rather a table than the floor: what is higher is easier seen and reached.
            let score = bodies.len() as f32 + 0.2 * level / site.reach.max(1e-3);
            let scan_from_root = standing(base + site.lift * up, up, *forward);
            options.push((
                score,
                Placement {
                    scan_from_root,
                    bodies,
                },
            ));
        }
    }
    options.sort_by(|a, b| b.0.total_cmp(&a.0));
    options.truncate(FINALISTS * 8);
    // As clear as can be; among the equally clear, the best.
    let best = options.into_iter().min_by_key(|(score, option)| {
        let blocked = in_the_way(&option.scan_from_root);
        (blocked, (-1e3 * score) as i64)
    });
    best.map(|(_, option)| option).ok_or(no_place)
}

/// The surfaces on which a body has room, with as much of it as there is.
fn surfaces_for_bodies(scan: &PointCloud<'_>, up: Vec3, site: &Site) -> Vec<Vec3> {
    if site.reach <= 0.0 || site.bodies == 0 {
        return Vec::new();
    }
    let with_room = |room: &f32| level_places(scan, up, room * site.body_radius);
    let mut places = DISC_RADII.iter().map(with_room);
    places.find(|places| !places.is_empty()).unwrap_or_default()
}

/// The horizontal directions that are tried.
fn directions(up: Vec3, site: &Site) -> Vec<Vec3> {
    let (level, _) = up.any_orthonormal_pair();
    let turned = |turn: u8| Quat::from_axis_angle(up, f32::from(turn) * FRAC_PI_4) * level;
    let all_around = || (0..8).map(turned).collect();
    site.facing.map_or_else(all_around, |facing| vec![facing])
}

/// The pose of a root whose z is `up` and x is `forward`.
fn standing(origin: Vec3, up: Vec3, forward: Vec3) -> Pose3 {
    let axes = tldi::glamx::Mat3::from_cols(forward, up.cross(forward), up);
    Pose3::from_parts(origin, Quat::from_mat3(&axes).normalize())
}

/// The surfaces that a robot at `base` reaches.
fn in_reach(surfaces: &[Vec3], base: Vec3, up: Vec3, site: &Site) -> Vec<Vec3> {
    let [near, far] = RING.map(|share| share * site.reach);
    let [low, high] = LEVELS.map(|share| share * site.reach);
    (surfaces.iter().copied())
        .filter(|surface| {
            let offset = *surface - base;
            let height = offset.dot(up);
            let distance = offset.reject_from(up).length();
            (near.max(site.footprint + site.body_radius)..far).contains(&distance)
                && (low..high).contains(&height)
        })
        .collect()
}

/// Up to `site.bodies` of the surfaces in front, well apart.
fn in_front(reachable: &[Vec3], base: Vec3, forward: Vec3, site: &Site) -> Vec<Vec3> {
    let ideal = 0.5 * (RING[0] + RING[1]) * site.reach;
    let mut ahead: Vec<(f32, Vec3)> = (reachable.iter())
        .filter(|surface| (**surface - base).normalize_or_zero().dot(forward) > 0.5)
        .map(|surface| (((*surface - base).length() - ideal).abs(), *surface))
        .collect();
    ahead.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut chosen: Vec<Vec3> = Vec::new();
    for (_, surface) in ahead {
        let apart = APART * site.body_radius;
        if chosen.len() < site.bodies && chosen.iter().all(|c| c.distance(surface) > apart) {
            chosen.push(surface);
        }
    }
    chosen
}
