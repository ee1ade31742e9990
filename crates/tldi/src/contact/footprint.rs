//! Contact pixels of which the gaps and slopes are known, for tests.

use crate::contact::estimate::{Estimate, EstimateScratch, Observed, Plane};
use crate::contact::links::Links;
use crate::contact::quadric::Quadric;
use crate::contact::vertex::Vertex;
use crate::{ContactPixel, Params};
use glamx::{Vec2, Vec3};

/// Metres.
pub(crate) const PIXEL: f32 = 0.01;

/// Contact pixels of the level surface z = 0 and one above it.
pub(crate) struct Footprint {
    pub(crate) contacts: Vec<ContactPixel>,
    links: Links,
}

impl Footprint {
    /// All pixels in which `above` tells a gap, in pixels, and its slope; 20 pixels from the middle at most.
    pub(crate) fn of(mut above: impl FnMut(Vec2) -> Option<(f32, Vec2)>) -> Self {
        let pixels = (-20..=20).flat_map(|j| (-20..=20).map(move |i| [i, j]));
        let contacts: Vec<ContactPixel> = pixels
            .filter_map(|pixel| {
                let place = Vec2::new(pixel[0] as f32, pixel[1] as f32);
                let (gap, slope) = above(place)?;
                let mut contact = ContactPixel {
                    pixel,
                    view: 0,
                    point_a: PIXEL * place.extend(0.0),
                    point_b: PIXEL * place.extend(gap),
                    normal_a: Vec3::Z,
                    normal_b: slope.extend(-1.0).normalize(),
                    gap: 0.0,
                };
                contact.gap = contact.normal().z * PIXEL * gap;
                Some(contact)
            })
            .collect();
        let mut links = Links::default();
        let mut result = crate::PairResult {
            contacts: contacts.clone(),
            ..Default::default()
        };
        let params = Params::for_radius(PIXEL);
        links.find(&contacts, &params);
        links.confirm(&mut result, &params, true, &mut Vec::new());
        assert_eq!(result.contacts.len(), contacts.len(), "all are confirmed");
        Self { contacts, links }
    }

    fn plane(&self) -> Plane {
        let gaps = self.contacts.iter().map(|contact| contact.gap);
        Plane {
            origin: Vec3::ZERO,
            axes: [Vec3::X, Vec3::Y],
            normal: Vec3::Z,
            pixel_size: PIXEL,
            least_gap: gaps.fold(f32::INFINITY, f32::min),
        }
    }

    fn pixels(&self) -> impl Iterator<Item = (u32, &ContactPixel, f32)> {
        let contacts = self.contacts.iter().enumerate();
        contacts.map(|(k, contact)| (k as u32, contact, contact.gap))
    }

    pub(crate) fn observed(&self) -> Vec<Observed> {
        let plane = self.plane();
        let pixels = self.pixels();
        pixels
            .map(|(k, contact, gap)| plane.observe(k, contact, gap))
            .collect()
    }

    pub(crate) fn quadric(&self, observed: &[Observed]) -> Quadric {
        Quadric::fit(observed, &self.links, self.contacts.len(), &mut Vec::new())
    }

    pub(crate) fn vertex(&self) -> Option<Vertex> {
        let observed = self.observed();
        Vertex::find(&observed, &self.quadric(&observed), f32::NEG_INFINITY)
    }

    pub(crate) fn estimate(&self) -> Estimate {
        let mut scratch = EstimateScratch::default();
        let count = self.contacts.len();
        Estimate::of(
            self.pixels(),
            &self.plane(),
            &self.links,
            count,
            &mut scratch,
        )
    }
}

/// A random number of the standard normal distribution.
pub(crate) fn normal(rng: &mut fastrand::Rng) -> f32 {
    // By the central limit theorem; tails beyond six deviations do not matter here.
    (0..12).map(|_| rng.f32()).sum::<f32>() - 6.0
}

/// The gap above a ball of radius `radius` pixels that is lowest at `lowest`, where its gap is `gap`.
pub(crate) fn ball(place: Vec2, lowest: Vec2, radius: f32, gap: f32) -> (f32, Vec2) {
    let off = place - lowest;
    let height = (radius * radius - off.length_squared()).max(0.0).sqrt();
    (gap + radius - height, off / height)
}

/// The highest of faces, each given by its slope, that meet in `place` at the gap `gap`.
pub(crate) fn faces(at: Vec2, place: Vec2, gap: f32, slopes: &[Vec2]) -> (f32, Vec2) {
    let over = |slope: Vec2| (gap + slope.dot(at - place), slope);
    let gaps = slopes.iter().map(|&slope| over(slope));
    gaps.max_by(|f, g| f.0.total_cmp(&g.0)).expect("a face")
}
