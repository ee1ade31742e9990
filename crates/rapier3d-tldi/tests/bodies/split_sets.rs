//! A step in parts, with separate sets and rapier's own pipeline, is a step.

use crate::common::worlds::{HALF, TestResult, attached, dynamic_at, insert_floor};
use crate::common::{cube, shape, square};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;

/// Half the edge of the floor, metres.
const FLOOR: f32 = 1.0;

/// As [`TldiPipeline::step`] does it.
fn step_in_parts(
    world: &mut PhysicsWorld,
    tldi: &mut TldiPipeline,
) -> Result<StepReport, TldiError> {
    let integration = world.integration_parameters;
    tldi.prepare(
        world.gravity,
        &integration,
        &world.bodies,
        &world.colliders,
        &world.impulse_joints,
        &world.multibody_joints,
    )?;
    tldi.push(&mut world.bodies, &world.colliders, &integration, &());
    world.physics_pipeline.step(
        world.gravity,
        &integration,
        &mut world.islands,
        &mut world.broad_phase,
        &mut world.narrow_phase,
        &mut world.bodies,
        &mut world.colliders,
        &mut world.impulse_joints,
        &mut world.multibody_joints,
        &mut world.soft_bodies,
        &mut world.ccd_solver,
        &tldi.hooks(&()),
        &(),
    );
    tldi.finish(&mut world.bodies, &world.narrow_phase, &world.colliders)
}

/// Where a body is after a second on a floor that first moves sideways, then rises faster than rapier undoes
/// penetrations, then has new points, then is another cloud.
fn carried(
    in_parts: bool,
    most_seconds: &mut f64,
) -> Result<(Pose, Vector), Box<dyn std::error::Error>> {
    let mut world = PhysicsWorld::default();
    let (_, mut tldi) = attached();
    tldi.attach_narrow_phase(&mut world.narrow_phase);
    assert!(tldi.is_attached(&world.narrow_phase));
    let dt = 0.01;
    world.integration_parameters.dt = dt;
    let floor = insert_floor(&mut world, FLOOR);
    let body = cloud_collider(shape(&cube(HALF)));
    let (body, _) = world.insert(dynamic_at(HALF + 0.01), body);
    let mut moved = Vector::ZERO;
    let at = |moved: Vector| -> Vec<Vector> { square(FLOOR).iter().map(|p| *p + moved).collect() };
    for step in 0..100 {
        let deforms = step < 40;
        moved += dt
            * if step < 20 {
                0.4 * Vector::X
            } else if deforms {
                3.0 * Vector::Y
            } else {
                0.2 * Vector::Z
            };
        let points = at(moved);
        match (step, in_parts) {
            (70, true) => tldi.set_collider_cloud(
                &mut world.colliders,
                floor,
                shape(&points).cloud().clone(),
            )?,
            (70, false) => tldi.set_cloud(&mut world, floor, shape(&points).cloud().clone())?,
            (_, true) if deforms => {
                tldi.deform_collider(&mut world.colliders, floor, &points, None, dt)?
            }
            (_, false) if deforms => tldi.deform(&mut world, floor, &points, None)?,
            (_, true) => tldi.set_collider_points(&mut world.colliders, floor, &points, None)?,
            (_, false) => tldi.set_points(&mut world, floor, &points, None)?,
        }
        let report = match in_parts {
            true => step_in_parts(&mut world, &mut tldi)?,
            false => tldi.step(&mut world)?,
        };
        assert_eq!(report.pairs_missed, 0, "step {step}");
        *most_seconds = most_seconds.max(report.prepare_seconds);
        if step == 19 {
            let carried = world.bodies[body].linvel().x;
            assert!((carried - 0.4).abs() < 0.05, "{carried} m/s");
        }
    }
    let body = &world.bodies[body];
    Ok((*body.position(), body.linvel()))
}

#[test]
fn a_step_in_parts_is_a_step() -> TestResult {
    let mut seconds = 0.0;
    let whole = carried(false, &mut seconds)?;
    assert_eq!(carried(true, &mut seconds)?, whole);
    assert!(seconds > 0.0, "a comparison takes time");
    // It was carried along, and lifted off.
    let at = whole.0.translation;
    assert!(at.x > 0.03 && at.y > 0.6 + HALF - 0.01, "{at}");
    Ok(())
}
