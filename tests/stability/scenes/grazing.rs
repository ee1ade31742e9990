//! The contact of one step, with the samples turned through every angle: nothing may depend on how
//! pixels lie.

use crate::suite::arena::{Arena, Material};
use crate::suite::case::{Cases, Scale, Scene, Setup, Stop, Verdict};
use crate::suite::surface::{Backing, Normals, Surface};
use fastrand::Rng;
use rapier3d::prelude::*;
use std::f32::consts::{FRAC_PI_4, SQRT_2};
use tldi::glamx::{Quat, Vec2, Vec3};

/// The scene.
pub(crate) const SCENE: Scene = Scene {
    name: "grazing",
    about: "A box and a ball of 0.2 m lie 0.3 r̄ deep in a sheet, and a ball in a groove of two \
            sheets at 90°. The samples of both sides turn together, in their own frames, through \
            0 to 90° about each axis; r̄ = 2 cm.",
    rule: "At every angle, each sheet has contacts. The deepest gap is within 0.15 r̄ of the \
           truth for the box and 0.3 r̄ for the ball. Normals of contacts that push are within \
           1° and 5°. Between neighbouring angles the gap changes by no more than those bounds. \
           (A splat's plane is off by at most half a pixel × tan 45° × the 30 % of its slope \
           that is damped: 0.15 r̄. On a ball of radius R, a disc of radius r̄ is off by r̄²/2R \
           = 0.1 r̄ more.)",
    cases,
};

const SPACING: f32 = 0.02;
const HALF: f32 = 0.1;
const DEPTH: f32 = 0.3 * SPACING;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Pair {
    BoxOnSheet,
    BallOnSheet,
    BallInGroove,
}

impl Pair {
    const ALL: [Self; 3] = [Self::BoxOnSheet, Self::BallOnSheet, Self::BallInGroove];

    fn name(self) -> &'static str {
        match self {
            Self::BoxOnSheet => "box",
            Self::BallOnSheet => "ball",
            Self::BallInGroove => "ball in a groove",
        }
    }

    /// Body, sheets, where the body's middle is, and the true normals of the contacts.
    fn parts(self, rng: &mut Rng) -> (Surface, Surface, Vec3, Vec<Vec3>) {
        let sheet = Surface::flat(Vec2::splat(0.6), SPACING, Backing::Film, rng);
        let above = Vec3::Y * (HALF - DEPTH);
        match self {
            Self::BoxOnSheet => {
                let body = Surface::cuboid(Vec3::splat(HALF), SPACING, rng);
                (body, sheet, above, vec![Vec3::Y])
            }
            Self::BallOnSheet => (Surface::ball(HALF, SPACING), sheet, above, vec![Vec3::Y]),
            Self::BallInGroove => {
                let slope = |angle: f32| {
                    let tilt = Quat::from_rotation_z(angle);
                    let middle = tilt * Vec3::X * (0.3 * angle.signum());
                    (Pose::from_parts(middle, tilt), tilt * Vec3::Y)
                };
                let (left, left_normal) = slope(-FRAC_PI_4);
                let (right, right_normal) = slope(FRAC_PI_4);
                let groove = sheet.moved(&left).joined(&sheet.moved(&right));
                let normals = vec![left_normal, right_normal];
                (
                    Surface::ball(HALF, SPACING),
                    groove,
                    SQRT_2 * above,
                    normals,
                )
            }
        }
    }

    /// Largest errors of the gap in mean radii, and of normals in degrees.
    fn bounds(self) -> (f64, f64) {
        match self {
            Self::BoxOnSheet => (0.15, 1.0),
            Self::BallOnSheet | Self::BallInGroove => (0.3, 5.0),
        }
    }
}

fn cases(scale: &Scale, cases: &mut Cases) {
    let step_deg = scale.pick(5, 1);
    for pair in Pair::ALL {
        for (normals, kind) in Normals::GIVEN_OR_NOT {
            for (axis, letter) in [(Vec3::X, "x"), (Vec3::Y, "y"), (Vec3::Z, "z")] {
                let name = format!("{}, {kind}, about {letter}", pair.name());
                cases.add(name, move |setup, verdict| {
                    turn(setup, verdict, pair, normals, axis, step_deg)
                });
            }
        }
    }
}

/// Contacts of the first step, which are those of the poses before it: normals and gaps.
fn contacts(
    setup: &Setup,
    sheet: &Surface,
    body: &Surface,
    middle: Vec3,
    rotation: Quat,
) -> Result<Vec<(Vec3, f32)>, Stop> {
    let mut arena = Arena::new(setup)?;
    arena.world.gravity = rotation * Vec3::NEG_Y;
    let turned = Pose::from_rotation(rotation);
    let fixed = RigidBodyBuilder::fixed();
    arena.insert(fixed, &sheet.moved(&turned), Material::default())?;
    let builder = RigidBodyBuilder::dynamic().translation(rotation * middle);
    let placed = arena.insert(builder, &body.moved(&turned), Material::default())?;
    arena.step()?;
    Ok(arena.contacts(&placed))
}

fn turn(
    setup: &Setup,
    verdict: &mut Verdict,
    pair: Pair,
    normals: Normals,
    axis: Vec3,
    step_deg: usize,
) -> Result<(), Stop> {
    let mut rng = setup.rng();
    let (body, sheet, middle, true_normals) = pair.parts(&mut rng);
    let sheet = sheet.with_normals(normals);
    let (gap_bound, normal_bound) = pair.bounds();
    let mut last: Vec<Option<f32>> = vec![None; true_normals.len()];
    let (mut worst_gap, mut worst_jump) = (0.0_f32, 0.0_f32);
    let (mut worst_normal, mut worst_pushing_normal) = (0.0_f32, 0.0_f32);
    let mut missing = Vec::new();
    for degrees in (0..=90).step_by(step_deg) {
        let rotation = Quat::from_axis_angle(axis, (degrees as f32).to_radians());
        let contacts = contacts(setup, &sheet, &body, middle, rotation)?;
        let mut deepest = vec![f32::INFINITY; true_normals.len()];
        for (normal, gap) in contacts {
            let angle = |truth: &Vec3| normal.angle_between(rotation * *truth).to_degrees();
            let angles: Vec<f32> = true_normals.iter().map(angle).collect();
            let nearest = usize::from(angles.len() > 1 && angles[1] < angles[0]);
            worst_normal = worst_normal.max(angles[nearest]);
            if gap <= 0.0 {
                worst_pushing_normal = worst_pushing_normal.max(angles[nearest]);
            }
            deepest[nearest] = deepest[nearest].min(gap);
        }
        for (gap, last) in deepest.into_iter().zip(&mut last) {
            if gap.is_finite() {
                worst_gap = worst_gap.max((gap + DEPTH).abs() / SPACING);
                if let Some(last) = last {
                    worst_jump = worst_jump.max((gap - *last).abs() / SPACING);
                }
                *last = Some(gap);
            } else {
                missing.push(degrees);
            }
        }
    }
    verdict.note("missing_contacts", missing.len() as f64);
    verdict.require("missing_contacts", missing.is_empty(), || {
        format!("a sheet has no contact at {missing:?} degrees")
    });
    verdict.at_most("worst_gap_error_mean_radii", worst_gap, gap_bound);
    verdict.at_most("worst_jump_mean_radii", worst_jump, gap_bound);
    verdict.at_most(
        "worst_pushing_normal_error_deg",
        worst_pushing_normal,
        normal_bound,
    );
    verdict.note("worst_normal_error_deg", worst_normal);
    Ok(())
}
