//! What the dispatcher answers, asked directly, as rapier's narrow phase asks it.

use crate::common::{SPACING, cube, shape, square};
use rapier3d::glamx::Vec3Swizzles;
use rapier3d::parry::query::{
    DefaultQueryDispatcher, PersistentQueryDispatcher, QueryDispatcher, Unsupported,
};
use rapier3d::parry::shape::Shape;
use rapier3d::prelude::*;
use rapier3d_tldi::TldiDispatcher;
use rapier3d_tldi::prelude::*;

const PREDICTION: f32 = 0.02;

/// A dispatcher that passes on what was measured.
fn dispatcher() -> TldiDispatcher {
    dispatcher_with_scatter(0.0)
}

fn dispatcher_with_scatter(scatter: f32) -> TldiDispatcher {
    let config = TldiConfig {
        scatter,
        ..TldiConfig::default()
    };
    TldiPipeline::new(config)
        .expect("valid settings")
        .dispatcher()
}

/// All contacts of a pair as (middle, normal, gap) in the frame of the first shape.
fn contacts(
    dispatcher: &dyn PersistentQueryDispatcher<ContactManifoldData, ContactData>,
    pos12: &Pose,
    shape1: &dyn Shape,
    shape2: &dyn Shape,
) -> Result<Vec<(Vector, Vector, f32)>, Unsupported> {
    let mut manifolds: Vec<ContactManifold> = Vec::new();
    dispatcher.contact_manifolds(pos12, shape1, shape2, PREDICTION, &mut manifolds, &mut None)?;
    let mut contacts = Vec::new();
    for m in &manifolds {
        let pose1 = m.subshape_pos1().copied().unwrap_or(Pose::IDENTITY);
        let pose2 = *pos12 * m.subshape_pos2().copied().unwrap_or(Pose::IDENTITY);
        let normal = pose1.rotation * m.local_n1;
        assert!((normal + pose2.rotation * m.local_n2).length() < 1e-5);
        assert!(!m.points.is_empty());
        for p in &m.points {
            let (p1, p2) = (pose1 * p.local_p1, pose2 * p.local_p2);
            // What rapier's solver takes for granted; the points are metres in size.
            assert!(((p2 - p1).dot(normal) - p.dist).abs() < 1e-5);
            contacts.push((p1.midpoint(p2), normal, p.dist));
        }
    }
    Ok(contacts)
}

#[test]
fn pairs_without_a_cloud_are_declined() {
    let (ball, cuboid) = (Ball::new(0.5), Cuboid::new(Vector::ONE));
    let ours = dispatcher();
    let pose = Pose::from_translation(Vector::Y * 1.4);
    let declined = contacts(&ours, &pose, &cuboid, &ball);
    assert_eq!(declined, Err(Unsupported));
    let declined = ours.intersection_test(&pose, &cuboid, &ball);
    assert_eq!(declined.err(), Some(Unsupported));
    let chain = ours.chain(DefaultQueryDispatcher);
    let found = contacts(&chain, &pose, &cuboid, &ball).expect("rapier's own answer");
    assert_eq!(found.len(), 1);
    assert!((found[0].2 + 0.1).abs() < 1e-5);
}

/// A ball 20 mm deep in a square cloud: in either order the deepest contact lies below its middle,
/// with the normal from the first shape to the second.
#[test]
fn both_orders_mirror_each_other() {
    let (floor, ball) = (shape(&square(0.6)), Ball::new(0.3));
    let rotation = Rotation::from_rotation_y(0.3);
    let ball_in_floor = Pose::from_parts(Vector::new(0.07, 0.28, -0.05), rotation);
    let ours = dispatcher();
    let deepest = |contacts: Vec<(Vector, Vector, f32)>| {
        contacts
            .into_iter()
            .min_by(|a, b| a.2.total_cmp(&b.2))
            .expect("a contact")
    };
    let ahead = deepest(contacts(&ours, &ball_in_floor, &floor, &ball).expect("answered"));
    let floor_in_ball = ball_in_floor.inverse();
    let (point, normal, gap) =
        deepest(contacts(&ours, &floor_in_ball, &ball, &floor).expect("answered"));
    let back = (ball_in_floor * point, ball_in_floor.rotation * normal, gap);
    for (label, (point, normal, gap), up) in [("ahead", ahead, 1.0), ("back", back, -1.0)] {
        assert!(normal.dot(Vector::Y * up) > 0.98, "{label}: {normal:?}");
        // Depths are good to 0.15 of the radius of the points, here 6 mm.
        assert!((gap + 0.02).abs() < 0.15 * SPACING, "{label}: {gap}");
        let aside = (point - Vector::new(0.07, 0.0, -0.05)).with_y(0.0);
        assert!(aside.length() < 1.5 * SPACING, "{label}: {point:?}");
    }
}

/// What is within the roughness of a rough floor of touching touches, and what is deeper counts by
/// what it is deeper. Gaps of smooth faces are exact and count, but for the 0.105 of a radius by which their rims, which are
/// blurred, stand out.
#[test]
fn gaps_count_beyond_the_roughness() {
    let mut rng = fastrand::Rng::with_seed(1);
    let body = shape(&cube(0.2));
    let mut rough = square(0.6);
    for point in &mut rough {
        point.y += 0.5 * SPACING * (rng.f32() - 0.5);
    }
    for (floor, least, most) in [(shape(&square(0.6)), 0.0, 0.11), (shape(&rough), 0.05, 0.2)] {
        for depth in [-0.005, 0.002, 0.008, 0.02] {
            let pose = Pose::from_translation(Vector::Y * (0.2 - depth));
            let gaps = |scatter| {
                contacts(&dispatcher_with_scatter(scatter), &pose, &floor, &body)
                    .expect("answered")
                    .into_iter()
                    .map(|(middle, _, gap)| (middle, gap))
                    .collect::<Vec<_>>()
            };
            let (as_measured, scattered) = (gaps(0.0), gaps(0.1));
            // A face lies on three points at least.
            assert!(as_measured.len() >= 3, "{depth}: {as_measured:?}");
            assert_eq!(as_measured.len(), scattered.len(), "{depth}");
            let mut counted = Vec::new();
            for ((middle, measured), (same_middle, gap)) in as_measured.into_iter().zip(scattered) {
                assert!(middle.distance(same_middle) < 1e-6);
                let off = (measured + depth).abs() / SPACING;
                assert!(off < 0.002 || least > 0.0, "{measured} of {depth}");
                // Never past touching, nor by more than twice the scatter.
                assert!(gap * measured >= 0.0 && gap.abs() <= measured.abs());
                let taken = (measured.abs() - gap.abs()) / SPACING;
                assert!(taken <= most + 1e-4, "{measured}: {gap}");
                if gap != 0.0 {
                    counted.push(taken);
                }
            }
            assert!(counted.iter().all(|taken| *taken >= least), "{counted:?}");
        }
    }
}

/// A cloud inside a compound has the contacts it has at the same place on its own, named by its
/// part.
#[test]
fn parts_of_compounds_are_placed() {
    let (floor, body) = (shape(&square(0.6)), shape(&cube(0.1)));
    let part_pose = Pose::new(Vector::new(0.3, 0.0, 0.0), Vector::Y * 0.5);
    let far_pose = Pose::from_translation(Vector::Y * 5.0);
    let compound = Compound::new(vec![
        (far_pose, SharedShape::ball(0.1)),
        (part_pose, SharedShape::new(body.clone())),
    ]);
    let compound_in_floor = Pose::new(Vector::new(-0.2, 0.098, 0.1), Vector::Y * -0.2);
    let ours = dispatcher();
    let single = contacts(&ours, &(compound_in_floor * part_pose), &floor, &body);
    let part = contacts(&ours, &compound_in_floor, &floor, &compound);
    let (single, part) = (single.expect("answered"), part.expect("answered"));
    assert!(single.len() >= 3);
    assert_eq!(single.len(), part.len());
    for (s, p) in single.iter().zip(&part) {
        // The same comparison; the poses are composed in another order.
        assert!(
            (s.0 - p.0).length() < 1e-4 && (s.1 - p.1).length() < 1e-4,
            "{s:?} {p:?}"
        );
    }
    let flipped = contacts(&ours, &compound_in_floor.inverse(), &compound, &floor);
    assert!(flipped.expect("answered").len() >= 3);
    let crossing = ours.intersection_test(&compound_in_floor, &floor, &compound);
    let crossing = crossing.expect("answered");
    assert!(crossing.intersecting);
    assert_eq!((crossing.subshape1, crossing.subshape2), (0, 1));
}

/// In a pair of compounds, parts that are no clouds meet each other too.
#[test]
fn parts_without_a_cloud_are_rapiers() {
    let mixed = |cloud_at: Vector| {
        Compound::new(vec![
            (
                Pose::from_translation(cloud_at),
                SharedShape::new(shape(&cube(0.1))),
            ),
            (Pose::IDENTITY, SharedShape::cuboid(0.1, 0.1, 0.1)),
        ])
    };
    let (below, above) = (mixed(Vector::X * 3.0), mixed(Vector::X * -3.0));
    let pose = Pose::from_translation(Vector::Y * 0.195);
    let ours = dispatcher();
    let found = contacts(&ours, &pose, &below, &above).expect("answered");
    assert!(found.len() >= 4); // a face on a face
    for (_, normal, gap) in found {
        assert!((normal - Vector::Y).length() < 1e-5);
        assert!((gap + 0.005).abs() < 1e-5);
    }
    let crossing = ours
        .intersection_test(&pose, &below, &above)
        .expect("answered");
    assert!(crossing.intersecting);
    assert_eq!((crossing.subshape1, crossing.subshape2), (1, 1));
}

#[test]
fn surfaces_apart_do_not_intersect() {
    let (floor, body) = (shape(&square(0.6)), shape(&cube(0.1)));
    let ours = dispatcher();
    for (height, expected) in [(0.5, false), (0.12, false), (0.09, true), (0.0, true)] {
        let pose = Pose::from_translation(Vector::Y * height);
        let answer = ours
            .intersection_test(&pose, &floor, &body)
            .expect("answered");
        assert_eq!(answer.intersecting, expected, "at {height}");
    }
}

/// Distances of pairs without a cloud are rapier's own.
#[test]
fn queries_of_others_are_declined() {
    let (ball, cuboid) = (Ball::new(0.5), Cuboid::new(Vector::ONE));
    let ours = dispatcher();
    let pose = Pose::from_translation(Vector::Y * 2.0);
    let declined = [
        ours.distance(&pose, &cuboid, &ball).err(),
        ours.contact(&pose, &cuboid, &ball, 0.1).err(),
        ours.closest_points(&pose, &cuboid, &ball, 2.0).err(),
    ];
    assert_eq!(declined, [Some(Unsupported); 3]);
}

/// A cube in the corner of a floor and a wall. One view along the least overlap of the bounds sees one of them edge-on; the
/// default looks at both. So it is with a wall alone that the one view sees edge-on.
#[test]
fn the_camera_policy_is_that_of_the_settings() {
    let half = 0.2;
    let wall = || square(0.6).into_iter().map(|p| p.yxz() - 0.6 * Vector::X);
    let floor = || square(0.6).into_iter();
    let corner = shape(
        &floor()
            .chain(wall().map(|p| p + 0.6 * Vector::Y))
            .collect::<Vec<_>>(),
    );
    let body = shape(&cube(half));
    let pose = Pose::from_translation(Vector::new(-0.6 + half - 0.002, half - 0.001, 0.0));
    for (camera_policy, faces) in [
        (CameraPolicy::ContactZone, 2),
        (CameraPolicy::SmallestExtent, 1),
    ] {
        let config = TldiConfig {
            camera_policy,
            ..TldiConfig::default()
        };
        let ours = TldiPipeline::new(config)
            .expect("valid settings")
            .dispatcher();
        let found = contacts(&ours, &pose, &corner, &body).expect("answered");
        let is_met = |axis: Vector| {
            found
                .iter()
                .any(|(_, normal, _)| normal.dot(axis).abs() > 0.9)
        };
        let met = [Vector::X, Vector::Y]
            .into_iter()
            .filter(|axis| is_met(*axis));
        assert_eq!(met.count(), faces, "{camera_policy:?}: {found:?}");
    }
}
