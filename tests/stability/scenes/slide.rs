//! Boxes that slide over a plane, and hold or slip on ramps.

use crate::suite::arena::{Arena, DT, GRAVITY, Material};
use crate::suite::case::{Cases, Scale, Scene, Setup, Stop, Verdict};
use crate::suite::surface::{Backing, Normals, Surface};
use rapier3d::prelude::*;
use tldi::glamx::{Quat, Vec2, Vec3};

/// The scene.
pub(crate) const SCENE: Scene = Scene {
    name: "slide",
    about: "A box of 0.2 m slides over a plane (friction 0.5) at up to 10 m/s, and stands on \
            ramps 1° and 5° beside the friction angle; r̄ = 2 cm. Noise has σ = 0.25 r̄ where \
            said.",
    rule: "On the plane: stopping distance within 2 % of the primitive's (5 % with noise; 0.1 r̄ \
           at 0 m/s), heading within 1°, no hop above 0.5 r̄. On a ramp below the friction \
           angle: ≤ 1 r̄ downhill in 3 s, and then ≤ 1 mm/s. Above it: at least half of the \
           theoretical way.",
    cases,
};

/// Distance of points, and their radius, metres.
const SPACING: f32 = 0.02;
/// Half the box's edge, metres.
const HALF: f32 = 0.1;
const FRICTION: f32 = 0.5;
/// Seconds on a ramp.
const RAMP_SECONDS: f32 = 3.0;

fn material() -> Material {
    Material {
        friction: FRICTION,
        ..Material::default()
    }
}

fn cases(scale: &Scale, cases: &mut Cases) {
    let speeds: &[f32] = scale.pick(
        &[0.0, 1.0, 5.0, 10.0],
        &[0.0, 0.5, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0],
    );
    for (noise, kind) in [(0.0, "plane"), (0.25, "noisy plane")] {
        for &speed in speeds {
            let name = format!("{kind}, {speed} m/s");
            cases.add(name, move |setup, verdict| {
                slide(setup, verdict, speed, noise)
            });
        }
    }
    for offset in [-5.0, -1.0, 1.0, 5.0] {
        let name = format!("ramp, friction angle {offset:+}°");
        cases.add(name, move |setup, verdict| ramp(setup, verdict, offset));
    }
}

/// Where a sliding box stopped, and how high it went above its start, metres.
struct Slide {
    way: Vec3,
    hop: f32,
}

fn measure(setup: &Setup, speed: f32, noise: f32) -> Result<Slide, Stop> {
    let mut rng = setup.rng();
    let length = speed * speed / (2.0 * FRICTION * GRAVITY);
    let size = Vec2::new(1.2 * length + 1.0, 0.8);
    let floor = if noise > 0.0 {
        Surface::noisy(size, SPACING, noise * SPACING, Backing::Solid, &mut rng)
            .with_normals(Normals::Absent)
    } else {
        Surface::flat(size, SPACING, Backing::Solid, &mut rng)
    };
    let mut arena = Arena::new(setup)?;
    let middle = Vec3::X * (0.5 * size.x - 0.5);
    arena.insert(
        RigidBodyBuilder::fixed().translation(middle),
        &floor,
        material(),
    )?;
    let surface = Surface::cuboid(Vec3::splat(HALF), SPACING, &mut rng);
    let height = HALF + surface.lift_on(&floor, setup.method);
    let body = RigidBodyBuilder::dynamic()
        .translation(Vec3::Y * height)
        .linvel(Vec3::X * speed);
    let body = arena.insert(body, &surface, material())?;
    let mut hop = 0.0_f32;
    let seconds = speed / (FRICTION * GRAVITY);
    for _ in 0..((1.5 * seconds + 1.0) / DT) as usize {
        arena.step()?;
        hop = hop.max(arena.position(&body).y - height);
    }
    Ok(Slide {
        way: arena.position(&body).with_y(0.0),
        hop,
    })
}

fn slide(setup: &Setup, verdict: &mut Verdict, speed: f32, noise: f32) -> Result<(), Stop> {
    let truth = measure(&setup.of_primitive(), speed, noise)?;
    let ours = measure(setup, speed, noise)?;
    let expected = f64::from(truth.way.length());
    let tolerance = if speed == 0.0 {
        f64::from(0.1 * SPACING)
    } else if noise > 0.0 {
        0.05 * expected
    } else {
        0.02 * expected
    };
    verdict.near(
        "stopping_distance_m",
        ours.way.length(),
        expected,
        tolerance,
    );
    verdict.note(
        "theory_m",
        f64::from(speed * speed / (2.0 * FRICTION * GRAVITY)),
    );
    if speed > 0.0 {
        let heading = ours.way.z.atan2(ours.way.x).to_degrees().abs();
        verdict.at_most("heading_deg", heading, 1.0);
    }
    verdict.at_most("hop_mean_radii", ours.hop / SPACING, 0.5);
    Ok(())
}

fn ramp(setup: &Setup, verdict: &mut Verdict, offset_deg: f32) -> Result<(), Stop> {
    let mut rng = setup.rng();
    let angle = FRICTION.atan() + offset_deg.to_radians();
    let acceleration = (GRAVITY * (angle.sin() - FRICTION * angle.cos())).max(0.0);
    let theory = 0.5 * acceleration * RAMP_SECONDS * RAMP_SECONDS;
    let size = Vec2::new(1.2 * theory + 1.0, 0.8);
    // Downhill is +x.
    let tilt = Quat::from_rotation_z(-angle);
    let downhill = tilt * Vec3::X;
    let mut arena = Arena::new(setup)?;
    let floor = Surface::flat(size, SPACING, Backing::Solid, &mut rng);
    let pose = Pose::from_parts(downhill * (0.5 * size.x - 0.5), tilt);
    arena.insert(RigidBodyBuilder::fixed().pose(pose), &floor, material())?;
    let surface = Surface::cuboid(Vec3::splat(HALF), SPACING, &mut rng);
    let start = tilt * Vec3::Y * (HALF + surface.lift_on(&floor, setup.method));
    let builder = RigidBodyBuilder::dynamic().pose(Pose::from_parts(start, tilt));
    let body = arena.insert(builder, &surface, material())?;
    arena.steps((RAMP_SECONDS / DT) as usize)?;
    let way = (arena.position(&body) - start).dot(downhill);
    verdict.note("theory_m", theory);
    if offset_deg < 0.0 {
        verdict.at_most("downhill_mean_radii", way / SPACING, 1.0);
        verdict.at_most("end_speed_m_s", arena.speed(&body), 0.001);
    } else {
        verdict.at_least("downhill_m", way, f64::from(0.5 * theory));
    }
    Ok(())
}
