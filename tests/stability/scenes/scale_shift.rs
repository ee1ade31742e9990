//! The same fall moved by half a pixel, moved by a kilometre, and scaled.

use crate::suite::arena::{Arena, DT, GRAVITY, Material};
use crate::suite::case::{Cases, Scale, Scene, Setup, Stop, Verdict};
use crate::suite::surface::{Backing, Surface};
use rapier3d::prelude::*;
use tldi::glamx::{Vec2, Vec3};

/// The scene.
pub(crate) const SCENE: Scene = Scene {
    name: "scale-shift",
    about: "A box of 0.2 m falls 2 cm onto a plane (r̄ = 2 cm): as it is; half a pixel aside; 1 \
            km away (by poses, or in the clouds' own coordinates); scaled to 1 mm, 1 cm, 10 m \
            and 100 m (gravity, samples and `length_unit` alike).",
    rule: "Asleep within 2 s, within 0.1 r̄ of its height and place, and within 0.1° of upright, \
           in units of the scene. For 1 km, four steps of `f32` at 1 km are added: 0.012 r̄.",
    cases,
};

const SPACING: f32 = 0.02;
const HALF: f32 = 0.1;
const FALL: f32 = 0.02;
const SECONDS: f32 = 3.0;

#[derive(Clone, Copy, Debug)]
struct Change {
    scale: f32,
    /// Shift of the body only, in mean radii.
    aside: f32,
    /// Shift of the poses, metres.
    poses: Vec3,
    /// Shift of the points in their own frame, taken back by the pose, metres.
    points: Vec3,
}

const BASE: Change = Change {
    scale: 1.0,
    aside: 0.0,
    poses: Vec3::ZERO,
    points: Vec3::ZERO,
};

fn cases(_: &Scale, cases: &mut Cases) {
    let kilometre = Vec3::new(600.0, 0.0, 800.0);
    let scaled = |scale| Change { scale, ..BASE };
    let changes = [
        ("base", BASE),
        ("half a pixel aside", Change { aside: 0.5, ..BASE }),
        (
            "1 km away",
            Change {
                poses: kilometre,
                ..BASE
            },
        ),
        (
            "1 km up",
            Change {
                poses: Vec3::Y * 1000.0,
                ..BASE
            },
        ),
        (
            "points 1 km from their origin",
            Change {
                points: kilometre,
                ..BASE
            },
        ),
        ("box of 1 mm", scaled(0.005)),
        ("box of 1 cm", scaled(0.05)),
        ("box of 10 m", scaled(50.0)),
        ("box of 100 m", scaled(500.0)),
    ];
    for (name, change) in changes {
        cases.add(name, move |setup, verdict| fall(setup, verdict, change));
    }
}

fn fall(setup: &Setup, verdict: &mut Verdict, change: Change) -> Result<(), Stop> {
    let mut rng = setup.rng();
    let s = change.scale;
    let mut arena = Arena::new(setup)?;
    arena.world.gravity = Vec3::NEG_Y * (GRAVITY * s);
    arena.set_length_unit(s);
    let there = Pose::from_translation(change.points);
    let floor = Surface::flat(Vec2::splat(1.0 * s), SPACING * s, Backing::Solid, &mut rng);
    let origin = change.poses - change.points;
    let fixed = RigidBodyBuilder::fixed().translation(origin);
    arena.insert(fixed, &floor.moved(&there), Material::default())?;
    let place = change.poses + Vec3::X * (change.aside * SPACING * s);
    let body = Surface::cuboid(Vec3::splat(HALF * s), SPACING * s, &mut rng);
    let lift = body.lift_on(&floor, setup.method);
    let start = place + Vec3::Y * ((HALF + FALL) * s + lift);
    let builder = RigidBodyBuilder::dynamic().translation(start);
    let body = arena.insert(builder, &body, Material::default())?;
    let mut asleep_after = None;
    for step in 1..=(SECONDS / DT) as usize {
        arena.step()?;
        if asleep_after.is_none() && arena.body(&body).is_sleeping() {
            asleep_after = Some(step as f32 * DT);
        }
    }
    let rounding = if change.poses.length().max(change.points.length()) > 0.0 {
        0.012
    } else {
        0.0
    };
    let error = (arena.position(&body) - place - Vec3::Y * (HALF * s)) / (SPACING * s);
    verdict.near("height_error_mean_radii", error.y, 0.0, 0.1 + rounding);
    verdict.at_most(
        "shift_mean_radii",
        error.with_y(0.0).length(),
        0.1 + rounding,
    );
    let up = *arena.body(&body).rotation() * Vec3::Y;
    verdict.at_most("tilt_deg", up.angle_between(Vec3::Y).to_degrees(), 0.1);
    verdict.asleep_within(2.0, asleep_after);
    Ok(())
}
