//! What rolls on one spot: it rocks as it would in the continuum, and comes to rest.

mod common;

use common::worlds::{TestResult, attached};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use std::f32::consts::{PI, TAU};

/// A ball of this radius whose centre of mass is nearer to its surface, metres.
const RADIUS: f32 = 0.1;
const LOW: f32 = 0.036;
const MASS: f32 = 0.25;
/// Moment of inertia about each axis, kg m².
const INERTIA: f32 = 2.5e-4;
const GRAVITY: f32 = 9.81;
/// From where it starts, radians.
const TILT: f32 = 0.05;

/// Samples of a ball of `radius` around `center`.
fn ball(radius: f32, count: usize, center: Vector) -> PointCloudShape {
    let spacing = radius * (4.0 * PI / count as f32).sqrt();
    let points: Vec<Vector> = (0..count)
        .map(|k| {
            let y = 1.0 - (2 * k + 1) as f32 / count as f32;
            let (sin, cos) = (2.399_963 * k as f64).sin_cos(); // the golden angle
            let ring = (1.0 - y * y).sqrt();
            center + radius * Vector::new(ring * cos as f32, y, ring * sin as f32)
        })
        .collect();
    let cloud = PointCloud::builder(points).radius(spacing).build();
    PointCloudShape::new(cloud.expect("a valid cloud"))
}

/// A roly-poly doll on a floor: its angular velocity about z over 8 s.
fn rocking(floor: ColliderBuilder, floor_first: bool, doll: ColliderBuilder) -> Vec<f32> {
    let (mut world, mut tldi) = attached();
    world.gravity = -GRAVITY * Vector::Y;
    let properties = MassProperties::new(Vector::ZERO, MASS, Vector::splat(INERTIA));
    let body = RigidBodyBuilder::dynamic()
        .translation(Vector::Y * (RADIUS - (RADIUS - LOW) * TILT.cos()))
        .rotation(Vector::Z * TILT)
        .can_sleep(false)
        .additional_mass_properties(properties);
    let doll = doll.density(0.0).friction(1.0);
    let floor = floor.friction(1.0);
    let handle = if floor_first {
        world.insert(RigidBodyBuilder::fixed(), floor);
        world.insert(body, doll).0
    } else {
        let handle = world.insert(body, doll).0;
        world.insert(RigidBodyBuilder::fixed(), floor);
        handle
    };
    let mut turning = Vec::new();
    for _ in 0..480 {
        tldi.step(&mut world).expect("a step");
        turning.push(world.bodies[handle].angvel().z);
    }
    turning
}

fn doll() -> PointCloudShape {
    ball(RADIUS, 2000, (RADIUS - LOW) * Vector::Y)
}

/// Angular frequency of small rocking: m g (R − h) / (I + m h²).
fn frequency() -> f32 {
    (MASS * GRAVITY * (RADIUS - LOW) / (INERTIA + MASS * LOW * LOW)).sqrt()
}

fn largest(turning: &[f32]) -> f32 {
    turning.iter().fold(0.0, |most, w| w.abs().max(most))
}

/// Without friction in the air a doll rocks with the period of a pendulum, and never faster than at first; a doll of
/// rapier's own shapes rocks ever faster.
#[test]
fn what_rocks_gains_no_energy() {
    let half_space = || ColliderBuilder::new(SharedShape::new(HalfSpace::new(Vector::Y)));
    let primitive = ColliderBuilder::ball(RADIUS).translation((RADIUS - LOW) * Vector::Y);
    let first = TILT * frequency();
    // What all of this is about: were rapier to hold the energy of its own, nothing would have to be moved.
    assert!(largest(&rocking(half_space(), true, primitive)[420..]) > 5.0 * first);

    let ground: Vec<Vector> = (0..60 * 60)
        .map(|k| 0.01 * Vector::new((k % 60) as f32 - 29.7, 0.0, (k / 60) as f32 - 30.2))
        .collect();
    let ground = PointCloud::builder(ground)
        .radius(0.01)
        .build()
        .expect("a valid cloud");
    let ground = cloud_collider(PointCloudShape::new(ground));
    for (name, floor, floor_first) in [
        ("half-space", half_space(), true),
        ("half-space", half_space(), false),
        ("cloud", ground.clone(), true),
        ("cloud", ground, false),
    ] {
        let turning = rocking(floor, floor_first, cloud_collider(doll()));
        // The start is not exactly in touch.
        let at_first = largest(&turning[..60]);
        assert!((at_first / first - 1.0).abs() < 0.15, "{name}: {at_first}");
        let at_last = largest(&turning[420..]);
        assert!(at_last < 0.8 * first, "{name}: {at_last} after {at_first}");
        // Zero crossings of the first second and a half, while it rocks far enough to be measured.
        let crossings: Vec<usize> = (1..90)
            .filter(|&k| turning[k - 1] * turning[k] < 0.0)
            .collect();
        let (from, to) = (crossings[0], crossings[crossings.len() - 1]);
        let half_period = (to - from) as f32 / 60.0 / (crossings.len() - 1) as f32;
        let expected = 0.5 * TAU / frequency();
        // A step of 1/60 s is a twelfth of it, over seven half periods.
        let off = half_period / expected - 1.0;
        assert!(off.abs() < 0.06, "{name}: {half_period} s, not {expected}");
    }
}

/// Seen from the middle of a ball its contact stays where it is: on a level it rolls on, and as far as a primitive.
#[test]
fn a_ball_rolls_on() -> TestResult {
    for speed in [0.5, 4.0] {
        let way = |body: ColliderBuilder, floor: ColliderBuilder| -> Result<f32, TldiError> {
            let (mut world, mut tldi) = attached();
            world.insert(RigidBodyBuilder::fixed(), floor.friction(1.0));
            let rolling = RigidBodyBuilder::dynamic()
                .translation(Vector::Y * RADIUS)
                .linvel(speed * Vector::X)
                .angvel(-speed / RADIUS * Vector::Z);
            let (handle, _) = world.insert(rolling, body.friction(1.0));
            for _ in 0..180 {
                tldi.step(&mut world)?;
            }
            Ok(world.bodies[handle].translation().x)
        };
        let half_space = || ColliderBuilder::new(SharedShape::new(HalfSpace::new(Vector::Y)));
        let primitive = way(ColliderBuilder::ball(RADIUS), half_space())?;
        let ours = way(
            cloud_collider(ball(RADIUS, 2000, Vector::ZERO)),
            half_space(),
        )?;
        // Its radius of curvature is good to 1 %, of which the contact is a hundredth of a radius off at 4 m/s.
        assert!(
            (ours / primitive - 1.0).abs() < 0.02,
            "{speed} m/s: {ours} m, not {primitive}"
        );
    }
    Ok(())
}
