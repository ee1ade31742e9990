//! The gaps around a contact as a quadric over its plane, fitted to gaps and normals, and how far it may be off.
//!
//! The fit is robust: least squares, weighted anew in each round with Geman–McClure weights (Black and Rangarajan,
//! doi 10.1007/BF00131148). Its errors are those of the gaps alone. Normals come from the same points, so they make
//! the fit better, but not its errors smaller. Residuals that neighbours share count once.

use crate::contact::estimate::Observed;
use crate::contact::links::Links;
use glamx::{Vec2, Vec3};

/// Rounds of the fit. After four the coefficients change by less than their errors.
const ROUNDS: usize = 7;

/// A residual of this many deviations has a quarter of its weight. With 1.5 the rim of a ball's contact is an outlier; with 6
/// the rim of a face whose normals were estimated is none.
const OUTLIER: f32 = 3.0;

/// Least deviation of gaps, in pixels, and of slopes: what images leave of smooth surfaces. With half of it the places
/// of a ball's contact are believed too much, with twice of it a ball of 20 pixels touches in four points.
pub(crate) const LEAST_DEVIATION: f32 = 0.02;

/// What bends have at least, in squares of pixels of information: keeps the bend that few pixels do not tell below one in a
/// pixel. A factor of two changes nothing from a dozen pixels on.
const LEAST_KNOWN_BEND: f64 = 1.0;

/// Most by which neighbours' residuals correlate. It bounds the growth of the errors.
const MOST_ALIKE: f32 = 0.95;

/// Coefficients, or the form that takes a value from them: 1, x, y, x²/2, xy, y²/2.
type Row = [f64; 6];

/// A quadric over places in pixels. Gaps are in pixels.
#[derive(Clone, Debug)]
pub(crate) struct Quadric {
    coefficients: Row,
    /// Cholesky factor of the information that gaps have about the coefficients.
    information: [Row; 6],
    /// Standard deviation of all gaps about it, pixels.
    pub(crate) gaps_off: f32,
    /// Standard deviation of all slopes, and of them as tangents of angles.
    pub(crate) slopes_off: f32,
}

impl Quadric {
    /// The quadric that most of `observed` lie on. `residuals` is overwritten, one for each of `contacts` contact pixels.
    ///
    /// Cost: eight passes over the pixels.
    pub(crate) fn fit(
        observed: &[Observed],
        links: &Links,
        contacts: usize,
        residuals: &mut Vec<Vec3>,
    ) -> Self {
        let mut quadric = Self {
            coefficients: [0.0; 6],
            information: [[0.0; 6]; 6],
            gaps_off: 0.0,
            slopes_off: 0.0,
        };
        // Of gaps and of slopes; infinite before the first fit.
        let mut deviations = [f32::INFINITY; 2];
        let mut alike = [1.0; 2];
        for round in 0..ROUNDS {
            let weights = Weights { deviations, alike };
            let weigh = |quadric: &Self, o: &Observed| match round {
                0 => 1.0,
                _ => weights.of(quadric.off(o)),
            };
            let mut information = Information::default();
            for o in observed {
                let [of_gap, of_slope] = weights.scaled(weigh(&quadric, o));
                information.add(&gap_form(o.place), o.gap, of_gap * o.weight);
                for (axis, turn) in [(Vec2::X, o.turn.x), (Vec2::Y, o.turn.y)] {
                    let form = slope_form(o.place, axis);
                    information.add(&form, turn, of_slope * o.turn_weight);
                }
            }
            quadric.information = information.factor();
            quadric.coefficients = solve(&quadric.information, &information.moments);
            deviations = quadric.deviations(observed, |o| weigh(&quadric, o));
            if round + 2 == ROUNDS {
                alike = quadric.alike(observed, links, contacts, residuals);
            }
        }
        let weights = Weights { deviations, alike };
        let mut of_gaps = Information::default();
        for o in observed {
            let off = quadric.off(o).with_x(0.0).with_y(0.0);
            let [weight, _] = weights.scaled(weights.of(off));
            of_gaps.add(&gap_form(o.place), o.gap, weight * o.weight);
        }
        quadric.information = of_gaps.factor();
        let (mut gaps, mut slopes, mut known) = (0.0, 0.0, 0.0);
        for o in observed {
            gaps += quadric.off(o).z.powi(2);
            slopes += o.turn_weight * (o.slope - quadric.slope(o.place)).length_squared();
            known += o.turn_weight;
        }
        quadric.gaps_off = (gaps / observed.len() as f32).sqrt();
        quadric.slopes_off = (slopes / f32::max(known, f32::MIN_POSITIVE)).sqrt();
        quadric
    }

    /// The gap at a place.
    pub(crate) fn gap(&self, place: Vec2) -> f32 {
        self.value(&gap_form(place))
    }

    /// How steeply gaps rise at a place along `axis`, and the standard error of that.
    pub(crate) fn slope_along(&self, place: Vec2, axis: Vec2) -> [f32; 2] {
        let form = slope_form(place, axis);
        [self.value(&form), self.error(&form)]
    }

    /// How much gaps bend along `axis`, per pixel, and the standard error of that.
    pub(crate) fn bend_along(&self, axis: Vec2) -> [f32; 2] {
        let [u, v] = [axis.x, axis.y].map(f64::from);
        let form = [0.0, 0.0, 0.0, u * u, 2.0 * u * v, v * v];
        [self.value(&form), self.error(&form)]
    }

    /// The unit axis along which gaps bend most.
    pub(crate) fn main_axis(&self) -> Vec2 {
        let [xx, xy, yy] = [3, 4, 5].map(|k| self.coefficients[k] as f32);
        Vec2::from_angle(0.5 * (2.0 * xy).atan2(xx - yy))
    }

    fn value(&self, form: &Row) -> f32 {
        dot(&self.coefficients, form) as f32
    }

    fn error(&self, form: &Row) -> f32 {
        let scaled = solve_lower(&self.information, form);
        dot(&scaled, &scaled).sqrt() as f32
    }

    fn slope(&self, place: Vec2) -> Vec2 {
        let along = |axis| self.value(&slope_form(place, axis));
        Vec2::new(along(Vec2::X), along(Vec2::Y))
    }

    /// How far slopes, as turns of normals, and the gap are off.
    fn off(&self, o: &Observed) -> Vec3 {
        (o.turn - self.slope(o.place)).extend(o.gap - self.gap(o.place))
    }

    /// Standard deviations of gaps and slopes, weighted.
    fn deviations(&self, observed: &[Observed], weigh: impl Fn(&Observed) -> f32) -> [f32; 2] {
        let (mut squares, mut weights) = ([0.0; 2], [f32::MIN_POSITIVE; 2]);
        for o in observed {
            let (off, weight) = (self.off(o), weigh(o));
            let [gap, turn] = [o.weight, o.turn_weight].map(|own| own * weight);
            squares[0] += gap * off.z * off.z;
            weights[0] += gap;
            // One of two slopes.
            squares[1] += 0.5 * turn * off.truncate().length_squared();
            weights[1] += turn;
        }
        [0, 1].map(|k| (squares[k] / weights[k]).sqrt().max(LEAST_DEVIATION))
    }

    /// How many pixels share one error, for gaps and for slopes, by how alike neighbours' residuals are. If that falls
    /// from pixel to pixel by the same factor ρ, it is (1 + ρ) / (1 − ρ) along each axis.
    fn alike(
        &self,
        observed: &[Observed],
        links: &Links,
        contacts: usize,
        residuals: &mut Vec<Vec3>,
    ) -> [f32; 2] {
        residuals.clear();
        residuals.resize(contacts, Vec3::NAN);
        for o in observed {
            residuals[o.member as usize] = self.off(o);
        }
        let (mut mixed, mut squares) = ([0.0; 2], [f32::MIN_POSITIVE; 2]);
        for o in observed {
            let off = residuals[o.member as usize];
            for &neighbor in links.neighbors(o.member) {
                let other = residuals[neighbor as usize];
                if other.is_nan() {
                    continue;
                }
                let [slope, other_slope] = [off, other].map(Vec3::truncate);
                let both = [off.z * other.z, slope.dot(other_slope)];
                let own = [
                    off.z.powi(2) + other.z.powi(2),
                    slope.length_squared() + other_slope.length_squared(),
                ];
                for k in 0..2 {
                    mixed[k] += both[k];
                    squares[k] += 0.5 * own[k] + LEAST_DEVIATION.powi(2);
                }
            }
        }
        [0, 1].map(|k| {
            let rho = (mixed[k] / squares[k]).clamp(0.0, MOST_ALIKE);
            ((1.0 + rho) / (1.0 - rho))
                .powi(2)
                .min(observed.len() as f32)
        })
    }
}

/// How much observations count.
struct Weights {
    /// Of gaps, pixels, and of slopes.
    deviations: [f32; 2],
    alike: [f32; 2],
}

impl Weights {
    /// Of an observation that is `off` so far, 1 at most.
    fn of(&self, off: Vec3) -> f32 {
        let [gaps, slopes] = self.deviations.map(|deviation| OUTLIER * deviation);
        robust(off.z / gaps) * robust(off.truncate().length() / slopes)
    }

    /// The same in squares of deviations, for gaps and slopes.
    fn scaled(&self, weight: f32) -> [f32; 2] {
        [0, 1].map(|k| match self.deviations[k] {
            deviation if deviation.is_finite() => weight / deviation.powi(2) / self.alike[k],
            _ => weight,
        })
    }
}

/// Geman–McClure weight of what is so many scales off.
pub(crate) fn robust(off: f32) -> f32 {
    (1.0 + off * off).powi(-2)
}

fn gap_form(place: Vec2) -> Row {
    let [x, y] = [place.x, place.y].map(f64::from);
    [1.0, x, y, 0.5 * x * x, x * y, 0.5 * y * y]
}

fn slope_form(place: Vec2, axis: Vec2) -> Row {
    let [x, y, u, v] = [place.x, place.y, axis.x, axis.y].map(f64::from);
    [0.0, u, v, u * x, u * y + v * x, v * y]
}

fn dot(a: &Row, b: &Row) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// The normal equations.
struct Information {
    /// Its lower half.
    matrix: [Row; 6],
    moments: Row,
}

impl Default for Information {
    fn default() -> Self {
        let mut matrix = [[0.0; 6]; 6];
        for (k, row) in matrix.iter_mut().enumerate() {
            // The plane of a single pixel is known as well as nothing.
            row[k] = if k < 3 { 1e-6 } else { LEAST_KNOWN_BEND };
        }
        Self {
            matrix,
            moments: [0.0; 6],
        }
    }
}

impl Information {
    fn add(&mut self, form: &Row, value: f32, weight: f32) {
        let (value, weight) = (f64::from(value), f64::from(weight));
        for i in 0..6 {
            let weighted = weight * form[i];
            self.moments[i] += weighted * value;
            for j in 0..=i {
                self.matrix[i][j] += weighted * form[j];
            }
        }
    }

    /// Lower Cholesky factor.
    fn factor(&self) -> [Row; 6] {
        let mut lower = [[0.0; 6]; 6];
        for i in 0..6 {
            for j in 0..=i {
                let known: f64 = (0..j).map(|k| lower[i][k] * lower[j][k]).sum();
                let rest = self.matrix[i][j] - known;
                lower[i][j] = if i == j {
                    rest.max(f64::EPSILON).sqrt()
                } else {
                    rest / lower[j][j]
                };
            }
        }
        lower
    }
}

fn solve_lower(lower: &[Row; 6], values: &Row) -> Row {
    let mut solved = [0.0; 6];
    for i in 0..6 {
        let known: f64 = (0..i).map(|k| lower[i][k] * solved[k]).sum();
        solved[i] = (values[i] - known) / lower[i][i];
    }
    solved
}

fn solve(lower: &[Row; 6], values: &Row) -> Row {
    let half = solve_lower(lower, values);
    let mut solved = [0.0; 6];
    for i in (0..6).rev() {
        let known: f64 = (i + 1..6).map(|k| lower[k][i] * solved[k]).sum();
        solved[i] = (half[i] - known) / lower[i][i];
    }
    solved
}

#[cfg(test)]
mod tests {
    use crate::contact::footprint::{Footprint, normal};
    use glamx::Vec2;

    /// Gaps of a quadric: slope, bends along x, both and y.
    fn surface(at: Vec2) -> (f32, Vec2) {
        let bent = Vec2::new(0.05 * at.x + 0.01 * at.y, 0.01 * at.x - 0.02 * at.y);
        let slope = Vec2::new(0.1, -0.05);
        (0.2 + slope.dot(at) + 0.5 * bent.dot(at), slope + bent)
    }

    fn disc(at: Vec2) -> bool {
        at.length() < 8.0
    }

    /// The slope and bend that are found beside what they are, in their standard errors, for one axis.
    fn off(footprint: &Footprint, by_gaps_alone: bool) -> [f32; 2] {
        let mut observed = footprint.observed();
        for o in &mut observed {
            o.weight = 1.0;
            (o.turn, o.turn_weight) = match by_gaps_alone {
                true => (surface(o.place).1, 0.0),
                false => (o.slope, 1.0),
            };
        }
        let quadric = footprint.quadric(&observed);
        let [slope, slope_error] = quadric.slope_along(Vec2::ZERO, Vec2::X);
        let [bend, bend_error] = quadric.bend_along(Vec2::X);
        [(slope - 0.1) / slope_error, (bend - 0.05) / bend_error]
    }

    fn deviation(offs: &[f32]) -> f32 {
        (offs.iter().map(|off| off * off).sum::<f32>() / offs.len() as f32).sqrt()
    }

    #[test]
    fn a_quadric_is_found_exactly_and_beside_outliers() {
        for outliers in [0.0, 0.1] {
            let mut rng = fastrand::Rng::with_seed(1);
            let footprint = Footprint::of(|at| {
                let (gap, slope) = surface(at);
                let outlier = f32::from(rng.f32() < outliers);
                disc(at).then_some((gap + 2.0 * outlier, slope))
            });
            let mut observed = footprint.observed();
            for o in &mut observed {
                (o.weight, o.turn_weight, o.turn) = (1.0, 1.0, o.slope);
            }
            let quadric = footprint.quadric(&observed);
            for at in [Vec2::ZERO, Vec2::new(3.0, -2.0), Vec2::new(-5.0, 1.0)] {
                assert!(
                    (quadric.gap(at) - surface(at).0).abs() < 0.02,
                    "{at}, {outliers}"
                );
            }
            assert!(
                (quadric.bend_along(Vec2::X)[0] - 0.05).abs() < 0.001,
                "{outliers}"
            );
            assert!(
                (quadric.bend_along(Vec2::Y)[0] + 0.02).abs() < 0.001,
                "{outliers}"
            );
        }
    }

    /// Noise of single pixels, and of pixels that share it with their neighbours, as points that several pixels see do.
    /// Normals tell more than gaps alone, which decide the errors. The outliers that the fit expects of any noise make errors a
    /// fifth too small; where as few as twenty pixels differ, the fit follows their noise. If shared noise counted for each pixel,
    /// errors were 3.6 times too small.
    #[test]
    fn errors_are_as_told() {
        for (shared, by_gaps_alone, expected) in [
            (false, true, 0.8..1.3),
            (true, true, 0.6..1.7),
            (false, false, 0.1..0.9),
        ] {
            let mut offs = [vec![], vec![]];
            for seed in 0..300 {
                let mut rng = fastrand::Rng::with_seed(seed);
                let noise: Vec<f32> = (0..43 * 43).map(|_| normal(&mut rng)).collect();
                let noise_at = |at: Vec2| {
                    let [i, j] = [at.x + 21.0, at.y + 21.0].map(|x| x as usize);
                    let reach = usize::from(shared);
                    let rows = j - reach..=j + reach;
                    let cells = rows.flat_map(|j| (i - reach..=i + reach).map(move |i| 43 * j + i));
                    let count = (2 * reach + 1) as f32;
                    cells.map(|cell| noise[cell]).sum::<f32>() / count
                };
                let footprint = Footprint::of(|at| {
                    let (gap, slope) = surface(at);
                    let turn = 0.01 * Vec2::new(normal(&mut rng), normal(&mut rng));
                    disc(at).then_some((gap + 0.1 * noise_at(at), slope + turn))
                });
                for (offs, off) in offs.iter_mut().zip(off(&footprint, by_gaps_alone)) {
                    offs.push(off);
                }
            }
            let deviations = offs.map(|offs| deviation(&offs));
            for deviation in deviations {
                assert!(
                    expected.contains(&deviation),
                    "{deviations:?}, not {expected:?}"
                );
            }
        }
    }
}
