//! Bodies that start inside a floor or inside each other.

use crate::suite::arena::{Arena, DT, Material};
use crate::suite::case::{Cases, Scale, Scene, Setup, Stop, Verdict};
use crate::suite::surface::{Solid, Surface};
use rapier3d::prelude::*;
use tldi::glamx::Vec3;

/// The scene.
pub(crate) const SCENE: Scene = Scene {
    name: "deep-start",
    about: "Boxes and balls of 0.2 m start 10 to 80 % inside a floor (a box of 1 × 0.6 × 1 m), \
            or inside each other without gravity; r̄ = 2 cm.",
    rule: "They leave by the nearer side within 3 s: on the floor to within r̄ of their height \
           at rest, apart from each other to within r̄. They part along the line on which they \
           overlapped more than sideways. They are never faster than 2 m/s.",
    cases,
};

const SPACING: f32 = 0.02;
const HALF: f32 = 0.1;
const FLOOR_HALF: Vec3 = Vec3::new(0.5, 0.3, 0.5);
const SECONDS: f32 = 3.0;

fn cases(_: &Scale, cases: &mut Cases) {
    for solid in Solid::ALL {
        for percent in [10, 30, 50, 80] {
            let body = solid.name();
            let share = percent as f32 / 100.0;
            let name = format!("{body} in the floor, {percent} %");
            cases.add(name, move |setup, verdict| {
                in_floor(setup, verdict, solid, share)
            });
            let name = format!("two {body}es, {percent} %").replace("balles", "balls");
            cases.add(name, move |setup, verdict| {
                in_each_other(setup, verdict, solid, share)
            });
        }
    }
}

fn in_floor(setup: &Setup, verdict: &mut Verdict, solid: Solid, share: f32) -> Result<(), Stop> {
    let mut rng = setup.rng();
    let mut arena = Arena::new(setup)?;
    let floor = Surface::cuboid(FLOOR_HALF, SPACING, &mut rng);
    let below = RigidBodyBuilder::fixed().translation(Vec3::NEG_Y * FLOOR_HALF.y);
    arena.insert(below, &floor, Material::default())?;
    let depth = 2.0 * HALF * share;
    let builder = RigidBodyBuilder::dynamic().translation(Vec3::Y * (HALF - depth));
    let placed = arena.insert(
        builder,
        &solid.surface(HALF, SPACING, &mut rng),
        Material::default(),
    )?;
    let mut fastest = 0.0_f32;
    for _ in 0..(SECONDS / DT) as usize {
        arena.step()?;
        fastest = fastest.max(arena.speed(&placed));
    }
    let at = arena.position(&placed);
    verdict.near("height_error_mean_radii", (at.y - HALF) / SPACING, 0.0, 1.0);
    verdict.at_most("fastest_m_s", fastest, 2.0);
    verdict.note("shift_mean_radii", at.with_y(0.0).length() / SPACING);
    Ok(())
}

fn in_each_other(
    setup: &Setup,
    verdict: &mut Verdict,
    solid: Solid,
    share: f32,
) -> Result<(), Stop> {
    let mut rng = setup.rng();
    let mut arena = Arena::new(setup)?;
    arena.world.gravity = Vec3::ZERO;
    let offset = HALF * (1.0 - share);
    let mut placed = Vec::new();
    for side in [-1.0, 1.0] {
        let builder = RigidBodyBuilder::dynamic().translation(Vec3::X * (side * offset));
        placed.push(arena.insert(
            builder,
            &solid.surface(HALF, SPACING, &mut rng),
            Material::default(),
        )?);
    }
    let mut fastest = 0.0_f32;
    let mut at_parting: Option<Vec3> = None;
    for _ in 0..(SECONDS / DT) as usize {
        arena.step()?;
        let apart = (arena.position(&placed[1]) - arena.position(&placed[0])).abs();
        let distance = match solid {
            Solid::Ball => apart.length(),
            Solid::Box => apart.max_element(),
        };
        if distance >= 2.0 * HALF - SPACING {
            at_parting.get_or_insert(apart);
        }
        fastest = placed
            .iter()
            .map(|p| arena.speed(p))
            .fold(fastest, f32::max);
    }
    match at_parting {
        Some(apart) => {
            verdict.note("parting_along_x_m", apart.x);
            verdict.note("parting_sideways_m", apart.with_x(0.0).length());
            verdict.require("parted", apart.x > apart.with_x(0.0).length(), || {
                format!("they part sideways: {apart:.3}")
            });
        }
        None => {
            let apart = arena
                .position(&placed[1])
                .distance(arena.position(&placed[0]));
            verdict.note("distance_m", apart);
            verdict.require("parted", false, || {
                format!("still in each other, {apart:.3} m apart")
            });
        }
    }
    verdict.at_most("fastest_m_s", fastest, 2.0);
    Ok(())
}
