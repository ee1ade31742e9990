//! Shape casts: straight ones, and those of bodies that [turn](super::turning) while they move.

use super::moving::{Moving, TOUCHING, hit_of};
use super::queries;
use super::turning::Turning;
use crate::corrections::sweeps::SweptPair;
use crate::narrow_phase::parts::{
    ShapePair, has_cloud, has_surface, pairs_of_parts, part_count, rigid, surface,
};
use crate::narrow_phase::straight_way::StraightWay;
use crate::shape::exact::ExactShape;
use crate::step::prepared::{Blocked, Shared};
use rapier3d::math::{Pose, Vector};
use rapier3d::parry::query::details::ShapeCastOptions;
use rapier3d::parry::query::{
    DefaultQueryDispatcher, NonlinearRigidMotion, QueryDispatcher, ShapeCastHit, ShapeCastStatus,
    Unsupported,
};
use rapier3d::parry::shape::Shape;
use std::cell::RefCell;
use tldi::{BackendError, ContactPoint, Impact, ImpactQuery, Params, Penetration, Room};

/// Least cosine between normal and motion by which a target distance is divided: beyond, the
/// surface is seen edge-on. Half or twice: no test of queries fails.
const LEAST_COSINE: f32 = 0.2;

/// See [`QueryDispatcher::cast_shapes`].
pub(crate) fn cast_shapes(
    shared: &Shared,
    pair: &ShapePair<'_>,
    velocity12: Vector,
    options: ShapeCastOptions,
) -> Result<Option<ShapeCastHit>, Unsupported> {
    if options.stop_at_penetration {
        let overlap = overlap(shared, pair, options.target_distance)?;
        if overlap.is_some() {
            return Ok(overlap);
        }
    }
    first_of_parts(pair, |parts, _, [pose1, pose2]| {
        let pos12 = pose1.inv_mul(&(pair.pos12 * pose2));
        let velocity = pose1.rotation.inverse() * velocity12;
        if !is_ours(parts)? {
            let [part1, part2] = parts;
            return DefaultQueryDispatcher.cast_shapes(&pos12, velocity, part1, part2, options);
        }
        let moving = Moving::new(parts);
        let (a_from_b, velocity) = if moving.is_swapped {
            let inverse = pos12.inverse();
            (inverse, inverse.rotation * -velocity)
        } else {
            (pos12, velocity)
        };
        let Some(params) = moving.params(&shared.config()) else {
            return Ok(None);
        };
        let straight = Straight {
            moving: &moving,
            a_from_b,
            velocity,
            options,
            params,
        };
        let hit = (straight.held_at_the_start(shared)).or_else(|| straight.impact(shared));
        Ok(hit.map(|hit| moving.restore(hit)))
    })
}

/// See [`QueryDispatcher::cast_shapes_nonlinear`].
pub(crate) fn cast_shapes_nonlinear(
    shared: &Shared,
    motions: [&NonlinearRigidMotion; 2],
    shapes: [&dyn Shape; 2],
    (start, end): (f32, f32),
    stop_at_penetration: bool,
) -> Result<Option<ShapeCastHit>, Unsupported> {
    let pos12_at = |time: f32| {
        let [pose1, pose2] = motions.map(|motion| motion.position_at_time(time));
        pose1.inv_mul(&pose2)
    };
    // Where a pose leaves the numbers there is no way to cast along.
    let is_finite = |time: f32| time.is_finite() && pos12_at(time).is_finite();
    if start > end {
        return Ok(None);
    }
    if !(is_finite(start) && is_finite(end)) {
        shared.fail(BackendError::Unsupported {
            pair: 0,
            reason: "a shape cast leads to poses that are not finite: give it a lower velocity or a shorter time",
        });
        return Ok(None);
    }
    let pair = ShapePair::new(shapes[0], shapes[1], pos12_at(start), 0.0);
    if stop_at_penetration && let Some(mut hit) = overlap(shared, &pair, 0.0)? {
        hit.time_of_impact = start;
        return Ok(Some(hit));
    }
    let swept = SweptPair {
        shapes,
        poses: [motions[0].start, motions[1].start],
    };
    if shared.batch().lets_through(&swept) {
        return Ok(None);
    }
    first_of_parts(&pair, |parts, indices, [pose1, pose2]| {
        let motions = [motions[0].prepend(pose1), motions[1].prepend(pose2)];
        if is_ours(parts)? {
            let moving = Moving::new(parts);
            let hit = turning_impact(shared, &moving, motions, (start, end), &swept, indices);
            return Ok(hit.map(|hit| moving.restore(hit)));
        }
        DefaultQueryDispatcher.cast_shapes_nonlinear(
            &motions[0],
            parts[0],
            &motions[1],
            parts[1],
            start,
            end,
            stop_at_penetration,
        )
    })
}

/// Whether one of two parts is a cloud. Declines it if the other one has no surface.
fn is_ours(parts: [&dyn Shape; 2]) -> Result<bool, Unsupported> {
    match parts.into_iter().any(has_cloud) {
        true if !parts.into_iter().all(has_surface) => Err(Unsupported),
        is_ours => Ok(is_ours),
    }
}

/// The earliest hit over all pairs of parts, in the frames of the wholes; `cast` gets the shapes of
/// two parts, their indices and their poses.
fn first_of_parts(
    pair: &ShapePair<'_>,
    cast: impl Fn([&dyn Shape; 2], [u32; 2], [Pose; 2]) -> Result<Option<ShapeCastHit>, Unsupported>,
) -> Result<Option<ShapeCastHit>, Unsupported> {
    let is_single = part_count(pair.shape1) * part_count(pair.shape2) == 1;
    let mut first: Option<ShapeCastHit> = None;
    for parts in pairs_of_parts(pair.shape1, pair.shape2) {
        let [pose1, pose2] = parts.wholes_from_parts();
        let hit = match cast(parts.shapes, parts.indices, [pose1, pose2]) {
            Ok(Some(hit)) => hit,
            Err(Unsupported) if is_single => return Err(Unsupported),
            // A part without a surface passes, and the others meet.
            Ok(None) | Err(Unsupported) => continue,
        };
        if first.is_none_or(|first| hit.time_of_impact < first.time_of_impact) {
            let [subshape1, subshape2] = parts.indices;
            first = Some(ShapeCastHit {
                witness1: pose1 * hit.witness1,
                witness2: pose2 * hit.witness2,
                normal1: pose1.rotation * hit.normal1,
                normal2: pose2.rotation * hit.normal2,
                subshape1,
                subshape2,
                ..hit
            });
        }
    }
    Ok(first)
}

/// A hit at time 0 if the shapes are within `target_distance` metres.
fn overlap(
    shared: &Shared,
    pair: &ShapePair<'_>,
    target_distance: f32,
) -> Result<Option<ShapeCastHit>, Unsupported> {
    let pair = ShapePair {
        prediction: target_distance,
        ..*pair
    };
    let contact = queries::contact(shared, pair)?;
    Ok(contact.map(|contact| ShapeCastHit {
        time_of_impact: 0.0,
        witness1: contact.point1,
        witness2: contact.point2,
        normal1: contact.normal1,
        normal2: contact.normal2,
        status: ShapeCastStatus::PenetratingOrWithinTargetDist,
        subshape1: contact.subshape1,
        subshape2: contact.subshape2,
    }))
}

/// The impact of two parts with these motions, before they are ordered; their `indices` are those in the pair that is
/// swept. Tells the batch if the second part is held there.
fn turning_impact(
    shared: &Shared,
    moving: &Moving<'_>,
    motions: [NonlinearRigidMotion; 2],
    (start, end): (f32, f32),
    swept: &SweptPair<'_>,
    indices: [u32; 2],
) -> Option<ShapeCastHit> {
    let motions = moving.order(motions);
    let from_1_to_2 = if moving.is_swapped { -1.0 } else { 1.0 };
    let found = shared.batch().penetration(swept, indices);
    let turning = Turning {
        shared,
        moving,
        motions: &motions,
        params: moving.params(&shared.config())?,
        penetration: found.map(|found| Penetration {
            normal: from_1_to_2 * (motions[0].start.rotation.inverse() * found.normal),
            ..found
        }),
        start,
        end,
        room: RefCell::default(),
    };
    let hit = turning.impact();
    shared.tell_coarser(turning.room.borrow().coarser());
    let hit = hit?;
    if turning.is_blocked(&hit) {
        let world_from_a = motions[0].position_at_time(hit.time_of_impact);
        let blocked = Blocked {
            point: world_from_a * hit.witness1,
            normal: from_1_to_2 * (world_from_a.rotation * hit.normal1),
        };
        shared.batch().block(swept, blocked);
    }
    Some(hit)
}

/// A straight motion of the second of two parts.
struct Straight<'a> {
    moving: &'a Moving<'a>,
    /// At the start.
    a_from_b: Pose,
    /// In the frame of the first, m/s.
    velocity: Vector,
    options: ShapeCastOptions,
    params: Params,
}

impl Straight<'_> {
    /// Where only penetrations count that the motion does not end: the deepest contact at the start that it makes deeper.
    /// Over a pixel of the way, for which a contact speaks, it must become deeper than gaps scatter.
    fn held_at_the_start(&self, shared: &Shared) -> Option<ShapeCastHit> {
        let Self {
            moving, options, ..
        } = self;
        if options.stop_at_penetration {
            return None; // that is known already
        }
        let touching = TOUCHING * self.params.pixel_size;
        let direction = self.velocity.as_dvec3().try_normalize()?.as_vec3();
        let length = self.velocity.length() * options.max_time_of_impact;
        let way = length.min(self.params.pixel_size) * direction;
        let pair = ShapePair {
            shape1: moving.parts[0],
            shape2: moving.parts[1],
            pos12: self.a_from_b,
            prediction: touching,
        };
        let mut room = Room::default();
        let found = shared.contacts_on_the_way(pair, &shared.config(), &mut room, |patches| {
            let holding = patches.iter().flat_map(|patch| {
                let approach = -patch.normal.dot(way);
                let holds = move |point: &&ContactPoint| {
                    approach > 0.0 && point.gap - approach < options.target_distance - touching
                };
                let impact = |point: &ContactPoint| Impact {
                    distance: point.gap,
                    point: point.point_a,
                    normal: patch.normal,
                    coarser: None,
                };
                patch.points.iter().filter(holds).map(impact)
            });
            holding.min_by(|m, n| m.distance.total_cmp(&n.distance))
        });
        shared.tell_coarser(room.coarser());
        found.map(|impact| ShapeCastHit {
            status: ShapeCastStatus::PenetratingOrWithinTargetDist,
            ..hit_of(&impact, 0.0, &self.a_from_b)
        })
    }

    /// The impact on the way.
    fn impact(&self, shared: &Shared) -> Option<ShapeCastHit> {
        let Self {
            moving,
            a_from_b,
            velocity,
            options,
            params,
        } = self;
        let speed = velocity.as_dvec3().length();
        let [max_time, target_distance] =
            [options.max_time_of_impact, options.target_distance].map(f64::from);
        let direction = velocity.as_dvec3().try_normalize()?;
        // A cast without an end is one of the longest that there is.
        let ahead = target_distance / f64::from(LEAST_COSINE);
        let length = (speed * max_time + ahead).min(f64::from(f32::MAX));
        let way = StraightWay::new(moving.parts, a_from_b, length * direction, params)?;
        let [a, b] = moving.parts.map(ExactShape);
        let query = ImpactQuery {
            a: surface(&a),
            b: surface(&b),
            a_from_b: rigid(way.begin(a_from_b)),
            motion: way.motion(),
            touching: match options.stop_at_penetration {
                true => 0.0,
                false => TOUCHING * params.pixel_size,
            },
            core_only: !options.stop_at_penetration,
            penetration: None,
            turned: &[],
            params: *params,
        };
        let mut room = Room::default();
        let impact = shared.impact_on_the_spot(&query, &mut room);
        shared.tell_coarser(room.coarser());
        let impact = impact?;
        let cosine = -impact.normal.dot(way.direction);
        let early = target_distance / f64::from(cosine.max(LEAST_COSINE));
        let time = (way.from + f64::from(impact.distance) - early).max(0.0) / speed;
        let moved = way.at(a_from_b, impact.distance);
        (time <= max_time).then(|| hit_of(&impact, time as f32, &moved))
    }
}
