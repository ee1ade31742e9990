//! A part of a contact: its normal and main direction.

use crate::contact::estimate::{Estimate, EstimateScratch, Plane};
use crate::contact::links::Links;
use crate::contact::patches::Smooth;
use crate::contact::supports::longest_axis;
use crate::{ContactPatch, ContactPixel, Params};
use glamx::Vec3;

/// A surface's normal averaged over linked neighbours that is shorter than this (a spread of 26°) is a mean
/// over a crease, which says nothing of a bend.
const CREASED: f32 = 0.9;

/// Band above the smallest gap, in pixels (r̄), whose pixels shape the normal.
const NORMAL_BAND: f32 = 2.0;

/// Band whose pixels can be support points and decide where a part is split. What penetrates can up to
/// [`NORMAL_BAND`]: a body that lies deeper on one side must not sink in on the other.
const SUPPORT_BAND: f32 = 1.0;

/// Variance (1 − mean length) that a surface's normals are taken to have at least, 1.4°: keeps the weights
/// of two perfectly flat surfaces finite. Were it 0.01, a box's sides, which a moving view sees as
/// well, would tilt the normal by 0.6°, and a floor brake what slides over it by 2 % more.
const LEAST_VARIANCE: f32 = 3e-4;

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
}

impl Shape {
    pub(crate) fn of(
        members: &[u32],
        contacts: &[ContactPixel],
        smooth: &[Smooth],
        params: &Params,
    ) -> Self {
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
    pub(crate) fn split(&self, members: &mut [u32], contacts: &[ContactPixel]) -> usize {
        let behind =
            |m: u32| (contacts[m as usize].middle() - self.centre).dot(self.longest) >= 0.0;
        // Members stay in the order of their pixels.
        members.sort_unstable_by_key(|&m| (behind(m), m));
        members.partition_point(|&m| !behind(m))
    }

    /// The patch of `members`, which are in ascending order.
    pub(crate) fn patch(
        &self,
        members: &[u32],
        pixels: &Pixels<'_>,
        scratch: &mut EstimateScratch,
        params: &Params,
    ) -> ContactPatch {
        let Pixels {
            contacts,
            smooth,
            links,
        } = *pixels;
        let plane = Plane {
            origin: self.centre,
            axes: [self.longest, self.normal.cross(self.longest)],
            normal: self.normal,
            pixel_size: params.pixel_size,
            least_gap: self.least_gap,
        };
        let footprint = (members.iter())
            .map(|&m| (m, &contacts[m as usize], smooth[m as usize].gap))
            .filter(|(_, _, gap)| *gap <= self.support_gap);
        let estimate = Estimate::of(footprint, &plane, links, contacts.len(), scratch);
        ContactPatch {
            normal: self.normal,
            points: estimate.points,
            relative_radii: estimate.relative_radii,
            roughness: estimate.roughness,
        }
    }
}

/// Unit normal from the first surface towards the second. It is the mean of both surfaces' mean
/// normals, weighted by the inverse of their variances. So a face decides at an edge, and the
/// smooth side decides on a noisy scan.
pub(crate) fn common_normal(mean_a: Vec3, mean_b: Vec3) -> Option<Vec3> {
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
