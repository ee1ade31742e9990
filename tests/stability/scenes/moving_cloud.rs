//! Clouds that move against a resting body: as a kinematic body, and as a stream of new points.

use crate::suite::arena::{Arena, DT, Material, SamePoints};
use crate::suite::case::{Cases, Scale, Scene, Setup, Stop, Verdict};
use crate::suite::surface::{Backing, Normals, Solid, Surface};
use fastrand::Rng;
use rapier3d::prelude::*;
use tldi::glamx::{Quat, Vec2, Vec3};

/// The scene.
pub(crate) const SCENE: Scene = Scene {
    name: "moving-cloud",
    about: "A wall (one layer of points, r̄ = 2 cm) sweeps 1.5 m at 0.5 to 5 m/s over a box or a \
            ball of 0.2 m that rests on a plane. The wall is a kinematic body, a fixed body \
            whose points move, or a fixed body that is sampled anew in every frame. Only in the \
            last case has it no velocity that a method could know.",
    rule: "The wall never passes the body's middle, and pushes it as far as the wall goes, less \
           2 r̄. A wall that is sampled anew only has to not pass: rapier resolves penetrations \
           at 3 m/s at most.",
    cases,
};

const SPACING: f32 = 0.02;
const HALF: f32 = 0.1;
/// Way of the wall, metres, and where it starts: 0.1 m before the body.
const WAY: f32 = 1.5;
const START: f32 = -HALF - 0.1;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Motion {
    Kinematic,
    Deforming,
    Streamed,
}

impl Motion {
    const ALL: [Self; 3] = [Self::Kinematic, Self::Deforming, Self::Streamed];

    fn name(self) -> &'static str {
        match self {
            Self::Kinematic => "kinematic",
            Self::Deforming => "deforming",
            Self::Streamed => "streamed",
        }
    }
}

fn cases(_: &Scale, cases: &mut Cases) {
    for motion in Motion::ALL {
        for solid in Solid::ALL {
            for speed in [0.5, 2.0, 5.0] {
                let body = solid.name();
                let name = format!("{} wall, {body}, {speed} m/s", motion.name());
                cases.add(name, move |setup, verdict| {
                    sweep(setup, verdict, motion, solid, speed)
                });
            }
        }
    }
}

/// An upright wall in x = 0 that faces +x, its middle at the origin; rapier's is solid behind.
fn wall(rng: &mut Rng) -> Surface {
    let upright = Pose::from_rotation(Quat::from_rotation_z(-std::f32::consts::FRAC_PI_2));
    let flat = Surface::flat(Vec2::splat(0.6), SPACING, Backing::Solid, rng);
    flat.moved(&upright)
}

fn sweep(
    setup: &Setup,
    verdict: &mut Verdict,
    motion: Motion,
    solid: Solid,
    speed: f32,
) -> Result<(), Stop> {
    let mut rng = setup.rng();
    let mut arena = Arena::new(setup)?;
    let floor = Surface::flat(
        Vec2::new(2.0 * WAY + 3.0, 1.0),
        SPACING,
        Backing::Solid,
        &mut rng,
    );
    let ground = RigidBodyBuilder::fixed().translation(Vec3::X * WAY);
    arena.insert(ground, &floor, Material::default())?;
    let surface = solid.surface(HALF, SPACING, &mut rng);
    let body = RigidBodyBuilder::dynamic()
        .translation(Vec3::Y * (HALF + surface.lift_on(&floor, setup.method)))
        .ccd_enabled(true);
    let body = arena.insert(body, &surface, Material::default())?;
    // The wall's lower rim stays clear of the floor.
    let place = |x: f32| Pose::from_translation(Vec3::new(x, 0.36, 0.0));
    let mut sample = {
        let mut rng = rng.fork();
        move || {
            wall(&mut rng).with_normals(match motion {
                Motion::Kinematic | Motion::Deforming => Normals::Given,
                Motion::Streamed => Normals::Absent,
            })
        }
    };
    let mut still = sample();
    let (builder, surface) = match motion {
        Motion::Kinematic => {
            let builder = RigidBodyBuilder::kinematic_velocity_based().pose(place(START));
            (builder, still.clone())
        }
        Motion::Deforming | Motion::Streamed => {
            (RigidBodyBuilder::fixed(), still.moved(&place(START)))
        }
    };
    let wall = arena.insert(builder, &surface, Material::default())?;
    // At rest before the wall comes.
    arena.steps(30)?;
    if motion == Motion::Kinematic {
        arena.world.bodies[wall.body].set_linvel(Vec3::X * speed, true);
    }
    let mut least_lead = f32::INFINITY;
    let steps = (WAY / speed / DT) as usize;
    let mut x = START;
    for _ in 0..steps {
        if motion != Motion::Kinematic {
            x += speed * DT;
            let same = if motion == Motion::Deforming {
                SamePoints::Yes
            } else {
                still = sample();
                SamePoints::No
            };
            arena.reshape(&wall, &still.moved(&place(x)), same)?;
        }
        arena.step()?;
        if motion == Motion::Kinematic {
            x = arena.position(&wall).x;
        }
        least_lead = least_lead.min(arena.position(&body).x - x);
    }
    verdict.at_least("least_lead_m", least_lead, 0.0);
    let pushed = arena.position(&body).x;
    if motion == Motion::Streamed {
        verdict.note("pushed_m", pushed);
    } else {
        verdict.at_least("pushed_m", pushed, f64::from(x + HALF - 2.0 * SPACING));
    }
    verdict.note("end_speed_m_s", arena.speed(&body));
    Ok(())
}
