//! Reduces contact pixels to contact patches: the last stage, on the CPU for every backend.
//!
//! Pixels are grouped by neighbourhood and normal. What a group yields follows its pixels
//! continuously: normals and the deepest point are weighted means, and the support points are
//! chosen for extent first, so that near-ties in depth do not move them from frame to frame.

use crate::bowl::{GAP_PER_SLOPE, Lowest, relative_radius, slope_error};
use crate::cpu::sweep::SAME_FACE;
use crate::gap_fit::fitted_gap;
use crate::links::{Groups, Links, join, root};
use crate::lone_points::LonePoints;
use crate::noise::allow_for_noise;
use crate::supports::{longest_axis, supports};
use crate::{
    ContactPatch, ContactPixel, ContactPoint, PATCH_POINTS, PairQuery, PairResult, Params,
};
use glamx::Vec3;
use std::ops::Range;

/// Most patches of one pair, the deepest: a solver gains nothing from more.
pub const MAX_PATCHES: usize = 32;

/// Linked pixels belong to one group if their smoothed normals are within 30°.
const SAME_GROUP: f32 = 0.866;

/// A part whose pixels' unit normals have a mean shorter than this (a spread of about 14°) is split.
const FLAT: f32 = 0.97;

/// A surface's normal averaged over linked neighbours that is shorter than this (a spread of 26°) is a mean
/// over a crease, which says nothing of a bend.
const CREASED: f32 = 0.9;

/// Patches of fewer pixels are not split.
const LEAST_SPLIT: usize = 12;

/// Splits in a row: at most eight parts a group.
const MAX_SPLITS: u32 = 3;

/// Cosine of the angle (10°) within which normals belong to one plane: such parts share a patch,
/// wherever they are. A solver needs the supports of one plane together to choose the few that it
/// takes (rapier merges manifolds within 5.1° and keeps the deepest points, which need not be those
/// that bear the load).
pub const SAME_PLANE: f32 = 0.985;

/// Band above the smallest gap, in pixels (r̄), whose pixels shape the normal.
const NORMAL_BAND: f32 = 2.0;

/// Band whose pixels can be support points and decide where a part is split. What penetrates can up to
/// [`NORMAL_BAND`]: a body that lies deeper on one side must not sink in on the other.
const SUPPORT_BAND: f32 = 1.0;

/// The gaps of a patch are taken to be at least this rough, in pixels: below, extent alone chooses
/// the support points.
const LEAST_ROUGHNESS: f32 = 0.05;

/// Band above the smallest gap, in pixels, over which the deepest point is a mean.
const DEEPEST_BAND: f32 = 0.1;

/// By how much that point must be deeper than the support points to count, in roughnesses: on flat
/// faces it is noise, and four corners bear more than three.
const DEEPER: f32 = 0.4;

/// Roughness, in pixels, from which on a bend of the surfaces does not count as such. Gaps that rise
/// through all of the support band, as around a ball's contact, deviate from a plane by 0.29; those
/// of a small face whose rim is blurred by estimated normals by 0.1.
const LEAST_RISE: f32 = 0.15;

/// Most that a point of a flat contact may be off its plane to be moved onto it, in pixels: what estimated
/// normals make of the rims of two faces. What is lower still is a bump under the face.
const OFF_PLANE: f32 = 0.4;

/// Variance (1 − mean length) that a surface's normals are taken to have at least, 1.4°: keeps the weights
/// of two perfectly flat surfaces finite. Were it 0.01, a box's sides, which a moving view sees as
/// well, would tilt the normal by 0.6°, and a floor brake what slides over it by 2 % more.
const LEAST_VARIANCE: f32 = 3e-4;

/// A contact pixel after averaging over its linked neighbours.
#[derive(Clone, Copy, Debug)]
struct Smooth {
    gap: f32,
    normal_a: Vec3,
    normal_b: Vec3,
    /// Unit normal from the first surface towards the second.
    normal: Vec3,
}

/// Memory of [`PatchScratch::reduce`], kept from call to call.
#[derive(Debug, Default)]
pub struct PatchScratch {
    /// Union-find parents; after grouping, the group of each contact pixel.
    group: Vec<u32>,
    links: Links,
    lone_points: LonePoints,
    smooth: Vec<Smooth>,
    groups: Groups,
    stack: Vec<(usize, usize, u32)>,
    parts: Vec<Part>,
    /// Members of the parts of one patch, and those that can be support points.
    patch: Vec<u32>,
    points: Vec<ContactPoint>,
}

/// Some of the members, and what decides which patch they belong to.
#[derive(Debug)]
struct Part {
    members: Range<usize>,
    normal: Vec3,
    least_gap: f32,
}

impl PatchScratch {
    /// Confirms the contact pixels of `result`, settles what they say of `collides` and `gap`, as if
    /// normals told inside from outside, and fills its patches, deepest first.
    ///
    /// The contact pixels may come in any order; they are left ordered by view, row, column and
    /// gap, as the stage `compare` finds them. Cost: linear in them but for sorting the groups, and
    /// them if need be.
    pub fn reduce(&mut self, result: &mut PairResult, params: &Params) {
        self.link(result, params);
        self.reduce_linked(result, params, true);
    }

    /// [`reduce`](Self::reduce) without the contact pixels of points that stand alone: flying pixels
    /// of a depth camera, dust. A point stands alone if its fourth nearest neighbour is 2.5 times as
    /// far away as that of one of these four is from it. Cost beside that of `reduce`: where there
    /// are components of few contact pixels, a pass over the points of the blocks around them.
    pub fn reduce_pair(&mut self, result: &mut PairResult, query: &PairQuery) {
        self.link(result, &query.params);
        if self.lone_points.drop(result, &self.links, query) {
            self.links.find(&result.contacts, &query.params);
        }
        let tells_inside = query.a.is_oriented() || query.b.is_oriented();
        self.reduce_linked(result, &query.params, tells_inside);
        let fitted = self.smooth.iter().map(|pixel| pixel.gap);
        allow_for_noise(result, fitted.reduce(f32::min), query);
    }

    fn link(&mut self, result: &mut PairResult, params: &Params) {
        order(&mut result.contacts);
        drop_between_faces(result);
        self.links.find(&result.contacts, params);
    }

    fn reduce_linked(&mut self, result: &mut PairResult, params: &Params, tells_inside: bool) {
        self.links
            .confirm(result, params, tells_inside, &mut self.group);
        let (contacts, out) = (&result.contacts, &mut result.patches);
        out.clear();
        self.smooth.clear();
        if contacts.is_empty() {
            return;
        }
        self.smooth(contacts);
        self.group();
        self.groups.sort(&self.group);
        self.stack.clear();
        let mut start = 0;
        for part in self.groups.iter(&self.group) {
            self.stack.push((start, start + part.len(), 0));
            start += part.len();
        }
        self.parts.clear();
        while let Some((start, end, splits)) = self.stack.pop() {
            let members = &mut self.groups.members[start..end];
            let shape = Shape::of(members, contacts, &self.smooth, params);
            if splits < MAX_SPLITS && members.len() >= LEAST_SPLIT && shape.normal_length < FLAT {
                let middle = shape.split(members, contacts);
                if middle > 0 && middle < members.len() {
                    self.stack.push((start, start + middle, splits + 1));
                    self.stack.push((start + middle, end, splits + 1));
                    continue;
                }
            }
            self.parts.push(Part {
                members: start..end,
                normal: shape.normal,
                least_gap: shape.least_gap,
            });
        }
        self.emit_planes(contacts, params, out);
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
            let plane = deepest.normal;
            self.patch.clear();
            self.parts.retain(|part| {
                let in_plane = part.normal.dot(plane) >= SAME_PLANE;
                if in_plane {
                    let members = &self.groups.members[part.members.clone()];
                    self.patch.extend_from_slice(members);
                }
                !in_plane
            });
            let shape = Shape::of(&self.patch, contacts, &self.smooth, params);
            out.push(shape.patch(
                &self.patch,
                contacts,
                &self.smooth,
                &mut self.points,
                params,
            ));
        }
    }

    /// Averages normals over linked neighbours and fits the gaps to them: what is left of a sensor's
    /// noise is a third.
    fn smooth(&mut self, contacts: &[ContactPixel]) {
        for (k, contact) in contacts.iter().enumerate() {
            let (mut normal_a, mut normal_b) = (contact.normal_a, contact.normal_b);
            let neighbors = self.links.neighbors(k as u32);
            for neighbor in neighbors.iter().map(|&l| &contacts[l as usize]) {
                normal_a += neighbor.normal_a;
                normal_b += neighbor.normal_b;
            }
            let count = 1.0 + neighbors.len() as f32;
            let (normal_a, normal_b) = (normal_a / count, normal_b / count);
            self.smooth.push(Smooth {
                gap: fitted_gap(k as u32, contacts, &self.links),
                normal_a,
                normal_b,
                normal: common_normal(normal_a, normal_b).unwrap_or_else(|| contact.normal()),
            });
        }
    }

    /// Union-find over linked pixels of like normal.
    fn group(&mut self) {
        self.group.clear();
        self.group.extend(0..self.smooth.len() as u32);
        for &(k, l) in &self.links.pairs {
            let normal = |k: u32| self.smooth[k as usize].normal;
            if normal(k).dot(normal(l)) < SAME_GROUP {
                continue;
            }
            join(&mut self.group, k, l);
        }
        for k in 0..self.group.len() as u32 {
            self.group[k as usize] = root(&mut self.group, k);
        }
    }
}

/// Drops the contact pixels of faces that do not face each other and of which another view sees one
/// better, as of a floor's edge and the wall behind it: far along the view, and near beside it. Where
/// they are half of all or more there is nothing better.
fn drop_between_faces(result: &mut PairResult) {
    let PairResult { axes, contacts, .. } = result;
    let is_between = |contact: &ContactPixel| {
        let seen_better = |normal: Vec3| {
            let here = normal.dot(axes[contact.view as usize]).abs();
            axes.iter().any(|axis| normal.dot(*axis).abs() > here)
        };
        contact.normal_a.dot(contact.normal_b) > -SAME_FACE
            && (seen_better(contact.normal_a) || seen_better(contact.normal_b))
    };
    if axes.len() > 1 && 2 * contacts.iter().filter(|c| is_between(c)).count() < contacts.len() {
        contacts.retain(|contact| !is_between(contact));
    }
}

/// Orders contact pixels by view, row, column and gap.
fn order(contacts: &mut [ContactPixel]) {
    let place = |c: &ContactPixel| (c.view, c.pixel[1], c.pixel[0]);
    if !contacts.is_sorted_by_key(place) {
        contacts.sort_unstable_by(|c, d| (place(c).cmp(&place(d))).then(d.gap.total_cmp(&c.gap)));
    }
}

/// Unit normal from the first surface towards the second, from the means of unit normals of both:
/// weighted by the inverse of their variance, so that the flat side of an edge on a face, and the
/// smooth side of a noisy scan, decide.
fn common_normal(mean_a: Vec3, mean_b: Vec3) -> Option<Vec3> {
    let weighted = |mean: Vec3| {
        let spread = (1.0 - mean.length()).max(0.0);
        mean.normalize_or_zero() / (spread + LEAST_VARIANCE)
    };
    (weighted(mean_a) - weighted(mean_b)).try_normalize()
}

/// Weight of a gap `above` the smallest one: 1 there, falling smoothly to 0 at `band`.
fn falloff(above: f32, band: f32) -> f32 {
    let rest = (1.0 - above / band).max(0.0);
    rest * rest
}

fn least_gap(members: &[u32], smooth: &[Smooth]) -> f32 {
    members
        .iter()
        .fold(f32::INFINITY, |g, &m| g.min(smooth[m as usize].gap))
}

/// Length of the mean of the unit normals of the members that are at no crease: 1 where they agree, or where
/// there is none.
fn normal_length(members: &[u32], smooth: &[Smooth]) -> f32 {
    let (sum, count) = members
        .iter()
        .map(|&m| &smooth[m as usize])
        .filter(|s| s.normal_a.length().min(s.normal_b.length()) >= CREASED)
        .fold((Vec3::ZERO, 0), |(sum, n), s| (sum + s.normal, n + 1));
    match count {
        0 => 1.0,
        _ => sum.length() / count as f32,
    }
}

/// Normal and main direction of a part.
struct Shape {
    normal: Vec3,
    /// See [`normal_length`].
    normal_length: f32,
    least_gap: f32,
    /// Greatest gap of a support point.
    support_gap: f32,
    centre: Vec3,
    /// Across the normal: the direction of largest extent.
    longest: Vec3,
}

impl Shape {
    fn of(members: &[u32], contacts: &[ContactPixel], smooth: &[Smooth], params: &Params) -> Self {
        let least_gap = least_gap(members, smooth);
        let (mut mean_a, mut mean_b, mut mean) = (Vec3::ZERO, Vec3::ZERO, Vec3::ZERO);
        let mut total = 0.0;
        let normal_band = NORMAL_BAND * params.pixel_size;
        for s in members.iter().map(|&m| &smooth[m as usize]) {
            let w = falloff(s.gap - least_gap, normal_band);
            mean_a += w * s.normal_a;
            mean_b += w * s.normal_b;
            mean += w * s.normal;
            total += w;
        }
        let normal = common_normal(mean_a / total, mean_b / total)
            .or_else(|| mean.try_normalize())
            .unwrap_or(smooth[members[0] as usize].normal);
        let support_band = SUPPORT_BAND * params.pixel_size;
        let support_gap = least_gap + (-least_gap).clamp(support_band, normal_band);
        let in_band = || {
            members
                .iter()
                .filter(move |&&m| smooth[m as usize].gap <= support_gap)
                .map(|&m| contacts[m as usize].middle())
        };
        let centre = in_band().sum::<Vec3>() / in_band().count() as f32;
        Self {
            normal,
            normal_length: normal_length(members, smooth),
            least_gap,
            support_gap,
            centre,
            longest: longest_axis(in_band(), centre, normal),
        }
    }

    /// Parts `members` by the plane through the centre across the longest direction; returns how
    /// many are in the first part.
    fn split(&self, members: &mut [u32], contacts: &[ContactPixel]) -> usize {
        let behind =
            |m: u32| (contacts[m as usize].middle() - self.centre).dot(self.longest) >= 0.0;
        // Members stay in the order of their pixels.
        members.sort_unstable_by_key(|&m| (behind(m), m));
        members.partition_point(|&m| !behind(m))
    }

    /// The patch's support points and, in place of the highest of these, its deepest point where
    /// that is clearly deeper (a ball's).
    fn patch(
        &self,
        members: &[u32],
        contacts: &[ContactPixel],
        smooth: &[Smooth],
        points: &mut Vec<ContactPoint>,
        params: &Params,
    ) -> ContactPatch {
        points.clear();
        points.extend(
            members
                .iter()
                .map(|&m| m as usize)
                .filter(|&m| smooth[m].gap <= self.support_gap)
                .map(|m| self.point(contacts[m].middle(), smooth[m].gap)),
        );
        let supports = supports(points, self.normal, LEAST_ROUGHNESS * params.pixel_size);
        let rises = supports.roughness >= LEAST_RISE * params.pixel_size;
        let lowest_of_bowl = supports.lowest_of_bowl.filter(|_| rises);
        let roughness = supports.roughness_about_bowl;
        if let Some(lowest) = lowest_of_bowl {
            // Around it the surfaces have other normals: points there would stop what rolls. Where noise
            // leaves open where it is, points as far apart let a ball lie that would otherwise roll about.
            let in_band = || {
                (members.iter().map(|&m| m as usize))
                    .filter(|&m| smooth[m].gap <= self.support_gap)
                    .map(|m| (&contacts[m], &smooth[m]))
            };
            let off_fit = in_band().map(|(contact, smooth)| contact.gap - smooth.gap);
            let slope_error = slope_error(off_fit, params.pixel_size);
            let Lowest {
                point,
                aside,
                radii,
            } = lowest;
            let relative_radii = radii.map(|radius| {
                relative_radius(radius, self.centre, in_band().map(|(contact, _)| contact))
            });
            let [u, v] = aside.map(|aside| slope_error * aside);
            let points = if slope_error > 0.0 {
                let moved = |aside: Vec3| self.point(point.middle() + aside, point.gap);
                [u, v, -u, -v].into_iter().map(moved).collect()
            } else {
                [point].into_iter().collect()
            };
            return ContactPatch {
                normal: self.normal,
                points,
                relative_radii: Some(relative_radii),
                roughness: roughness.max(GAP_PER_SLOPE * slope_error),
            };
        }
        // Chosen for being low, they are lower than the plane of a flat contact by what its gaps scatter by.
        // What bends, or is rougher than that, is as low as it is, but for the rim of a flat contact.
        let scatter = if rises { 0.0 } else { roughness };
        let off_plane = OFF_PLANE * params.pixel_size;
        let scatter = scatter + supports.flatness * (off_plane - scatter).max(0.0);
        let in_plane = |(k, above): (usize, f32)| {
            let point = points[k];
            self.point(point.middle(), point.gap - above.clamp(-scatter, scatter))
        };
        let chosen = supports.indices.into_iter().zip(supports.above_plane);
        let mut patch = ContactPatch {
            normal: self.normal,
            points: chosen.map(in_plane).collect(),
            relative_radii: None,
            roughness,
        };
        patch.points.sort_by(|p, q| p.gap.total_cmp(&q.gap));
        let deepest = self.deepest(points, params);
        // Where the gaps do not rise only a bump under the face counts.
        let of_rims = if rises { supports.flatness } else { 1.0 } * off_plane;
        let deeper = DEEPER * supports.roughness + of_rims;
        if deepest.gap < patch.points[0].gap - deeper {
            patch.points.truncate(PATCH_POINTS - 1);
            patch.points.insert(0, deepest);
        }
        patch
    }

    /// Mean of the points with the smallest gaps.
    fn deepest(&self, points: &[ContactPoint], params: &Params) -> ContactPoint {
        let (mut middle, mut gap, mut total) = (Vec3::ZERO, 0.0, 0.0);
        for point in points {
            let w = falloff(point.gap - self.least_gap, DEEPEST_BAND * params.pixel_size);
            middle += w * point.middle();
            gap += w * point.gap;
            total += w;
        }
        self.point(middle / total, gap / total)
    }

    fn point(&self, middle: Vec3, gap: f32) -> ContactPoint {
        ContactPoint {
            point_a: middle - 0.5 * gap * self.normal,
            point_b: middle + 0.5 * gap * self.normal,
            gap,
        }
    }
}
