//! Balls that roll, rods and tops that spin, and a doll that rocks on a plane.

use crate::suite::arena::{Arena, DT, Material};
use crate::suite::case::{Cases, Scale, Scene, Setup, Stop, Verdict};
use crate::suite::surface::{Backing, Surface};
use fastrand::Rng;
use rapier3d::prelude::*;
use tldi::glamx::{Vec2, Vec3};

/// The scene.
pub(crate) const SCENE: Scene = Scene {
    name: "roll-spin",
    about: "A ball of 0.3 m rolls 10 m. A rod of 0.6 m spins flat on the floor at 10 rad/s. A \
            round top (a ball) spins upright at 50 rad/s. A roly-poly doll (the ball, its centre \
            of mass 10 cm below the middle) rocks for 10 s and starts 5° off its rest; r̄ = 2 \
            cm.",
    rule: "Compared with the primitive, within 5 %: the ball's way in 10 m / v seconds, and the \
           angle and speed of the spins after 1 s (5 % of the initial spin where that is \
           larger). The ball's heading is within 1°. Rod and top stay within r̄ of their place. \
           The doll rocks no faster in the last two seconds than in the first two.",
    cases,
};

const SPACING: f32 = 0.02;
const RADIUS: f32 = 0.15;
const WAY: f32 = 10.0;
const SPIN_SECONDS: f32 = 1.0;
/// Half extents of the rod, metres.
const ROD: Vec3 = Vec3::new(0.3, 0.04, 0.04);
/// How far the doll's centre of mass is below the middle of its ball, metres.
const LOW: f32 = 0.1;
const ROCK_SECONDS: f32 = 10.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Spinner {
    Rod,
    Top,
}

impl Spinner {
    fn name(self) -> &'static str {
        match self {
            Self::Rod => "rod at 10 rad/s",
            Self::Top => "top at 50 rad/s",
        }
    }

    /// Surface, height of its middle in metres, spin in rad/s.
    fn parts(self, rng: &mut Rng) -> (Surface, f32, f32) {
        match self {
            Self::Rod => (Surface::cuboid(ROD, SPACING, rng), ROD.y, 10.0),
            Self::Top => (Surface::ball(RADIUS, SPACING), RADIUS, 50.0),
        }
    }
}

fn cases(_: &Scale, cases: &mut Cases) {
    for speed in [1.0, 3.0, 6.0] {
        let name = format!("ball at {speed} m/s");
        cases.add(name, move |setup, verdict| roll(setup, verdict, speed));
    }
    for spinner in [Spinner::Rod, Spinner::Top] {
        cases.add(spinner.name(), move |setup, verdict| {
            spin(setup, verdict, spinner)
        });
    }
    cases.add("doll", rock);
}

/// Displacement of a ball that starts rolling at this speed.
fn way_of_ball(setup: &Setup, speed: f32) -> Result<Vec3, Stop> {
    let mut rng = setup.rng();
    let mut arena = Arena::new(setup)?;
    let size = Vec2::new(WAY + 2.0, 1.2);
    let floor = Surface::flat(size, SPACING, Backing::Solid, &mut rng);
    let middle = Vec3::X * (0.5 * size.x - 1.0);
    arena.insert(
        RigidBodyBuilder::fixed().translation(middle),
        &floor,
        Material::default(),
    )?;
    let surface = Surface::ball(RADIUS, SPACING);
    let height = RADIUS + surface.lift_on(&floor, setup.method);
    let body = RigidBodyBuilder::dynamic()
        .translation(Vec3::Y * height)
        .linvel(Vec3::X * speed)
        .angvel(Vec3::NEG_Z * (speed / RADIUS));
    let ball = arena.insert(body, &surface, Material::default())?;
    arena.steps((WAY / speed / DT) as usize)?;
    Ok(arena.position(&ball).with_y(0.0))
}

fn roll(setup: &Setup, verdict: &mut Verdict, speed: f32) -> Result<(), Stop> {
    let truth = f64::from(way_of_ball(&setup.of_primitive(), speed)?.length());
    let way = way_of_ball(setup, speed)?;
    verdict.near("way_m", way.length(), truth, 0.05 * truth);
    verdict.at_most("heading_deg", way.z.atan2(way.x).to_degrees().abs(), 1.0);
    Ok(())
}

/// Angle turned about the vertical, spin left, and shift sideways.
fn spun(setup: &Setup, spinner: Spinner) -> Result<[f32; 3], Stop> {
    let mut rng = setup.rng();
    let mut arena = Arena::new(setup)?;
    let floor = Surface::flat(Vec2::splat(1.0), SPACING, Backing::Solid, &mut rng);
    arena.insert(RigidBodyBuilder::fixed(), &floor, Material::default())?;
    let (surface, height, rate) = spinner.parts(&mut rng);
    let height = height + surface.lift_on(&floor, setup.method);
    let body = RigidBodyBuilder::dynamic()
        .translation(Vec3::Y * height)
        .angvel(Vec3::Y * rate);
    let body = arena.insert(body, &surface, Material::default())?;
    let mut angle = 0.0;
    for _ in 0..(SPIN_SECONDS / DT) as usize {
        arena.step()?;
        angle += arena.body(&body).angvel().y * DT;
    }
    let shift = arena.position(&body).with_y(0.0).length();
    Ok([angle, arena.body(&body).angvel().y, shift])
}

fn spin(setup: &Setup, verdict: &mut Verdict, spinner: Spinner) -> Result<(), Stop> {
    let [angle, rate, _] = spun(&setup.of_primitive(), spinner)?.map(f64::from);
    let ours = spun(setup, spinner)?;
    let initial = f64::from(spinner.parts(&mut setup.rng()).2);
    verdict.near("angle_rad", ours[0], angle, 0.05 * angle.abs());
    verdict.near(
        "spin_left_rad_s",
        ours[1],
        rate,
        0.05 * rate.abs().max(initial),
    );
    verdict.at_most("shift_mean_radii", ours[2] / SPACING, 1.0);
    Ok(())
}

/// Nothing drives the doll: it rocks no faster at last than at first.
fn rock(setup: &Setup, verdict: &mut Verdict) -> Result<(), Stop> {
    let mut rng = setup.rng();
    let mut arena = Arena::new(setup)?;
    let floor = Surface::flat(Vec2::splat(1.0), SPACING, Backing::Solid, &mut rng);
    arena.insert(RigidBodyBuilder::fixed(), &floor, Material::default())?;
    let mut surface = Surface::ball(RADIUS, SPACING);
    // As much mass as a ball of water, half as far from its middle as that of a ball is.
    let mass = 14.0;
    let inertia = 0.1 * mass * RADIUS * RADIUS;
    surface.mass = Some(MassProperties::new(
        LOW * Vec3::NEG_Y,
        mass,
        Vec3::splat(inertia),
    ));
    let height = RADIUS + surface.lift_on(&floor, setup.method);
    let body = RigidBodyBuilder::dynamic()
        .translation(Vec3::Y * height)
        .rotation(Vec3::Z * 5.0_f32.to_radians());
    let doll = arena.insert(body, &surface, Material::default())?;
    let steps = (ROCK_SECONDS / DT) as usize;
    let ends = (2.0 / DT) as usize;
    let (mut first, mut last) = (0.0_f32, 0.0_f32);
    for step in 0..steps {
        arena.step()?;
        let rate = arena.body(&doll).angvel().length();
        if step < ends {
            first = first.max(rate);
        }
        if step + ends >= steps {
            last = last.max(rate);
        }
    }
    let first = verdict.note("rate_at_first_rad_s", first);
    verdict.at_most("rate_at_last_rad_s", last, first);
    Ok(())
}
