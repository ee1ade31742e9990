//! A world that no pipeline was attached to lets bodies fall through clouds: the log says so, once.

mod common;
#[path = "common/warnings.rs"]
mod warnings;

use common::worlds::{HALF, attached, dynamic_at, insert_floor};
use rapier3d::prelude::*;

#[test]
fn a_world_without_a_pipeline_is_warned_about() {
    warnings::listen("TldiPipeline::attach");
    let fill = |world: &mut PhysicsWorld| {
        insert_floor(world, 0.8);
        world.insert(
            dynamic_at(HALF + 0.01),
            ColliderBuilder::cuboid(HALF, HALF, HALF),
        );
        world
            .insert(dynamic_at(3.0 * HALF), ColliderBuilder::ball(HALF))
            .0
    };
    let (mut world, mut tldi) = attached();
    fill(&mut world);
    for _ in 0..60 {
        tldi.step(&mut world).expect("nothing is wrong");
        world.step(); // without the batch: compared on the spot
    }
    assert_eq!(warnings::count(), 0, "attached");

    for _ in 0..2 {
        let mut world = PhysicsWorld::default();
        fill(&mut world);
        for _ in 0..60 {
            world.step();
        }
        assert_eq!(warnings::count(), 1);
    }
}
