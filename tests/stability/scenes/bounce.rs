//! Balls and boxes that rebound.

use crate::suite::arena::{Arena, DT, GRAVITY, Material};
use crate::suite::case::{Cases, Scale, Scene, Setup, Stop, Verdict};
use crate::suite::method::Method;
use crate::suite::surface::{Backing, Solid, Surface};
use rapier3d::prelude::*;
use tldi::glamx::{Vec2, Vec3};

/// The scene.
pub(crate) const SCENE: Scene = Scene {
    name: "bounce",
    about: "A ball and a box of 0.2 m fall 1 m onto a plane. Restitution goes from 0 to 1; r̄ = \
            2 cm.",
    rule: "The first rebound is within 3 cm (3 % of the fall) of e² × 1 m. Rapier's other shapes \
           may also be off by as much as the primitive is. Mechanical energy never exceeds the \
           initial one by more than 1 %.",
    cases,
};

const SPACING: f32 = 0.02;
const HALF: f32 = 0.1;
const FALL: f32 = 1.0;

fn cases(_: &Scale, cases: &mut Cases) {
    for body in [Solid::Ball, Solid::Box] {
        for restitution in [0.0, 0.25, 0.5, 0.75, 1.0] {
            let name = format!("{}, restitution {restitution}", body.name());
            cases.add(name, move |setup, verdict| {
                bounce(setup, verdict, body, restitution)
            });
        }
    }
}

/// Height of the first rebound in metres, and most energy over the initial one.
fn rebound(setup: &Setup, solid: Solid, restitution: f32) -> Result<[f64; 2], Stop> {
    let mut rng = setup.rng();
    let mut arena = Arena::new(setup)?;
    let material = Material {
        restitution,
        ..Material::default()
    };
    let floor = Surface::flat(Vec2::splat(0.8), SPACING, Backing::Solid, &mut rng);
    arena.insert(RigidBodyBuilder::fixed(), &floor, material)?;
    let surface = solid.surface(HALF, SPACING, &mut rng);
    let mass = surface.mass.map_or(0.0, |mass| mass.mass());
    let body = RigidBodyBuilder::dynamic()
        .translation(Vec3::Y * (HALF + FALL))
        .can_sleep(false);
    let body = arena.insert(body, &surface, material)?;
    let energy = |arena: &Arena| {
        let rigid = arena.body(&body);
        let height = arena.position(&body).y - HALF;
        f64::from(rigid.kinetic_energy() + mass * GRAVITY * height)
    };
    let initial = f64::from(mass * GRAVITY * FALL);
    let mut most_energy = 0.0_f64;
    let mut highest = 0.0_f32;
    let mut has_rebounded = false;
    let mut is_falling_again = false;
    for _ in 0..(3.0 / DT) as usize {
        arena.step()?;
        most_energy = most_energy.max(energy(&arena) / initial);
        let speed = arena.body(&body).linvel().y;
        let is_low = arena.position(&body).y < HALF + 0.5 * FALL;
        has_rebounded |= is_low && speed > -0.1;
        if has_rebounded && !is_falling_again {
            highest = highest.max(arena.position(&body).y - HALF);
            is_falling_again = speed < -0.1;
        }
    }
    Ok([f64::from(highest), most_energy])
}

fn bounce(
    setup: &Setup,
    verdict: &mut Verdict,
    solid: Solid,
    restitution: f32,
) -> Result<(), Stop> {
    let [primitive, _] = rebound(&setup.of_primitive(), solid, restitution)?;
    let [height, energy] = rebound(setup, solid, restitution)?;
    let truth = f64::from(restitution * restitution * FALL);
    // What rapier's solver itself loses is not the fault of its shapes.
    let lost_by_solver = match setup.method {
        Method::Tldi | Method::Primitive => 0.0,
        _ => (primitive - truth).abs(),
    };
    let tolerance = f64::from(0.03 * FALL) + lost_by_solver;
    verdict.near("rebound_m", height, truth, tolerance);
    verdict.note("primitive_rebound_m", primitive);
    verdict.at_most("most_energy_over_initial", energy, 1.01);
    Ok(())
}
