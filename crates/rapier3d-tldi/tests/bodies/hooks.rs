//! A user's physics hooks and event handler, where clouds take part: rapier asks and tells them as it does for its own
//! shapes, while surfaces deform and while they do not.

use crate::common::worlds::{HALF, REST_TOLERANCE, TestResult, attached, dynamic_at, insert_floor};
use crate::common::{SPACING, cloud, cube, square};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;
use std::sync::Mutex;
use std::sync::mpsc::channel;

/// Half the edges of the floor, metres: the cube of 0.4 m slides by less than a metre on it.
const FLOOR: f32 = 1.6;

/// Of a deforming floor, m/s.
const SLIDE: Vector = Vector::new(0.3, 0.0, -0.2);

/// What the hooks do, and what they saw.
struct UserHooks {
    /// The body and its floor, in either order.
    pair: [ColliderHandle; 2],
    /// Whether the pair may touch.
    lets: bool,
    /// What is added to the velocity of each contact, m/s.
    belt: Vector,
    /// Velocities of contacts, as they were given to the hook, of a floor that is the first collider.
    seen: Mutex<Vec<Vector>>,
}

impl UserHooks {
    fn new(pair: [ColliderHandle; 2], lets: bool) -> Self {
        Self {
            pair,
            lets,
            belt: Vector::ZERO,
            seen: Mutex::default(),
        }
    }

    /// Whether the hook is asked about the pair.
    fn is_meant(&self, collider1: ColliderHandle, collider2: ColliderHandle) -> bool {
        let [a, b] = self.pair;
        [collider1, collider2] == [a, b] || [collider1, collider2] == [b, a]
    }
}

impl PhysicsHooks for UserHooks {
    fn filter_contact_pair(&self, context: &PairFilterContext<'_>) -> Option<SolverFlags> {
        assert!(self.is_meant(context.collider1, context.collider2));
        self.lets.then_some(SolverFlags::COMPUTE_RIGID_IMPULSES)
    }

    fn filter_intersection_pair(&self, context: &PairFilterContext<'_>) -> bool {
        assert!(self.is_meant(context.collider1, context.collider2));
        self.lets
    }

    fn modify_solver_contacts(&self, context: &mut ContactModificationContext<'_>) {
        assert!(self.is_meant(context.collider1, context.collider2));
        // Velocities of contacts are those of the first body's surface.
        let sign = if context.collider1 == self.pair[1] {
            1.0
        } else {
            -1.0
        };
        let rigid = context.rigid_mut().expect("no soft body is there");
        if !self.lets {
            rigid.solver_contacts.clear();
        }
        let mut seen = self.seen.lock().expect("no hook panicked");
        for contact in rigid.solver_contacts.iter_mut() {
            seen.push(sign * contact.tangent_velocity);
            contact.tangent_velocity += sign * self.belt;
        }
    }
}

/// A cube that lies on a floor, both clouds.
struct CubeOnFloor {
    world: PhysicsWorld,
    tldi: TldiPipeline,
    body: RigidBodyHandle,
    /// The cube and the floor.
    pair: [ColliderHandle; 2],
}

impl CubeOnFloor {
    /// The cube has these hooks.
    fn new(hooks: ActiveHooks) -> Self {
        let (mut world, tldi) = attached();
        let floor = insert_floor(&mut world, FLOOR);
        let collider = tldi.collider(cloud(&cube(HALF))).active_hooks(hooks);
        let (body, cube) = world.insert(dynamic_at(HALF), collider);
        Self {
            world,
            tldi,
            body,
            pair: [cube, floor],
        }
    }

    /// Steps for a second, with the floor sliding if it deforms.
    fn run(&mut self, deforms: bool, hooks: &dyn PhysicsHooks) -> TestResult {
        let Self { world, tldi, .. } = self;
        let step = world.integration_parameters.dt * SLIDE;
        for k in 1..=60 {
            if deforms {
                let points: Vec<Vector> =
                    square(FLOOR).iter().map(|p| *p + k as f32 * step).collect();
                tldi.deform(world, self.pair[1], &points, None)?;
            }
            tldi.step_with_events(world, hooks, &())?;
        }
        Ok(())
    }

    /// [`run`](Self::run) with hooks that let the pair touch or do not.
    fn run_letting(&mut self, lets: bool, deforms: bool) -> TestResult {
        self.run(deforms, &UserHooks::new(self.pair, lets))
    }

    /// Of the body above where it lies, metres.
    fn height(&self) -> f32 {
        self.world.bodies[self.body].translation().y - HALF
    }
}

/// All ways to deform or not, and to let or not.
const CASES: [[bool; 2]; 4] = [[false, false], [false, true], [true, false], [true, true]];

/// The body falls through what the hook filters out, and lies on what it lets.
#[test]
fn filtered_pairs_do_not_touch() -> TestResult {
    for [deforms, lets] in CASES {
        let mut scene = CubeOnFloor::new(ActiveHooks::FILTER_CONTACT_PAIRS);
        scene.run_letting(lets, deforms)?;
        let height = scene.height();
        // A second of free fall: 4.9 m.
        let falls = height < -4.5;
        let lies = height.abs() < 0.02;
        assert!(
            if lets { lies } else { falls },
            "{deforms} {lets}: {height} m"
        );
    }
    Ok(())
}

/// A sensor on the floor sees the body only if the hook lets it.
#[test]
fn filtered_sensors_do_not_see() -> TestResult {
    for [deforms, lets] in CASES {
        let mut scene = CubeOnFloor::new(ActiveHooks::FILTER_INTERSECTION_PAIR);
        let [cube, floor] = scene.pair;
        scene.world.colliders[cube].set_sensor(true);
        let body = &mut scene.world.bodies[scene.body];
        body.set_gravity_scale(0.0, true);
        body.set_translation(Vector::Y * 0.5 * HALF, true);
        scene.run_letting(lets, deforms)?;
        let sees = scene.world.narrow_phase.intersection_pair(cube, floor);
        assert_eq!(sees.unwrap_or(false), lets, "deforms: {deforms}");
    }
    Ok(())
}

/// The hook is asked last: it sees the velocity of a deforming floor, and what it adds counts beside it. A conveyor belt in
/// the hook carries the body on a floor at rest as well.
#[test]
fn modified_contacts_reach_the_solver() -> TestResult {
    for deforms in [false, true] {
        let mut scene = CubeOnFloor::new(ActiveHooks::MODIFY_SOLVER_CONTACTS);
        let mut hooks = UserHooks::new(scene.pair, true);
        hooks.belt = Vector::X * 0.5;
        scene.run(deforms, &hooks)?;
        let surface = if deforms { SLIDE } else { Vector::ZERO };
        let seen = hooks.seen.into_inner()?;
        assert!(seen.len() >= 60, "{} contacts", seen.len());
        for velocity in seen {
            // All points of the floor have one velocity: their mean is that, but for rounding of positions in f32, 1e-7 m in
            // a sixtieth of a second.
            assert!(
                (velocity - surface).length() < 1e-4,
                "{velocity} of {surface}"
            );
        }
        // Friction of 0.5 brings it to the speed within 0.2 s.
        let speed = scene.world.bodies[scene.body].linvel();
        let expected = surface + hooks.belt;
        assert!(
            (speed - expected).length() < 0.05,
            "{deforms}: {speed} of {expected}"
        );
    }
    Ok(())
}

/// A floor that rises at 6 m/s, faster than rapier undoes penetrations, pushes only what the hook lets it touch.
#[test]
fn fast_floors_push_only_what_hooks_let() -> TestResult {
    for lets in [true, false] {
        let mut scene = CubeOnFloor::new(ActiveHooks::FILTER_CONTACT_PAIRS);
        scene.world.bodies[scene.body].set_gravity_scale(0.0, true);
        let hooks = UserHooks::new(scene.pair, lets);
        let rise = scene.world.integration_parameters.dt * 6.0 * Vector::Y;
        for k in 1..=3 {
            let points: Vec<Vector> = (square(FLOOR).iter())
                .map(|p| *p + k as f32 * rise)
                .collect();
            (scene.tldi).deform(&mut scene.world, scene.pair[1], &points, None)?;
            (scene.tldi).step_with_events(&mut scene.world, &hooks, &())?;
        }
        let speed = scene.world.bodies[scene.body].linvel().y;
        let is_right = if lets { speed > 5.0 } else { speed == 0.0 };
        assert!(is_right, "{lets}: {speed} m/s");
    }
    Ok(())
}

/// Hooks that count in the user data of a manifold how often they saw it, and may take its contacts away.
struct Counting {
    clears: bool,
    counts: Mutex<Vec<u32>>,
}

impl PhysicsHooks for Counting {
    fn modify_solver_contacts(&self, context: &mut ContactModificationContext<'_>) {
        let rigid = context.rigid_mut().expect("no soft body is there");
        *rigid.user_data += 1;
        let mut counts = self.counts.lock().expect("no hook panicked");
        counts.push(*rigid.user_data);
        if self.clears {
            rigid.solver_contacts.clear();
        }
    }
}

/// The user data of a manifold lasts as long as the body lies there, whether its contacts are measured in every step or kept,
/// and whether the hook leaves them to the solver.
#[test]
fn user_data_of_manifolds_lasts() -> TestResult {
    for clears in [false, true] {
        for deforms in [false, true] {
            let mut scene = CubeOnFloor::new(ActiveHooks::MODIFY_SOLVER_CONTACTS);
            let body = &mut scene.world.bodies[scene.body];
            body.set_gravity_scale(0.0, true);
            *body.activation_mut() = RigidBodyActivation::cannot_sleep();
            let counting = Counting {
                clears,
                counts: Mutex::default(),
            };
            scene.run(deforms, &counting)?;
            let counts = counting.counts.into_inner()?;
            let expected: Vec<u32> = (1..=60).collect();
            assert_eq!(counts, expected, "clears {clears}, deforms {deforms}");
        }
    }
    Ok(())
}

/// A hook that takes the contacts away lets the body fall, and is asked although only the user wants it.
#[test]
fn cleared_contacts_hold_nothing() -> TestResult {
    for deforms in [false, true] {
        let mut scene = CubeOnFloor::new(ActiveHooks::MODIFY_SOLVER_CONTACTS);
        scene.run_letting(false, deforms)?;
        let height = scene.height();
        assert!(height < -4.5, "{deforms}: {height} m");
    }
    Ok(())
}

/// A plate that lets bodies through from below.
struct OneWay;

impl PhysicsHooks for OneWay {
    fn modify_solver_contacts(&self, context: &mut ContactModificationContext<'_>) {
        context.update_as_oneway_platform(Vector::Y, 0.2);
    }
}

/// A fast ball flies up through a one-way plate, as high as without it, falls back and lies on it: sweeps do not hold what
/// the hook lets through. Its own height is half of what it moves in two steps, so it is swept.
#[test]
fn fast_bodies_pass_one_way_platforms() -> TestResult {
    let plate = sample_shape(&Cuboid::new(Vector::new(0.6, 0.05, 0.6)), SPACING)?;
    let of_cloud = cloud_collider(PointCloudShape::new(plate));
    for plate in [ColliderBuilder::cuboid(0.6, 0.05, 0.6), of_cloud] {
        let ball = sample_shape(&Ball::new(0.1), SPACING)?;
        let (mut world, mut tldi) = attached();
        let plate = plate.active_hooks(ActiveHooks::MODIFY_SOLVER_CONTACTS);
        world.insert(RigidBodyBuilder::fixed(), plate);
        let (ball, _) = world.insert(
            dynamic_at(-0.5).linvel(6.0 * Vector::Y),
            tldi.collider(ball),
        );
        let mut highest = f32::MIN;
        for _ in 0..180 {
            tldi.step_with_events(&mut world, &OneWay, &())?;
            highest = highest.max(world.bodies[ball].translation().y);
        }
        // 6² / (2 · 9.81) m above the start is 1.33 m; a sweep stops it for a part of one step, 0.1 m.
        assert!((1.2..1.35).contains(&highest), "{highest} m");
        let height = world.bodies[ball].translation().y - 0.15;
        assert!(height.abs() < REST_TOLERANCE, "{height} m");
    }
    Ok(())
}

/// A plate whose contacts are told, but push nothing.
struct Ghost;

impl PhysicsHooks for Ghost {
    fn filter_contact_pair(&self, _: &PairFilterContext<'_>) -> Option<SolverFlags> {
        Some(SolverFlags::empty())
    }
}

/// A fast ball passes such a plate, up and down, as if it were not there. Its contacts are told.
#[test]
fn fast_bodies_pass_what_must_not_push() -> TestResult {
    let flown = |plate: Option<PointCloud<'static>>| {
        let ball = sample_shape(&Ball::new(0.1), SPACING).expect("a ball has a surface");
        let (mut world, mut tldi) = attached();
        if let Some(plate) = plate {
            let plate = cloud_collider(PointCloudShape::new(plate));
            let plate = plate.active_hooks(ActiveHooks::FILTER_CONTACT_PAIRS);
            world.insert(RigidBodyBuilder::fixed(), plate);
        }
        let (ball, _) = world.insert(
            dynamic_at(-0.5).linvel(6.0 * Vector::Y),
            tldi.collider(ball),
        );
        let mut touching = 0;
        for _ in 0..90 {
            let report = tldi.step_with_events(&mut world, &Ghost, &())?;
            touching += report.pairs_in_contact;
        }
        Ok::<_, TldiError>((world.bodies[ball].translation(), touching))
    };
    let (free, _) = flown(None)?;
    let plate = sample_shape(&Cuboid::new(Vector::new(0.6, 0.05, 0.6)), SPACING)?;
    let (passed, touching) = flown(Some(plate))?;
    assert!(
        touching > 2 && passed == free,
        "{passed} instead of {free}, {touching} steps"
    );
    Ok(())
}

/// A contact begins once, its force is the weight, and it ends once: when the body is lifted, and when its collider goes.
#[test]
fn contacts_begin_push_and_end() -> TestResult {
    for removes in [false, true] {
        let CubeOnFloor {
            mut world,
            mut tldi,
            body,
            pair: [cube, floor],
        } = CubeOnFloor::new(ActiveHooks::empty());
        let (events, forces) = (
            ActiveEvents::COLLISION_EVENTS,
            ActiveEvents::CONTACT_FORCE_EVENTS,
        );
        world.colliders[cube].set_active_events(events | forces);
        world.bodies[body].set_translation(Vector::Y * (HALF + 0.05), true);
        let weight = 9.81 * world.bodies[body].mass();
        let (collision_sender, collisions) = channel();
        let (force_sender, forces) = channel();
        let (tear_sender, _tears) = channel();
        let handler = ChannelEventCollector::new(collision_sender, force_sender, tear_sender);
        // It falls by 5 cm and lies still, but is not asleep.
        for _ in 0..40 {
            tldi.step_with_events(&mut world, &(), &handler)?;
        }
        let is_pair = |one, other| [one, other] == [cube, floor] || [one, other] == [floor, cube];
        let begun: Vec<CollisionEvent> = collisions.try_iter().collect();
        assert!(
            matches!(begun[..], [CollisionEvent::Started(one, other, flags)]
            if is_pair(one, other) && flags.is_empty()),
            "{begun:?}"
        );
        let last: ContactForceEvent = forces.try_iter().last().expect("forces");
        assert!(is_pair(last.collider1, last.collider2));
        let force = last.total_force_magnitude;
        assert!(
            (force / weight - 1.0).abs() < 0.05,
            "{force} N of {weight} N"
        );

        let expected = if removes {
            world.remove_collider(cube);
            CollisionEventFlags::REMOVED
        } else {
            world.bodies[body].set_translation(Vector::Y * 2.0, true);
            CollisionEventFlags::empty()
        };
        for _ in 0..10 {
            tldi.step_with_events(&mut world, &(), &handler)?;
        }
        let ended: Vec<CollisionEvent> = collisions.try_iter().collect();
        assert!(
            matches!(ended[..], [CollisionEvent::Stopped(one, other, flags)]
            if is_pair(one, other) && flags == expected),
            "{removes}: {ended:?}"
        );
        assert_eq!(forces.try_iter().count(), 0, "nothing touches any more");
    }
    Ok(())
}
