//! Bodies at rest on a plane whose samples stay, or are new in every frame.

use crate::suite::arena::{Arena, DT, Material, Placed, SamePoints};
use crate::suite::case::{Cases, Scale, Scene, Setup, Stop, Verdict};
use crate::suite::model;
use crate::suite::surface::{Backing, Normals, Surface};
use fastrand::Rng;
use rapier3d::prelude::*;
use tldi::glamx::{Vec2, Vec3};

/// The scene.
pub(crate) const SCENE: Scene = Scene {
    name: "rest",
    about: "A box, a ball and a bunny of 0.3 m lie on a plane. Points are 2 cm apart (r̄ = 2 cm; \
            the bunny's 0.5 cm). Samples stay, or are drawn anew in every frame (σ = 0.25 r̄ \
            along the normal).",
    rule: "Samples that stay: asleep within 2 s; over the next 10 s, drift ≤ 0.1 r̄ and turn ≤ \
           0.1°; the box within 0.1° of upright. New samples: RMS speed ≤ 1 cm/s over the last 5 \
           of 12 s.",
    cases,
};

/// Distance of points, and their radius, metres.
const SPACING: f32 = 0.02;
/// The same of the bunny.
const BUNNY_SPACING: f32 = 0.005;
/// Half the size of box and ball, metres.
const HALF: f32 = 0.15;
/// How high above the surface bodies start, metres.
const LIFT: f32 = 0.005;
/// Seconds to fall asleep, and seconds that follow.
const SETTLE_SECONDS: f32 = 2.0;
const REST_SECONDS: f32 = 10.0;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Body {
    Box,
    Ball,
    Bunny,
}

impl Body {
    const ALL: [Self; 3] = [Self::Box, Self::Ball, Self::Bunny];

    fn name(self) -> &'static str {
        match self {
            Self::Box => "box",
            Self::Ball => "ball",
            Self::Bunny => "bunny",
        }
    }

    fn surface(self, rng: &mut Rng) -> Surface {
        match self {
            Self::Box => Surface::cuboid(Vec3::splat(HALF), SPACING, rng),
            Self::Ball => Surface::ball(HALF, SPACING),
            Self::Bunny => model::bunny(2.0 * HALF, BUNNY_SPACING),
        }
    }

    /// Edge of the plane below, metres; a ball may roll about.
    fn floor_size(self) -> f32 {
        match self {
            Self::Box | Self::Bunny => 0.5,
            Self::Ball => 0.9,
        }
    }

    /// The pose in which it lies on y = 0.
    fn resting_pose(self, surface: &Surface) -> Pose {
        match self {
            Self::Box | Self::Ball => Pose::from_translation(Vec3::Y * HALF),
            Self::Bunny => model::lowest_resting_pose(surface),
        }
    }
}

fn cases(_: &Scale, cases: &mut Cases) {
    for body in Body::ALL {
        for (normals, name) in Normals::GIVEN_OR_NOT {
            let name = format!("{}, {name} plane", body.name());
            cases.add(name, move |setup, verdict| {
                fixed_samples(setup, verdict, body, normals)
            });
        }
        let name = format!("{}, new samples each frame", body.name());
        cases.add(name, move |setup, verdict| {
            new_samples(setup, verdict, body)
        });
    }
}

fn plane(body: Body, noise: f32, normals: Normals, rng: &mut Rng) -> Surface {
    let size = Vec2::splat(body.floor_size());
    let plane = if noise > 0.0 {
        Surface::noisy(size, SPACING, noise * SPACING, Backing::Solid, rng)
    } else {
        Surface::flat(size, SPACING, Backing::Solid, rng)
    };
    plane.with_normals(normals)
}

/// A world with a body just above a plane, and the pose in which the body lies on it.
fn start(
    setup: &Setup,
    body: Body,
    plane: &Surface,
    rng: &mut Rng,
) -> Result<(Arena, [Placed; 2], Pose), Stop> {
    let mut arena = Arena::new(setup)?;
    let floor = arena.insert(RigidBodyBuilder::fixed(), plane, Material::default())?;
    let surface = body.surface(rng);
    let resting = body.resting_pose(&surface);
    let lift = LIFT + surface.lift_on(plane, setup.method);
    let lifted = resting.append_translation(lift * Vec3::Y);
    let builder = RigidBodyBuilder::dynamic().pose(lifted);
    let placed = arena.insert(builder, &surface, Material::default())?;
    Ok((arena, [floor, placed], resting))
}

fn fixed_samples(
    setup: &Setup,
    verdict: &mut Verdict,
    body: Body,
    normals: Normals,
) -> Result<(), Stop> {
    let mut rng = setup.rng();
    let plane = plane(body, 0.0, normals, &mut rng);
    let (mut arena, [_, placed], truth) = start(setup, body, &plane, &mut rng)?;
    let mut asleep_after = None;
    let mut settled = Pose::IDENTITY;
    let mut last_awake = 0.0;
    for step in 1..=((SETTLE_SECONDS + REST_SECONDS) / DT) as usize {
        arena.step()?;
        let seconds = step as f32 * DT;
        if arena.body(&placed).is_sleeping() {
            asleep_after.get_or_insert(seconds);
        } else {
            last_awake = seconds;
        }
        if step == (SETTLE_SECONDS / DT) as usize {
            settled = *arena.body(&placed).position();
        }
    }
    let end = *arena.body(&placed).position();
    verdict.asleep_within(SETTLE_SECONDS.into(), asleep_after);
    verdict.note("last_awake_s", last_awake);
    let drift = end.translation.distance(settled.translation) / SPACING;
    verdict.at_most("drift_mean_radii", drift, 0.1);
    let turn = end.rotation.angle_between(settled.rotation).to_degrees();
    verdict.at_most("turn_deg", turn, 0.1);
    verdict.note(
        "height_error_mean_radii",
        (end.translation.y - truth.translation.y) / SPACING,
    );
    verdict.note(
        "landing_shift_mean_radii",
        (end.translation - truth.translation).with_y(0.0).length() / SPACING,
    );
    let tilt = (end.rotation * Vec3::Y)
        .angle_between(truth.rotation * Vec3::Y)
        .to_degrees();
    if body == Body::Box {
        verdict.at_most("tilt_deg", tilt, 0.1);
    } else {
        verdict.note("tilt_deg", tilt);
    }
    Ok(())
}

fn new_samples(setup: &Setup, verdict: &mut Verdict, body: Body) -> Result<(), Stop> {
    if body == Body::Bunny && !model::has_bunny() {
        return Err(Stop::Unfit(
            "the bunny is not at hand; the pebble in its place rocks by up to 2.5 cm/s",
        ));
    }
    let mut rng = setup.rng();
    let mut sample = {
        let mut rng = Rng::with_seed(setup.seed ^ 0x5eed);
        move || plane(body, 0.25, Normals::Absent, &mut rng)
    };
    let (mut arena, [floor, placed], truth) = start(setup, body, &sample(), &mut rng)?;
    let steps = ((SETTLE_SECONDS + REST_SECONDS) / DT) as usize;
    let watched = (5.0 / DT) as usize;
    let mut speeds = Vec::with_capacity(steps);
    for step in 1..=steps {
        arena.reshape(&floor, &sample(), SamePoints::No)?;
        arena.step()?;
        speeds.push(f64::from(arena.speed(&placed)));
        let at = arena.position(&placed);
        if at.x.abs().max(at.z.abs()) > 0.5 * body.floor_size() {
            let seconds = verdict.note("left_after_s", step as f32 * DT);
            verdict.require("left_after_s", false, || {
                format!("left the plane after {seconds:.1} s")
            });
            break;
        }
    }
    let speeds = &speeds[speeds.len().saturating_sub(watched)..];
    let mean_square = speeds.iter().map(|v| v * v).sum::<f64>() / speeds.len() as f64;
    verdict.at_most("rms_speed_m_s", mean_square.sqrt(), 0.01);
    let fastest = speeds.iter().fold(0.0, |a: f64, b| a.max(*b));
    verdict.note("max_speed_m_s", fastest);
    let end = arena.position(&placed);
    verdict.note(
        "height_error_mean_radii",
        (end.y - truth.translation.y) / SPACING,
    );
    verdict.note(
        "drift_mean_radii",
        (end - truth.translation).with_y(0.0).length() / SPACING,
    );
    Ok(())
}
