//! A generated creature that gallops: a body on four legs, y up, heading along x.

use super::runner::Runner;
use crate::surface_sampling::sample_surface;
use std::f32::consts::TAU;
use tldi::Aabb;
use tldi::glamx::{Pose3, Quat, Vec3};
use tldi_sources::{MovingError, MovingPoints};

/// Frames of a cycle.
const FRAMES: usize = 24;
/// Distance of points, metres.
const SPACING: f32 = 0.02;

/// A capsule, and what it hangs on.
struct Limb {
    /// Ends in the frame of the limb, metres.
    ends: [Vec3; 2],
    radius: f32,
    /// The limb that carries it, and where, in that one's frame.
    parent: Option<usize>,
    joint: Vec3,
    /// Turn about z at rest, amplitude (radians) and phase (cycles).
    turn: f32,
    swing: f32,
    phase: f32,
}

/// A galloping creature 1.6 m long, with the outward normals of every frame.
///
/// # Errors
/// None.
pub fn creature(seed: u64) -> Result<Runner, MovingError> {
    let limbs = limbs();
    let mut points: Vec<(usize, Vec3, Vec3)> = Vec::new();
    for (k, limb) in limbs.iter().enumerate() {
        let [a, b] = limb.ends;
        let reach = Vec3::splat(limb.radius + SPACING);
        let bounds = Aabb {
            min: a.min(b) - reach,
            max: a.max(b) + reach,
        };
        let skin = sample_surface(|p| capsule(p, limb), bounds, SPACING, seed ^ k as u64);
        points.extend((skin.points.iter().zip(&skin.normals)).map(|(p, n)| (k, *p, *n)));
    }
    // What lies within another limb in every frame is not skin.
    let poses: Vec<Vec<Pose3>> = (0..FRAMES).map(|frame| limb_poses(&limbs, frame)).collect();
    points.retain(|(own, p, _)| {
        poses.iter().any(|poses| {
            let at = poses[*own] * *p;
            !(limbs.iter().enumerate()).any(|(k, limb)| {
                k != *own && capsule(poses[k].inverse_transform_point(at), limb) < -0.5 * SPACING
            })
        })
    });
    let frames = poses.iter().map(|poses| {
        points
            .iter()
            .map(|(limb, p, _)| poses[*limb] * *p)
            .collect()
    });
    let normals = poses.iter().map(|poses| {
        points
            .iter()
            .map(|(limb, _, n)| poses[*limb].rotation * *n)
            .collect()
    });
    Ok(Runner::with_normals(
        MovingPoints::new(frames.collect())?,
        MovingPoints::new(normals.collect())?,
    ))
}

/// Signed distance to a limb, in its frame.
fn capsule(p: Vec3, limb: &Limb) -> f32 {
    let [a, b] = limb.ends;
    let t = ((p - a).dot(b - a) / (b - a).length_squared()).clamp(0.0, 1.0);
    p.distance(a + t * (b - a)) - limb.radius
}

fn limb_poses(limbs: &[Limb], frame: usize) -> Vec<Pose3> {
    let cycle = frame as f32 / FRAMES as f32;
    let mut poses: Vec<Pose3> = Vec::new();
    for limb in limbs {
        let swing = limb.swing * (TAU * (cycle + limb.phase)).sin();
        let parent = match limb.parent {
            Some(parent) => poses[parent],
            // The trunk rises and falls.
            None => Pose3::from_translation(Vec3::Y * (0.86 + 0.04 * (TAU * cycle).sin())),
        };
        let turn = Quat::from_rotation_z(limb.turn + swing);
        poses.push(parent * Pose3::from_parts(limb.joint, turn));
    }
    poses
}

/// A limb that does not swing, from its joint to `end`.
fn limb(parent: Option<usize>, joint: [f32; 3], end: [f32; 3], radius: f32) -> Limb {
    Limb {
        ends: [Vec3::ZERO, Vec3::from(end)],
        radius,
        parent,
        joint: Vec3::from(joint),
        turn: 0.0,
        swing: 0.0,
        phase: 0.0,
    }
}

impl Limb {
    fn swinging(self, swing: f32, phase: f32) -> Self {
        Self {
            swing,
            phase,
            ..self
        }
    }
}

fn limbs() -> Vec<Limb> {
    let mut limbs = vec![
        // What carries the others, and the trunk.
        limb(None, [0.0; 3], [0.0001, 0.0, 0.0], 0.01).swinging(0.07, 0.25),
        limb(Some(0), [-0.38, 0.0, 0.0], [0.76, 0.03, 0.0], 0.17),
        // Neck, head and tail.
        limb(Some(0), [0.42, 0.08, 0.0], [0.27, 0.34, 0.0], 0.085).swinging(0.15, 0.6),
        limb(Some(2), [0.27, 0.34, 0.0], [0.2, -0.12, 0.0], 0.07).swinging(0.1, 0.2),
        limb(Some(0), [-0.5, 0.06, 0.0], [-0.3, -0.1, 0.0], 0.035).swinging(0.3, 0.1),
    ];
    let front = [(0.34, 0.11, 0.0), (0.34, -0.11, 0.1)];
    let hind = [(-0.34, 0.11, 0.45), (-0.34, -0.11, 0.55)];
    for (x, z, phase) in front.into_iter().chain(hind) {
        let upper = limbs.len();
        let back = if x < 0.0 { 1.0 } else { -1.0 };
        let thigh = limb(Some(0), [x, -0.06, z], [0.0, -0.4, 0.0], 0.07);
        let shin = limb(Some(upper), [0.0, -0.4, 0.0], [0.0, -0.36, 0.0], 0.045);
        limbs.push(thigh.swinging(0.5, phase));
        // Knees bend while the leg goes forward.
        limbs.push(Limb {
            turn: 0.35 * back,
            ..shin.swinging(0.35 * back, phase + 0.25)
        });
    }
    limbs
}
