//! Coordinates in which wide gaps between points are shortened, so that empty space takes no
//! memory.
//!
//! Grids and images are dense over the bounds of the points, and one point far from all others can
//! make them arbitrarily large. If that would cost more than the points do, each axis is folded: a
//! gap of more than a few quanta between points is cut down to these few, by a whole number of
//! quanta. Points within a quantum of each other keep their distance. Others stay at least two
//! quanta apart. So neighbourhoods, splats and the pixels of one contact do not change. A place on
//! a folded axis is found again by adding what was cut.

use super::rect::Rect;
use super::room::PER_POINT;
use glamx::Vec3;

/// Empty quanta that remain of a gap: one belongs to the points before it, one to the points behind it, and one lies
/// between. With fewer, points on both sides could meet.
const LEFT: i64 = 3;

/// Pixels up to which an image is not folded, whatever the number of points: 256 × 256, which takes less time than the
/// stages before it. Half or twice: no row changes.
const SMALL: usize = 1 << 16;

/// Edges of a cell in reaches beyond which its grid is folded. The cells of surfaces, which fill little of their
/// bounds, are up to three times as large as the reach. Half or twice: no row changes.
const COARSE: f32 = 4.0;

/// Least edge of a quantum in pixels: what casts look at beside a surface, and two for the rounding of a border.
/// Half or twice: no test of queries fails.
const LEAST_QUANTUM: i32 = 8;

/// Largest coordinate of a pixel of an image: an `i32` holds four times as many, so that differences fit, too.
pub(super) const FARTHEST_PIXEL: f32 = (1 << 29) as f32;

/// Whether cells of so many per metre are much larger than `reach` metres, since most are empty.
pub(super) fn is_coarse(inv_cell: f32, reach: f32) -> bool {
    inv_cell * reach < COARSE.recip()
}

/// One axis, kept from call to call. Folds nothing at first.
#[derive(Debug, Default)]
pub(crate) struct AxisFold {
    /// Metres.
    quantum: f64,
    keys: Vec<i32>,
    runs: Vec<Run>,
}

/// What is between two gaps.
#[derive(Clone, Copy, Debug)]
struct Run {
    /// The first quantum.
    first: i64,
    /// By how many quanta it moves towards the lower end.
    cut: i64,
}

impl AxisFold {
    fn clear(&mut self) {
        self.runs.clear();
    }

    /// Folds the gaps between `coordinates`, metres. Where their median is nothing moves, so that nothing is rounded
    /// there. Cost: that of sorting them.
    fn find(&mut self, quantum: f64, coordinates: impl Iterator<Item = f32>) {
        self.quantum = quantum;
        self.keys.clear();
        self.keys
            .extend(coordinates.map(|c| (f64::from(c) / self.quantum).floor() as i32));
        self.keys.sort_unstable();
        self.runs.clear();
        let first = i64::MIN / 2; // before all keys
        self.runs.push(Run { first, cut: 0 });
        let (mut cut, mut at_median) = (0, 0);
        for (k, pair) in self.keys.windows(2).enumerate() {
            let [before, behind] = [0, 1].map(|k| i64::from(pair[k]));
            let empty = behind - before - 1;
            if empty > LEFT {
                cut += empty - LEFT;
                let first = behind - 1;
                self.runs.push(Run { first, cut });
                if k < self.keys.len() / 2 {
                    at_median = cut;
                }
            }
        }
        if cut == 0 {
            self.runs.clear();
        }
        self.runs.iter_mut().for_each(|run| run.cut -= at_median);
    }

    /// Where a coordinate is on the folded axis, metres.
    #[inline]
    fn folded(&self, coordinate: f32) -> f32 {
        if self.runs.is_empty() {
            return coordinate;
        }
        let key = (f64::from(coordinate) / self.quantum).floor() as i64;
        let after = self.runs.partition_point(|run| run.first <= key);
        match after.checked_sub(1).map_or(0, |last| self.runs[last].cut) {
            0 => coordinate,
            cut => (f64::from(coordinate) - cut as f64 * self.quantum) as f32,
        }
    }

    /// By how many quanta a quantum of the folded axis was moved.
    fn cut_at(&self, folded: i64) -> i64 {
        let after = self
            .runs
            .partition_point(|run| run.first - run.cut <= folded);
        after.checked_sub(1).map_or(0, |last| self.runs[last].cut)
    }
}

/// The axes of space, for the cells of a grid; kept from call to call.
#[derive(Debug, Default)]
pub(crate) struct SpaceFold([AxisFold; 3]);

impl SpaceFold {
    /// Folds nothing.
    pub(crate) fn clear(&mut self) {
        self.0.iter_mut().for_each(AxisFold::clear);
    }

    /// Folds the gaps between points; what is within `reach` metres stays so.
    pub(crate) fn find(&mut self, reach: f32, points: impl Iterator<Item = Vec3> + Clone) {
        for (k, axis) in self.0.iter_mut().enumerate() {
            axis.find(reach.into(), points.clone().map(|point| point[k]));
        }
    }

    pub(crate) fn is_identity(&self) -> bool {
        self.0.iter().all(|axis| axis.runs.is_empty())
    }

    #[inline]
    pub(crate) fn folded(&self, point: Vec3) -> Vec3 {
        let [x, y, z] = &self.0;
        Vec3::new(x.folded(point.x), y.folded(point.y), z.folded(point.z))
    }
}

/// Columns and rows of a view; kept from call to call. Folds nothing at first.
#[derive(Debug, Default)]
pub(crate) struct ViewFold {
    axes: [AxisFold; 2],
    /// Pixels.
    quantum: i32,
}

impl ViewFold {
    pub(super) fn clear(&mut self) {
        self.axes.iter_mut().for_each(AxisFold::clear);
    }

    /// Whether an image of this many `points` is worth folding.
    pub(super) fn is_wanted(rect: &Rect, points: usize) -> bool {
        rect.pixels() > SMALL + PER_POINT * points
    }

    /// Folds the gaps between view coordinates `[x, y]`, metres, of points that reach out by `reach` pixels.
    pub(super) fn find(
        &mut self,
        reach: f32,
        pixel_size: f32,
        points: impl Iterator<Item = [f32; 2]> + Clone,
    ) {
        self.quantum = LEAST_QUANTUM + reach.ceil().min(FARTHEST_PIXEL) as i32;
        let quantum = f64::from(self.quantum) * f64::from(pixel_size);
        for (k, axis) in self.axes.iter_mut().enumerate() {
            axis.find(quantum, points.clone().map(|point| point[k]));
        }
    }

    /// Moves view coordinates, metres, to where they are in the folded image.
    pub(super) fn fold(&self, x: &mut [f32], y: &mut [f32]) {
        for (axis, coordinates) in self.axes.iter().zip([x, y]) {
            coordinates.iter_mut().for_each(|c| *c = axis.folded(*c));
        }
    }

    /// Column and row, in the view, of a pixel of the folded image.
    pub(super) fn unfolded(&self, pixel: [i32; 2]) -> [i32; 2] {
        std::array::from_fn(|k| {
            let axis = &self.axes[k];
            if axis.runs.is_empty() {
                return pixel[k];
            }
            let cut = axis.cut_at(i64::from(pixel[k].div_euclid(self.quantum)));
            let unfolded = i64::from(pixel[k]) + cut * i64::from(self.quantum);
            unfolded.clamp(i32::MIN.into(), i32::MAX.into()) as i32
        })
    }

    /// The same for a place in pixel coordinates.
    pub(super) fn place(&self, place: [f32; 2]) -> [f32; 2] {
        let pixel = place.map(|c| c.floor() as i32);
        let unfolded = self.unfolded(pixel);
        std::array::from_fn(|k| match unfolded[k] == pixel[k] {
            true => place[k],
            false => unfolded[k] as f32 + (place[k] - pixel[k] as f32),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;

    /// Clusters of points from a metre to the size of the Earth apart, by brute force: neighbours keep their offsets,
    /// others stay apart, the order stays, and an axis is as long as its clusters.
    #[test]
    fn neighbours_stay_and_gaps_go() {
        for seed in 0..50 {
            let mut rng = Rng::with_seed(seed);
            let quantum = 0.1f32;
            let mut middle = -(10.0f32.powf(rng.f32() * 4.0));
            let mut points = Vec::new();
            for _ in 0..8 {
                points.extend((0..20).map(|_| middle + 0.5 * rng.f32()));
                middle += 10.0f32.powf(rng.f32() * 4.0);
            }
            let mut fold = AxisFold::default();
            fold.find(quantum.into(), points.iter().copied());
            let folded: Vec<f32> = points.iter().map(|p| fold.folded(*p)).collect();
            // Of a coordinate of 80 km, twice.
            let rounding = 0.016;
            for (p, f) in points.iter().zip(&folded) {
                for (q, g) in points.iter().zip(&folded) {
                    let (apart, after) = (q - p, g - f);
                    if apart.abs() <= quantum {
                        assert!((apart - after).abs() <= rounding, "{seed}: {apart} {after}");
                    } else {
                        assert!(after.abs() >= quantum - rounding, "{seed}: {apart} {after}");
                        assert!(apart * after > 0.0, "{seed}: {apart} {after}");
                    }
                }
            }
            let length = folded.iter().copied().fold(f32::NEG_INFINITY, f32::max)
                - folded.iter().copied().fold(f32::INFINITY, f32::min);
            assert!(length <= 8.0 * (0.5 + 5.0 * quantum), "{seed}: {length}");
        }
    }

    /// What is within a quantum of a point is unfolded to where it was.
    #[test]
    fn pixels_are_found_again() {
        for seed in 0..50 {
            let mut rng = Rng::with_seed(seed);
            let pixels: Vec<[i32; 2]> = (0..30)
                .map(|_| [0, 1].map(|_| (10.0f32.powf(6.0 * rng.f32()) * (rng.f32() - 0.5)) as i32))
                .collect();
            let pixel_size = 0.25;
            let points = pixels
                .iter()
                .map(|p| p.map(|c| pixel_size * (c as f32 + 0.5)));
            let mut fold = ViewFold::default();
            let reach = 12.0 * rng.f32();
            fold.find(reach, pixel_size, points.clone());
            let (mut x, mut y): (Vec<f32>, Vec<f32>) = points.map(|[x, y]| (x, y)).unzip();
            fold.fold(&mut x, &mut y);
            for (k, pixel) in pixels.iter().enumerate() {
                let folded = [x[k], y[k]].map(|c| (c / pixel_size).floor() as i32);
                for beside in [0, reach as i32, -(reach as i32)] {
                    let expected = pixel.map(|c| c + beside);
                    assert_eq!(
                        fold.unfolded(folded.map(|c| c + beside)),
                        expected,
                        "seed {seed}"
                    );
                }
            }
        }
    }
}
