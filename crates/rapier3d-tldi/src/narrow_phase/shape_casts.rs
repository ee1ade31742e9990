//! Shape casts: straight ones, and those of bodies that turn while they move.
//!
//! A turning body is cast in pieces. Within a piece, the rotation is that of the piece's middle,
//! and the middle of the smaller shape moves straight. This displaces points. The displacement is
//! added to the distance at which surfaces count as met, so an impact is found too early rather
//! than too late. Some points do not lie in the way and only turn towards the other shape. Contacts
//! within reach at the beginning of the piece find them. Most motions meet only what touches
//! already. So pieces are long at first: as far as a body may turn that rapier calls slow. Only
//! pieces in which something is met are cast again in short ones. The images of all pieces share one
//! [`Room`]. Once it is used up, no piece is cast again.

use super::queries;
use crate::TldiConfig;
use crate::corrections::sweeps::SweptPair;
use crate::narrow_phase::parts::{ShapePair, has_cloud, has_surface, part, part_count, surface};
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
use tldi::{BackendError, Impact, ImpactQuery, Params, Penetration, Room};

/// Most pieces of the motion of a body that turns.
const MAX_PIECES: f32 = 64.0;

/// Largest displacement of a point within a piece, in pixels. It is less than the rim that casts of
/// turning bodies leave out.
const MAX_DISPLACEMENT: f32 = 0.5;

/// The same for pieces that only say whether anything is met, in CCD thicknesses. The ends of a
/// body then turn by half a thickness; rapier calls a faster body fast.
const SLOW: f32 = 0.25;

/// Distance in pixels up to which surfaces count as touching. It is twice the scatter of measured
/// gaps (0.1), because contacts are kept until a pair has moved by that much.
const TOUCHING: f32 = 0.2;

/// Factor of [`TOUCHING`] for fast surfaces: those that close by more than [`TOUCHING`] in one
/// piece of a motion that continues. They are met at this larger distance. Otherwise the next piece
/// could already measure them as touching, and miss them.
const CLOSING: f32 = 1.5;

/// A sweep that stops a touching body within this distance, in pixels, holds it. Contacts are no
/// more certain than that.
const BLOCKED: f32 = 1.0;

/// Depth in pixels from which a pair is deep in contact. Bodies that slide over noise are
/// shallower.
const DEEP: f32 = 0.5;

/// Least cosine between normal and motion by which a target distance is divided: beyond, the
/// surface is seen edge-on.
const LEAST_COSINE: f32 = 0.2;

/// A pair of parts, the smaller one second: it is taken to move.
struct Moving<'a> {
    parts: [&'a dyn Shape; 2],
    /// Whether the second part was the first one.
    is_swapped: bool,
}

impl<'a> Moving<'a> {
    fn new([part1, part2]: [&'a dyn Shape; 2]) -> Self {
        let size = |shape: &dyn Shape| shape.compute_local_aabb().extents().length_squared();
        let is_swapped = size(part1) < size(part2);
        Self {
            parts: if is_swapped {
                [part2, part1]
            } else {
                [part1, part2]
            },
            is_swapped,
        }
    }

    /// What belongs to the parts, in their order.
    fn order<T>(&self, [of1, of2]: [T; 2]) -> [T; 2] {
        if self.is_swapped {
            [of2, of1]
        } else {
            [of1, of2]
        }
    }

    /// A hit in the order in which the parts were given.
    fn restore(&self, hit: ShapeCastHit) -> ShapeCastHit {
        if self.is_swapped { hit.swapped() } else { hit }
    }

    fn params(&self, config: &TldiConfig) -> Option<Params> {
        config.params(self.parts, 0.0)
    }
}

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
        if has_cloud(parts[0]) || has_cloud(parts[1]) {
            if !parts.into_iter().all(has_surface) {
                return Err(Unsupported);
            }
            let moving = Moving::new(parts);
            let (a_from_b, velocity) = if moving.is_swapped {
                let inverse = pos12.inverse();
                (inverse, inverse.rotation * -velocity)
            } else {
                (pos12, velocity)
            };
            let hit = straight_impact(shared, &moving, a_from_b, velocity, options);
            return Ok(hit.map(|hit| moving.restore(hit)));
        }
        DefaultQueryDispatcher.cast_shapes(&pos12, velocity, parts[0], parts[1], options)
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
    let pair = ShapePair {
        shape1: shapes[0],
        shape2: shapes[1],
        pos12: pos12_at(start),
        prediction: 0.0,
    };
    if stop_at_penetration && let Some(mut hit) = overlap(shared, &pair, 0.0)? {
        hit.time_of_impact = start;
        return Ok(Some(hit));
    }
    let swept = SweptPair {
        shapes,
        poses: [motions[0].start, motions[1].start],
    };
    first_of_parts(&pair, |parts, indices, [pose1, pose2]| {
        let motions = [motions[0].prepend(pose1), motions[1].prepend(pose2)];
        if has_cloud(parts[0]) || has_cloud(parts[1]) {
            if !parts.into_iter().all(has_surface) {
                return Err(Unsupported);
            }
            let moving = Moving::new(parts);
            let motions = moving.order(motions);
            let from_1_to_2 = if moving.is_swapped { -1.0 } else { 1.0 };
            let found = shared.batch().penetration(&swept, indices);
            let penetration = found.map(|found| Penetration {
                normal: from_1_to_2 * (motions[0].start.rotation.inverse() * found.normal),
                ..found
            });
            let Some(params) = moving.params(&shared.config()) else {
                return Ok(None);
            };
            let turning = Turning {
                shared,
                moving: &moving,
                motions: &motions,
                params,
                penetration,
                end,
                room: RefCell::default(),
            };
            let hit = turning.impact(start);
            shared.tell_coarser(turning.room.borrow().coarser());
            if let Some(hit) = hit.filter(|hit| turning.is_blocked(start, hit)) {
                let world_from_a = motions[0].position_at_time(hit.time_of_impact);
                let blocked = Blocked {
                    point: world_from_a * hit.witness1,
                    normal: from_1_to_2 * (world_from_a.rotation * hit.normal1),
                };
                shared.batch().block(&swept, blocked);
            }
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

/// The earliest hit over all pairs of parts, in the frames of the wholes; `cast` gets the shapes of
/// two parts, their indices and their poses.
fn first_of_parts(
    pair: &ShapePair<'_>,
    cast: impl Fn([&dyn Shape; 2], [u32; 2], [Pose; 2]) -> Result<Option<ShapeCastHit>, Unsupported>,
) -> Result<Option<ShapeCastHit>, Unsupported> {
    let mut first: Option<ShapeCastHit> = None;
    for i in 0..part_count(pair.shape1) {
        for j in 0..part_count(pair.shape2) {
            let ((pose1, part1), (pose2, part2)) = (part(pair.shape1, i), part(pair.shape2, j));
            let [pose1, pose2] = [pose1, pose2].map(|p| p.copied().unwrap_or(Pose::IDENTITY));
            let Some(hit) = cast([part1, part2], [i, j], [pose1, pose2])? else {
                continue;
            };
            if first.is_none_or(|first| hit.time_of_impact < first.time_of_impact) {
                first = Some(ShapeCastHit {
                    witness1: pose1 * hit.witness1,
                    witness2: pose2 * hit.witness2,
                    normal1: pose1.rotation * hit.normal1,
                    normal2: pose2.rotation * hit.normal2,
                    subshape1: i,
                    subshape2: j,
                    ..hit
                });
            }
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

/// The impact of the second part, of this velocity in the frame of the first, in m/s.
fn straight_impact(
    shared: &Shared,
    moving: &Moving<'_>,
    a_from_b: Pose,
    velocity: Vector,
    options: ShapeCastOptions,
) -> Option<ShapeCastHit> {
    let params = moving.params(&shared.config())?;
    let speed = velocity.as_dvec3().length();
    let [max_time, target_distance] =
        [options.max_time_of_impact, options.target_distance].map(f64::from);
    let direction = velocity.as_dvec3().try_normalize()?;
    // A cast without an end is one of the longest that there is.
    let length = (speed * max_time + target_distance).min(f64::from(f32::MAX));
    let way = StraightWay::new(moving.parts, &a_from_b, length * direction, &params)?;
    let [a, b] = moving.parts.map(ExactShape);
    let query = ImpactQuery {
        a: surface(&a),
        b: surface(&b),
        a_from_b: way.begin(&a_from_b),
        motion: way.motion(),
        touching: match options.stop_at_penetration {
            true => 0.0,
            false => TOUCHING * params.pixel_size,
        },
        core_only: !options.stop_at_penetration,
        penetration: None,
        params,
    };
    let mut room = Room::default();
    let impact = shared.impact_on_the_spot(&query, &mut room);
    shared.tell_coarser(room.coarser());
    let impact = impact?;
    let cosine = -impact.normal.dot(way.direction);
    let early = target_distance / f64::from(cosine.max(LEAST_COSINE));
    let time = (way.from + f64::from(impact.distance) - early).max(0.0) / speed;
    let moved = way.at(&a_from_b, impact.distance);
    (time <= max_time).then(|| hit_of(&impact, time as f32, &moved))
}

/// The motion of two parts both of which may turn.
struct Turning<'a> {
    shared: &'a Shared,
    moving: &'a Moving<'a>,
    motions: &'a [NonlinearRigidMotion; 2],
    params: Params,
    /// How they are in each other at first, in the frame of the first part.
    penetration: Option<Penetration>,
    /// The time until which it lasts.
    end: f32,
    /// Of the images of all pieces.
    room: RefCell<Room>,
}

/// A piece of such a motion.
#[derive(Clone, Copy)]
struct Piece {
    from: f32,
    to: f32,
    /// What the rotation of its middle displaces points by, metres.
    displacement: f32,
}

impl Turning<'_> {
    /// In the frame of the first part, as if the second had the rotation of another time.
    fn a_from_b(&self, time: f32, rotated_as: f32) -> Pose {
        let pose_at = |time: f32| {
            let [pose_a, pose_b] = [0, 1].map(|k: usize| self.motions[k].position_at_time(time));
            pose_a.inv_mul(&pose_b)
        };
        let middle = self.moving.parts[1].compute_local_aabb().center();
        let rotation = pose_at(rotated_as).rotation;
        Pose::from_parts(pose_at(time) * middle - rotation * middle, rotation)
    }

    /// Pieces in which no point is displaced by more than `allowed` metres, or [`MAX_PIECES`] if that takes more.
    fn pieces(
        &self,
        start: f32,
        end: f32,
        allowed: f32,
    ) -> impl ExactSizeIterator<Item = Piece> + use<> {
        let [motion_a, motion_b] = self.motions;
        let bounds = self.moving.parts[1].compute_local_aabb();
        let duration = end - start;
        let turn_by = |angvel: Vector| (angvel.as_dvec3().length() * f64::from(duration)) as f32;
        let turn_a = turn_by(motion_a.angvel);
        let turn = turn_by(motion_b.angvel - motion_a.angvel);
        // The corners of the second part turn. The way of its middle bends about the first part.
        let turned = 0.5 * turn * bounds.half_extents().length();
        let lever = [start, end]
            .map(|time| self.a_from_b(time, time) * bounds.center())
            .map(|middle| motion_a.local_center.distance(middle));
        let lever = lever[0].max(lever[1]);
        let count = (turned / allowed)
            .max(turn_a * (lever / (8.0 * allowed)).sqrt())
            .ceil()
            .clamp(1.0, MAX_PIECES);
        let diameter = 2.0 * bounds.half_extents().length();
        let time_at = move |piece: u32| start + duration * piece as f32 / count;
        (0..count as u32).map(move |piece| Piece {
            from: time_at(piece),
            to: time_at(piece + 1),
            // No turn displaces a point by more than the part's diameter.
            displacement: (turned / count).min(diameter),
        })
    }

    /// The impact.
    fn impact(&self, start: f32) -> Option<ShapeCastHit> {
        let fine = MAX_DISPLACEMENT * self.params.pixel_size;
        let mut whole = self.pieces(start, self.end, fine);
        if whole.len() == 1 {
            return whole.find_map(|piece| self.met_by_moving(piece));
        }
        let coarse = fine.max(SLOW * self.moving.parts[1].ccd_thickness());
        self.pieces(start, self.end, coarse).find_map(|piece| {
            let hit = self.hit_in(piece)?;
            let mut finer = self.pieces(piece.from, piece.to, fine);
            if finer.len() == 1 || self.room.borrow().is_used_up() {
                return Some(hit);
            }
            finer.find_map(|piece| self.hit_in(piece))
        })
    }

    /// Whether what is deep in contact is held there.
    fn is_blocked(&self, start: f32, hit: &ShapeCastHit) -> bool {
        let middle = self.moving.parts[1].compute_local_aabb().center();
        let [before, held] = [start, hit.time_of_impact].map(|t| self.a_from_b(t, t) * middle);
        let pixel = self.params.pixel_size;
        let is_deep = self.penetration.is_some_and(|p| p.depth > DEEP * pixel);
        is_deep && hit.time_of_impact < self.end && before.distance(held) <= BLOCKED * pixel
    }

    /// What is met first in a piece.
    fn hit_in(&self, piece: Piece) -> Option<ShapeCastHit> {
        let hits = [self.met_by_moving(piece), self.met_by_turning(piece)];
        (hits.into_iter().flatten()).min_by(|m, n| m.time_of_impact.total_cmp(&n.time_of_impact))
    }

    fn met_by_moving(&self, piece: Piece) -> Option<ShapeCastHit> {
        let Piece {
            from,
            to,
            displacement,
        } = piece;
        let touching = TOUCHING * self.params.pixel_size;
        let frozen = self.a_from_b(from, 0.5 * (from + to));
        let moved_to = self.a_from_b(to, 0.5 * (from + to)).translation;
        let way = moved_to.as_dvec3() - frozen.translation.as_dvec3();
        // What would seem to touch already in the next piece is met in this one.
        let beyond = if to < self.end {
            touching + 2.0 * displacement
        } else {
            0.0
        };
        let length = way.length();
        let longer = way + f64::from(beyond) * way.try_normalize()?;
        let way = StraightWay::new(self.moving.parts, &frozen, longer, &self.params)?;
        let [a, b] = self.moving.parts.map(ExactShape);
        let query = ImpactQuery {
            a: surface(&a),
            b: surface(&b),
            a_from_b: way.begin(&frozen),
            motion: way.motion(),
            touching,
            core_only: true,
            penetration: self.penetration,
            params: self.params,
        };
        let impact = (self.shared).impact_on_the_spot(&query, &mut self.room.borrow_mut())?;
        // Not at the very start, which a solver takes for a contact that it has.
        let distance = way.from + f64::from(impact.distance);
        let early = (distance - f64::from(displacement))
            .max(0.5 * distance)
            .max(f64::from(0.5 * touching));
        let time = f64::from(from) + f64::from(to - from) * early / length;
        let moved = way.at(&frozen, impact.distance);
        Some(hit_of(&impact, (time as f32).min(self.end), &moved))
    }

    fn met_by_turning(&self, Piece { from, to, .. }: Piece) -> Option<ShapeCastHit> {
        let touching = TOUCHING * self.params.pixel_size;
        let poses = [from, to].map(|time| self.a_from_b(time, time));
        let goes_on = to < self.end;
        let (share, impact) = self.closed_by_turning(poses, touching, goes_on)?;
        let time = from + (to - from) * share;
        Some(hit_of(&impact, time, &self.a_from_b(time, time)))
    }

    /// Of the contacts that a piece of the motion closes, the first one, and the share of the piece until then: what
    /// only a turning brings together. What touches at its beginning is the solver's.
    fn closed_by_turning(
        &self,
        [before, after]: [Pose; 2],
        touching: f32,
        goes_on: bool,
    ) -> Option<(f32, Impact)> {
        let Self { shared, moving, .. } = *self;
        let from_before = before.inverse();
        let way_of = |point: Vector| after * (from_before * point) - point;
        let bounds = moving.parts[1].compute_local_aabb();
        let longest = bounds
            .vertices()
            .into_iter()
            .map(|corner| way_of(before * corner).as_dvec3().length() as f32);
        // What is farther than the part is large, its motion brings it to and not its turning.
        let diameter = 2.0 * bounds.half_extents().length();
        let pair = ShapePair {
            shape1: moving.parts[0],
            shape2: moving.parts[1],
            pos12: before,
            prediction: touching + longest.fold(0.0, f32::max).min(diameter),
        };
        let room = &mut self.room.borrow_mut();
        shared.contacts_on_the_way(pair, &shared.config(), room, |patches| {
            let meetings = patches.iter().flat_map(|patch| {
                patch.points.iter().filter_map(move |point| {
                    let way = way_of(point.point_b);
                    let approach = -patch.normal.dot(way);
                    let is_fast = goes_on && approach >= touching;
                    let met = if is_fast { CLOSING } else { 1.0 } * touching;
                    let meets = point.gap > touching && point.gap - approach <= met;
                    let impact = Impact {
                        distance: point.gap,
                        point: point.point_a,
                        normal: patch.normal,
                        coarser: None,
                    };
                    meets.then(|| (((point.gap - 0.5 * touching) / approach).min(1.0), impact))
                })
            });
            meetings.min_by(|m, n| m.0.total_cmp(&n.0))
        })
    }
}

/// The hit of an impact; `a_from_b` maps from the second part's frame as it is then.
fn hit_of(impact: &Impact, time_of_impact: f32, a_from_b: &Pose) -> ShapeCastHit {
    let b_from_a = a_from_b.inverse();
    ShapeCastHit {
        time_of_impact,
        witness1: impact.point,
        witness2: b_from_a * impact.point,
        normal1: impact.normal,
        normal2: b_from_a.rotation * -impact.normal,
        status: ShapeCastStatus::Converged,
        subshape1: 0,
        subshape2: 0,
    }
}
