//! Whole worlds of clouds and shapes of any size: every step is taken or says why not, and rapier's numbers stay numbers.

use crate::check;
use crate::shapes::{ShapeSpec, shape};
use crate::shares::Shares;
use crate::spec::{CloudSpec, PoseSpec, cloud, pose};
use proptest::collection::vec;
use proptest::prelude::*;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;

/// Steps of each world.
const STEPS: usize = 8;

const CLOUDS: Group = Group::GROUP_1;
const SHAPES: Group = Group::GROUP_2;

#[derive(Clone, Debug)]
struct Body {
    cloud: Option<CloudSpec>,
    shape: ShapeSpec,
    pose: PoseSpec,
    /// In sizes a second, a power of ten.
    speed: i32,
    /// Fixed, dynamic or kinematic.
    kind: u8,
    ccd: bool,
    sensor: bool,
    /// Gets new points at this step.
    points_at: Option<(usize, CloudSpec)>,
}

fn body() -> impl Strategy<Value = Body> {
    let cloud_or_not = proptest::option::weighted(0.7, cloud(Just(0), false));
    let kinds = (0..3u8, prop::bool::weighted(0.3), prop::bool::weighted(0.2));
    let new_points = proptest::option::weighted(0.2, (0..STEPS, cloud(Just(0), true)));
    (cloud_or_not, shape(), pose(), -2..=4i32, kinds, new_points).prop_map(
        |(cloud, shape, pose, speed, (kind, ccd, sensor), points_at)| Body {
            cloud,
            shape,
            pose,
            speed,
            kind,
            ccd,
            sensor,
            points_at,
        },
    )
}

#[test]
fn worlds_go_on() {
    let cases = (-6..=6i32, vec(body(), 2..5));
    let shares = Shares::default();
    check(&cases, |(exponent, mut bodies)| {
        let size = 10f32.powi(exponent);
        let mut world = PhysicsWorld::default();
        world.integration_parameters.length_unit = size;
        world.gravity = -9.81 * size * Vector::Y;
        let mut tldi = TldiPipeline::new(TldiConfig::default()).expect("the settings are valid");
        tldi.attach(&mut world);
        let mut inserted = Vec::new();
        for body in &mut bodies {
            let collider = match &mut body.cloud {
                Some(spec) => {
                    spec.exponent = exponent;
                    let Ok(cloud) = spec.build() else { continue };
                    let all = InteractionGroups::all();
                    tldi.collider(cloud)
                        .collision_groups(all.with_memberships(CLOUDS))
                }
                None => {
                    let Some(shape) = body.shape.build(size) else {
                        continue;
                    };
                    // Pairs without a cloud are rapier's, which panics at some (voxels and a half-space).
                    let clouds_only = InteractionGroups::all().with_filter(CLOUDS);
                    ColliderBuilder::new(shape)
                        .collision_groups(clouds_only.with_memberships(SHAPES))
                }
            };
            let velocity = 10f32.powi(body.speed) * size * Vector::new(0.3, -1.0, 0.2);
            // Half-spaces have no middle to move about.
            let is_boundless = body.cloud.is_none() && body.shape.is_half_space();
            let builder = match body.kind {
                _ if is_boundless => RigidBodyBuilder::fixed(),
                0 => RigidBodyBuilder::fixed(),
                1 => RigidBodyBuilder::dynamic().additional_mass(1.0),
                _ => RigidBodyBuilder::kinematic_velocity_based(),
            };
            let builder = builder
                .pose(body.pose.at(size))
                .linvel(velocity)
                .angvel(Vector::new(1.0, 2.0, 3.0))
                .ccd_enabled(body.ccd);
            // About 1 kg at any size: moments of inertia grow with the fifth power of the size, and rapier's solver
            // multiplies them.
            let collider = collider.sensor(body.sensor).density(size.powi(-3));
            inserted.push((world.insert(builder, collider).1, &*body));
        }
        // Rapier's own gyroscopic term is no number where moments of inertia are so large that their products leave
        // `f32`: of clouds with outliers a thousand sizes away, about 10²⁰ kg m².
        let dt = world.integration_parameters.dt;
        for (_, body) in world.bodies.iter_mut() {
            body.recompute_mass_properties_from_colliders(&world.colliders);
            if !body.angvel_with_gyroscopic_forces(dt).is_finite() {
                shares.note("stepped", false);
                return Ok(());
            }
        }
        shares.note("stepped", true);
        let mut touches = false;
        for step in 0..STEPS {
            for (collider, body) in &inserted {
                if let Some((at, spec)) = &body.points_at
                    && *at == step
                {
                    // Refused or taken; a shape has no points.
                    let taken = tldi.set_points(&mut world, *collider, &spec.points(), None);
                    if body.cloud.is_some() {
                        shares.note("new points", taken.is_ok());
                    }
                }
            }
            match tldi.step(&mut world) {
                Ok(report) => prop_assert!(report.max_penetration.is_finite()),
                Err(TldiError::PassesThrough { .. }) => {}
                Err(error) => prop_assert!(false, "step {}: {}", step, error),
            }
            let contacts = tldi.contacts(&world.narrow_phase, &world.colliders);
            for contact in contacts {
                touches = true;
                prop_assert!(contact.point.is_finite() && contact.depth.is_finite());
            }
            for (_, body) in world.bodies.iter() {
                prop_assert!(body.translation().is_finite(), "step {}", step);
            }
        }
        shares.note("in contact", touches);
        Ok(())
    });
    shares.assert_at_least(&[
        ("stepped", 0.98),
        ("new points", 0.45),
        ("in contact", 0.19),
    ]);
}
