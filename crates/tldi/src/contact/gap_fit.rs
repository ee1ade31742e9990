//! The gap between two surfaces around a contact pixel: a paraboloid through its neighbours.
//!
//! A mean over neighbours would lift the middle of a curved contact (a ball's, over 3 × 3 pixels,
//! by 1.3 pixel² / 2 R) and jump where neighbours drop out at the rim. A fit does neither, and over
//! 5 × 5 pixels it averages noise as well as that mean.

use crate::ContactPixel;
use crate::contact::links::{Links, NONE};
use arrayvec::ArrayVec;
use glamx::{Mat4, Vec4};

/// Neighbours of a pixel in 5 × 5 pixels, and room for some with two layers.
const MOST_NEIGHBORS: usize = 48;

/// Weights that keep slope and curvature small where neighbours tell little of them, as a row or a corner does; in
/// squares of pixels. Half or twice of either: no change.
const LEAST_SLOPE_WEIGHT: f32 = 0.5;
const LEAST_BEND_WEIGHT: f32 = 2.0;

/// Places in the 5 × 5 pixels around a pixel, row by row, and the one of the pixel itself.
const PLACES: usize = 25;
const MIDDLE: usize = PLACES / 2;

/// 1, u, v and u² + v² at each place, (u, v) in pixels from the middle.
const BASIS: [Vec4; PLACES] = {
    let mut basis = [Vec4::ZERO; PLACES];
    let mut place = 0;
    while place < PLACES {
        let [u, v] = [(place % 5) as f32 - 2.0, (place / 5) as f32 - 2.0];
        basis[place] = Vec4::new(1.0, u, v, u * u + v * v);
        place += 1;
    }
    basis
};

/// Fits gaps. It keeps the inverse matrix, which depends only on which neighbours are there: most pixels have the same.
#[derive(Debug, Default)]
pub(crate) struct GapFit {
    /// A bit for each place that has a neighbour.
    pattern: u32,
    /// The inverse normal matrix for these neighbours.
    inverse: Mat4,
}

impl GapFit {
    /// The gap at contact pixel `k`, in metres, by a fit to it and its neighbours up to two links away.
    pub(crate) fn gap(&mut self, k: u32, contacts: &[ContactPixel], links: &Links) -> f32 {
        // Contact pixels and their places.
        let mut ring = ArrayVec::<(u32, usize), MOST_NEIGHBORS>::new();
        // The first of the ring in each of the 5 × 5 pixels: others in the same pixel are rare.
        let mut first = [NONE; PLACES];
        ring.push((k, MIDDLE));
        first[MIDDLE] = k;
        let mut push_neighbors = |ring: &mut ArrayVec<_, MOST_NEIGHBORS>, of: u32, at: usize| {
            for (l, [u, v]) in links.placed_neighbors(of) {
                let place = at.wrapping_add_signed(isize::from(5 * v + u));
                let first = &mut first[place];
                if *first == NONE {
                    *first = l;
                } else if *first == l || ring.iter().any(|(m, _)| *m == l) {
                    continue;
                }
                if !ring.is_full() {
                    ring.push((l, place));
                }
            }
        };
        push_neighbors(&mut ring, k, MIDDLE);
        for near in 1..ring.len() {
            let (of, at) = ring[near];
            push_neighbors(&mut ring, of, at);
        }
        let (mut moments, mut pattern) = (Vec4::ZERO, 0u32);
        for &(l, place) in &ring {
            moments += BASIS[place] * contacts[l as usize].gap;
            pattern |= 1 << place;
        }
        let places = ring.iter().map(|(_, place)| *place);
        if ring.len() != pattern.count_ones() as usize {
            return (inverse_normal_matrix(places) * moments).x;
        }
        if pattern != self.pattern {
            self.pattern = pattern;
            self.inverse = inverse_normal_matrix(places);
        }
        (self.inverse * moments).x
    }
}

/// Its sums are of small whole numbers: their order does not matter.
fn inverse_normal_matrix(places: impl Iterator<Item = usize>) -> Mat4 {
    let mut normal_matrix = Mat4::from_diagonal(Vec4::new(
        0.0,
        LEAST_SLOPE_WEIGHT,
        LEAST_SLOPE_WEIGHT,
        LEAST_BEND_WEIGHT,
    ));
    for basis in places.map(|place| BASIS[place]) {
        normal_matrix += Mat4::from_cols(
            basis * basis.x,
            basis * basis.y,
            basis * basis.z,
            basis * basis.w,
        );
    }
    normal_matrix.inverse()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{PairResult, Params};
    use glamx::Vec3;

    /// Fitted gap of the pixel `[0, 0]` among `pixels` whose gaps are `gap`.
    fn fitted(pixels: &[[i32; 2]], gap: impl Fn(f32, f32) -> f32) -> f32 {
        let contacts = pixels.iter().map(|&[i, j]| {
            let point = Vec3::new(i as f32, 0.0, j as f32);
            ContactPixel {
                pixel: [i, j],
                view: 0,
                point_a: point,
                point_b: point,
                normal_a: Vec3::Y,
                normal_b: -Vec3::Y,
                gap: gap(i as f32, j as f32),
            }
        });
        let mut result = PairResult {
            contacts: contacts.collect(),
            ..PairResult::default()
        };
        let params = Params::for_radius(1.0);
        let mut links = Links::default();
        links.find(&result.contacts, &params);
        links.confirm(&mut result, &params, None, &mut Vec::new());
        let middle = pixels.iter().position(|p| *p == [0, 0]);
        let middle = middle.expect("is among them") as u32;
        GapFit::default().gap(middle, &result.contacts, &links)
    }

    fn block(rows: std::ops::RangeInclusive<i32>) -> Vec<[i32; 2]> {
        rows.flat_map(|j| (-2..=2).map(move |i| [i, j])).collect()
    }

    /// On a ball of 5 pixels' radius a mean would be off by 0.4 (5 × 5) or 0.13 pixels (3 × 3); what
    /// the fit is off by comes from its weights for what the neighbours leave open.
    #[test]
    fn bent_and_tilted_gaps_are_kept() {
        let bent = fitted(&block(-2..=2), |u, v| 1.0 + 0.1 * (u * u + v * v));
        assert!((bent - 1.0).abs() < 0.01, "{bent}");
        let tilted = fitted(&block(0..=2), |u, v| 1.0 + 0.2 * u + 0.3 * v);
        assert!((tilted - 1.0).abs() < 0.05, "{tilted}");
    }

    /// The middle of this fit has 0.39 of the deviation of a pixel's gap; a pixel's own is uniform
    /// with 0.29 pixels.
    #[test]
    fn noise_is_averaged() {
        let mut rng = fastrand::Rng::with_seed(7);
        let mut squares = 0.0;
        for _ in 0..500 {
            let noise: Vec<f32> = (0..25).map(|_| rng.f32() - 0.5).collect();
            let at = |u: f32, v: f32| noise[((v + 2.0) * 5.0 + u + 2.0) as usize];
            squares += (fitted(&block(-2..=2), |u, v| 1.0 + at(u, v)) - 1.0).powi(2);
        }
        let deviation = (squares / 500.0).sqrt();
        assert!((0.09..0.125).contains(&deviation), "{deviation}");
    }

    #[test]
    fn a_lone_pixel_has_its_own_gap() {
        assert_eq!(fitted(&[[0, 0]], |_, _| 0.25), 0.25);
    }
}
