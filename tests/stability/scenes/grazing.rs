//! The contact of one step, with the pair turned through every angle: nothing may depend on how
//! pixels lie.

use crate::suite::arena::{Arena, Material};
use crate::suite::case::{Case, Scale, Scene, Setup, Stop, Verdict};
use crate::suite::surface::{Backing, Normals, Surface};
use fastrand::Rng;
use rapier3d::prelude::*;
use tldi::glamx::{Quat, Vec2, Vec3};

/// The scene.
pub(crate) const SCENE: Scene = Scene {
    name: "grazing",
    about: "A box and a ball of 0.2 m lie 0.3 r̄ deep in a sheet; both are turned together through \
            0 to 90° about each axis, with the same samples; r̄ = 2 cm.",
    rule: "Contacts at every angle; deepest gap within 0.15 r̄ of the truth for the box and 0.3 r̄ \
           for the ball, normals within 1° and 5°; between neighbouring angles the gap changes by \
           no more than those bounds. (A splat's plane is off by at most half a pixel × tan 45° × \
           the 30 % of its slope that is damped, 0.15 r̄; on a ball of radius R a disc of radius r̄ \
           is off by r̄²/2R = 0.1 r̄ more.)",
    cases,
};

const SPACING: f32 = 0.02;
const HALF: f32 = 0.1;
const DEPTH: f32 = 0.3 * SPACING;

fn cases(scale: &Scale) -> Vec<Case> {
    let step_deg = scale.pick(5, 1);
    let mut cases = Vec::new();
    for &seed in &scale.seeds {
        for is_ball in [false, true] {
            for (normals, kind) in [(Normals::Given, "oriented"), (Normals::Absent, "bare")] {
                for (axis, letter) in [(Vec3::X, "x"), (Vec3::Y, "y"), (Vec3::Z, "z")] {
                    let body = if is_ball { "ball" } else { "box" };
                    let name = format!("{body}, {kind}, about {letter}");
                    cases.push(Case::new(SCENE.name, name, seed, move |setup, verdict| {
                        turn(setup, verdict, is_ball, normals, axis, step_deg, seed)
                    }));
                }
            }
        }
    }
    cases
}

fn turn(
    setup: &Setup,
    verdict: &mut Verdict,
    is_ball: bool,
    normals: Normals,
    axis: Vec3,
    step_deg: usize,
    seed: u64,
) -> Result<(), Stop> {
    let mut rng = Rng::with_seed(seed);
    let sheet = Surface::flat(Vec2::splat(0.6), SPACING, Backing::Solid, &mut rng);
    let sheet = sheet.with_normals(normals);
    let body = if is_ball {
        Surface::ball(HALF, SPACING)
    } else {
        Surface::cuboid(Vec3::splat(HALF), SPACING, &mut rng)
    };
    let (gap_bound, normal_bound) = if is_ball { (0.3, 5.0) } else { (0.15, 1.0) };
    let mut last: Option<f32> = None;
    let (mut worst_gap, mut worst_normal, mut worst_jump) = (0.0_f32, 0.0_f32, 0.0_f32);
    for degrees in (0..=90).step_by(step_deg) {
        let rotation = Quat::from_axis_angle(axis, (degrees as f32).to_radians());
        let mut arena = Arena::new(setup)?;
        let up = rotation * Vec3::Y;
        // The contacts of the first step are those of the poses before it.
        arena.world.gravity = -up;
        arena.insert(
            RigidBodyBuilder::fixed().pose(Pose::from_rotation(rotation)),
            &sheet,
            Material::default(),
        )?;
        let pose = Pose::from_parts(up * (HALF - DEPTH), rotation);
        let builder = RigidBodyBuilder::dynamic().pose(pose);
        let placed = arena.insert(builder, &body, Material::default())?;
        arena.step()?;
        let contacts = arena.contacts(&placed);
        let deepest = contacts.iter().min_by(|a, b| a.1.total_cmp(&b.1));
        let Some((_, gap)) = deepest else {
            verdict.failures.push(format!("no contact at {degrees}°"));
            return Ok(());
        };
        worst_gap = worst_gap.max((gap + DEPTH).abs() / SPACING);
        for (normal, _) in &contacts {
            worst_normal = worst_normal.max(normal.angle_between(up).to_degrees());
        }
        if let Some(last) = last {
            worst_jump = worst_jump.max((gap - last).abs() / SPACING);
        }
        last = Some(*gap);
    }
    verdict.at_most("worst_gap_error_mean_radii", worst_gap, gap_bound);
    verdict.at_most("worst_jump_mean_radii", worst_jump, gap_bound);
    verdict.at_most("worst_normal_error_deg", worst_normal, normal_bound);
    Ok(())
}
