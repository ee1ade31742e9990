//! Clouds as sensors give them: uneven, with duplicates, flying pixels and range noise.

use crate::suite::arena::{Arena, DT, Material};
use crate::suite::case::{Cases, Scale, Scene, Setup, Stop, Verdict};
use crate::suite::surface::{Backing, Normals, Radius, Surface};
use fastrand::Rng;
use rapier3d::prelude::*;
use tldi::glamx::{Vec2, Vec3};
use tldi_tests::{Samples, Sheet, standard_normal};

/// The scene.
pub(crate) const SCENE: Scene = Scene {
    name: "density",
    about: "A box of 0.2 m rests on a plane with one flaw: points 2 mm apart on one side and 20 \
            mm on the other (100:1 by area); points that occur 4 or 12 times; 1 % flying pixels \
            up to 0.2 m above; the range noise of a Kinect 1.5 m away. Radii are from 7 \
            neighbours; there are no normals.",
    rule: "After 3 s, every lower corner of the box is within 1 local r̄ of the plane. Local r̄ \
           is the mean radius of the cloud at that corner.",
    cases,
};

const HALF: f32 = 0.1;
const COARSE: f32 = 0.02;
const FINE: f32 = 0.002;
const SECONDS: f32 = 3.0;
/// Points of the box.
const BODY_SPACING: f32 = 0.01;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Flaw {
    /// 100:1, with the box at this x; the border is at 0.
    Uneven {
        x: f32,
    },
    /// Every point so many times.
    Repeated(usize),
    FlyingPixels,
    KinectNoise,
}

fn cases(_: &Scale, cases: &mut Cases) {
    let flaws = [
        (Flaw::Uneven { x: 0.0 }, "100:1, across the border"),
        (Flaw::Uneven { x: -0.15 }, "100:1, on the dense side"),
        (Flaw::Uneven { x: 0.15 }, "100:1, on the sparse side"),
        (Flaw::Repeated(4), "every point 4 times"),
        (Flaw::Repeated(12), "every point 12 times"),
        (Flaw::FlyingPixels, "1 % flying pixels"),
        (Flaw::KinectNoise, "range noise of a Kinect at 1.5 m"),
    ];
    for (flaw, name) in flaws {
        cases.add(name, move |setup, verdict| rest(setup, verdict, flaw));
    }
}

/// Range noise of a Kinect at a distance in metres: deviation along the ray (Nguyen, Izadi and
/// Lovell, "Modeling Kinect Sensor Noise", 2012), metres.
fn kinect_deviation(distance: f32) -> f32 {
    0.0012 + 0.0019 * (distance - 0.4) * (distance - 0.4)
}

/// What a Kinect (focal length 585 pixels) sees of y = 0 that lies 1.5 m away, from 45° above.
fn kinect_view(rng: &mut Rng) -> Samples {
    let camera = Vec3::new(0.0, 1.06, 1.06);
    let forward = -camera.normalize();
    let (right, up) = (Vec3::X, Vec3::X.cross(forward));
    let mut samples = Samples::default();
    for v in -140..=140 {
        for u in -140..=140 {
            let ray = forward + right * (u as f32 / 585.0) - up * (v as f32 / 585.0);
            if ray.y < 0.0 {
                let depth = camera.y / -ray.y;
                let noisy = depth + kinect_deviation(depth) * standard_normal(rng);
                samples.points.push(camera + ray * noisy);
                samples.normals.push(Vec3::Y);
            }
        }
    }
    samples
}

fn floor(flaw: Flaw, rng: &mut Rng) -> Surface {
    let size = Vec2::new(0.8, 0.4);
    let spacing = if flaw == Flaw::KinectNoise {
        0.005
    } else {
        COARSE
    };
    let mut floor = Surface::flat(size, spacing, Backing::Solid, rng);
    floor.radius = Radius::Neighbors;
    floor.normals = Normals::Absent;
    match flaw {
        Flaw::Uneven { .. } => {
            let dense = Sheet::sampled(Vec2::new(0.5 * size.x, size.y), FINE, rng, |_| 0.0);
            let points = (floor.samples.points.iter())
                .filter(|p| p.x > 0.0)
                .copied()
                .chain(
                    dense
                        .samples
                        .points
                        .iter()
                        .map(|p| *p - Vec3::X * (0.25 * size.x)),
                );
            floor.samples.points = points.collect();
            floor.samples.normals = vec![Vec3::Y; floor.samples.points.len()];
        }
        Flaw::Repeated(times) => {
            let once = floor.samples.clone();
            for _ in 1..times {
                floor.samples.extend(&once);
            }
        }
        Flaw::FlyingPixels => {
            for p in &mut floor.samples.points {
                if rng.f32() < 0.01 {
                    p.y += 0.2 * rng.f32();
                }
            }
        }
        Flaw::KinectNoise => {
            floor.samples = kinect_view(rng);
            floor.voxel_edge = 2.0 * spacing;
        }
    }
    if matches!(flaw, Flaw::FlyingPixels | Flaw::KinectNoise) {
        floor.mesh = Err("nothing joins such points into a mesh");
    }
    floor
}

/// Mean radius of the floor's points within 4 cm of a place on it, metres.
fn local_radius(floor: &Surface, at: Vec3) -> Result<f32, Stop> {
    let Ok(cloud) = floor.cloud() else {
        return Ok(floor.mean_radius());
    };
    let near = |p: &Vec3| (*p - at).with_y(0.0).length() < 2.0 * COARSE;
    let (mut sum, mut count) = (0.0, 0);
    for (i, _) in cloud
        .points()
        .iter()
        .copied()
        .enumerate()
        .filter(|(_, p)| near(p))
    {
        sum += cloud.radius(i);
        count += 1;
    }
    if count == 0 {
        return Err(Stop::Failed("a corner has left the floor".into()));
    }
    Ok(sum / count as f32)
}

fn rest(setup: &Setup, verdict: &mut Verdict, flaw: Flaw) -> Result<(), Stop> {
    let mut rng = setup.rng();
    let mut arena = Arena::new(setup)?;
    let floor = floor(flaw, &mut rng);
    arena.insert(RigidBodyBuilder::fixed(), &floor, Material::default())?;
    let x = match flaw {
        Flaw::Uneven { x } => x,
        _ => 0.0,
    };
    let surface = Surface::cuboid(Vec3::splat(HALF), BODY_SPACING, &mut rng);
    let lift = surface.lift_on(&floor, setup.method);
    let builder = RigidBodyBuilder::dynamic().translation(Vec3::new(x, HALF + 0.02 + lift, 0.0));
    let body = arena.insert(builder, &surface, Material::default())?;
    arena.steps((SECONDS / DT) as usize)?;
    let pose = *arena.body(&body).position();
    let mut worst = 0.0_f32;
    for (sx, sz) in [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)] {
        let corner = pose * (Vec3::new(sx, -1.0, sz) * HALF);
        worst = worst.max(corner.y.abs() / local_radius(&floor, corner)?);
    }
    verdict.at_most("worst_corner_local_radii", worst, 1.0);
    verdict.note("height_error_m", pose.translation.y - HALF);
    verdict.note(
        "tilt_deg",
        (pose.rotation * Vec3::Y)
            .angle_between(Vec3::Y)
            .to_degrees(),
    );
    verdict.note("end_speed_m_s", arena.speed(&body));
    verdict.note(
        "asleep",
        f64::from(u8::from(arena.body(&body).is_sleeping())),
    );
    Ok(())
}
