//! Reduces contact pixels to contact patches: the last stage, on the CPU for every backend.
//!
//! Pixels are grouped by neighbourhood and normal. What a group yields follows its pixels
//! continuously: normals and the deepest point are weighted means, and the support points are
//! chosen for extent first, so that near-ties in depth do not move them from frame to frame.

use crate::contact::gap_fit::GapFit;
use crate::contact::links::{Groups, Links, find_roots};
use crate::contact::lone_points::LonePoints;
use crate::contact::main_plane::LEAST_PLANE;
use crate::contact::neighbors::Culled;
use crate::contact::noise::allow_for_noise;
use crate::contact::part_shape::{Pixels, Shape, ShapeScratch};
use crate::contact::smooth::{Smooth, smooth};
use crate::contact::way_out::WayOut;
use crate::cpu::sweep::SAME_FACE;
use crate::plan::first_is_smaller;
use crate::stage::stage;
use crate::{ContactPatch, ContactPixel, PATCH_POINTS, PairQuery, PairResult, Params, Surface};
use arrayvec::ArrayVec;
use glamx::Vec3;
use std::cmp::Ordering;
use std::ops::Range;

/// Most patches of one pair. The deepest are kept; a solver gains nothing from more. Half or twice: no row changes.
pub const MAX_PATCHES: usize = 32;

/// Linked pixels belong to one group if their smoothed normals are within 30°. Half or twice the angle: no change.
const SAME_GROUP: f32 = 0.866;

/// A part whose pixels' unit normals have a mean shorter than this (a spread of about 14°) is split. Half or twice the
/// rest to 1: no change.
const SPLIT_BELOW: f32 = 0.97;

/// Splits in a row: at most eight parts a group. Half or twice: no change.
const MAX_SPLITS: u32 = 3;

/// Cosine of the angle (10°) between normals of one plane. Parts on one plane share a patch, wherever they are, so that its few
/// points are chosen among all. (Rapier merges manifolds within 5.1° and keeps the deepest points, which need not be those
/// that bear the load.) Half the angle: a ball in a groove fails with 2 of 6 seeds instead of none; twice: no change.
pub const SAME_PLANE: f32 = 0.985;

/// Memory of [`PatchScratch::reduce`], kept from call to call.
#[derive(Debug, Default)]
pub struct PatchScratch {
    /// The group of each contact pixel: the first pixel in it.
    group: Vec<u32>,
    links: Links,
    way_out: WayOut,
    pub(crate) lone_points: LonePoints,
    gap_fit: GapFit,
    smooth: Vec<Smooth>,
    groups: Groups,
    stack: Vec<(usize, usize, u32)>,
    parts: Vec<GroupPart>,
    /// Members of the parts of one patch, and of one of its groups.
    patch: Vec<u32>,
    spot: Vec<u32>,
    shape: ShapeScratch,
    /// Of the pair: see [`Pixels`].
    end_in_discs: bool,
}

/// Some of the members, and what decides which patch they belong to.
#[derive(Debug)]
struct GroupPart {
    members: Range<usize>,
    normal: Vec3,
    least_gap: f32,
}

impl PatchScratch {
    /// Confirms the contact pixels of `result`, sets `collides` and `gap` by them as if normals told inside from outside, and
    /// fills the patches, deepest first.
    ///
    /// The contact pixels may come in any order. Afterwards they are ordered by view, row and column; of one pixel, the
    /// greatest gap comes first. Those beyond the prediction tell the shape of patches and are dropped afterwards. The axes of
    /// `result` are those of the pixels' views. Cost: linear in the pixels, except for sorting the groups, and the pixels if
    /// needed.
    pub fn reduce(&mut self, result: &mut PairResult, params: &Params) {
        let _stage = stage!("patches");
        self.end_in_discs = true;
        self.link(result, params);
        self.reduce_linked(result, params, None);
    }

    /// [`reduce`](Self::reduce) without the contact pixels of points that stand alone: flying pixels
    /// of a depth camera, dust. A point stands alone if the distance to its fourth nearest neighbour is 2.5
    /// times that of one of these four neighbours. Cost beside that of `reduce`: where there
    /// are components of few contact pixels, a pass over the points of the blocks around them.
    ///
    /// Returns whether there were such points. They hide what lies behind them, so the CPU backend then compares the pair
    /// again without them.
    pub fn reduce_pair(&mut self, result: &mut PairResult, query: &PairQuery) -> bool {
        self.reduce_culled(result, query, [None; 2])
    }

    /// [`reduce_pair`](Self::reduce_pair) where all points of each cloud that can touch may be at hand.
    pub(crate) fn reduce_culled(
        &mut self,
        result: &mut PairResult,
        query: &PairQuery,
        culled: [Option<Culled>; 2],
    ) -> bool {
        let _stage = stage!("patches");
        self.link(result, &query.params);
        let are_lone_points = self.lone_points.drop(result, &self.links, query, culled);
        if are_lone_points {
            self.links.find(&result.contacts, &query.params);
        }
        self.finish(result, query, 0.0);
        are_lone_points
    }

    /// [`reduce`](Self::reduce) of the contact pixels of a first look, in which no point stands alone. The surfaces are
    /// taken to cross; the caller has to prove it. A large pixel may hold surfaces that only touch, and where bodies coincide
    /// such pixels are everywhere. So overlaps of less than a layer prove nothing.
    pub(crate) fn reduce_coarse(&mut self, result: &mut PairResult, query: &PairQuery) {
        let _stage = stage!("patches");
        result.collides = true;
        self.link(result, &query.params);
        self.finish(result, query, query.params.thickness);
    }

    fn link(&mut self, result: &mut PairResult, params: &Params) {
        order(&mut result.contacts);
        drop_between_faces(result);
        self.way_out.keep_least(result, params);
        self.links.find(&result.contacts, params);
    }

    /// Reduces linked contact pixels by what is known of both surfaces. `least_proof`: see [`Links::confirm`].
    fn finish(&mut self, result: &mut PairResult, query: &PairQuery, least_proof: f32) {
        self.end_in_discs = !smaller_is_exact(query);
        let tells_inside = query.a.is_oriented() || query.b.is_oriented();
        let least_proof = (!tells_inside).then_some(least_proof);
        self.reduce_linked(result, &query.params, least_proof);
        let fitted = self.smooth.iter().map(|pixel| pixel.gap);
        allow_for_noise(result, fitted.reduce(f32::min), query);
    }

    fn reduce_linked(
        &mut self,
        result: &mut PairResult,
        params: &Params,
        least_proof: Option<f32>,
    ) {
        self.links
            .confirm(result, params, least_proof, &mut self.group);
        let (contacts, out) = (&result.contacts, &mut result.patches);
        out.clear();
        self.smooth.clear();
        if contacts.is_empty() {
            return;
        }
        (self.gap_fit).fit(contacts, &result.axes, &self.links, params.pixel_size);
        smooth(contacts, &self.links, &self.gap_fit, &mut self.smooth);
        self.group();
        self.groups.sort(&self.group);
        self.stack.clear();
        let mut start = 0;
        for part in self.groups.iter(&self.group) {
            self.stack.push((start, start + part.len(), 0));
            start += part.len();
        }
        self.parts.clear();
        let is_reported = |contact: &ContactPixel| contact.gap <= params.prediction;
        while let Some((start, end, splits)) = self.stack.pop() {
            let members = &mut self.groups.members[start..end];
            let shape = Shape::of(members, contacts, &self.smooth, params);
            if splits < MAX_SPLITS
                && members.len() >= LEAST_PLANE
                && shape.normal_length < SPLIT_BELOW
            {
                let middle = shape.split(members, contacts);
                if middle > 0 && middle < members.len() {
                    self.stack.push((start, start + middle, splits + 1));
                    self.stack.push((start + middle, end, splits + 1));
                    continue;
                }
            }
            if !members.iter().any(|&m| is_reported(&contacts[m as usize])) {
                continue;
            }
            self.parts.push(GroupPart {
                members: start..end,
                normal: shape.normal,
                least_gap: shape.least_gap,
            });
        }
        self.emit_planes(contacts, params, out);
        result.contacts.retain(is_reported);
    }

    /// Pushes a patch for the parts of each plane, starting with the deepest, up to [`MAX_PATCHES`].
    fn emit_planes(
        &mut self,
        contacts: &[ContactPixel],
        params: &Params,
        out: &mut Vec<ContactPatch>,
    ) {
        self.parts.sort_unstable_by(|p, q| {
            (p.least_gap.total_cmp(&q.least_gap)).then(p.members.start.cmp(&q.members.start))
        });
        while let Some(deepest) = self.parts.first()
            && out.len() < MAX_PATCHES
        {
            let (plane, first) = (deepest.normal, deepest.members.start);
            self.patch.clear();
            self.parts.retain(|part| {
                // The deepest part's own normal may tell nothing.
                let is_deepest = part.members.start == first;
                let in_plane = is_deepest || part.normal.dot(plane) >= SAME_PLANE;
                if in_plane {
                    let members = &self.groups.members[part.members.clone()];
                    self.patch.extend_from_slice(members);
                }
                !in_plane
            });
            if !self.push_round_spots(contacts, params, out) {
                let members = std::mem::take(&mut self.patch);
                out.push(self.patch_of(&members, contacts, params));
                self.patch = members;
            }
        }
    }

    /// Pushes one patch for each group on one plane, if there are several groups and each is a
    /// single spot. A body that touches in two spots rolls on both. Returns whether they are; else `out` is as before.
    fn push_round_spots(
        &mut self,
        contacts: &[ContactPixel],
        params: &Params,
        out: &mut Vec<ContactPatch>,
    ) -> bool {
        let mut groups = ArrayVec::<u32, PATCH_POINTS>::new();
        for &member in &self.patch {
            let group = self.group[member as usize];
            if !groups.contains(&group) && groups.try_push(group).is_err() {
                return false;
            }
        }
        let mut spot = std::mem::take(&mut self.spot);
        let first = out.len();
        let most = MAX_PATCHES - first;
        let are_spots = (2..=most).contains(&groups.len())
            && groups.into_iter().all(|group| {
                spot.clear();
                let members = self.patch.iter().copied();
                spot.extend(members.filter(|&m| self.group[m as usize] == group));
                out.push(self.patch_of(&spot, contacts, params));
                (out.last()).is_some_and(|patch| patch.is_round() && patch.points.len() == 1)
            });
        self.spot = spot;
        if !are_spots {
            out.truncate(first);
        }
        are_spots
    }

    fn patch_of(
        &mut self,
        members: &[u32],
        contacts: &[ContactPixel],
        params: &Params,
    ) -> ContactPatch {
        let shape = Shape::of(members, contacts, &self.smooth, params);
        let pixels = Pixels {
            contacts,
            smooth: &self.smooth,
            links: &self.links,
            end_in_discs: self.end_in_discs,
        };
        shape.patch(members, &pixels, &mut self.shape, params)
    }

    /// Groups linked pixels of like normal.
    fn group(&mut self) {
        let normal = |k: u32| self.smooth[k as usize].normal;
        let alike = |&(k, l): &(u32, u32)| normal(k).dot(normal(l)) >= SAME_GROUP;
        let pairs = self.links.pairs.iter().copied().filter(alike);
        find_roots(self.smooth.len(), pairs, &mut self.group);
    }
}

/// Whether the smaller surface, which is taken to end first, is exact.
fn smaller_is_exact(query: &PairQuery) -> bool {
    let sides = [query.a, query.b];
    let extents = sides.map(|side| side.bounds().extents());
    let smaller = sides[usize::from(!first_is_smaller(extents))];
    matches!(smaller, Surface::Exact(_))
}

/// Drops contact pixels of faces that do not face each other, if another view sees one of the faces
/// better. An example is a floor's edge and the wall behind it, which are far apart along the view
/// and near beside it. If half of all contact pixels or more are like that, they stay: nothing better was seen.
fn drop_between_faces(result: &mut PairResult) {
    let PairResult { axes, contacts, .. } = result;
    let is_between = |contact: &ContactPixel| {
        let seen_better = |normal: Vec3| {
            let here = normal.dot(axes[contact.view as usize]).abs();
            axes.iter().any(|axis| normal.dot(*axis).abs() > here)
        };
        let lengths = contact.normal_a.length() * contact.normal_b.length();
        contact.normal_a.dot(contact.normal_b) > -SAME_FACE * lengths
            && (seen_better(contact.normal_a) || seen_better(contact.normal_b))
    };
    if axes.len() > 1 && 2 * contacts.iter().filter(|c| is_between(c)).count() < contacts.len() {
        contacts.retain(|contact| !is_between(contact));
    }
}

/// Orders contact pixels by view, row and column; of one pixel, the greatest gap first, and of equal gaps by their places.
fn order(contacts: &mut [ContactPixel]) {
    let pixel = |c: &ContactPixel| (c.view, c.pixel[1], c.pixel[0]);
    let place = |c: &ContactPixel, d: &ContactPixel| {
        let axes = c.point_a.to_array().into_iter().zip(d.point_a.to_array());
        axes.fold(Ordering::Equal, |order, (c, d)| order.then(c.total_cmp(&d)))
    };
    let order = |c: &ContactPixel, d: &ContactPixel| {
        let by_gap = (pixel(c).cmp(&pixel(d))).then(d.gap.total_cmp(&c.gap));
        by_gap.then_with(|| place(c, d))
    };
    if !contacts.is_sorted_by(|c, d| order(c, d).is_le()) {
        contacts.sort_unstable_by(order);
    }
}
