//! Impulses outside of rapier's solver: bodies that have to separate at points.

use rapier3d::dynamics::{
    RigidBody, RigidBodyDominance, RigidBodyHandle, RigidBodySet, RigidBodyType, RigidBodyVelocity,
};
use rapier3d::geometry::Collider;
use rapier3d::math::Vector;

/// Rounds over all points: a box on four corners has come to 1 % of the velocity asked for. Half or
/// twice: no change in any suite.
const ROUNDS: usize = 10;

/// A point in which bodies have to separate.
pub(crate) struct PushedPoint {
    pub(crate) bodies: [Option<RigidBodyHandle>; 2],
    /// From the centre of mass of each body to the point, in world space, metres.
    pub(crate) arms: [Vector; 2],
    /// Unit normal from the first body towards the second.
    pub(crate) normal: Vector,
    /// Speed at which the bodies have to separate there, m/s.
    pub(crate) speed: f32,
    /// So far, Ns.
    pub(crate) impulse: f32,
}

/// Whether rapier's solver separates the two, user hooks left aside.
pub(crate) fn may_separate(collider1: &Collider, collider2: &Collider) -> bool {
    let groups = [collider1, collider2].map(Collider::solver_groups);
    !collider1.is_sensor() && !collider2.is_sensor() && groups[0].test(groups[1])
}

/// The bodies of a pair that impulses between them move: dynamic ones which the other does not dominate.
fn movable(
    bodies: &RigidBodySet,
    pair: [Option<RigidBodyHandle>; 2],
) -> [Option<RigidBodyHandle>; 2] {
    let found = pair.map(|body| bodies.get(body?));
    let dominance = found.map(|body| {
        let fixed = RigidBodyDominance::default().effective_group(&RigidBodyType::Fixed);
        body.map_or(fixed, RigidBody::effective_dominance_group)
    });
    let moves =
        |k: usize| found[k].is_some_and(RigidBody::is_dynamic) && dominance[k] <= dominance[1 - k];
    [0, 1].map(|k| pair[k].filter(|_| moves(k)))
}

/// Velocity that a unit of impulse along `normal` at the end of `arm` gives to a body that moves.
fn velocity_per_impulse(
    bodies: &RigidBodySet,
    body: Option<RigidBodyHandle>,
    arm: Vector,
    normal: Vector,
) -> RigidBodyVelocity<f32> {
    let Some(body) = body.and_then(|body| bodies.get(body)) else {
        return RigidBodyVelocity::zero();
    };
    let mass = body.mass_properties();
    RigidBodyVelocity {
        linvel: mass.effective_inv_mass * normal,
        angvel: mass.effective_world_inv_inertia * arm.cross(normal),
    }
}

/// Gives the bodies of all points the velocities that separate them there, where nothing else does.
pub(crate) fn separate(points: &mut [PushedPoint], bodies: &mut RigidBodySet) {
    for _ in 0..ROUNDS {
        for point in &mut *points {
            point.solve(bodies);
        }
    }
}

impl PushedPoint {
    /// A point in world space, in metres, where nothing has pushed yet.
    pub(crate) fn at(
        point: Vector,
        normal: Vector,
        speed: f32,
        of: [Option<RigidBodyHandle>; 2],
        bodies: &RigidBodySet,
    ) -> Self {
        let arm = |body: Option<RigidBodyHandle>| {
            let body = body.and_then(|body| bodies.get(body));
            body.map_or(Vector::ZERO, |body| point - body.center_of_mass())
        };
        Self {
            bodies: of,
            arms: of.map(arm),
            normal,
            speed,
            impulse: 0.0,
        }
    }

    /// Speed at which the bodies separate there, m/s, by the velocity of each.
    pub(crate) fn separating(
        &self,
        velocity_of: impl Fn(RigidBodyHandle) -> Option<RigidBodyVelocity<f32>>,
    ) -> f32 {
        let [first, second] = [0, 1].map(|k| {
            let velocity = self.bodies[k].and_then(&velocity_of);
            velocity.map_or(Vector::ZERO, |velocity| velocity_at(velocity, self.arms[k]))
        });
        (second - first).dot(self.normal)
    }

    /// Raises the separation speed of the bodies to the required one, or withdraws an impulse that
    /// other points made unnecessary.
    fn solve(&mut self, bodies: &mut RigidBodySet) {
        let separating = self.separating(|body| Some(*bodies.get(body)?.vels()));
        let movable = movable(bodies, self.bodies);
        let gained =
            [0, 1].map(|k| velocity_per_impulse(bodies, movable[k], self.arms[k], self.normal));
        let mobility: f32 = (gained.iter().zip(self.arms))
            .map(|(gained, arm)| velocity_at(*gained, arm).dot(self.normal))
            .sum();
        if mobility <= 0.0 {
            return;
        }
        let impulse = (self.impulse + (self.speed - separating) / mobility).max(0.0);
        let change = impulse - self.impulse;
        self.impulse = impulse;
        if change == 0.0 {
            return;
        }
        for ((body, gained), sign) in movable.into_iter().zip(gained).zip([-1.0, 1.0]) {
            if let Some(body) = body.and_then(|body| bodies.get_mut(body)) {
                let linvel = body.linvel() + sign * change * gained.linvel;
                let angvel = body.angvel() + sign * change * gained.angvel;
                // What is awake may still come to rest.
                let is_asleep = body.is_sleeping();
                body.set_linvel(linvel, is_asleep);
                body.set_angvel(angvel, is_asleep);
            }
        }
    }
}

/// Velocity at the end of an arm from the centre of mass, m/s.
fn velocity_at(velocity: RigidBodyVelocity<f32>, arm: Vector) -> Vector {
    velocity.linvel + velocity.angvel.cross(arm)
}
