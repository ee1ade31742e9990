//! The gap between two surfaces at a contact pixel: the mean of its own and of what each neighbour tells of it.
//!
//! A neighbour tells its own gap, and by the normals of both surfaces how gaps rise from there: by the mean of the slopes at
//! both ends of the way, which is exact for planes and paraboloids. So a ball's gap is not lifted in its middle as by a mean
//! of gaps (over 3 × 3 pixels by 1.3 pixel² / 2 R), and an edge not rounded.

use crate::ContactPixel;
use crate::contact::links::Links;
use glamx::Vec3;

/// Least cosine between a normal and the axis of a view: what is seen edge-on has a finite slope. Half or twice: no change.
const LEAST_COSINE: f32 = 1e-3;

/// The gaps of the contact pixels of a pair; kept from call to call.
#[derive(Debug, Default)]
pub(crate) struct GapFit {
    gaps: Vec<GapAlongView>,
    pixel_size: f32,
    /// Share (0 to 1) of the rises told by slopes that gaps confirm: their regression. Normals that were estimated at the rim
    /// of a small body tell twice of what is there.
    confirmed: f32,
}

impl GapFit {
    /// Takes the gaps of `contacts`, and how much of their rises slopes tell. `axes` are those of their views; a view without one looks along each contact's normal.
    pub(crate) fn fit(
        &mut self,
        contacts: &[ContactPixel],
        axes: &[Vec3],
        links: &Links,
        pixel_size: f32,
    ) {
        self.pixel_size = pixel_size;
        self.gaps.clear();
        self.gaps.extend(contacts.iter().map(|contact| {
            let axis = axes.get(contact.view as usize);
            GapAlongView::of(contact, axis.copied().unwrap_or(contact.normal()))
        }));
        let (mut seen, mut told) = (0.0, 0.0);
        for (k, l) in links.pairs.iter().map(|&(k, l)| (k as usize, l as usize)) {
            let (at, from) = (&self.gaps[k], &self.gaps[l]);
            let (rise, weight) = from.rise_to(at, pixel_size);
            let weight = weight * at.weight;
            seen += weight * rise * (at.gap - from.gap);
            told += weight * rise * rise;
        }
        self.confirmed = if told > 0.0 {
            (seen / told).clamp(0.0, 1.0)
        } else {
            0.0
        };
    }

    /// The gap at contact pixel `k`, metres along its normal. Its own gap has the weight of a neighbour that faces the view.
    pub(crate) fn gap(&self, k: u32, links: &Links) -> f32 {
        let at = &self.gaps[k as usize];
        let (mut sum, mut total) = (at.gap, 1.0);
        for from in links.neighbors(k).iter().map(|&l| &self.gaps[l as usize]) {
            let (rise, weight) = from.rise_to(at, self.pixel_size);
            sum += weight * (from.gap + self.confirmed * rise);
            total += weight;
        }
        sum / total * at.cosine
    }
}

/// The gap at a contact pixel along the axis of its view.
#[derive(Clone, Copy, Debug)]
struct GapAlongView {
    /// On the first surface, metres.
    place: Vec3,
    /// Metres.
    gap: f32,
    /// How steeply the gap rises, metres per metre, across the axis.
    slope: Vec3,
    /// Inverse of the variance that tilted surfaces have along the axis: 1 if both face it.
    weight: f32,
    /// Between the axis and the normal of the contact.
    cosine: f32,
}

impl GapAlongView {
    /// `axis`: a unit vector, in either direction.
    fn of(contact: &ContactPixel, axis: Vec3) -> Self {
        let normal = contact.normal();
        let axis = if normal.dot(axis) < 0.0 { -axis } else { axis };
        // A rim, which has no normal, is a point across the view.
        let normals = [contact.normal_a, -contact.normal_b].map(|normal| normal.normalize_or(axis));
        let [cos_a, cos_b] = normals.map(|normal| normal.dot(axis).max(LEAST_COSINE));
        let [across_a, across_b] = normals.map(|normal| normal.reject_from_normalized(axis));
        let cosine = normal.dot(axis).max(LEAST_COSINE);
        Self {
            place: contact.point_a,
            gap: contact.gap / cosine,
            slope: across_a / cos_a - across_b / cos_b,
            weight: (cos_a * cos_b).powi(2),
            cosine,
        }
    }

    /// How much higher than here the gap is at a neighbour, metres, and the weight of what this tells. If the slopes differ, an
    /// edge may be anywhere between the two pixels.
    fn rise_to(&self, neighbor: &Self, pixel_size: f32) -> (f32, f32) {
        let way = neighbor.place - self.place;
        let rise = 0.5 * (self.slope + neighbor.slope).dot(way);
        let bend = (neighbor.slope - self.slope).dot(way) / pixel_size;
        (rise, self.weight / (1.0 + bend * bend))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PairResult, Params};
    use glamx::Vec2;

    /// Fitted gap of the pixel `[0, 0]` among `pixels` of a body over a floor, seen from above. `body` has the height of the
    /// gap at a place, and the slope that its normal tells.
    fn fitted(pixels: &[[i32; 2]], body: impl Fn(Vec2) -> (f32, Vec2)) -> f32 {
        let contacts = pixels.iter().map(|&pixel| {
            let [x, z] = pixel.map(|k| k as f32);
            let (height, slope) = body(Vec2::new(x, z));
            let mut contact = ContactPixel {
                pixel,
                view: 0,
                point_a: Vec3::new(x, 0.0, z),
                point_b: Vec3::new(x, height, z),
                normal_a: Vec3::Y,
                normal_b: Vec3::new(slope.x, -1.0, slope.y).normalize(),
                gap: 0.0,
            };
            contact.gap = height * contact.normal().y;
            contact
        });
        let mut result = PairResult {
            axes: vec![-Vec3::Y],
            contacts: contacts.collect(),
            ..PairResult::default()
        };
        let params = Params::for_radius(1.0);
        let mut links = Links::default();
        links.find(&result.contacts, &params);
        links.confirm(&mut result, &params, None, &mut Vec::new());
        let middle = pixels.iter().position(|p| *p == [0, 0]);
        let middle = middle.expect("is among them") as u32;
        let mut fit = GapFit::default();
        fit.fit(&result.contacts, &result.axes, &links, params.pixel_size);
        fit.gap(middle, &links) / result.contacts[middle as usize].normal().y
    }

    fn block(rows: std::ops::RangeInclusive<i32>) -> Vec<[i32; 2]> {
        rows.flat_map(|j| (-2..=2).map(move |i| [i, j])).collect()
    }

    /// On a ball of 5 pixels' radius a mean of gaps would be off by 0.13 pixels. At the end of a block, too.
    #[test]
    fn bent_and_tilted_gaps_are_kept() {
        let ball = |place: Vec2| (1.0 + 0.1 * place.length_squared(), 0.2 * place);
        let bent = fitted(&block(-2..=2), ball);
        assert!((bent - 1.0).abs() < 1e-5, "{bent}");
        let slope = Vec2::new(0.2, 0.3);
        let tilted = fitted(&block(0..=2), |place| (1.0 + slope.dot(place), slope));
        assert!((tilted - 1.0).abs() < 1e-5, "{tilted}");
    }

    /// Two faces that rise at 45° to either side of a pixel. A mean of gaps would be off by 0.67 pixels.
    #[test]
    fn edges_stay_low() {
        let edge = |place: Vec2| (1.0 + place.x.abs(), Vec2::new(place.x.signum(), 0.0));
        let found = fitted(&block(-2..=2), edge);
        assert!((found - 1.0).abs() < 0.15, "{found}");
    }

    /// A ball whose normals turn twice as much as it bends.
    #[test]
    fn slopes_that_gaps_do_not_confirm_count_less() {
        let ball = |place: Vec2| (1.0 + 0.1 * place.length_squared(), 0.4 * place);
        let found = fitted(&block(-2..=2), ball);
        assert!((found - 1.0).abs() < 1e-5, "{found}");
    }

    /// The mean of nine has a third of the deviation of a pixel's gap, which is uniform with 0.29 pixels.
    #[test]
    fn noise_is_averaged() {
        let mut rng = fastrand::Rng::with_seed(7);
        let mut squares = 0.0;
        for _ in 0..500 {
            let noise: Vec<f32> = (0..25).map(|_| rng.f32() - 0.5).collect();
            let at = |place: Vec2| noise[((place.y + 2.0) * 5.0 + place.x + 2.0) as usize];
            let found = fitted(&block(-2..=2), |place| (1.0 + at(place), Vec2::ZERO));
            squares += (found - 1.0).powi(2);
        }
        let deviation = (squares / 500.0).sqrt();
        assert!((0.085..0.11).contains(&deviation), "{deviation}");
    }

    #[test]
    fn a_lone_pixel_has_its_own_gap() {
        let found = fitted(&[[0, 0]], |_| (0.25, Vec2::new(0.3, 0.0)));
        assert!((found - 0.25).abs() < 1e-6, "{found}");
    }
}
