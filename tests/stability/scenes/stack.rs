//! A tower of boxes.

use crate::suite::arena::{Arena, DT, Material, Placed};
use crate::suite::case::{Cases, Scale, Scene, Setup, Stop, Verdict};
use crate::suite::surface::{Backing, Normals, Surface};
use rapier3d::prelude::*;
use tldi::glamx::{Vec2, Vec3};

/// The scene.
pub(crate) const SCENE: Scene = Scene {
    name: "stack",
    about: "10 boxes of 0.2 m stand on each other on a plane. Each is a cloud of its own (r̄ = 2 \
            cm). Rapier makes 4 solver iterations, or 12.",
    rule: "It stands for 10 s. The top box drifts ≤ r̄ sideways, and its height is within 10 r̄ \
           (1 r̄ for each box).",
    cases,
};

const SPACING: f32 = 0.02;
const HALF: f32 = 0.1;
const BOXES: usize = 10;
const SECONDS: f32 = 10.0;

/// Solver iterations of a step, instead of rapier's 4.
const MANY: usize = 12;

fn cases(_: &Scale, cases: &mut Cases) {
    let default = IntegrationParameters::default().num_solver_iterations;
    for (iterations, said) in [(default, ""), (MANY, " 12 solver iterations,")] {
        for (normals, kind) in Normals::GIVEN_OR_NOT {
            let name = format!("10 boxes,{said} {kind}");
            cases.add(name, move |setup, verdict| {
                stack(setup, verdict, iterations, normals)
            });
        }
    }
}

fn stack(
    setup: &Setup,
    verdict: &mut Verdict,
    iterations: usize,
    normals: Normals,
) -> Result<(), Stop> {
    let mut rng = setup.rng();
    let mut arena = Arena::new(setup)?;
    arena.set_solver_iterations(iterations);
    let floor = Surface::flat(Vec2::splat(1.0), SPACING, Backing::Solid, &mut rng);
    let floor = floor.with_normals(normals);
    arena.insert(RigidBodyBuilder::fixed(), &floor, Material::default())?;
    let mut boxes: Vec<Placed> = Vec::new();
    let mut top_of_stack = 0.0;
    for k in 0..BOXES {
        let surface = Surface::cuboid(Vec3::splat(HALF), SPACING, &mut rng).with_normals(normals);
        let lift = match k {
            0 => surface.lift_on(&floor, setup.method),
            _ => surface.lift_on(&surface, setup.method),
        };
        top_of_stack += lift + 2.0 * HALF;
        let height = top_of_stack - HALF;
        let body = RigidBodyBuilder::dynamic().translation(Vec3::Y * height);
        boxes.push(arena.insert(body, &surface, Material::default())?);
    }
    let (Some(bottom), Some(top)) = (boxes.first(), boxes.last()) else {
        return Ok(());
    };
    let mut drift = 0.0_f32;
    for _ in 0..(SECONDS / DT) as usize {
        arena.step()?;
        drift = drift.max(arena.position(top).with_y(0.0).length());
    }
    let height = arena.position(top).y - HALF * (2 * BOXES - 1) as f32;
    verdict.at_most("top_drift_mean_radii", drift / SPACING, 1.0);
    verdict.near(
        "top_height_error_mean_radii",
        height / SPACING,
        0.0,
        BOXES as f64,
    );
    verdict.note(
        "bottom_height_error_mean_radii",
        (arena.position(bottom).y - HALF) / SPACING,
    );
    verdict.note("end_speed_m_s", arena.speed(top));
    let awake = boxes
        .iter()
        .filter(|b| !arena.body(b).is_sleeping())
        .count();
    verdict.note("awake", awake as f64);
    Ok(())
}
