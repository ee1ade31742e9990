//! Bodies with restitution, without gravity: what they do is known exactly.

use crate::common::worlds::{HALF, TestResult, attached, insert_floor};
use crate::common::{cube, shape};
use rapier3d::prelude::*;
use rapier3d_tldi::prelude::*;

/// Speed of arrival, m/s.
const SPEED: f32 = 3.0;
/// The step that arrives ends behind the surface, if nothing is there.
const WAY: f32 = 4.3 * SPEED / 60.0;
const STEPS: usize = 10;
/// Of a box of 1 kg about each axis, kg m².
const INERTIA: f32 = 2.0 / 3.0 * HALF * HALF;

fn cloud_box() -> ColliderBuilder {
    cloud_collider(shape(&cube(HALF)))
}

/// A box, as rapier's own shape and as a cloud.
fn boxes() -> [ColliderBuilder; 2] {
    [ColliderBuilder::cuboid(HALF, HALF, HALF), cloud_box()]
}

fn box_at(height: f32) -> RigidBodyBuilder {
    let mass = MassProperties::new(Vector::ZERO, 1.0, Vector::splat(INERTIA));
    RigidBodyBuilder::dynamic()
        .translation(height * Vector::Y)
        .additional_mass_properties(mass)
}

/// A weightless world with a floor, on which a body of 1 kg arrives after a few steps.
struct Arrival {
    world: PhysicsWorld,
    tldi: TldiPipeline,
    floor: RigidBodyHandle,
    body: RigidBodyHandle,
}

impl Arrival {
    /// Restitution and friction are those of both colliders.
    fn new(collider: ColliderBuilder, restitution: f32, friction: f32) -> Self {
        let (mut world, tldi) = attached();
        world.gravity = Vector::ZERO;
        let floor = insert_floor(&mut world, 1.0);
        let of_floor = &mut world.colliders[floor];
        of_floor.set_restitution(restitution);
        of_floor.set_friction(friction);
        let floor = of_floor.parent().expect("a floor has a body");
        let body = box_at(HALF + WAY).linvel(-SPEED * Vector::Y);
        let collider = collider.density(0.0).restitution(restitution);
        let (body, _) = world.insert(body, collider.friction(friction));
        Self {
            world,
            tldi,
            floor,
            body,
        }
    }

    fn step(&mut self) -> TestResult {
        for _ in 0..STEPS {
            self.tldi.step(&mut self.world)?;
        }
        Ok(())
    }

    fn body(&mut self) -> &mut RigidBody {
        &mut self.world.bodies[self.body]
    }

    /// Kinetic energy of the body, in joules.
    fn energy(&self) -> f32 {
        let body = &self.world.bodies[self.body];
        0.5 * (body.linvel().length_squared() + INERTIA * body.angvel().length_squared())
    }
}

/// A box that lands flat leaves as fast as its restitution says, without spin. Friction moves it aside by 0.1 m/s at most:
/// rapier solves the corners one after the other in each substep.
#[test]
fn boxes_rebound_as_a_whole() -> TestResult {
    for (kind, collider) in boxes().into_iter().enumerate() {
        for restitution in [0.25, 0.5, 1.0] {
            for (friction, most_aside) in [(0.0, 1e-3), (0.5, 0.15)] {
                let mut arrival = Arrival::new(collider.clone(), restitution, friction);
                arrival.step()?;
                let (velocity, turn) = (arrival.body().linvel(), arrival.body().angvel());
                let case = format!("box {kind}, {restitution}, {friction}: {velocity}, {turn}");
                let off = velocity - restitution * SPEED * Vector::Y;
                assert!(off.y.abs() < 1e-3 * SPEED, "{case}");
                assert!(off.length() < most_aside * SPEED, "{case}");
                assert!(turn.length() < 0.15, "{case}");
            }
        }
    }
    Ok(())
}

/// A box without friction that lands turning has as much energy afterwards as before, if its restitution is 1. (With friction
/// Newton's law of restitution itself adds energy: it asks for the speeds before the impact.)
#[test]
fn what_lands_turning_keeps_its_energy() -> TestResult {
    for (kind, collider) in boxes().into_iter().enumerate() {
        let mut rng = fastrand::Rng::with_seed(1);
        for _ in 0..40 {
            let mut arrival = Arrival::new(collider.clone(), 1.0, 0.0);
            let turn = [(); 3].map(|()| 4.0 * rng.f32() - 2.0);
            arrival.body().set_angvel(Vector::from(turn), true);
            let before = arrival.energy();
            arrival.step()?;
            let kept = arrival.energy() / before;
            assert!((kept - 1.0).abs() < 0.01, "box {kind}, {turn:?}: {kept}");
        }
    }
    Ok(())
}

/// Two equal boxes that meet face to face in free space swap their velocities.
#[test]
fn equal_boxes_swap_their_velocities() -> TestResult {
    let mut arrival = Arrival::new(cloud_box(), 1.0, 0.0);
    arrival.world.remove_body(arrival.floor);
    let collider = cloud_box().density(0.0).restitution(1.0).friction(0.0);
    let (other, _) = arrival.world.insert(box_at(-HALF), collider);
    arrival.step()?;
    let first = *arrival.body().vels();
    let other = *arrival.world.bodies[other].vels();
    for (velocity, expected) in [(first, 0.0), (other, -SPEED)] {
        let off = velocity.linvel - expected * Vector::Y;
        assert!(off.length() < 0.02 * SPEED, "{off}");
        assert!(velocity.angvel.length() < 0.5, "{}", velocity.angvel);
    }
    Ok(())
}

/// A floor that moves or turns adds the velocity of the place twice, wherever in the world it is, also if it dominates the
/// body: rapier measures contact points from the origin then.
#[test]
fn moving_floors_add_their_velocity() -> TestResult {
    for (place, dominance) in [(0.0, 0), (5.0, 0), (5.0, 10)] {
        for (lift, turn, aside) in [(1.0, 0.0, 0.0), (0.0, 2.0, 0.5)] {
            let mut arrival = Arrival::new(ColliderBuilder::ball(HALF), 1.0, 0.0);
            let floor = &mut arrival.world.bodies[arrival.floor];
            floor.set_body_type(RigidBodyType::KinematicVelocityBased, true);
            floor.set_dominance_group(dominance);
            floor.set_translation(place * Vector::X, true);
            floor.set_linvel(lift * Vector::Y, true);
            floor.set_angvel(turn * Vector::Z, true);
            floor.set_rotation(Rotation::from_rotation_z(-turn * 4.0 / 60.0), true);
            let at = arrival.body().translation();
            let at = at + (place + aside) * Vector::X;
            arrival.body().set_translation(at, true);
            arrival.step()?;
            let upwards = arrival.body().linvel().y;
            let expected = SPEED + 2.0 * (lift + turn * aside);
            let off = upwards - expected;
            assert!(
                off.abs() < 0.01 * expected,
                "{place}, {dominance}, {lift}, {turn}: {off}"
            );
        }
    }
    Ok(())
}

/// A floor that is moved in the very step in which it hits a box throws it as a whole.
#[test]
fn floors_that_start_to_move_throw() -> TestResult {
    for (kind, collider) in boxes().into_iter().enumerate() {
        let mut arrival = Arrival::new(collider, 1.0, 0.0);
        arrival.body().set_linvel(Vector::ZERO, true);
        arrival.body().set_translation(HALF * Vector::Y, true);
        let floor = &mut arrival.world.bodies[arrival.floor];
        floor.set_body_type(RigidBodyType::KinematicPositionBased, true);
        floor.set_next_kinematic_translation(SPEED / 60.0 * Vector::Y);
        arrival.tldi.step(&mut arrival.world)?;
        let (velocity, turn) = (arrival.body().linvel(), arrival.body().angvel());
        let off = velocity - 2.0 * SPEED * Vector::Y;
        assert!(off.length() < 0.01 * SPEED, "box {kind}: {velocity}");
        assert!(turn.length() < 0.15, "box {kind}: {turn}");
    }
    Ok(())
}

/// Contacts that carried something in the step before do not rebound. (A box on four feet may leave one of them idle. That
/// one is new to rapier.)
#[test]
fn what_rests_stays() -> TestResult {
    let mut carried = 0;
    for (collider, turn) in boxes()
        .into_iter()
        .flat_map(|b| [0.0, 0.2, 0.4, 0.6].map(|t| (b.clone(), t)))
    {
        let mut arrival = Arrival::new(collider, 0.5, 0.5);
        arrival.world.gravity = -9.81 * Vector::Y;
        arrival
            .body()
            .set_rotation(Rotation::from_rotation_y(turn), true);
        for _ in 0..30 {
            arrival.step()?;
        }
        let carries = |pair: &ContactPair| {
            let mut points = pair.manifolds().iter().flat_map(|m| &m.points);
            points.all(|point| point.data.impulse > 0.0)
        };
        if !arrival.world.narrow_phase.contact_pairs().all(carries) {
            continue;
        }
        carried += 1;
        arrival.body().set_linvel(-Vector::Y, true);
        arrival.tldi.step(&mut arrival.world)?;
        let velocity = arrival.body().linvel();
        assert!(velocity.length() < 0.1, "{turn}: {velocity}");
    }
    assert!(carried >= 4, "{carried}");
    Ok(())
}
