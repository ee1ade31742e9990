//! Distances, nearest points and contacts of clouds, and rapier's query pipeline, against analytic
//! truth.

use crate::cases::{BALL, R, SPHERE, for_all_cases, plane, shape, sphere};
use crate::common::worlds::{TestResult, attached};
use rapier3d::parry::query::{ClosestPoints, Contact, DefaultQueryDispatcher, QueryDispatcher};
use rapier3d::parry::shape::Shape;
use rapier3d::prelude::*;
use rapier3d_tldi::TldiDispatcher;
use rapier3d_tldi::prelude::*;
use rayon::prelude::*;

fn dispatcher() -> TldiDispatcher {
    TldiPipeline::new(TldiConfig::default())
        .expect("valid settings")
        .dispatcher()
}

/// Distances within the stated error, in either order, from a tenth of a radius to 40 radii.
#[test]
fn distances_of_surfaces_apart() {
    let ours = dispatcher();
    let mut rng = fastrand::Rng::with_seed(2);
    for_all_cases(|case, with_normals| {
        let name = case.name;
        let [low, high] = case.tolerance(with_normals);
        for scale in [0.1, 0.5, 2.0, 20.0] {
            for _ in 0..25 {
                let pose = case.pose(scale * R * (1.0 + rng.f32()), &mut rng);
                let truth = (case.distance)(&pose);
                let [shape1, shape2] = case.shapes;
                let answers = [
                    ours.distance(&pose, shape1, shape2),
                    ours.distance(&pose.inverse(), shape2, shape1),
                ];
                for answer in answers {
                    let distance = answer.expect("answered").distance;
                    let error = distance - truth;
                    assert!(
                        low <= error && error <= high,
                        "{name}, normals {with_normals}, {} r apart: off by {} r",
                        truth / R,
                        error / R
                    );
                }
            }
        }
    });
}

/// The nearest points are as far apart as said and lie on both surfaces; beyond the limit there
/// are none.
#[test]
fn closest_points_lie_on_both_surfaces() {
    let ours = dispatcher();
    let mut rng = fastrand::Rng::with_seed(3);
    for_all_cases(|case, with_normals| {
        let name = case.name;
        let [low, high] = case.tolerance(with_normals);
        for scale in [0.5, 10.0] {
            let pose = case.pose(scale * R, &mut rng);
            let [shape1, shape2] = case.shapes;
            let closest = |limit| ours.closest_points(&pose, shape1, shape2, limit);
            let distance = ours
                .distance(&pose, shape1, shape2)
                .expect("answered")
                .distance;
            let ClosestPoints::WithinMargin(point1, point2) =
                closest(distance + 1e-6).expect("answered")
            else {
                panic!("{name}: nothing within the distance");
            };
            let apart = point1.distance(pose * point2);
            assert!(
                (apart - distance).abs() < 1e-5,
                "{name}: {apart} {distance}"
            );
            assert_eq!(
                closest(0.99 * distance),
                Ok(ClosestPoints::Disjoint),
                "{name}"
            );
            // Each point is as far from the other surface as the shapes are.
            let bead = Ball::new(1e-5);
            let chain = ours.clone().chain(DefaultQueryDispatcher);
            for (bead_in_other, other) in [
                (pose.inverse() * Pose::from_translation(point1), shape2),
                (pose * Pose::from_translation(point2), shape1),
            ] {
                let from_other = chain.distance(&bead_in_other, other, &bead);
                let off = from_other.expect("answered").distance - distance;
                assert!(
                    low - high <= off && off <= high - low,
                    "{name}: {} r off",
                    off / R
                );
            }
        }
    });
}

/// Surfaces that cross intersect: their distance is 0, and contacts tell how deep.
#[test]
fn contacts_of_surfaces_that_cross() {
    let ours = dispatcher();
    let mut rng = fastrand::Rng::with_seed(4);
    for_all_cases(|case, with_normals| {
        let name = case.name;
        if case.has_edges {
            return; // Of a corner in a face, depth is not distance.
        }
        for depth in [0.5 * R, 2.0 * R] {
            for _ in 0..10 {
                let pose = case.pose(-depth, &mut rng);
                let [shape1, shape2] = case.shapes;
                let what = format!("{name}, normals {with_normals}, {} r deep", depth / R);
                let distance = ours.distance(&pose, shape1, shape2).expect("answered");
                assert_eq!(distance.distance, 0.0, "{what}");
                let closest = ours.closest_points(&pose, shape1, shape2, 0.0);
                assert_eq!(closest, Ok(ClosestPoints::Intersecting), "{what}");
                let ahead = checked_contact(&ours, &pose, shape1, shape2, 0.0);
                let back = checked_contact(&ours, &pose.inverse(), shape2, shape1, 0.0);
                if name == "sphere, cuboid" {
                    continue; // The same at the cuboid's edges and corners.
                }
                for contact in [ahead, back] {
                    // What the comparison is good for on curved surfaces.
                    assert!(
                        (contact.dist + depth).abs() < 0.25 * R,
                        "{what}: {contact:?}"
                    );
                }
                let turned = pose.rotation * back.normal1;
                assert!(
                    ahead.normal1.dot(turned) < -0.99,
                    "{what}: {ahead:?} {back:?}"
                );
            }
        }
    });
}

/// A contact whose frames agree with each other.
fn checked_contact(
    ours: &TldiDispatcher,
    pose: &Pose,
    shape1: &dyn Shape,
    shape2: &dyn Shape,
    prediction: f32,
) -> Contact {
    let contact = ours
        .contact(pose, shape1, shape2, prediction)
        .expect("answered")
        .expect("within the prediction");
    let normal2 = pose.rotation * contact.normal2;
    assert!(contact.normal1.distance(-normal2) < 1e-5, "{contact:?}");
    let along = (*pose * contact.point2 - contact.point1).dot(contact.normal1);
    assert!((along - contact.dist).abs() < 1e-5, "{contact:?}");
    contact
}

/// Contacts of surfaces apart are their nearest points, up to the prediction.
#[test]
fn contacts_of_surfaces_apart() {
    let mut rng = fastrand::Rng::with_seed(5);
    let ours = dispatcher();
    let floor = shape(&plane(&mut rng), true);
    let ball = Ball::new(BALL);
    let pose = Pose::from_translation(Vector::new(0.1, BALL + 0.05, 0.2));
    let contact = checked_contact(&ours, &pose, &floor, &ball, 0.06);
    assert!((contact.dist - 0.05).abs() < 1e-5, "{contact:?}");
    // The distance is flat around its least: 0.1 r aside it is 5 µm more.
    assert!(contact.normal1.distance(Vector::Y) < 0.02, "{contact:?}");
    assert!(
        contact.point1.distance(Vector::new(0.1, 0.0, 0.2)) < 0.2 * R,
        "{contact:?}"
    );
    assert_eq!(ours.contact(&pose, &floor, &ball, 0.04), Ok(None));
}

/// Which side of a surface a body is on decides where surfaces cross nowhere.
#[test]
fn surfaces_that_cross_nowhere() {
    let mut rng = fastrand::Rng::with_seed(6);
    let ours = dispatcher();
    let floor = shape(&plane(&mut rng), true);
    let distance = |pose: &Pose, shape1: &dyn Shape, shape2: &dyn Shape| {
        ours.distance(pose, shape1, shape2)
            .expect("answered")
            .distance
    };
    // An upturned sheet above the floor and one that has sunk through it.
    let upturned = |height| Pose::new(Vector::Y * height, Vector::X * std::f32::consts::PI);
    assert!((distance(&upturned(0.1), &floor, &floor) - 0.1).abs() < 1e-5);
    assert_eq!(distance(&upturned(-0.1), &floor, &floor), 0.0);
    let sunk = checked_contact(&ours, &upturned(-2.0 * R), &floor, &floor, 0.0);
    assert!((sunk.dist + 2.0 * R).abs() < 0.02 * R, "{sunk:?}");
    // A body under an open scan.
    let body = shape(&sphere(), true);
    let below = Pose::from_translation(Vector::Y * -0.5);
    assert!((distance(&below, &floor, &body) - 0.2).abs() < 0.05 * R);
    // Inside of a solid of rapier's, which is one, and of a cloud, which is a surface.
    let room = Cuboid::new(Vector::ONE);
    assert_eq!(distance(&Pose::IDENTITY, &room, &body), 0.0);
    let at_the_side = Pose::from_translation(Vector::X * 0.6);
    let inside = checked_contact(&ours, &at_the_side, &room, &body, 0.0);
    assert!((inside.dist + 0.7).abs() < 0.2 * R, "{inside:?}");
    assert!(inside.normal1.distance(Vector::X) < 0.01, "{inside:?}");
    let bead = Ball::new(0.1);
    assert!((distance(&Pose::IDENTITY, &body, &bead) - 0.2).abs() < 0.05 * R);
    // Under the shell of a mesh without inside.
    let (vertices, triangles) = room.to_trimesh();
    let shell = TriMesh::new(vertices, triangles).expect("a valid mesh");
    assert!((distance(&Pose::IDENTITY, &shell, &body) - 0.7).abs() < 0.05 * R);
    let through = Pose::from_translation(Vector::X * 0.71);
    assert_eq!(distance(&through, &shell, &body), 0.0);
}

/// Where the depth cannot be compared, as by the paper's variant with a shape of rapier's, the
/// contact says where and which way, with depth 0.
#[test]
fn contacts_without_a_comparison() {
    let mut rng = fastrand::Rng::with_seed(9);
    let config = TldiConfig {
        variant: Variant::Paper,
        ..TldiConfig::default()
    };
    let pipeline = TldiPipeline::new(config).expect("valid settings");
    let (ours, floor) = (pipeline.dispatcher(), shape(&plane(&mut rng), true));
    let (ball, pose) = (Ball::new(BALL), Pose::from_translation(Vector::Y * 0.19));
    let ahead = checked_contact(&ours, &pose, &floor, &ball, 0.0);
    let back = checked_contact(&ours, &pose.inverse(), &ball, &floor, 0.0);
    // The ball is 62 mm wide in the floor: up to 18° off at the rim.
    assert!(ahead.dist == 0.0 && ahead.normal1.y > 0.94, "{ahead:?}");
    assert!(back.dist == 0.0 && back.normal1.y < -0.94, "{back:?}");
}

/// Parts of compounds answer for themselves, those without a cloud through rapier.
#[test]
fn parts_of_compounds() {
    let mut rng = fastrand::Rng::with_seed(7);
    let ours = dispatcher();
    let floor = shape(&plane(&mut rng), true);
    let body = |height: f32| {
        Compound::new(vec![
            (
                Pose::from_translation(Vector::new(0.4, 0.0, 0.0)),
                SharedShape::ball(0.1),
            ),
            (
                Pose::new(Vector::new(-0.4, height, 0.0), Vector::new(0.3, 0.2, 0.1)),
                SharedShape::new(shape(&sphere(), true)),
            ),
        ])
    };
    for (height, part, expected) in [(0.3, 0, 0.4), (0.0, 1, 0.2), (-0.25, 1, 0.0)] {
        let (compound, pose) = (body(height), Pose::from_translation(Vector::Y * 0.5));
        let ahead = ours.distance(&pose, &floor, &compound).expect("answered");
        let back = ours
            .distance(&pose.inverse(), &compound, &floor)
            .expect("answered");
        assert!((ahead.distance - expected).abs() < 0.05 * R, "{ahead:?}");
        assert!((back.distance - ahead.distance).abs() < 1e-4, "{back:?}");
        assert_eq!((ahead.subshape1, ahead.subshape2), (0, part));
        assert_eq!((back.subshape1, back.subshape2), (part, 0));
        let contact = checked_contact(&ours, &pose, &floor, &compound, 0.5);
        let deep = if height < 0.0 { -0.05 } else { expected };
        assert!((contact.dist - deep).abs() < 0.2 * R, "{contact:?}");
        assert_eq!((contact.subshape1, contact.subshape2), (0, part));
        assert!(contact.normal1.y > 0.999, "{contact:?}");
    }
    // Two compounds whose nearest parts are no clouds.
    let pose = Pose::from_translation(Vector::Y * 0.7);
    let (below, above) = (body(-2.0), body(2.0));
    let answer = ours.distance(&pose, &below, &above).expect("answered");
    assert!((answer.distance - 0.5).abs() < 1e-4, "{answer:?}");
    let pose = Pose::from_translation(Vector::Y * 0.15);
    let contact = checked_contact(&ours, &pose, &below, &above, 0.0);
    assert!((contact.dist + 0.05).abs() < 1e-4, "{contact:?}");
    assert_eq!((contact.subshape1, contact.subshape2), (0, 0));
}

/// Rapier's scene queries on a world with a cloud for a floor.
#[test]
fn query_pipeline() -> TestResult {
    let mut rng = fastrand::Rng::with_seed(8);
    let (mut world, mut tldi) = attached();
    let floor_cloud = shape(&plane(&mut rng), true);
    let (_, floor) = world.insert(RigidBodyBuilder::fixed(), cloud_collider(floor_cloud));
    let at = Vector::new(0.5, 0.5, 0.0);
    let cuboid = ColliderBuilder::cuboid(0.1, 0.1, 0.1).translation(at);
    let (_, cuboid) = world.insert(RigidBodyBuilder::fixed(), cuboid);
    tldi.step(&mut world)?;
    let pipeline = world.broad_phase.as_query_pipeline(
        world.narrow_phase.query_dispatcher(),
        &world.bodies,
        &world.colliders,
        QueryFilter::default(),
    );

    let down = |x: f32| Ray::new(Vector::new(x, 2.0, 0.03), -Vector::Y);
    let (hit, distance) = pipeline
        .cast_ray(&down(0.1), 10.0, true)
        .expect("the floor");
    assert_eq!(hit, floor);
    assert!((distance - 2.0).abs() < 1e-5);
    let (hit, distance) = pipeline
        .cast_ray(&down(0.5), 10.0, true)
        .expect("the cuboid");
    assert_eq!(hit, cuboid);
    assert!((distance - 1.4).abs() < 1e-5);
    let slanted = Ray::new(Vector::new(-0.5, 1.0, 0.0), Vector::new(0.3, -1.0, 0.2));
    let (hit, answer) = pipeline
        .cast_ray_and_get_normal(&slanted, 10.0, true)
        .expect("the floor");
    assert_eq!((hit, answer.normal), (floor, Vector::Y));
    assert!((answer.time_of_impact - 1.0).abs() < 1e-5);

    let point = Vector::new(-0.3, 0.07, 0.2);
    let (hit, projection) = pipeline.project_point(point, 1.0, true).expect("the floor");
    assert_eq!(hit, floor);
    assert!(!projection.is_inside);
    assert!(projection.point.distance(point.with_y(0.0)) < 1e-5);

    // Shapes without and with a cloud, of which some are in the floor and some in the cuboid.
    let ball = Ball::new(0.1);
    let body = shape(&sphere(), true);
    for (query, radius) in [(&ball as &dyn Shape, 0.1), (&body, SPHERE)] {
        for (x, height, expected) in [
            (-0.5, radius + 0.01, vec![]),
            (-0.5, radius - 0.01, vec![floor]),
            (0.5, 0.6 + radius - 0.01, vec![cuboid]),
            (0.5, 0.6 + radius + 0.01, vec![]),
        ] {
            let pose = Pose::from_translation(Vector::new(x, height, 0.0));
            let hits: Vec<_> = pipeline
                .intersect_shape(pose, query)
                .map(|(handle, _)| handle)
                .collect();
            assert_eq!(hits, expected, "radius {radius} at {x}, {height}");
        }
    }
    Ok(())
}

/// A bare square sheet of `edge` × `edge` points.
fn sheet(edge: usize) -> PointCloudShape {
    let point = |k: usize| 0.02 * Vector::new((k % edge) as f32, 0.0, (k / edge) as f32);
    let points: Vec<Vector> = (0..edge * edge).map(point).collect();
    let cloud = PointCloud::builder(points).radius(0.02).build();
    PointCloudShape::new(cloud.expect("a valid cloud"))
}

/// Many threads ask for distances to clouds whose normals nobody has asked for yet: the work of finding these is shared, and
/// nobody waits for himself. Else, nearly every run of this test does not end.
#[test]
fn first_distances_may_be_asked_for_at_once() {
    let dispatcher = TldiPipeline::new(TldiConfig::default())
        .expect("the settings are valid")
        .dispatcher();
    let pool = rayon::ThreadPoolBuilder::new().num_threads(8).build();
    let asked = pool.expect("threads can be started").install(|| {
        let rounds = (0..20).map(|_| {
            let shapes: Vec<PointCloudShape> = (0..24).map(|k| sheet(90 + 2 * k)).collect();
            let above = Pose::from_translation(2.0 * Vector::Y);
            let found = (0..24 * 16).into_par_iter().map(|k| {
                let shape = &shapes[k * 7 % 24];
                dispatcher.distance(&above, shape, &Ball::new(0.1)).is_ok()
            });
            found.filter(|is_found| *is_found).count()
        });
        rounds.sum::<usize>()
    });
    assert_eq!(asked, 20 * 24 * 16);
}
