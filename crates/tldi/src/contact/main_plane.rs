//! The plane on which most heights lie, whatever the others do.

use glamx::{Mat3, Vec2, Vec3};

/// Fewest contact pixels that tell a plane. Of fewer no main plane is looked for, they are not split, and their support
/// points are not moved inwards. Half: the edges of cards that stand on a floor are 0.1 r̄ off in place of 0.09; twice: no
/// change.
pub(crate) const LEAST_PLANE: usize = 12;

/// Most heights that are used; of more, every n-th. So many tell a plane to a twentieth of their deviation. Half or
/// twice: no change.
const MOST_HEIGHTS: usize = 384;

/// Rounds of the fit, and the factor by which the scale of the weights shrinks in each round: to a 20th in all, but not below
/// `near`. Half or twice the rounds, or the root or the square of the factor: no change.
const ROUNDS: i32 = 6;
const NARROWER: f32 = 0.6;

/// Least information about a plane in the weighted heights, as a share of that in as many heights of unit variance. Heights
/// in a row leave a slope undetermined. Half or twice: no change.
const LEAST_KNOWN: f32 = 1e-3;

/// A plane over places: its height at the origin, and its slopes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct GapPlane(Vec3);

impl GapPlane {
    pub(crate) fn new(height: f32, slopes: Vec2) -> Self {
        Self(slopes.extend(height))
    }

    /// How far `height` is above the plane.
    pub(crate) fn residual(self, (place, height): (Vec2, f32)) -> f32 {
        height - self.0.dot(place.extend(1.0))
    }

    /// `self` for a `share` of 0, `other` for 1.
    pub(crate) fn lerp(self, other: Self, share: f32) -> Self {
        Self(self.0.lerp(other.0, share))
    }

    /// The plane on which most of `heights` lie, and the share of heights within twice `near` of it. The share counts
    /// [`LEAST_PLANE`] more heights that lie elsewhere, so that few heights are no plane. The search begins with `self`, the
    /// plane that fits all best, with a standard deviation of `spread`.
    ///
    /// Least squares, weighted anew in each round with ever narrower Geman–McClure weights (Blake and
    /// Zisserman's graduated non-convexity, doi 10.7551/mitpress/7132.001.0001). Places should have about
    /// unit variance. Cost: seven passes over at most 384 heights.
    pub(crate) fn of_most(
        self,
        heights: impl ExactSizeIterator<Item = (Vec2, f32)> + Clone,
        spread: f32,
        near: f32,
    ) -> (Self, f32) {
        if heights.len() < LEAST_PLANE {
            return (self, 0.0);
        }
        let stride = heights.len().div_ceil(MOST_HEIGHTS);
        let heights = heights.step_by(stride);
        let count = heights.len();
        let mut plane = self;
        for round in 1..=ROUNDS {
            let scale = (spread * NARROWER.powi(round)).max(near);
            let (mut matrix, mut moments) = (Mat3::ZERO, Vec3::ZERO);
            for (place, height) in heights.clone() {
                let off = plane.residual((place, height)) / scale;
                let weight = (1.0 + off * off).powi(-2);
                let basis = place.extend(1.0);
                let weighted = weight * basis;
                matrix += Mat3::from_cols(basis.x * weighted, basis.y * weighted, weighted);
                moments += height * weighted;
            }
            if matrix.determinant() < LEAST_KNOWN * (count as f32).powi(3) {
                break;
            }
            plane = Self(matrix.inverse() * moments);
        }
        let on_plane = heights.filter(|&height| plane.residual(height).abs() < 2.0 * near);
        (
            plane,
            on_plane.count() as f32 / (count + LEAST_PLANE) as f32,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;

    /// Places of unit variance, heights on a plane, scattered by `scatter`, and of every so many one that
    /// is anywhere above it.
    fn heights(scatter: f32, odd_one_in: usize, rng: &mut Rng) -> Vec<(Vec2, f32)> {
        let side = || 12.0_f32.sqrt();
        (0..200)
            .map(|k| {
                let place = side() * Vec2::new(rng.f32() - 0.5, rng.f32() - 0.5);
                let odd = if k % odd_one_in == 0 {
                    4.0 * rng.f32()
                } else {
                    0.0
                };
                let off = scatter * (rng.f32() + rng.f32() - 1.0);
                (place, 2.0 + 0.3 * place.x - 0.2 * place.y + off + odd)
            })
            .collect()
    }

    /// A third of odd heights lifts the plane that fits all best by 0.7; most of the others are found.
    #[test]
    fn odd_heights_do_not_count() {
        let mut rng = Rng::with_seed(1);
        for scatter in [0.0, 0.05, 0.1] {
            let heights = heights(scatter, 3, &mut rng);
            let best = GapPlane::new(2.67, Vec2::new(0.3, -0.2));
            let (plane, share) = best.of_most(heights.iter().copied(), 1.0, 0.05);
            for corner in [Vec2::ONE, -Vec2::ONE, Vec2::new(1.0, -1.0)] {
                let truth = 2.0 + 0.3 * corner.x - 0.2 * corner.y;
                // What scatters with a deviation of 0.04 in 133 places, and the odd ones near the plane.
                assert!(plane.residual((corner, truth)).abs() < 0.03, "{plane:?}");
            }
            assert!((0.55..0.7).contains(&share), "{share}");
        }
    }

    /// Without odd ones it is the plane of least squares: nothing is made up.
    #[test]
    fn what_is_flat_stays() {
        let mut rng = Rng::with_seed(2);
        let heights = heights(0.0, usize::MAX, &mut rng);
        let start = GapPlane::new(2.0, Vec2::new(0.3, -0.2));
        let (plane, share) = start.of_most(heights[1..].iter().copied(), 0.0, 0.05);
        assert!((plane.0 - start.0).length() < 1e-4, "{plane:?}");
        assert_eq!(share, 199.0 / 211.0);
    }

    /// Few heights, or heights in a row, leave the plane as it was.
    #[test]
    fn few_places_tell_nothing() {
        let start = GapPlane::new(1.0, Vec2::ONE);
        let row = (0..40).map(|k| (Vec2::X * (k as f32 - 20.0) / 11.5, 0.0));
        assert_eq!(start.of_most(row, 1.0, 0.05).0, start);
        let few = (0..11).map(|k| (Vec2::new(k as f32, (k * k) as f32), 0.0));
        assert_eq!(start.of_most(few, 1.0, 0.05), (start, 0.0));
        let none = std::iter::empty::<(Vec2, f32)>();
        assert_eq!(start.of_most(none, 1.0, 0.05), (start, 0.0));
    }
}
