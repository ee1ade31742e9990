//! What users ask a dispatcher: distances, contacts, straight and turning casts, rays.

use crate::check;
use crate::shapes::shape;
use crate::shares::Shares;
use crate::spec::{any_number, cloud, pose};
use proptest::prelude::*;
use rapier3d::parry::query::details::ShapeCastOptions;
use rapier3d::parry::query::{ClosestPoints, NonlinearRigidMotion, QueryDispatcher};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;

/// Velocities up to what `f32` holds, in sizes a second, and numbers that are none.
fn velocity() -> impl Strategy<Value = Vector> {
    let number = prop_oneof![
        3 => -10.0..10.0f32,
        1 => any_number(),
        1 => (0..=37i32).prop_map(|e| -(10f32.powi(e))),
    ];
    let number = number.boxed();
    [number.clone(), number.clone(), number].prop_map(Vector::from_array)
}

#[test]
fn questions_have_answers() {
    let shapes = (cloud(-6..=6i32, false), cloud(Just(0), false), shape());
    let motions = (
        pose(),
        velocity(),
        velocity(),
        any_number(),
        any::<[bool; 3]>(),
    );
    let shares = Shares::default();
    check(
        &(shapes, motions),
        |((a, mut b, shape), (pose, linear, angular, time, flags))| {
            b.exponent = a.exponent;
            let (Ok(cloud_a), Ok(cloud_b), Some(shape)) =
                (a.build(), b.build(), shape.build(a.scale()))
            else {
                shares.note("built", false);
                return Ok(());
            };
            shares.note("built", true);
            let tldi = TldiPipeline::new(TldiConfig::default()).expect("the settings are valid");
            let dispatcher = tldi.dispatcher();
            let (first, other) = (PointCloudShape::new(cloud_a), PointCloudShape::new(cloud_b));
            let other: &dyn Shape = if flags[0] { &other } else { &*shape.0 };
            let (shape1, shape2): (&dyn Shape, &dyn Shape) = if flags[1] {
                (&first, other)
            } else {
                (other, &first)
            };
            let size = a.scale();
            let pos12 = pose.at(size);

            // What touches at the start is told at any end, rapier's own answers likewise.
            let is_within = |hit: f32| (0.0..=time.max(0.0)).contains(&hit);
            let distance = dispatcher.distance(&pos12, shape1, shape2);
            shares.note("distance", distance.is_ok());
            if let Ok(answer) = distance {
                prop_assert!(answer.distance >= 0.0, "{}", answer.distance);
            }
            let contact = dispatcher.contact(&pos12, shape1, shape2, size);
            shares.note("contact", contact.is_ok());
            shares.note("a contact", matches!(contact, Ok(Some(_))));
            if let Ok(Some(contact)) = contact {
                prop_assert!(contact.dist.is_finite() && contact.normal1.is_finite());
            }
            let closest = dispatcher.closest_points(&pos12, shape1, shape2, size);
            shares.note("closest points", closest.is_ok());
            if let Ok(ClosestPoints::WithinMargin(p, q)) = closest {
                prop_assert!(p.is_finite() && q.is_finite(), "{} {}", p, q);
            }
            let crossing = dispatcher.intersection_test(&pos12, shape1, shape2);
            shares.note(
                "a crossing",
                crossing.as_ref().is_ok_and(|answer| answer.intersecting),
            );
            prop_assert!(crossing.is_ok());
            let options = ShapeCastOptions {
                stop_at_penetration: flags[2],
                ..ShapeCastOptions::with_max_time_of_impact(time)
            };
            let straight = dispatcher.cast_shapes(&pos12, size * linear, shape1, shape2, options);
            shares.note("straight cast", straight.is_ok());
            shares.note("a straight hit", matches!(straight, Ok(Some(_))));
            if let Ok(Some(hit)) = straight {
                prop_assert!(is_within(hit.time_of_impact), "{:?}", hit);
                prop_assert!(
                    hit.witness1.is_finite() && hit.normal1.is_finite(),
                    "{:?}",
                    hit
                );
            }
            let still = NonlinearRigidMotion::constant_position(Pose::IDENTITY);
            let motion = NonlinearRigidMotion::new(pos12, Vector::ZERO, size * linear, angular);
            let turning = dispatcher
                .cast_shapes_nonlinear(&still, shape1, &motion, shape2, 0.0, time, flags[2]);
            shares.note("turning cast", turning.is_ok());
            shares.note("a turning hit", matches!(turning, Ok(Some(_))));
            if let Ok(Some(hit)) = turning {
                prop_assert!(is_within(hit.time_of_impact), "{:?}", hit);
                prop_assert!(
                    hit.witness1.is_finite() && hit.normal1.is_finite(),
                    "{:?}",
                    hit
                );
            }
            let ray = Ray::new(pos12.translation, linear);
            let hit = first.cast_local_ray_and_get_normal(&ray, time, true);
            shares.note("a ray that hits", hit.is_some());
            if let Some(hit) = hit {
                prop_assert!(
                    hit.time_of_impact >= 0.0 && hit.normal.is_finite(),
                    "{:?}",
                    hit
                );
            }
            let projected = first.project_local_point(pos12.translation, flags[2]);
            prop_assert!(projected.point.is_finite(), "{:?}", projected);
            let mass = first.mass_properties(1.0);
            prop_assert!(mass.mass().is_finite() && mass.local_com.is_finite());
            prop_assert!(mass.principal_inertia().is_finite());
            prop_assert!(mass.principal_inertia_local_frame.is_normalized());
            Ok(())
        },
    );
    shares.assert_at_least(&[
        ("built", 0.92),
        ("distance", 0.99),
        ("contact", 0.99),
        ("a contact", 0.83),
        ("closest points", 0.99),
        ("a crossing", 0.37),
        ("straight cast", 0.91),
        ("a straight hit", 0.2),
        ("turning cast", 0.96),
        ("a turning hit", 0.08),
        ("a ray that hits", 0.1),
    ]);
}
