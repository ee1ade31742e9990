//! Rapier's character controller asks its own dispatcher about contacts: the log says so, once.

mod common;
#[path = "common/warnings.rs"]
mod warnings;

use common::worlds::{TestResult, attached, insert_floor};
use rapier3d::control::KinematicCharacterController;
use rapier3d::prelude::*;

#[test]
fn a_character_on_a_cloud_is_warned_about() -> TestResult {
    warnings::listen("TldiPipeline::attach");
    let (mut world, mut tldi) = attached();
    insert_floor(&mut world, 0.8);
    tldi.step(&mut world)?;
    assert_eq!(warnings::count(), 0);
    let character = Ball::new(0.2);
    let controller = KinematicCharacterController::default();
    let mut at = Vector::Y * 0.25;
    for _ in 0..60 {
        let queries = world.broad_phase.as_query_pipeline(
            world.narrow_phase.query_dispatcher(),
            &world.bodies,
            &world.colliders,
            QueryFilter::default(),
        );
        let pose = Pose::from_translation(at);
        let down = Vector::Y * -0.02;
        at += controller
            .move_shape(1.0 / 60.0, &queries, &character, &pose, down, |_| {})
            .translation;
    }
    // Where a later rapier lets it stand, the warning and the docs can go.
    assert!(at.y < -0.9, "{at}");
    assert_eq!(warnings::count(), 1);
    Ok(())
}
