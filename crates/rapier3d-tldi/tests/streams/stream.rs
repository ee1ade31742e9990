//! Frames of a sensor as a collider.

use crate::common::worlds::{REST_TOLERANCE, TestResult, attached, settle};
use crate::common::{SPACING, square};
use fastrand::Rng;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use rapier3d_tldi::{CloudRecipe, RadiusRule, SeenPoints, StreamFrame};

/// Neighbours for radii and normals, asked for once.
const RECIPE: CloudRecipe = CloudRecipe {
    radii: RadiusRule::NearestNeighbors { k: 4, scale: 0.8 },
    pca_neighbors: Some(8),
    viewpoint: None,
    noise: 0.0,
    non_finite: NonFinite::Drop,
};

fn cloud_of<'a>(world: &'a PhysicsWorld, stream: &CloudStream) -> &'a PointCloud<'static> {
    let shape = world.colliders[stream.collider()].shape();
    shape
        .as_shape::<PointCloudShape>()
        .expect("a cloud")
        .cloud()
}

/// Gives a frame to the stream of a world.
fn see<'a>(
    stream: &mut CloudStream,
    world: &mut PhysicsWorld,
    tldi: &mut TldiPipeline,
    seen: impl Into<SeenPoints<'a>>,
    world_from_sensor: &Pose,
) -> Result<StreamFrame, TldiError> {
    let (bodies, colliders) = (&world.bodies, &mut world.colliders);
    stream.frame(tldi, bodies, colliders, seen, world_from_sensor)
}

/// Why the points of a frame were refused.
fn refusal(outcome: Result<StreamFrame, TldiError>) -> CloudError {
    match outcome {
        Err(TldiError::Cloud { source, .. }) => source,
        other => panic!("{other:?}"),
    }
}

/// Square grids of another size and spacing in every frame, seen from other places by a sensor that is turned:
/// radii are 0.8 × the spacing away from the rim, and normals point to the sensor.
#[test]
fn every_frame_is_made_as_it_was_asked_for() -> TestResult {
    let (mut world, mut tldi) = attached();
    let mut stream = CloudStream::new(&mut world.colliders, RECIPE)?;
    for frame in 0..12 {
        let (n, spacing) = (10 + 3 * frame, 0.01 * (1 + frame) as f32);
        let side = if frame % 2 == 0 { 1.0 } else { -1.0 };
        let turn = Rotation::from_rotation_z(0.4 * frame as f32);
        let world_from_sensor = Pose::from_parts(Vector::new(0.0, side * 2.0, 0.0), turn);
        let in_world: Vec<Vector> = (0..n * n)
            .map(|i| Vector::new((i % n) as f32, 0.0, (i / n) as f32) * spacing)
            .collect();
        let sensor_from_world = world_from_sensor.inverse();
        let mut seen: Vec<Vector> = in_world.iter().map(|p| sensor_from_world * *p).collect();
        seen.push(Vector::splat(f32::NAN));
        let taken = see(
            &mut stream,
            &mut world,
            &mut tldi,
            &seen,
            &world_from_sensor,
        )?;
        let points = (n * n) as usize;
        assert_eq!(
            taken,
            StreamFrame {
                points,
                dropped: 1,
                own: 0
            }
        );
        let cloud = cloud_of(&world, &stream);
        // Coordinates of up to 13 m, there and back, in f32.
        let off = cloud
            .points()
            .iter()
            .copied()
            .zip(&in_world)
            .map(|(p, q)| p.distance(*q));
        assert!(off.fold(0.0, f32::max) < 1e-5, "{frame}");
        let middle = (n / 2 * n + n / 2) as usize;
        assert!(
            (cloud.radius(middle) - 0.8 * spacing).abs() < 1e-4,
            "{frame}"
        );
        let normals = cloud.normals().expect("asked for");
        assert!(normals.iter().all(|n| n.y * side > 0.99), "{frame}");
        assert!(cloud.normals_oriented());
        tldi.step(&mut world)?;
    }
    Ok(())
}

/// Normals that are given are turned with the sensor, and to it.
#[test]
fn given_normals_are_turned_to_the_sensor() -> TestResult {
    let (mut world, mut tldi) = attached();
    let mut stream = CloudStream::new(&mut world.colliders, CloudRecipe::default())?;
    let world_from_sensor = Pose::from_parts(3.0 * Vector::Y, Rotation::from_rotation_z(1.2));
    let sensor_from_world = world_from_sensor.inverse();
    let points: Vec<Vector> = square(0.4).iter().map(|p| sensor_from_world * *p).collect();
    let normals: Vec<Vector> = (0..points.len())
        .map(|i| sensor_from_world.rotation * if i % 2 == 0 { Vector::Y } else { -Vector::Y })
        .collect();
    see(
        &mut stream,
        &mut world,
        &mut tldi,
        SeenPoints {
            normals: Some(&normals),
            ..SeenPoints::from(&points)
        },
        &world_from_sensor,
    )?;
    let cloud = cloud_of(&world, &stream);
    let found = cloud.normals().expect("given");
    assert!(found.iter().all(|n| n.distance(Vector::Y) < 1e-5) && cloud.normals_oriented());
    let few = &normals[1..];
    let refused = see(
        &mut stream,
        &mut world,
        &mut tldi,
        SeenPoints {
            normals: Some(few),
            ..SeenPoints::from(&points)
        },
        &world_from_sensor,
    );
    assert!(matches!(
        refusal(refused),
        CloudError::LengthMismatch { .. }
    ));
    Ok(())
}

/// A ball that sleeps on a streamed floor wakes and falls when a frame is empty, and is held by the next one
/// with points. No contact is left in between.
#[test]
fn an_empty_frame_holds_nothing() -> TestResult {
    let (mut world, mut tldi) = attached();
    let mut stream = CloudStream::new(&mut world.colliders, RECIPE)?;
    let sensor = Pose::from_translation(2.0 * Vector::Y);
    let floor = |y: f32| -> Vec<Vector> {
        square(0.8)
            .iter()
            .map(|p| *p + Vector::Y * (y - 2.0))
            .collect()
    };
    let ball = RigidBodyBuilder::dynamic().translation(0.1 * Vector::Y);
    let (ball, _) = world.insert(ball, ColliderBuilder::ball(0.1));
    let contacts = |tldi: &TldiPipeline, w: &PhysicsWorld| {
        tldi.contacts(&w.narrow_phase, &w.colliders).count()
    };

    see(&mut stream, &mut world, &mut tldi, &floor(0.0), &sensor)?;
    settle(&mut world, &mut tldi)?;
    assert!((world.bodies[ball].translation().y - 0.1).abs() < REST_TOLERANCE);
    assert!(world.bodies[ball].is_sleeping() && contacts(&tldi, &world) > 0);

    let nothing = [Vector::splat(f32::NAN); 3];
    for empty in [&nothing[..0], &nothing[..]] {
        let taken = see(&mut stream, &mut world, &mut tldi, empty, &sensor)?;
        assert_eq!((taken.points, taken.dropped), (0, empty.len()));
        assert!(!world.colliders[stream.collider()].is_enabled());
        assert_eq!(cloud_of(&world, &stream).len(), 1, "no point is kept");
        for _ in 0..10 {
            let report = tldi.step(&mut world)?;
            assert_eq!((report.pairs_in_contact, report.pairs_batched), (0, 0));
        }
        assert!(!world.bodies[ball].is_sleeping());
        assert_eq!(contacts(&tldi, &world), 0);
    }
    // 20 steps of free fall are 0.57 m: the floor is back below it.
    assert!(world.bodies[ball].translation().y < -0.3);
    see(&mut stream, &mut world, &mut tldi, &floor(-1.0), &sensor)?;
    settle(&mut world, &mut tldi)?;
    assert!((world.bodies[ball].translation().y + 0.9).abs() < REST_TOLERANCE);
    Ok(())
}

/// Drivers write (0, 0, 0) where a ray met nothing: no point is where the sensor is, whatever comes with it.
#[test]
fn rays_without_a_return_leave_no_points() -> TestResult {
    let (mut world, mut tldi) = attached();
    let mut stream = CloudStream::new(&mut world.colliders, RECIPE)?;
    let sensor = Pose::from_translation(2.0 * Vector::Y);
    let floor: Vec<Vector> = (square(0.8).iter()).map(|p| *p - 2.0 * Vector::Y).collect();
    let mut seen = floor.clone();
    seen.insert(3, Vector::ZERO);
    seen.extend([Vector::ZERO, -Vector::ZERO]);
    let (normals, radii) = (vec![Vector::Y; seen.len()], vec![SPACING; seen.len()]);
    let told = SeenPoints {
        points: &seen,
        normals: Some(&normals),
        radii: Some(&radii),
    };
    let expected = StreamFrame {
        points: floor.len(),
        dropped: 3,
        own: 0,
    };
    for frame in [told, SeenPoints::from(&seen)] {
        let taken = see(&mut stream, &mut world, &mut tldi, frame, &sensor)?;
        assert_eq!(taken, expected);
        let cloud = cloud_of(&world, &stream);
        assert!(cloud.points().iter().all(|p| p.y.abs() < 1e-6));
    }
    let nothing = [Vector::ZERO; 4];
    let taken = see(&mut stream, &mut world, &mut tldi, &nothing[..], &sensor)?;
    assert_eq!((taken.points, taken.dropped), (0, 4));
    assert!(!world.colliders[stream.collider()].is_enabled());
    let recipe = CloudRecipe {
        non_finite: NonFinite::Refuse,
        ..RECIPE
    };
    let mut strict = CloudStream::new(&mut world.colliders, recipe)?;
    let refused = refusal(see(&mut strict, &mut world, &mut tldi, &seen, &sensor));
    assert!(matches!(
        refused,
        CloudError::NonFinite { index: 3, count: 3 }
    ));
    Ok(())
}

/// A stream enables what it disabled itself, and not what the user disabled.
#[test]
fn what_the_user_disables_stays_so() -> TestResult {
    let (mut world, mut tldi) = attached();
    let mut stream = CloudStream::new(&mut world.colliders, RECIPE)?;
    for (disables, is_enabled) in [(false, true), (true, false)] {
        if disables {
            world.colliders[stream.collider()].set_enabled(false);
        }
        see(
            &mut stream,
            &mut world,
            &mut tldi,
            &square(0.8),
            &Pose::IDENTITY,
        )?;
        assert_eq!(world.colliders[stream.collider()].is_enabled(), is_enabled);
    }
    Ok(())
}

/// A single point has no neighbours: it has the radius of the frame before, or the frame is refused.
#[test]
fn a_single_point_is_taken() -> TestResult {
    let (mut world, mut tldi) = attached();
    let mut stream = CloudStream::new(&mut world.colliders, RECIPE)?;
    let sensor = Pose::from_translation(2.0 * Vector::Y);
    let one = [-2.0 * Vector::Y];
    let refused = see(&mut stream, &mut world, &mut tldi, &one[..], &sensor);
    assert!(matches!(refusal(refused), CloudError::NoSpacing { .. }));
    see(&mut stream, &mut world, &mut tldi, &square(0.4), &sensor)?;
    let mean = cloud_of(&world, &stream).mean_radius();
    let taken = see(&mut stream, &mut world, &mut tldi, &one[..], &sensor)?;
    assert_eq!(taken.points, 1);
    let cloud = cloud_of(&world, &stream);
    assert_eq!((cloud.len(), cloud.mean_radius()), (1, mean));
    Ok(())
}

/// A moving link in front of the sensor leaves no points; the floor below it does.
#[test]
fn own_links_are_left_out_where_they_are() -> TestResult {
    let (mut world, mut tldi) = attached();
    let link = RigidBodyBuilder::kinematic_position_based().translation(Vector::Y);
    let (link, collider) = world.insert(link, ColliderBuilder::ball(0.2));
    let recipe = CloudRecipe {
        radii: RadiusRule::Global(SPACING),
        ..CloudRecipe::default()
    };
    let mut stream = CloudStream::new(&mut world.colliders, recipe)?.without([collider], 0.01);
    let sensor = Pose::from_translation(2.0 * Vector::Y);
    let mut rng = Rng::with_seed(8);
    for frame in 0..20 {
        let center = Vector::new(0.05 * frame as f32, 1.0, 0.0);
        world.bodies[link].set_next_kinematic_translation(center);
        tldi.step(&mut world)?;
        let mut seen: Vec<Vector> = square(0.8);
        let floor = seen.len();
        for _ in 0..500 {
            let noise = Vector::new(rng.f32(), rng.f32(), rng.f32()) - Vector::splat(0.5);
            let on_link = center + 0.2 * noise.normalize() * (1.0 + 0.08 * (rng.f32() - 0.5));
            seen.push(on_link);
        }
        seen.iter_mut().for_each(|p| *p -= 2.0 * Vector::Y);
        let taken = see(&mut stream, &mut world, &mut tldi, &seen, &sensor)?;
        assert_eq!(
            taken,
            StreamFrame {
                points: floor,
                dropped: 0,
                own: 500
            }
        );
    }
    world.remove_body(link);
    let refused = see(&mut stream, &mut world, &mut tldi, &square(0.8), &sensor);
    assert_eq!(refused, Err(TldiError::NoSuchCollider(collider)));
    Ok(())
}

/// A link that was put elsewhere since the last step is left out there.
#[test]
fn own_links_that_were_moved_are_left_out() -> TestResult {
    let (mut world, mut tldi) = attached();
    let collider = ColliderBuilder::ball(0.2).translation(0.1 * Vector::X);
    let (link, collider) = world.insert(RigidBodyBuilder::fixed(), collider);
    let recipe = CloudRecipe {
        radii: RadiusRule::Global(SPACING),
        ..CloudRecipe::default()
    };
    let mut stream = CloudStream::new(&mut world.colliders, recipe)?.without([collider], 0.01);
    world.bodies[link].set_translation(2.0 * Vector::Y, true);
    let [now, before] = [2.0, 0.0].map(|y| Vector::new(0.2, y, 0.0));
    let seen = [now, before];
    let taken = see(
        &mut stream,
        &mut world,
        &mut tldi,
        &seen[..],
        &Pose::IDENTITY,
    )?;
    assert_eq!((taken.points, taken.own), (1, 1));
    assert_eq!(cloud_of(&world, &stream).points(), [before]);
    Ok(())
}

#[test]
fn what_cannot_be_followed_is_refused() -> TestResult {
    let (mut world, mut tldi) = attached();
    let bad = CloudRecipe {
        pca_neighbors: Some(1),
        ..CloudRecipe::default()
    };
    assert!(matches!(
        CloudStream::new(&mut world.colliders, bad),
        Err(CloudError::BadParameter { .. })
    ));
    let mut stream = CloudStream::new(&mut world.colliders, CloudRecipe::default())?;
    let nowhere = Pose::from_translation(Vector::new(0.0, f32::NAN, 0.0));
    let refused = see(&mut stream, &mut world, &mut tldi, &square(0.4), &nowhere);
    assert!(matches!(refusal(refused), CloudError::BadParameter { .. }));
    Ok(())
}

/// Radii that a frame tells are those of its points, also where points are left out or not finite; and the recipe's again
/// in a frame that tells none.
#[test]
fn radii_may_come_with_a_frame() -> TestResult {
    let (mut world, mut tldi) = attached();
    let link = world.colliders.insert(ColliderBuilder::ball(0.15));
    let mut stream = CloudStream::new(&mut world.colliders, RECIPE)?.without([link], 0.0);
    let mut points = square(0.4);
    points[3] = Vector::NAN;
    let radii: Vec<f32> = (0..points.len()).map(|i| 0.2 + 1e-4 * i as f32).collect();
    let seen = SeenPoints {
        radii: Some(&radii),
        ..SeenPoints::from(&points)
    };
    let taken = see(&mut stream, &mut world, &mut tldi, seen, &Pose::IDENTITY)?;
    // The sensor is in the middle of the square, where no point can be seen.
    assert!(taken.own > 0 && taken.dropped == 2);
    let cloud = cloud_of(&world, &stream);
    assert!(cloud.normals().is_some());
    for (i, point) in cloud.points().iter().copied().enumerate() {
        let given = points
            .iter()
            .position(|p| *p == point)
            .expect("one of them");
        assert_eq!(cloud.radius(i), radii[given]);
    }
    let few = SeenPoints {
        radii: Some(&radii[1..]),
        ..SeenPoints::from(&points)
    };
    let refused = see(&mut stream, &mut world, &mut tldi, few, &Pose::IDENTITY);
    assert!(matches!(
        refusal(refused),
        CloudError::LengthMismatch {
            attribute: "radii",
            ..
        }
    ));
    see(&mut stream, &mut world, &mut tldi, &points, &Pose::IDENTITY)?;
    assert!(cloud_of(&world, &stream).max_radius() < 0.1);
    Ok(())
}

/// A box lies on a floor that rises at `floor_speed` m/s. A camera that turns and flies down at 3 m/s sees the floor for a second;
/// the stream's collider is always where the camera is. Returns the largest speed of the box, m/s.
fn speed_seen_from_a_camera(floor_speed: f32) -> Result<f32, Box<dyn std::error::Error>> {
    let (mut world, mut tldi) = attached();
    let recipe = CloudRecipe {
        radii: RadiusRule::Global(SPACING),
        ..CloudRecipe::default()
    };
    let mut stream = CloudStream::new(&mut world.colliders, recipe)?;
    let above = RigidBodyBuilder::dynamic().translation(0.2 * Vector::Y);
    let (body, _) = world.insert(above, ColliderBuilder::cuboid(0.2, 0.2, 0.2));
    let dt = world.integration_parameters.dt;
    let (mut rng, mut fastest) = (Rng::with_seed(4), 0.0_f32);
    for k in 0..60 {
        let seconds = k as f32 * dt;
        let turn = Rotation::from_rotation_z(0.5 * seconds);
        let camera = Pose::from_parts((4.0 - 3.0 * seconds) * Vector::Y, turn);
        let sensor_from_world = camera.inverse();
        let moved = Vector::new(0.01 * rng.f32(), floor_speed * seconds, 0.01 * rng.f32());
        let floor = square(1.2);
        let seen: Vec<Vector> = (floor.iter().map(|p| sensor_from_world * (*p + moved))).collect();
        world.colliders[stream.collider()].set_position(camera);
        see(&mut stream, &mut world, &mut tldi, &seen, &camera)?;
        tldi.step(&mut world)?;
        fastest = fastest.max(world.bodies[body].linvel().length());
    }
    Ok(fastest)
}

/// What stands still in the world does not move because the camera does, and what moves has its own speed.
#[test]
fn a_moving_camera_moves_nothing() -> TestResult {
    let still = speed_seen_from_a_camera(0.0)?;
    assert!(still < 0.1, "{still} m/s");
    let rising = speed_seen_from_a_camera(2.0)?;
    assert!((1.5..3.0).contains(&rising), "{rising} m/s");
    Ok(())
}
