//! The life cycle of manifolds inside rapier, and what they inherit from step to step.
//!
//! Rapier's solver indexes into a pair's manifolds; replacing them against its rules panics in
//! debug builds, or with rapier's feature `solver-bounds-checks`.

use crate::common::{cube, shape, square};
use rapier3d::geometry::SolverContact;
use rapier3d::parry::query::PersistentQueryDispatcher;
use rapier3d::parry::query::details::ContactManifoldsWorkspace;
use rapier3d::pipeline::ActiveHooks;
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use rapier3d_tldi::tldi::glamx::Vec3;
use rapier3d_tldi::tldi::{
    Backend, BackendError, ContactPatch, ContactPoint, PairQuery, PairResult,
};
use std::error::Error;
use std::f32::consts::PI;

/// Contacts of the lower box corners of one surface with the plane on top of the other's bounds,
/// split into another number of patches, in another order, at every call: no manifold keeps its
/// place.
struct Restless {
    rng: fastrand::Rng,
}

impl Backend for Restless {
    fn name(&self) -> &str {
        "restless"
    }

    fn compare(
        &mut self,
        batch: &[PairQuery<'_>],
        results: &mut Vec<PairResult>,
    ) -> Result<(), BackendError> {
        results.resize_with(batch.len(), PairResult::default);
        for (query, result) in batch.iter().zip(results) {
            result.clear();
            let volume = |extents: Vec3| extents.x * extents.z;
            let a_is_floor =
                volume(query.a.bounds().extents()) >= volume(query.b.bounds().extents());
            let (floor, body, floor_from_body) = if a_is_floor {
                (query.a, query.b, query.a_from_b)
            } else {
                (query.b, query.a, query.a_from_b.inverse())
            };
            let top = floor.bounds().max.y;
            let mut points: Vec<ContactPoint> = Vec::new();
            for corner in 0..8 {
                let bounds = body.bounds();
                let pick = |axis: usize| match corner >> axis & 1 {
                    0 => bounds.min[axis],
                    _ => bounds.max[axis],
                };
                let point = floor_from_body * Vec3::new(pick(0), pick(1), pick(2));
                let gap = point.y - top;
                if !(-0.1..query.params.prediction).contains(&gap) {
                    continue;
                }
                let ends = [point.with_y(top), point];
                let [point_a, point_b] = if a_is_floor {
                    ends
                } else {
                    [ends[1], ends[0]].map(|p| query.a_from_b * p)
                };
                points.push(ContactPoint {
                    point_a,
                    point_b,
                    gap,
                });
            }
            let normal = if a_is_floor {
                Vec3::Y
            } else {
                query.a_from_b.rotation * -Vec3::Y
            };
            self.rng.shuffle(&mut points);
            result.collides = points.iter().any(|p| p.gap < 0.0);
            for chunk in points.chunks(self.rng.usize(1..=4)) {
                result.patches.push(ContactPatch {
                    normal,
                    points: chunk.iter().copied().collect(),
                    ..ContactPatch::default()
                });
            }
        }
        Ok(())
    }
}

/// Removal, teleport, sensor toggling, new points and new shapes in the middle of a simulation in
/// which every step brings other manifolds.
fn ordeal(
    clustering: bool,
    recycling: bool,
    hooks: bool,
    kept: bool,
    seed: u64,
) -> Result<(), Box<dyn Error>> {
    let backend = Restless {
        rng: fastrand::Rng::with_seed(seed),
    };
    let config = TldiConfig {
        scatter: if kept { 0.05 } else { 0.0 },
        ..TldiConfig::default()
    };
    let mut tldi = TldiPipeline::with_backend(config, Box::new(backend))?;
    let mut world = PhysicsWorld::default();
    tldi.attach(&mut world);
    world.integration_parameters.contact_clustering = clustering;
    world.integration_parameters.contact_recycling = recycling;
    let active = if hooks {
        ActiveHooks::FILTER_INTERSECTION_PAIR
    } else {
        ActiveHooks::empty()
    };

    let half = 0.1;
    let drop = |world: &mut PhysicsWorld, x: f32, z: f32| {
        let body = RigidBodyBuilder::dynamic().translation(Vector::new(x, half + 0.02, z));
        world.insert(
            body,
            cloud_collider(shape(&cube(half))).active_hooks(active),
        )
    };
    let (first, first_collider) = drop(&mut world, -0.6, 0.0);
    let floor = cloud_collider(shape(&square(1.2))).active_hooks(active);
    let (_, floor) = world.insert(RigidBodyBuilder::fixed(), floor);
    let (second, _) = drop(&mut world, 0.0, 0.0);
    let (third, third_collider) = drop(&mut world, 0.6, 0.0);
    let mut bodies = vec![first, second, third];

    for step in 0..160 {
        match step {
            40 => {
                world.remove_body(second);
                bodies.retain(|b| *b != second);
            }
            50 => bodies.push(drop(&mut world, 0.0, 0.5).0),
            60 => {
                world.bodies[first].set_translation(Vector::new(-0.6, 1.0, 0.3), true);
                world.bodies[first].set_linvel(Vector::ZERO, true);
            }
            90 => world.colliders[third_collider].set_sensor(true),
            92 => world.colliders[third_collider].set_sensor(false),
            100 => tldi.set_points(&mut world, floor, &square(1.0), None)?,
            110 => tldi.set_points(&mut world, first_collider, &cube(0.12), None)?,
            120 => world.colliders[third_collider].set_shape(SharedShape::cuboid(half, half, half)),
            130 => world.colliders[third_collider].set_shape(SharedShape::new(shape(&cube(half)))),
            140 => world.integration_parameters.contact_clustering = !clustering,
            _ => {}
        }
        tldi.step(&mut world)?;
        for pair in world.narrow_phase.contact_pairs() {
            for manifold in pair.manifolds() {
                assert!((1..=4).contains(&manifold.points.len()));
            }
        }
    }
    for body in bodies {
        let y = world.bodies[body].translation().y;
        assert!((y - half).abs() < 0.05, "a body ended at height {y}");
    }
    Ok(())
}

#[test]
fn manifolds_survive_everything() -> Result<(), Box<dyn Error>> {
    for case in 0..16_u32 {
        let on = |bit: u32| case >> bit & 1 == 1;
        ordeal(on(0), on(1), on(2), on(3), u64::from(case))
            .map_err(|e| format!("clustering, recycling, hooks, kept: bits of {case}: {e}"))?;
    }
    Ok(())
}

/// A pipeline that measures in every step.
fn measuring_pipeline() -> TldiPipeline {
    TldiPipeline::new(TldiConfig {
        scatter: 0.0,
        ..TldiConfig::default()
    })
    .expect("valid settings")
}

/// A contact as the solver sees it, which only rapier can make.
fn some_solver_contact() -> SolverContact {
    let mut world = PhysicsWorld::default();
    world.insert(RigidBodyBuilder::fixed(), ColliderBuilder::ball(0.5));
    world.insert(
        RigidBodyBuilder::dynamic().translation(Vector::Y),
        ColliderBuilder::ball(0.5),
    );
    world.step();
    let mut pairs = world.narrow_phase.contact_pairs();
    let pair = pairs.next().expect("the balls touch");
    pair.manifolds()[0].data.solver_contacts[0]
}

/// Asks for the manifolds of two clouds as rapier's narrow phase does.
fn measure(
    tldi: &TldiPipeline,
    pos12: &Pose,
    shapes: &[PointCloudShape; 2],
    prediction: f32,
    manifolds: &mut Vec<ContactManifold>,
    workspace: &mut Option<ContactManifoldsWorkspace>,
) {
    tldi.dispatcher()
        .contact_manifolds(
            pos12, &shapes[0], &shapes[1], prediction, manifolds, workspace,
        )
        .expect("clouds are answered");
}

/// Manifolds, workspace and the impulses 1, 2, 3 … written to the points, as after a solve.
fn solved(
    tldi: &TldiPipeline,
    pos12: &Pose,
) -> (
    Vec<ContactManifold>,
    Option<ContactManifoldsWorkspace>,
    [PointCloudShape; 2],
) {
    let shapes = [shape(&square(0.6)), shape(&cube(0.1))];
    let (mut manifolds, mut workspace) = (Vec::new(), None);
    measure(tldi, pos12, &shapes, 0.02, &mut manifolds, &mut workspace);
    let contact = some_solver_contact();
    let mut impulse = 0.0;
    for manifold in &mut manifolds {
        manifold.data.user_data = 7;
        for point in &mut manifold.points {
            impulse += 1.0;
            point.data.warmstart_impulse = impulse;
            manifold.data.solver_contacts.push(contact);
        }
    }
    assert!(impulse >= 3.0, "too few contacts to tell");
    (manifolds, workspace, shapes)
}

fn impulses(manifolds: &[ContactManifold]) -> Vec<f32> {
    let points = manifolds.iter().flat_map(|m| &m.points);
    points.map(|p| p.data.warmstart_impulse).collect()
}

/// After a small motion every contact has the impulse of the nearest old one, no impulse is used
/// twice, and a workspace dropped on the way (rapier does so when a shape changes) does no harm.
#[test]
fn impulses_are_inherited() {
    let tldi = measuring_pipeline();
    let start = Pose::from_translation(Vector::Y * 0.098);
    for keep_workspace in [true, false] {
        let (mut manifolds, mut workspace, shapes) = solved(&tldi, &start);
        let old: Vec<_> = manifolds.iter().flat_map(|m| m.points.clone()).collect();
        if !keep_workspace {
            workspace = None;
        }
        let moved = Pose::from_translation(Vector::new(0.001, 0.098, 0.0005));
        measure(&tldi, &moved, &shapes, 0.02, &mut manifolds, &mut workspace);
        let mut inherited = impulses(&manifolds);
        for point in manifolds.iter().flat_map(|m| &m.points) {
            let nearest = old
                .iter()
                .min_by(|a, b| {
                    let squared = |o: &TrackedContact<ContactData>| {
                        o.local_p2.distance_squared(point.local_p2)
                    };
                    squared(a).total_cmp(&squared(b))
                })
                .expect("old contacts");
            assert_eq!(point.data.warmstart_impulse, nearest.data.warmstart_impulse);
        }
        assert!(manifolds.iter().all(|m| m.data.user_data == 7));
        assert!(manifolds.iter().all(|m| m.data.solver_contacts.is_empty()));
        inherited.sort_by(f32::total_cmp);
        inherited.dedup();
        assert_eq!(inherited.len(), old.len());
    }
}

/// Where several contacts are near a single old one, its impulse goes to one of them.
#[test]
fn an_impulse_is_inherited_once() {
    let tldi = measuring_pipeline();
    let pose = Pose::from_translation(Vector::Y * 0.098);
    let (mut manifolds, mut workspace, shapes) = solved(&tldi, &pose);
    manifolds.truncate(1);
    manifolds[0].points.truncate(1);
    let old = &mut manifolds[0].points[0];
    (old.local_p1, old.local_p2) = (Vector::ZERO, Vector::Y * -0.098);
    let old = old.data.warmstart_impulse;
    // Contacts match within the prediction distance: the middle of the face reaches all corners.
    measure(&tldi, &pose, &shapes, 0.16, &mut manifolds, &mut workspace);
    let inherited = impulses(&manifolds);
    assert!(inherited.len() >= 3, "{inherited:?}");
    assert_eq!(inherited.iter().sum::<f32>(), old);
}

/// Nothing is inherited from manifolds that the solver did not see, nor after the body has moved
/// far and stands on its head.
#[test]
fn stale_impulses_are_dropped() {
    let tldi = measuring_pipeline();
    let start = Pose::from_translation(Vector::Y * 0.098);
    let far = Pose::new(Vector::new(0.3, 0.098, 0.2), Vector::Z * PI);
    for (unsolved, pose) in [(true, start), (false, far)] {
        let (mut manifolds, mut workspace, shapes) = solved(&tldi, &start);
        if unsolved {
            manifolds
                .iter_mut()
                .for_each(|m| m.data.solver_contacts.clear());
        }
        measure(&tldi, &pose, &shapes, 0.02, &mut manifolds, &mut workspace);
        let inherited = impulses(&manifolds);
        assert!(!inherited.is_empty());
        assert!(inherited.iter().all(|i| *i == 0.0), "{inherited:?}");
    }
}
