//! Which pairs of colliders rapier's narrow phase is going to ask about.
//!
//! Rapier offers no hook between its broad and narrow phase, so the pairs are found before its
//! step, by the same rules: enabled colliders, parents, joints, body types, groups, sleep, and bounds
//! loosened like those in its broad phase. A pair that is missed here is compared on the spot.

use crate::narrow_phase::parts::{coarsest_radius, has_cloud};
use rapier3d::dynamics::{
    ImpulseJointSet, IntegrationParameters, MultibodyJointSet, RigidBody, RigidBodyHandle,
    RigidBodySet, RigidBodyType,
};
use rapier3d::geometry::{Collider, ColliderHandle, ColliderSet};
use rapier3d::math::{Pose, Vector};

/// How much rapier's broad phase widens a collider's bounds, in units of `length_unit`, so that it
/// can ignore small motions. It is twice `CHANGE_DETECTION_FACTOR` in rapier3d's
/// `broad_phase_bvh/mod.rs`, because a collider may have moved by that much inside them.
const BROAD_PHASE_SLACK: f32 = 2.0 * 0.04;

/// How far contacts are searched when bodies approach fast, in mean radii of the coarser cloud.
/// Without it, a surface that is new in every step could stay beyond rapier's prediction distance,
/// while sweeps stop the body in front of it again and again. Half: no change in any suite; twice:
/// the shadow of a hole fails with each of 6 seeds instead of none.
const AHEAD: f32 = 1.0;

/// Two colliders whose widened bounds overlap. At least one holds a cloud.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Candidate {
    /// The collider with the lower index: rapier's collider 1.
    pub(crate) collider1: ColliderHandle,
    pub(crate) collider2: ColliderHandle,
    /// Rapier is not going to update the pair: no side is awake or was changed.
    pub(crate) asleep: bool,
    /// Rapier asks for no contacts of the pair: its joint or its body types keep it apart. Its sweeps ask nevertheless.
    pub(crate) is_apart: bool,
    /// Whether one of the bodies is a link of a multibody.
    pub(crate) has_link: bool,
}

/// All joints of a world.
pub(crate) struct Joints<'a> {
    pub(crate) impulse: &'a ImpulseJointSet,
    pub(crate) multibody: &'a MultibodyJointSet,
}

impl Joints<'_> {
    /// Whether the collider's body is a link of a multibody.
    fn has_link(&self, collider: &Collider) -> bool {
        let link = |body| self.multibody.rigid_body_link(body);
        collider.parent().and_then(link).is_some()
    }

    /// Whether rapier drops contacts between the two bodies, by the rules of rapier3d's `narrow_phase/pair_update.rs`.
    fn keep_apart(&self, body1: RigidBodyHandle, body2: RigidBodyHandle) -> bool {
        let mut between = self.impulse.joints_between(body1, body2);
        if between.any(|(_, joint)| !joint.data.contacts_enabled) {
            return true;
        }
        let links = [body1, body2].map(|body| self.multibody.rigid_body_link(body));
        let [Some(link1), Some(link2)] = links else {
            return false;
        };
        if link1.multibody != link2.multibody {
            return false;
        }
        let multibody = self.multibody.get_multibody(link1.multibody);
        let joint = self.multibody.joint_between(body1, body2);
        multibody.is_some_and(|multibody| !multibody.self_contacts_enabled())
            || joint.is_some_and(|(_, _, link)| !link.joint.data.contacts_enabled)
    }
}

/// A collider in the sweep.
struct Proxy {
    handle: ColliderHandle,
    min: Vector,
    max: Vector,
    has_cloud: bool,
}

/// Sort and sweep along the axis on which the colliders spread most: O(n log n) for n colliders,
/// plus the pairs that overlap on that axis. Keeps its memory from step to step.
#[derive(Default)]
pub(crate) struct CandidateSearch {
    proxies: Vec<Proxy>,
    open_clouds: Vec<usize>,
    open_others: Vec<usize>,
    candidates: Vec<Candidate>,
}

impl CandidateSearch {
    /// The candidate pairs in ascending order of their indices. `changed` holds the colliders whose
    /// shape was changed since the last step: rapier updates their pairs even if both sides sleep.
    pub(crate) fn find(
        &mut self,
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
        joints: &Joints<'_>,
        integration: &IntegrationParameters,
        changed: &[ColliderHandle],
    ) -> &[Candidate] {
        self.candidates.clear();
        self.collect(bodies, colliders, integration);
        if self.proxies.iter().any(|proxy| proxy.has_cloud) {
            self.sweep(bodies, colliders, joints, changed);
            self.candidates
                .sort_unstable_by_key(|c| (index(c.collider1), index(c.collider2)));
        }
        &self.candidates
    }

    /// What the last search found.
    pub(crate) fn candidates(&self) -> &[Candidate] {
        &self.candidates
    }

    fn collect(
        &mut self,
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
        integration: &IntegrationParameters,
    ) {
        let slack =
            0.5 * integration.prediction_distance() + BROAD_PHASE_SLACK * integration.length_unit;
        self.proxies.clear();
        for (handle, collider) in colliders.iter() {
            let parent = parent_of(collider, bodies);
            if !collider.is_enabled() || parent.is_some_and(|body| !body.is_enabled()) {
                continue;
            }
            let soft_ccd = parent.map_or(0.0, RigidBody::soft_ccd_prediction);
            let margin = Vector::splat(slack + collider.contact_skin() + soft_ccd);
            let bounds = collider.shape().compute_aabb(&pose_of(collider, bodies));
            let (min, max) = (bounds.mins - margin, bounds.maxs + margin);
            let has_speed =
                parent.is_none_or(|body| body.linvel().is_finite() && body.angvel().is_finite());
            if min.is_nan() || max.is_nan() || !has_speed {
                continue; // rapier quarantines it
            }
            self.proxies.push(Proxy {
                handle,
                min,
                max,
                has_cloud: has_cloud(collider.shape()),
            });
        }
    }

    fn sweep(
        &mut self,
        bodies: &RigidBodySet,
        colliders: &ColliderSet,
        joints: &Joints<'_>,
        changed: &[ColliderHandle],
    ) {
        let axis = axis_of_most_spread(&self.proxies);
        self.proxies.sort_unstable_by(|a, b| {
            let order = a.min[axis].total_cmp(&b.min[axis]);
            order.then_with(|| index(a.handle).cmp(&index(b.handle)))
        });
        let proxies = &self.proxies;
        let (clouds, others) = (&mut self.open_clouds, &mut self.open_others);
        clouds.clear();
        others.clear();
        for (i, proxy) in proxies.iter().enumerate() {
            clouds.retain(|&j| proxies[j].max[axis] >= proxy.min[axis]);
            let partners = if proxy.has_cloud {
                others.retain(|&j| proxies[j].max[axis] >= proxy.min[axis]);
                &others[..]
            } else {
                &[]
            };
            for &j in clouds.iter().chain(partners) {
                let other = &proxies[j];
                if !(proxy.min.cmple(other.max) & other.min.cmple(proxy.max)).all() {
                    continue;
                }
                let (collider1, collider2) = if index(proxy.handle) < index(other.handle) {
                    (proxy.handle, other.handle)
                } else {
                    (other.handle, proxy.handle)
                };
                let (c1, c2) = (&colliders[collider1], &colliders[collider2]);
                if !may_meet(c1, c2) {
                    continue;
                }
                let is_apart = are_apart(c1, c2, bodies, joints);
                if !is_apart || may_be_swept(c1, c2, bodies) {
                    let is_updated = |c, handle| is_awake(c, bodies) || changed.contains(handle);
                    self.candidates.push(Candidate {
                        collider1,
                        collider2,
                        asleep: !is_updated(c1, &collider1) && !is_updated(c2, &collider2),
                        is_apart,
                        has_link: [c1, c2].into_iter().any(|c| joints.has_link(c)),
                    });
                }
            }
            if proxy.has_cloud {
                clouds.push(i);
            } else {
                others.push(i);
            }
        }
    }
}

fn index(handle: ColliderHandle) -> u32 {
    handle.into_raw_parts().0
}

/// The axis along which the centres have the largest variance, boundless colliders left out.
fn axis_of_most_spread(proxies: &[Proxy]) -> usize {
    let centers = || {
        proxies
            .iter()
            .map(|proxy| proxy.min.midpoint(proxy.max).as_dvec3())
            .zip(proxies)
            .filter(|(_, proxy)| (proxy.max - proxy.min).max_element() < 1.0e9)
            .map(|(center, _)| center)
    };
    let mut count = 0.0_f64;
    let mut sums = [[0.0_f64; 2]; 3];
    for center in centers() {
        count += 1.0;
        for (axis, sum) in sums.iter_mut().enumerate() {
            sum[0] += center[axis];
            sum[1] += center[axis] * center[axis];
        }
    }
    let variance = |axis: usize| sums[axis][1] - sums[axis][0] * sums[axis][0] / count.max(1.0);
    (0..3)
        .max_by(|&a, &b| variance(a).total_cmp(&variance(b)))
        .unwrap_or(0)
}

/// The collider's body.
pub(crate) fn parent_of<'b>(
    collider: &Collider,
    bodies: &'b RigidBodySet,
) -> Option<&'b RigidBody> {
    collider.parent().and_then(|handle| bodies.get(handle))
}

/// The pose that rapier's narrow phase is going to use, to the bit: the step begins by moving the
/// colliders of bodies that the user moved.
pub(crate) fn pose_of(collider: &Collider, bodies: &RigidBodySet) -> Pose {
    match (parent_of(collider, bodies), collider.position_wrt_parent()) {
        (Some(body), Some(offset)) => *body.position() * *offset,
        _ => *collider.position(),
    }
}

/// The gap up to which rapier is going to ask for contacts, in metres, to the bit as in rapier3d's
/// `narrow_phase/pair_update.rs`: with soft continuous collision detection it covers the motion of
/// the step.
pub(crate) fn effective_prediction(
    collider1: &Collider,
    collider2: &Collider,
    bodies: &RigidBodySet,
    integration: &IntegrationParameters,
) -> f32 {
    let base = integration.prediction_distance();
    let skins = collider1.contact_skin() + collider2.contact_skin();
    let body1 = parent_of(collider1, bodies);
    let body2 = parent_of(collider2, bodies);
    let soft_ccd = |body: Option<&RigidBody>| body.map_or(0.0, RigidBody::soft_ccd_prediction);
    if soft_ccd(body1) <= 0.0 && soft_ccd(body2) <= 0.0 {
        return base + skins;
    }
    let dt = integration.dt;
    let inv_dt = if dt == 0.0 { 0.0 } else { 1.0 / dt };
    let velocity = |body: Option<&RigidBody>| {
        body.map_or(Vector::ZERO, |body| {
            body.linvel()
                .clamp_length_max(body.soft_ccd_prediction() * inv_dt)
        })
    };
    base.max(dt * (velocity(body1) - velocity(body2)).length()) + skins
}

/// The largest gap at which contacts are searched, in metres: what rapier asks, or the way by which
/// the bodies approach in the step, then at most [`AHEAD`]. Rapier keeps the contacts that are
/// reached within the step.
pub(crate) fn contact_reach(
    collider1: &Collider,
    collider2: &Collider,
    bodies: &RigidBodySet,
    integration: &IntegrationParameters,
) -> f32 {
    let [velocity1, velocity2] = [collider1, collider2].map(|collider| {
        let body = parent_of(collider, bodies);
        body.map_or(Vector::ZERO, RigidBody::linvel)
    });
    let shapes = [collider1.shape(), collider2.shape()];
    let coarsest = coarsest_radius(shapes).unwrap_or(0.0);
    let way = (velocity2 - velocity1).length() * integration.dt;
    effective_prediction(collider1, collider2, bodies, integration).max(way.min(AHEAD * coarsest))
}

/// Whether rapier's narrow phase or its sweeps look at the two: other bodies, groups that meet.
fn may_meet(collider1: &Collider, collider2: &Collider) -> bool {
    let bodies = (collider1.parent(), collider2.parent());
    let is_same_body = matches!(bodies, (Some(body1), Some(body2)) if body1 == body2);
    !is_same_body
        && collider1
            .collision_groups()
            .test(collider2.collision_groups())
}

/// Whether a joint or the types of their bodies keep the two apart. Joints let sensors see.
fn are_apart(
    collider1: &Collider,
    collider2: &Collider,
    bodies: &RigidBodySet,
    joints: &Joints<'_>,
) -> bool {
    if let (Some(body1), Some(body2)) = (collider1.parent(), collider2.parent())
        && !is_any_sensor(collider1, collider2)
        && joints.keep_apart(body1, body2)
    {
        return true;
    }
    let body_type =
        |collider| parent_of(collider, bodies).map_or(RigidBodyType::Fixed, RigidBody::body_type);
    let (type1, type2) = (body_type(collider1), body_type(collider2));
    let types_meet = |collider: &Collider| collider.active_collision_types().test(type1, type2);
    !types_meet(collider1) && !types_meet(collider2)
}

/// Whether a sweep of rapier's may hold one of the two at the other: it tests neither joints nor the types of bodies.
fn may_be_swept(collider1: &Collider, collider2: &Collider, bodies: &RigidBodySet) -> bool {
    let is_dynamic = |c| parent_of(c, bodies).is_some_and(RigidBody::is_dynamic);
    !is_any_sensor(collider1, collider2) && (is_dynamic(collider1) || is_dynamic(collider2))
}

fn is_any_sensor(collider1: &Collider, collider2: &Collider) -> bool {
    collider1.is_sensor() || collider2.is_sensor()
}

fn is_awake(collider: &Collider, bodies: &RigidBodySet) -> bool {
    parent_of(collider, bodies)
        .is_some_and(|body| body.is_dynamic_or_kinematic() && !body.is_sleeping())
}
