//! Rapier does not ask for the contacts of a pair without hooks while it hardly moves: the log says so, once.

mod common;
#[path = "common/warnings.rs"]
mod warnings;

use common::worlds::{HALF, TestResult, attached, dynamic_at};
use common::{shape, square};
use rapier3d::prelude::*;
use rapier3d_tldi::cloud_collider;

#[test]
fn a_cloud_whose_contacts_rapier_recycles_is_warned_about() -> TestResult {
    warnings::listen("cloud_collider");
    let floor = || shape(&square(0.8));
    let made = || cloud_collider(floor());
    let plain = || ColliderBuilder::new(SharedShape::new(floor()));
    let compound = || ColliderBuilder::compound(vec![(Pose::IDENTITY, SharedShape::new(floor()))]);
    for (case, floor, recycles, warnings) in [
        ("made by cloud_collider", made(), true, 0),
        ("nothing is recycled", plain(), false, 0),
        ("plain", plain(), true, 1),
        ("once only", compound(), true, 1),
    ] {
        let (mut world, mut tldi) = attached();
        world.integration_parameters.contact_recycling = recycles;
        world.insert(RigidBodyBuilder::fixed(), floor);
        world.insert(dynamic_at(HALF), ColliderBuilder::ball(HALF));
        for _ in 0..3 {
            tldi.step(&mut world)?;
        }
        assert_eq!(warnings::count(), warnings, "{case}");
    }
    Ok(())
}
