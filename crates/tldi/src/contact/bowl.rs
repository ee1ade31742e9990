//! The bowl that gaps form around the contact of a round surface: where it is lowest, and how
//! certain that is.

use crate::{ContactPixel, ContactPoint};
use glamx::{Mat3, Vec2, Vec3};

/// Largest share of the roughness that a bowl may leave: noise of a quarter of a radius leaves a third of a ball's. Half: a
/// ball on new samples each frame fails with each of 6 seeds instead of none; twice: depths of boxes on ramps, exact now,
/// are 0.02 mean radii off.
const UNEXPLAINED: f32 = 0.5;

/// The same of less than [`MANY`] points: a small flat face whose rim is bent by estimated normals is no bowl, nor is a
/// crease. Half: a ball of restitution 1 fails with each of 6 seeds instead of none; twice: no change.
const UNEXPLAINED_OF_FEW: f32 = 0.1;

/// Number of points from which noise can be told from a rim or a crease. 12: a ball on new samples each frame rolls up to
/// 1.6 times as fast; twice: it fails with each of 6 seeds instead of none.
const MANY: f32 = 30.0;

/// Largest distance of a bowl's lowest point from the middle of the points, in standard deviations along each main
/// axis. The rim of a disc is at 2. Half or twice: no change.
const OUTERMOST: f32 = 1.5;

/// Least ratio between the widening of a bowl along its two axes, in standard deviations of its points. In these units, a
/// whole bowl widens equally, however oblong it is. Along a cylinder nothing widens, and along a capsule its ends do. 0.3: 200 N
/// squeeze a capsule of 6 r̄ out from under a plate, because it turns about a single point; 0.6: a lying capsule, as long as it
/// is wide, changes from one point to two when it lands, and rocks on.
const LEAST_ALIKE: f32 = 0.4;

/// Fewest points of a bowl. It has six unknowns, so a bowl fits any six points, with its lowest point anywhere. Half: six
/// unknowns of fewer points; twice: no test of `patches` and `bodies` fails.
const BOWL_POINTS: f32 = 7.0;

/// Least spread of the squares of places, as a share of that in a disc, and least part of it that the axes do not have
/// in common. If places differ less, rounding decides the bend. Half or twice: no change.
const KNOWN_BEND: f32 = 0.02;

/// Error of the slope of the gaps, for each metre by which they scatter about the means with their neighbours, over the root of
/// their number: two standard errors; pixels that see the same points share theirs (the lowest points of a ball on a noisy plane
/// vary 1.5 times as much as with independent pixels); and a gap is part of the mean. Half: a ball on new samples each frame
/// fails with each of 6 seeds instead of none; twice: no change.
const DOUBT: f32 = 3.3;

/// Error of a bowl's lowest gap, for each metre of error in its slope: in a disc the root of 4, 1 for the mean and 3
/// for the bend. Half: a ball on new samples each frame fails with 3 of 6 seeds instead of none; twice: no change.
pub(crate) const GAP_PER_SLOPE: f32 = 2.0;

/// Largest ratio between the radii that normals and gaps tell. Beyond it, the normals are not those of the surface.
/// Half or twice: no change.
const ALIKE_RADII: f32 = 2.0;

/// The lowest point of a bowl.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Lowest {
    /// The point, and the gap there.
    pub(crate) point: ContactPoint,
    /// Displacement of the lowest point along each axis of the bowl, metres, for each metre of error in the slope: the gap over
    /// one standard deviation of the places.
    pub(crate) aside: [Vec3; 2],
    /// Along the same axes, vectors as long as the bowl's radii of curvature, metres.
    pub(crate) radii: [Vec3; 2],
}

/// The floor of a valley.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Floor {
    /// Its ends, and the gaps there.
    pub(crate) ends: [ContactPoint; 2],
    /// Across it, a vector as long as its radius of curvature, metres.
    pub(crate) radius: Vec3,
}

/// Where gaps around the contact of a cylinder are lowest.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Valley {
    /// Where its floor is along the bowl's first axis, which leads across it, in standard deviations.
    pub(crate) place: f32,
    /// Rise of the gaps with the square of the distance from there, metres; distances in standard
    /// deviations.
    pub(crate) bend: f32,
}

/// A paraboloid that widens along two axes, or does not bend, above a plane. Its axes are those of its curvature. Where the
/// points extend as far in all directions, their main axes are arbitrary.
pub(crate) struct Bowl {
    /// From the main axes of the points to its own: the cosine and the sine of the angle.
    pub(crate) turn: Vec2,
    /// By how much it rises with the square of the place along its own axes, in standard deviations along these.
    widening: Vec2,
    /// Standard deviation of the heights about it, metres.
    pub(crate) left: f32,
    count: f32,
}

impl Bowl {
    /// The bowl that fits heights above a plane best. They are at places along the main axes, in standard deviations, which
    /// are `sigma` metres.
    pub(crate) fn fit(heights: impl Iterator<Item = (Vec2, f32)> + Clone, sigma: Vec2) -> Self {
        let (mut matrix, mut moments, mut count) = (Mat3::ZERO, Vec3::ZERO, 0.0);
        for (place, height) in heights.clone() {
            // Squares of the places, less their mean.
            let basis = (place * place - Vec2::ONE).extend(place.x * place.y);
            matrix += Mat3::from_cols(basis.x * basis, basis.y * basis, basis.z * basis);
            moments += height * basis;
            count += 1.0;
        }
        let squares = Vec3::new(matrix.x_axis.x, matrix.y_axis.y, matrix.z_axis.z);
        let is_known = count >= BOWL_POINTS
            && squares.min_element() > KNOWN_BEND * count
            && matrix.determinant() > KNOWN_BEND * squares.element_product();
        if !is_known {
            let left = heights.map(|(_, height)| height * height).sum::<f32>();
            return Self {
                turn: Vec2::X,
                widening: Vec2::ZERO,
                left: (left / count).sqrt(),
                count,
            };
        }
        // With the squares and the product of places in metres.
        let rise = matrix.inverse() * moments;
        let [x, y, mixed] = [
            rise.x / sigma.x.powi(2),
            rise.y / sigma.y.powi(2),
            rise.z / (sigma.x * sigma.y),
        ];
        let turn = Vec2::from_angle(0.5 * mixed.atan2(x - y));
        let (mean, off) = (0.5 * (x + y), 0.5 * (x - y).hypot(mixed));
        let bends = Vec2::new(mean + off, mean - off).max(Vec2::ZERO);
        let variance = |along: Vec2| (along * along).dot(sigma * sigma);
        let widening = bends * Vec2::new(variance(turn), variance(turn.perp()));
        let mut bowl = Self {
            turn,
            widening,
            left: 0.0,
            count,
        };
        let above = |place: Vec2| {
            let own = bowl.own(place * sigma);
            bends.dot(own * own) - widening.element_sum()
        };
        let left = heights.map(|(place, height)| (height - above(place)).powi(2));
        bowl.left = (left.sum::<f32>() / count).sqrt();
        bowl
    }

    /// A vector along the main axes as one along the bowl's own.
    pub(crate) fn own(&self, along_main: Vec2) -> Vec2 {
        Vec2::new(self.turn.dot(along_main), self.turn.perp_dot(along_main))
    }

    /// Whether it explains most of the `roughness` about the plane.
    pub(crate) fn explains_most(&self, roughness: f32) -> bool {
        self.left < UNEXPLAINED * roughness
    }

    /// The place of the lowest point along its own axes, and its height above the middle of a plane that rises by `slope` in a
    /// standard deviation along each of them. `None` unless the bowl widens in both directions, is lowest among its points, and
    /// explains most of the `roughness` about the plane.
    pub(crate) fn lowest(&self, slope: Vec2, roughness: f32) -> Option<(Vec2, f32)> {
        let place = -0.5 * slope / self.widening;
        let is_bowl = self.explains_most(roughness)
            && (self.count >= MANY || self.left < UNEXPLAINED_OF_FEW * roughness)
            && self.widening.min_element() >= LEAST_ALIKE * self.widening.max_element()
            && place.abs().max_element() <= OUTERMOST;
        let above = slope.dot(place) + self.widening.dot(place * place - Vec2::ONE);
        is_bowl.then_some((place, above))
    }

    /// The floor of a valley, above a plane that rises by `slope` as for [`lowest`](Self::lowest). `None` unless it widens
    /// along one axis only.
    pub(crate) fn valley(&self, slope: Vec2) -> Option<Valley> {
        let bend = self.widening.x;
        let place = -0.5 * slope.x / bend;
        let is_valley =
            self.count >= MANY && self.widening.y < LEAST_ALIKE * bend && place.abs() <= OUTERMOST;
        is_valley.then_some(Valley { place, bend })
    }

    /// How far the lowest place moves, for each metre of error in the slope.
    pub(crate) fn place_per_slope(&self) -> Vec2 {
        0.5 / self.widening
    }
}

/// Error of the slope of the gaps, metres over a standard deviation of the places. `off` says how far each gap is off
/// the fit through its neighbours, metres; on smooth surfaces this is less than `smooth`. 0 without noise, or of fewer than
/// [`MANY`] gaps.
pub(crate) fn slope_error(off: impl Iterator<Item = f32>, smooth: f32) -> f32 {
    let (squares, count) = off.fold((0.0, 0.0), |(sum, n), off| (sum + off * off, n + 1.0));
    if count < MANY {
        return 0.0;
    }
    let variance = (squares / count - smooth * smooth).max(0.0);
    DOUBT * (variance / count).sqrt()
}

/// Relative radius of curvature along `radius`, from how the normals turn: a vector, metres. Second: share (0 to 1) of the
/// normals' variance that a linear turn explains. `radius` is what the gaps tell: of a ball up to a fifth too much or too
/// little, depending on how far up gaps are known.
pub(crate) fn relative_radius<'c>(
    radius: Vec3,
    centre: Vec3,
    contacts: impl Iterator<Item = &'c ContactPixel>,
) -> (Vec3, f32) {
    let (axis, by_gaps) = radius.normalize_and_length();
    let (mut squares, mut turn, mut turns) = (0.0, 0.0, 0.0);
    for contact in contacts {
        let place = (contact.middle() - centre).dot(axis);
        let normal = (contact.normal_a + contact.normal_b).dot(axis);
        squares += place * place;
        turn += place * normal;
        turns += normal * normal;
    }
    let by_normals = squares / turn.max(f32::MIN_POSITIVE);
    let radius = by_normals.clamp(by_gaps / ALIKE_RADII, by_gaps * ALIKE_RADII) * axis;
    let steady = turn * turn / (squares * turns).max(f32::MIN_POSITIVE);
    (radius, steady)
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;

    /// A sum of twelve has the variance of one.
    fn normal(rng: &mut Rng) -> f32 {
        (0..12).map(|_| rng.f32() - 0.5).sum()
    }

    /// Places in a disc, in standard deviations along both axes.
    fn disc(radius_squared: f32) -> Vec<Vec2> {
        let grid = (-4..=4).flat_map(|i| (-4..=4).map(move |j| Vec2::new(i as f32, j as f32)));
        let disc: Vec<Vec2> = grid
            .filter(|p| p.length_squared() < radius_squared)
            .collect();
        let variance = disc.iter().map(|p| p.x * p.x).sum::<f32>() / disc.len() as f32;
        disc.into_iter().map(|p| p / variance.sqrt()).collect()
    }

    /// A bowl's lowest place is found under noise, which scatters as the fit says it does.
    #[test]
    fn noise_moves_the_lowest_point_as_far_as_told() {
        let mut rng = Rng::with_seed(11);
        let (places, widening, slope) = (disc(17.0), 0.4, Vec2::new(0.3, -0.2));
        let count = places.len() as f32;
        assert!(count >= MANY);
        let (mut squares, rounds) = (Vec2::ZERO, 400);
        let sigma = 0.1;
        let mut told = Vec2::ZERO;
        for _ in 0..rounds {
            let noisy = |p: &Vec2| (*p, widening * (*p * *p - Vec2::ONE).element_sum());
            let heights: Vec<(Vec2, f32)> = (places.iter().map(noisy))
                .map(|(p, height)| (p, height + sigma * normal(&mut rng)))
                .collect();
            // The slope is fitted before.
            let slope_of = |axis: fn(&Vec2) -> f32| {
                heights.iter().map(|(p, h)| axis(p) * h).sum::<f32>() / count
            };
            let fitted = slope + Vec2::new(slope_of(|p| p.x), slope_of(|p| p.y));
            let bowl = Bowl::fit(heights.iter().copied(), Vec2::ONE);
            let (lowest, _) = bowl.lowest(fitted, 10.0 * sigma).expect("a bowl");
            squares += (lowest + 0.5 * slope / widening).powf(2.0);
            told += sigma / count.sqrt() * bowl.place_per_slope();
        }
        let scatter = (squares.element_sum() / (2.0 * rounds as f32)).sqrt();
        let told = told.element_sum() / (2.0 * rounds as f32);
        // That the bend is fitted, too, adds a little.
        assert!((0.9..1.2).contains(&(scatter / told)), "{scatter} {told}");
    }

    /// A bowl under noise is one where many points tell so; of few it may as well be a rim.
    #[test]
    fn few_noisy_points_are_no_bowl() {
        let mut rng = Rng::with_seed(14);
        for (radius_squared, is_bowl) in [(7.0, false), (17.0, true)] {
            let places = disc(radius_squared);
            assert_eq!(places.len() as f32 >= MANY, is_bowl);
            let heights: Vec<(Vec2, f32)> = (places.iter())
                .map(|p| (*p, 0.4 * (*p * *p - Vec2::ONE).element_sum()))
                .map(|(p, height)| (p, height + 0.1 * normal(&mut rng)))
                .collect();
            let bowl = Bowl::fit(heights.iter().copied(), Vec2::ONE);
            let roughness = 0.45;
            assert!(
                (0.1..0.4).contains(&(bowl.left / roughness)),
                "{}",
                bowl.left
            );
            assert_eq!(bowl.lowest(Vec2::ZERO, roughness).is_some(), is_bowl);
        }
    }

    /// Gaps that widen along one axis only, as around the edge of a box, are no bowl, at any noise.
    #[test]
    fn a_noisy_edge_is_no_bowl() {
        let mut rng = Rng::with_seed(13);
        let places = disc(17.0);
        let mut round = 0;
        for across in [0.0, 0.4] {
            for _ in 0..200 {
                let height = |p: &Vec2| Vec2::new(0.4, across).dot(*p * *p - Vec2::ONE);
                let heights: Vec<(Vec2, f32)> = (places.iter())
                    .map(|p| (*p, height(p) + 0.08 * normal(&mut rng)))
                    .collect();
                let bowl = Bowl::fit(heights.iter().copied(), Vec2::ONE);
                let lowest = bowl.lowest(Vec2::ZERO, 1.0);
                assert!(lowest.is_none() || across > 0.0);
                round += usize::from(lowest.is_some());
            }
        }
        assert_eq!(round, 200);
    }

    /// Two standard errors of noise, none of what smooth surfaces leave or of too few pixels.
    #[test]
    fn noise_is_told_from_smooth_surfaces() {
        let mut rng = Rng::with_seed(12);
        let mut off = |sigma: f32, count: usize| -> Vec<f32> {
            (0..count).map(|_| sigma * normal(&mut rng)).collect()
        };
        assert_eq!(slope_error(off(0.03, 60).into_iter(), 0.05), 0.0);
        assert_eq!(slope_error(off(0.2, 20).into_iter(), 0.05), 0.0);
        let error = slope_error(off(0.2, 60).into_iter(), 0.05);
        let expected = DOUBT * 0.2 / 60.0_f32.sqrt();
        assert!((error / expected - 1.0).abs() < 0.3, "{error} {expected}");
    }
}
