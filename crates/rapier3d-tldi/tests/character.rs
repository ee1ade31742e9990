//! Rapier's character controller walks on clouds as on rapier's own shapes, but does not know that it is grounded.

mod common;
#[path = "common/warnings.rs"]
mod warnings;

use common::worlds::attached;
use common::{SPACING, worlds::TestResult};
use rapier3d::control::{CharacterAutostep, CharacterLength, KinematicCharacterController};
use rapier3d::parry::query::details::ShapeCastOptions;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use std::error::Error;

/// Of the character, metres.
const HALF_HEIGHT: f32 = 0.6;
const RADIUS: f32 = 0.25;

/// What the controller keeps free around the character, metres.
const OFFSET: f32 = 0.01;

/// A floor, a curb 6 cm high from x = 0.2 to 0.6, and a wall at x = 1.2 m: as clouds, or as rapier's own shapes.
fn street(of_clouds: bool) -> Result<(PhysicsWorld, TldiPipeline), Box<dyn Error>> {
    let (mut world, mut tldi) = attached();
    let floor = (-0.5 * Vector::Y, Vector::new(2.0, 0.5, 1.0));
    let curb = (Vector::new(0.4, 0.0, 0.0), Vector::new(0.2, 0.06, 0.6));
    let wall = (Vector::new(1.4, 0.2, 0.0), Vector::new(0.2, 0.6, 0.6));
    for (middle, half) in [floor, curb, wall] {
        let cuboid = Cuboid::new(half);
        let collider = match of_clouds {
            true => tldi.collider(sample_shape(&cuboid, SPACING)?),
            false => ColliderBuilder::new(SharedShape::new(cuboid)),
        };
        world.insert(RigidBodyBuilder::fixed().translation(middle), collider);
    }
    tldi.step(&mut world)?;
    Ok((world, tldi))
}

/// Where the character is in each of `steps` steps of 1/60 s, if it walks along x at `speed` m/s.
fn walk(world: &PhysicsWorld, speed: f32, steps: usize) -> Vec<Vector> {
    let character = Capsule::new_y(HALF_HEIGHT - RADIUS, RADIUS);
    let controller = KinematicCharacterController {
        offset: CharacterLength::Absolute(OFFSET),
        autostep: Some(CharacterAutostep {
            max_height: CharacterLength::Absolute(0.12),
            min_width: CharacterLength::Absolute(0.05),
            include_dynamic_bodies: false,
        }),
        ..KinematicCharacterController::default()
    };
    let queries = world.broad_phase.as_query_pipeline(
        world.narrow_phase.query_dispatcher(),
        &world.bodies,
        &world.colliders,
        QueryFilter::default(),
    );
    let ground = ShapeCastOptions {
        target_distance: OFFSET,
        stop_at_penetration: false,
        ..ShapeCastOptions::with_max_time_of_impact(0.02)
    };
    let dt = 1.0 / 60.0;
    let mut pose = Pose::from_translation(Vector::new(-0.5, HALF_HEIGHT + 0.1, 0.0));
    let mut fall = 0.0;
    let mut step = |_| {
        let below = queries.cast_shape(&pose, -Vector::Y, &character, ground);
        fall = if below.is_some() { 0.0 } else { fall } - 9.81 * dt;
        let wanted = Vector::new(speed, fall, 0.0) * dt;
        let moved = controller.move_shape(dt, &queries, &character, &pose, wanted, |_| {});
        pose.translation += moved.translation;
        pose.translation
    };
    (0..steps).map(&mut step).collect()
}

#[test]
fn a_character_walks_on_clouds() -> TestResult {
    warnings::listen("in_your_app.md");
    let (clouds, _tldi) = street(true)?;
    let (shapes, _other_tldi) = street(false)?;
    assert_eq!(warnings::count(), 0);
    for (speed, steps) in [(0.0, 30), (2.0, 70)] {
        let [on_clouds, on_shapes] = [&clouds, &shapes].map(|world| walk(world, speed, steps));
        // Where the ground is flat: gaps are good to 0.2 r̄. At edges and at the wall: splats reach up to r̄ over them.
        let last = [on_clouds[steps - 1], on_shapes[steps - 1]];
        assert!((last[0].y - last[1].y).abs() < 0.2 * SPACING, "{last:?}");
        assert!((last[0].x - last[1].x).abs() < SPACING, "{last:?}");
        for (k, (p, q)) in on_clouds.iter().zip(&on_shapes).enumerate() {
            // The ground tells of itself up to 2 cm ahead: it is reached some steps later.
            assert!(
                k < 20 || (p.y - q.y).abs() < SPACING,
                "{speed} m/s, {k}: {p} {q}"
            );
        }
        let highest = on_clouds[20..].iter().map(|p| p.y).fold(0.0, f32::max);
        let curb = if speed > 0.0 { 0.06 } else { 0.0 };
        let expected = curb + HALF_HEIGHT + OFFSET;
        assert!((highest - expected).abs() < SPACING, "{highest}");
    }
    // Rapier's own dispatcher is asked whether the character is grounded. Where a later rapier asks ours, the warning can go.
    assert_eq!(warnings::count(), 1);
    Ok(())
}
