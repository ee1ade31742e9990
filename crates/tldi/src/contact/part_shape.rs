//! A part of a contact: its normal, its main direction, and the few points that stand for it.

use crate::contact::bowl::{Floor, GAP_PER_SLOPE, Lowest, relative_radius, slope_error};
use crate::contact::crease::{ContactPlane, Face, lower_by};
use crate::contact::links::Links;
use crate::contact::main_plane::LEAST_PLANE;
use crate::contact::point_axes::longest_axis;
use crate::contact::smooth::{Smooth, common_normal};
use crate::contact::supports::{Supports, supports};
use crate::{ContactPatch, ContactPixel, ContactPoint, PATCH_POINTS, Params};
use glamx::Vec3;

/// A surface's normal averaged over linked neighbours that is shorter than this (a spread of 26°) is a mean over a
/// crease, which says nothing of a bend. Half or twice the rest to 1: no change. Without it, a ball in a groove fails
/// with 3 of 24 seeds instead of none.
const OVER_CREASE: f32 = 0.9;

/// Band above the smallest gap, in pixels (r̄), whose pixels shape the normal and tell the faces at an edge. For the normal,
/// half: 9 % worse; twice: 14 % better, no more stability rows fail, but depths of deep edges are twice as wrong. For the
/// faces, half: bare edges rounded by r̄ are 0.17 r̄ off in place of 0.03; twice: corners rounded by r̄ scatter by up to 0.32 r̄
/// in place of 0.27.
const NORMAL_BAND: f32 = 2.0;

/// Band above the smallest gap whose pixels can be support points and decide where a part is split. Pixels that
/// penetrate can be up to [`NORMAL_BAND`] above it: a body that lies deeper on one side must not sink in on the other.
/// Half: 27 of 636 stability rows fail instead of 3, most of balls; twice: depths 20 % worse.
const SUPPORT_BAND: f32 = 1.0;

/// What gaps of smooth surfaces scatter by at most, in pixels. Less is neither a bend nor noise, and the deepest point is a mean
/// over as much. Half: no change; twice: depths 14 % worse, and a bunny on new samples each frame fails with each of 6
/// seeds instead of one.
const LEAST_ROUGHNESS: f32 = 0.05;

/// How much deeper than the support points the deepest point must be to count, in units of the roughness and, below a flat
/// contact, in pixels as well. By so much are support points moved onto the plane of a flat contact: normals that were
/// estimated bend the rims of faces as far, and four corners carry more than three. Half: a box on new samples each frame
/// fails with each of 6 seeds instead of none; twice: a ball in a groove fails with each of 6 seeds instead of none.
const DEEPER: f32 = 0.4;

/// Roughness up to which a contact counts as flat, as a share of the band of gaps that is seen: [`SUPPORT_BAND`], or
/// what of it is no farther apart than surfaces are seen; at least [`LEAST_ROUGHNESS`]. Gaps that rise through all of it,
/// as around a ball's contact, deviate from a plane by 0.29; those of a small face whose rim is blurred by estimated
/// normals by 0.1.
/// Half: no change; twice: 17 of 159 stability rows fail instead of none, and depths are 47 % worse.
const LEAST_RISE: f32 = 0.15;

/// Share of the variance of normals across a valley that a steady turn explains at least. Measured: 0.98 and more of
/// cylinders, 0.52 to 0.97 of two faces that meet at an edge. Half or twice the rest to 1: no row changes.
const STEADY: f32 = 0.9;

/// Normal and main direction of a part.
pub(crate) struct Shape {
    pub(crate) normal: Vec3,
    /// See [`normal_length`].
    pub(crate) normal_length: f32,
    pub(crate) least_gap: f32,
    /// Greatest gap of a support point.
    support_gap: f32,
    centre: Vec3,
    /// Across the normal: the direction of largest extent.
    longest: Vec3,
}

/// The contact pixels of a pair, of which some are a part.
pub(crate) struct Pixels<'a> {
    pub(crate) contacts: &'a [ContactPixel],
    pub(crate) smooth: &'a [Smooth],
    pub(crate) links: &'a Links,
    /// Whether faces end at the discs around a cloud's points, and not at an exact edge.
    pub(crate) end_in_discs: bool,
}

/// Memory of [`Shape::patch`], kept from call to call.
#[derive(Debug, Default)]
pub(crate) struct ShapeScratch {
    /// Those that can be support points.
    points: Vec<ContactPoint>,
    /// The tangent planes there.
    tangents: Vec<Face>,
}

impl Shape {
    pub(crate) fn of(
        members: &[u32],
        contacts: &[ContactPixel],
        smooth: &[Smooth],
        params: &Params,
    ) -> Self {
        let gaps = members.iter().map(|&m| smooth[m as usize].gap);
        let least_gap = gaps.fold(f32::INFINITY, f32::min);
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
    pub(crate) fn split(&self, members: &mut [u32], contacts: &[ContactPixel]) -> usize {
        let behind =
            |m: u32| (contacts[m as usize].middle() - self.centre).dot(self.longest) >= 0.0;
        // Members stay in the order of their pixels.
        members.sort_unstable_by_key(|&m| (behind(m), m));
        members.partition_point(|&m| !behind(m))
    }

    /// The patch of the part. Its points are the lowest point of a bowl, the ends of a valley's floor, or support points.
    pub(crate) fn patch(
        &self,
        members: &[u32],
        pixels: &Pixels<'_>,
        scratch: &mut ShapeScratch,
        params: &Params,
    ) -> ContactPatch {
        let ShapeScratch { points, tangents } = scratch;
        let part = Part {
            shape: self,
            members,
            pixels,
            pixel_size: params.pixel_size,
        };
        let in_band = part.in_band();
        points.clear();
        points.extend(in_band.map(|(contact, smooth)| self.point(contact.middle(), smooth.gap)));
        let band = SUPPORT_BAND * params.pixel_size;
        let seen = (params.seen_gap().max(band) - self.least_gap).clamp(0.0, band);
        let smooth = LEAST_ROUGHNESS * params.pixel_size;
        let supports = supports(points, self.normal, smooth);
        if supports.roughness < smooth.max(LEAST_RISE * seen) {
            return part.on_supports(supports, false, points, tangents);
        }
        let roughness = supports.roughness_about_bowl;
        if let Some(lowest) = &supports.lowest_of_bowl {
            return part.on_bowl(lowest, roughness, tangents);
        }
        let valley = supports.floor_of_valley;
        let on_valley = valley.and_then(|floor| part.on_valley(floor, roughness));
        on_valley.unwrap_or_else(|| part.on_supports(supports, true, points, tangents))
    }

    /// Mean of the points with the smallest gaps.
    fn deepest(&self, points: &[ContactPoint], pixel_size: f32) -> ContactPoint {
        let (mut middle, mut gap, mut total) = (Vec3::ZERO, 0.0, 0.0);
        for point in points {
            let w = falloff(
                point.gap - self.least_gap,
                2.0 * LEAST_ROUGHNESS * pixel_size,
            );
            middle += w * point.middle();
            gap += w * point.gap;
            total += w;
        }
        self.point(middle / total, gap / total)
    }

    fn point(&self, middle: Vec3, gap: f32) -> ContactPoint {
        ContactPoint::about(middle, gap, self.normal)
    }
}

/// The pixels of a part and its shape.
struct Part<'a> {
    shape: &'a Shape,
    members: &'a [u32],
    pixels: &'a Pixels<'a>,
    pixel_size: f32,
}

impl Part<'_> {
    fn can_support(&self, m: &u32) -> bool {
        self.pixels.smooth[*m as usize].gap <= self.shape.support_gap
    }

    /// The pixels that can be support points.
    fn in_band(&self) -> impl Iterator<Item = (&ContactPixel, &Smooth)> + Clone {
        let Pixels {
            contacts, smooth, ..
        } = *self.pixels;
        let members = self.members.iter().filter(|m| self.can_support(m));
        members.map(|&m| (&contacts[m as usize], &smooth[m as usize]))
    }

    fn contacts_in_band(&self) -> impl Iterator<Item = &ContactPixel> + Clone {
        self.in_band().map(|(contact, _)| contact)
    }

    /// How far below `lowest_gap`, that of the lowest fitted point, the faces of an edge or corner meet, metres; negative:
    /// above. 0 where no faces meet.
    fn lower(&self, lowest_gap: f32, tangents: &mut Vec<Face>) -> f32 {
        let Shape {
            normal,
            centre,
            longest,
            ..
        } = *self.shape;
        let plane = ContactPlane {
            origin: centre,
            axes: [longest, normal.cross(longest)],
            normal,
        };
        let Pixels {
            contacts, smooth, ..
        } = *self.pixels;
        let highest = self.shape.least_gap + NORMAL_BAND * self.pixel_size;
        let members = (self.members.iter()).filter(|&&m| smooth[m as usize].gap <= highest);
        let pixels = members.map(|&m| &contacts[m as usize]);
        lower_by(pixels, &plane, lowest_gap, self.pixel_size, tangents)
    }

    /// The lowest point of a bowl. Around it the surfaces have other normals, so further points would stop a body that rolls.
    /// Where noise hides the lowest point, four points stand around it, as far away as it may be: on one that jumps about, a
    /// ball would never lie still.
    fn on_bowl(&self, lowest: &Lowest, roughness: f32, tangents: &mut Vec<Face>) -> ContactPatch {
        let shape = self.shape;
        let Lowest {
            point,
            aside,
            radii,
        } = lowest;
        let off_fit = (self.in_band()).map(|(contact, smooth)| contact.gap - smooth.gap);
        let slope_error = slope_error(off_fit, LEAST_ROUGHNESS * self.pixel_size);
        let relative = |radius| relative_radius(radius, shape.centre, self.contacts_in_band()).0;
        let relative_radii = radii.map(relative);
        let point = shape.point(point.middle(), point.gap - self.lower(point.gap, tangents));
        let [u, v] = aside.map(|aside| slope_error * aside);
        let moved = |aside: Vec3| shape.point(point.middle() + aside, point.gap);
        ContactPatch {
            normal: shape.normal,
            points: match slope_error > 0.0 {
                true => [u, v, -u, -v].into_iter().map(moved).collect(),
                false => [point].into_iter().collect(),
            },
            relative_radii: Some(relative_radii),
            roughness: roughness.max(GAP_PER_SLOPE * slope_error),
        }
    }

    /// The ends of a valley's floor. `None` where two faces meet at an edge: there, the normals turn all at once.
    fn on_valley(&self, Floor { ends, radius }: Floor, roughness: f32) -> Option<ContactPatch> {
        let shape = self.shape;
        let (radius, steady) = relative_radius(radius, shape.centre, self.contacts_in_band());
        let on_plane = |end: ContactPoint| shape.point(end.middle(), end.gap);
        (steady >= STEADY).then(|| ContactPatch {
            normal: shape.normal,
            points: ends.into_iter().map(on_plane).collect(),
            relative_radii: Some([radius, Vec3::ZERO]),
            roughness,
        })
    }

    /// The support points. If the deepest of the `points` is clearly deeper, it replaces the highest of them.
    fn on_supports(
        &self,
        supports: Supports,
        rises: bool,
        points: &[ContactPoint],
        tangents: &mut Vec<Face>,
    ) -> ContactPatch {
        let shape = self.shape;
        let roughness = supports.roughness_about_bowl;
        // Where the gaps do not rise, or only at the rim of a face, contacts lie on a plane. The points were chosen for being
        // low, so they are too low by as much as gaps scatter, or as rims are bent.
        let flatness = if rises { supports.flatness } else { 1.0 };
        let scatter = if rises { 0.0 } else { roughness };
        let bent = DEEPER * self.pixel_size;
        let off_plane = scatter.max(supports.flatness * bent);
        // A pixel at the rim of a cloud's face stands out beyond its points, by half a pixel on average. The mean of such a
        // pixel and its linked neighbours is as far inwards, also at a corner. Within a face the mean is where the pixel is.
        let is_face = self.pixels.end_in_discs && points.len() >= LEAST_PLANE;
        let inwards = if is_face { flatness } else { 0.0 };
        let in_plane = |(k, above): (usize, f32)| {
            let point = points[k];
            let off = self.mean_around(k, point.middle()) - point.middle();
            let aside = inwards * off.reject_from_normalized(shape.normal);
            let gap = point.gap - above.clamp(-off_plane, off_plane);
            shape.point(point.middle() + aside, gap)
        };
        let chosen = supports.indices.into_iter().zip(supports.above_plane);
        let mut patch = ContactPatch {
            normal: shape.normal,
            points: chosen.map(in_plane).collect(),
            relative_radii: None,
            roughness,
        };
        patch.points.sort_by(|p, q| p.gap.total_cmp(&q.gap));
        let deepest = shape.deepest(points, self.pixel_size);
        let deeper = DEEPER * supports.roughness + flatness * bent;
        if deepest.gap < patch.points[0].gap - deeper {
            patch.points.truncate(PATCH_POINTS - 1);
            patch.points.insert(0, deepest);
        }
        let lower = self.lower(patch.points[0].gap, tangents);
        for point in &mut patch.points {
            *point = shape.point(point.middle(), point.gap - lower);
        }
        patch
    }

    /// Mean of the `middle` of the k-th pixel that can be a support point, and of those of its linked neighbours that can.
    fn mean_around(&self, k: usize, middle: Vec3) -> Vec3 {
        let Pixels {
            contacts, links, ..
        } = *self.pixels;
        let mut members = self.members.iter().filter(|m| self.can_support(m));
        let neighbors = members.nth(k).map_or(&[][..], |&m| links.neighbors(m));
        let (mut sum, mut count) = (middle, 1.0);
        for &l in neighbors.iter().filter(|l| self.can_support(l)) {
            sum += contacts[l as usize].middle();
            count += 1.0;
        }
        sum / count
    }
}

/// Weight of a gap `above` the smallest one: 1 there, falling smoothly to 0 at `band`.
fn falloff(above: f32, band: f32) -> f32 {
    let rest = (1.0 - above / band).max(0.0);
    rest * rest
}

/// Length of the mean of the unit normals of the members that are at no crease: 1 where they agree, or where
/// there is none.
fn normal_length(members: &[u32], smooth: &[Smooth]) -> f32 {
    let (sum, count) = members
        .iter()
        .map(|&m| &smooth[m as usize])
        .filter(|s| s.normal_a.length().min(s.normal_b.length()) >= OVER_CREASE)
        .fold((Vec3::ZERO, 0), |(sum, n), s| (sum + s.normal, n + 1));
    match count {
        0 => 1.0,
        _ => sum.length() / count as f32,
    }
}
