//! Casts of bodies that turn while they move.
//!
//! A turning body is cast in pieces. Within a piece, the rotation is that of the piece's middle,
//! and the middle of the smaller shape moves straight. This displaces points. The displacement is
//! added to the distance at which surfaces count as met, so an impact is found too early rather
//! than too late. Some points do not lie in the way and only turn towards the other shape. Contacts
//! within reach at the beginning of the piece find them.
//!
//! What touches already seems to be met in every long piece: where a body rolls or tips over, all
//! of it seems to fall with its middle. So a piece also knows the poses that the body truly takes
//! until the motion ends. What meets the other shape must be taken into it by one of them.
//!
//! Most motions meet nothing. So pieces are long at first: as far as a body may turn that rapier
//! calls slow. Only pieces in which something is met are cast again in short ones, but for those
//! that end before it can be met. The images of all pieces share one [`Room`]. Once it is used up,
//! no piece is cast again.

use super::moving::{Moving, TOUCHING, hit_of};
use super::parts::{ShapePair, rigid, surface};
use super::straight_way::StraightWay;
use crate::shape::exact::ExactShape;
use crate::step::prepared::Shared;
use arrayvec::ArrayVec;
use rapier3d::math::{Pose, Vector};
use rapier3d::parry::query::{NonlinearRigidMotion, ShapeCastHit};
use std::cell::RefCell;
use tldi::{Impact, ImpactQuery, Params, Penetration, Room};

/// Most pieces of the motion of a body that turns. Half or twice: no row of any suite changes.
const MAX_PIECES: f32 = 64.0;

/// Largest displacement of a point within a piece, in pixels. It is less than the rim that casts of
/// turning bodies leave out. Half or twice: no change in any suite.
const MAX_DISPLACEMENT: f32 = 0.5;

/// The same for pieces that only say whether anything is met, in CCD thicknesses. The ends of a
/// body then turn by half a thickness; rapier calls a faster body fast. Half or twice: no row of tunnelling
/// changes.
const SLOW: f32 = 0.25;

/// Factor of [`TOUCHING`] for fast surfaces: those that close by more than [`TOUCHING`] in one
/// piece of a motion that continues. They are met at this larger distance. Otherwise the next piece
/// could already measure them as touching, and miss them. Half or twice: no change in any suite.
const CLOSING: f32 = 1.5;

/// A sweep that stops a touching body within this distance, in pixels, holds it. Contacts are no
/// more certain than that. Half or twice: no row of any suite changes.
const BLOCKED: f32 = 1.0;

/// Depth in pixels from which a pair is deep in contact. Bodies that slide over noise are
/// shallower. Half or twice: no row of any suite changes.
const DEEP: f32 = 0.5;

/// The motion of two parts both of which may turn.
pub(super) struct Turning<'a> {
    pub(super) shared: &'a Shared,
    pub(super) moving: &'a Moving<'a>,
    pub(super) motions: &'a [NonlinearRigidMotion; 2],
    pub(super) params: Params,
    /// How they are in each other at first, in the frame of the first part.
    pub(super) penetration: Option<Penetration>,
    /// The times between which it lasts.
    pub(super) start: f32,
    pub(super) end: f32,
    /// Of the images of all pieces.
    pub(super) room: RefCell<Room>,
}

/// A piece of such a motion.
#[derive(Clone, Copy)]
struct Piece {
    from: f32,
    to: f32,
    /// What the rotation of its middle displaces points by, metres.
    displacement: f32,
}

/// What is met in a piece.
struct Met {
    hit: ShapeCastHit,
    /// A bound of the time: the hit may be later by what a piece displaces points by.
    not_before: f32,
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

    /// Poses from the second part's frame into the first one's, often enough that no point moves by more than
    /// [`MAX_DISPLACEMENT`] off its way between two of them. None without a turn.
    fn poses_after(&self, piece: &Piece) -> ArrayVec<Pose, { MAX_PIECES as usize }> {
        if (self.motions.iter()).all(|motion| motion.angvel == Vector::ZERO) {
            return ArrayVec::new();
        }
        let fine = MAX_DISPLACEMENT * self.params.pixel_size;
        let rest = self.pieces(piece.from, self.end, fine);
        rest.map(|piece| self.a_from_b(piece.to, piece.to))
            .collect()
    }

    /// The impact.
    pub(super) fn impact(&self) -> Option<ShapeCastHit> {
        let fine = MAX_DISPLACEMENT * self.params.pixel_size;
        let mut whole = self.pieces(self.start, self.end, fine);
        if whole.len() == 1 {
            return whole.find_map(|piece| self.met_by_moving(piece).map(|met| met.hit));
        }
        let coarse = fine.max(SLOW * self.moving.parts[1].ccd_thickness());
        self.pieces(self.start, self.end, coarse).find_map(|piece| {
            let met = self.met_in(piece)?;
            let finer = self.pieces(piece.from, piece.to, fine);
            if finer.len() == 1 || self.room.borrow().is_used_up() {
                return Some(met.hit);
            }
            // The last one sees what would seem to touch already in the next long piece.
            let last = finer.len() - 1;
            let mut rest = (finer.enumerate())
                .skip_while(|(k, finer)| *k < last && finer.to <= met.not_before);
            rest.find_map(|(_, piece)| self.met_in(piece).map(|met| met.hit))
        })
    }

    /// Whether what is deep in contact is held there.
    pub(super) fn is_blocked(&self, hit: &ShapeCastHit) -> bool {
        let middle = self.moving.parts[1].compute_local_aabb().center();
        let [before, held] = [self.start, hit.time_of_impact].map(|t| self.a_from_b(t, t) * middle);
        let pixel = self.params.pixel_size;
        let is_deep = self.penetration.is_some_and(|p| p.depth > DEEP * pixel);
        is_deep && hit.time_of_impact < self.end && before.distance(held) <= BLOCKED * pixel
    }

    /// What is met first in a piece.
    fn met_in(&self, piece: Piece) -> Option<Met> {
        let met = [self.met_by_moving(piece), self.met_by_turning(piece)];
        met.into_iter().flatten().reduce(|m, n| Met {
            hit: match m.hit.time_of_impact <= n.hit.time_of_impact {
                true => m.hit,
                false => n.hit,
            },
            not_before: m.not_before.min(n.not_before),
        })
    }

    /// What is met in a piece, as if the body had the rotation of the piece's middle all the while.
    fn met_by_moving(&self, piece: Piece) -> Option<Met> {
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
        let turned = self.poses_after(&piece);
        let query = ImpactQuery {
            a: surface(&a),
            b: surface(&b),
            a_from_b: rigid(way.begin(&frozen)),
            motion: way.motion(),
            touching,
            core_only: true,
            penetration: self.penetration,
            turned: &turned,
            params: self.params,
        };
        let impact = (self.shared).impact_on_the_spot(&query, &mut self.room.borrow_mut())?;
        // Not at the very start, which a solver takes for a contact that it has.
        let distance = way.from + f64::from(impact.distance);
        let earliest = distance - f64::from(displacement);
        let early = earliest.max(0.5 * distance).max(f64::from(0.5 * touching));
        let time_at = |way: f64| (f64::from(from) + f64::from(to - from) * way / length) as f32;
        let moved = way.at(&frozen, impact.distance);
        Some(Met {
            hit: hit_of(&impact, time_at(early).min(self.end), &moved),
            not_before: time_at(earliest),
        })
    }

    fn met_by_turning(&self, Piece { from, to, .. }: Piece) -> Option<Met> {
        let touching = TOUCHING * self.params.pixel_size;
        let poses = [from, to].map(|time| self.a_from_b(time, time));
        let goes_on = to < self.end;
        let (share, impact) = self.closed_by_turning(poses, touching, goes_on)?;
        let time = from + (to - from) * share;
        Some(Met {
            hit: hit_of(&impact, time, &self.a_from_b(time, time)),
            not_before: from,
        })
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
        let prediction = touching + longest.fold(0.0, f32::max).min(diameter);
        let pair = ShapePair::new(moving.parts[0], moving.parts[1], before, prediction);
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
