//! Points, normals and radii of the pixels of a tile's line, all at once.

use super::sensor::{Intrinsics, SensorModel};
use multiversion::multiversion;
use tldi::glamx::{Mat3, Pose3, Vec3};

/// Edge in pixels of the tiles in which points come: their bounds are tight, so that what is out of
/// reach is passed over.
pub(super) const TILE: usize = 16;
/// Columns of a window, and its rows, from its middle, in its spacing.
const WINDOW: [i8; 5] = [-2, -1, 0, 1, 2];
/// Widest spacing of a window in pixels.
pub(super) const WIDEST: usize = 10;
/// Pixels that a window reaches to each side at most.
pub(super) const REACH: usize = WINDOW.len() / 2 * WIDEST;
/// Standard error of a slope, in radians, that a full window is made wide enough for. Half of its
/// pixels leave 4°, of which nine in ten directions are within 9°.
pub(super) const SLOPE_ERROR: f32 = 0.05;
/// Fewest pixels of a window, its middle included, that tell a plane: twice its unknowns.
pub(super) const FEWEST: f32 = 6.0;
/// Least variance of those pixels across their main direction, in squares of the spacing: fewer are a row. Half: no
/// test of depth frames fails; twice: that of images of any size does.
pub(super) const LEAST_WIDTH: f32 = 0.1;
/// Three standard errors of the slope of a first plane, of half of the window's pixels, over a spacing,
/// as a part of what a single pixel may differ by.
pub(super) const ERROR_STEP: f32 = 0.2;
/// Standard deviations of the difference of two pixels that a surface may show. Half: the test of a noisy plane
/// fails; twice: no test of depth frames does.
pub(super) const DEVIATIONS: f32 = 3.0 * std::f32::consts::SQRT_2;
/// Steepest surface, as the tangent of the angle between it and the image plane, that is not taken
/// for a jump in depth (80°). Half: the test of normals of a sweep fails; twice: none does.
pub(super) const STEEPEST: f32 = 5.67;
/// The same over the pixels of a window (70°): so few surfaces are steeper that pixels beyond are rather
/// those of another one. The second fit follows what is steeper. Half: the test of normals of a sweep fails; twice:
/// that of jumps as well.
pub(super) const STEEPEST_IN_WINDOW: f32 = 2.75;
/// Radius that covers a square grid, in its spacing, with a little overlap. Half or twice: tests of planes and of
/// sweeps fail.
pub(super) const COVER: f32 = 0.75;

/// √(x² + y²), without the care for overflow that makes `f32::hypot` slow.
#[inline(always)]
fn length(x: f32, y: f32) -> f32 {
    (x * x + y * y).sqrt()
}

/// Sums of a row of a window: of the values, of their products with the column, and with its square.
#[inline(always)]
fn moments([a, b, c, d, e]: [f32; WINDOW.len()]) -> [f32; 3] {
    let [outer, inner] = [a + e, b + d];
    [
        outer + inner + c,
        2.0 * (e - a) + (d - b),
        4.0 * outer + inner,
    ]
}

/// What is the same for all pixels of a frame.
pub(super) struct Optics {
    /// Metres that a depth may change by from one pixel to the next by a surface's slope, for each
    /// metre of depth.
    slope_step: f32,
    /// Metres that a pixel covers at a depth of 1 m.
    footprint: f32,
    focal: [f32; 2],
    model: SensorModel,
    /// From the frame of the camera into that of the world.
    rotation: Mat3,
    origin: Vec3,
}

impl Optics {
    pub(super) fn new(
        intrinsics: &Intrinsics,
        model: &SensorModel,
        world_from_camera: &Pose3,
    ) -> Self {
        let [fx, fy] = intrinsics.focal;
        Self {
            slope_step: STEEPEST / fx.min(fy),
            footprint: COVER / fx.min(fy),
            focal: intrinsics.focal,
            model: *model,
            rotation: Mat3::from_quat(world_from_camera.rotation),
            origin: world_from_camera.translation,
        }
    }

    /// Spacing in pixels of a window about the depth `z` that tells slopes within [`SLOPE_ERROR`].
    fn spacing(&self, z: f32) -> usize {
        // Sum of squares of the 25 pixels' coordinates along an axis, at a spacing of 1.
        const SQUARES: f32 = 50.0;
        let pixel = z / self.focal[0].max(self.focal[1]);
        let needed = self.model.deviation(z) / (pixel * SQUARES.sqrt() * SLOPE_ERROR);
        (needed.ceil() as usize).clamp(1, WIDEST)
    }
}

/// The image around a line of a tile.
pub(super) struct Window<'a> {
    /// Depths of the line and its fringe, 0 where there is none.
    pub(super) depths: &'a [f32],
    /// Their inverses, likewise.
    pub(super) inverses: &'a [f32],
    /// Where both hold the line's first pixel.
    pub(super) first: usize,
    /// From one row to the next.
    pub(super) stride: usize,
}

impl<'a> Window<'a> {
    #[inline(always)]
    fn line(&self, list: &'a [f32], right: isize, down: isize) -> &'a [f32; TILE] {
        let at = (self.first as isize + down * self.stride as isize + right) as usize;
        &list[at..].as_chunks().0[0]
    }

    /// Depths of the line.
    pub(super) fn depth(&self) -> &'a [f32; TILE] {
        self.line(self.depths, 0, 0)
    }
}

/// What the pixels of a line show, in the frame of the world, metres; anything where there is no depth.
#[derive(Default)]
pub(super) struct Pixels {
    /// Along x, y and z, as the processor likes it.
    points: [[f32; TILE]; 3],
    normals: [[f32; TILE]; 3],
    pub(super) radii: [f32; TILE],
    /// Whether it is on no surface: a neighbour is farther off than a surface may be, or the pixels
    /// around tell no plane, or one that it is off.
    pub(super) flies: [bool; TILE],
}

impl Pixels {
    pub(super) fn point(&self, k: usize) -> Vec3 {
        let [x, y, z] = &self.points;
        Vec3::new(x[k], y[k], z[k])
    }

    pub(super) fn normal(&self, k: usize) -> Vec3 {
        let [x, y, z] = &self.normals;
        Vec3::new(x[k], y[k], z[k])
    }
}

/// Planes through the windows of a line's pixels: inverse depth, which on a plane is linear in the
/// image, over columns and rows.
struct Planes {
    /// Change of inverse depth over a spacing of the windows, to the right and downwards.
    slopes: [[f32; TILE]; 2],
    /// Inverse depth in the middle, beside that of the pixel itself.
    offsets: [f32; TILE],
    /// Whether there are pixels enough.
    are_told: [bool; TILE],
}

impl Planes {
    /// Through the pixels themselves, parallel to the image.
    const LEVEL: Self = Self {
        slopes: [[0.0; TILE]; 2],
        offsets: [0.0; TILE],
        are_told: [false; TILE],
    };

    /// Fits planes to the pixels of the windows that differ from these planes through the pixel itself
    /// by `slack` and `slack_step` a spacing of distance at most, in inverse depth.
    #[inline(always)]
    fn fitted(
        &self,
        window: &Window<'_>,
        spacing: usize,
        slack: &[f32; TILE],
        slack_step: &[f32; TILE],
    ) -> Self {
        // Sums over the pixels of 1, x, y, d, xx, xy, yy, xd, yd.
        let mut sums = [[0.0_f32; TILE]; 9];
        let middle = window.line(window.inverses, 0, 0);
        for down in WINDOW {
            let y = f32::from(down);
            let mut lines = [middle; WINDOW.len()];
            for (line, right) in lines.iter_mut().zip(WINDOW) {
                let [right, down] = [right, down].map(|k| isize::from(k) * spacing as isize);
                *line = window.line(window.inverses, right, down);
            }
            for k in 0..TILE {
                // The row's sums without y, which is the same for all of it.
                let mut ones = [0.0_f32; WINDOW.len()];
                let mut differences = ones;
                for (at, (right, line)) in WINDOW.into_iter().zip(lines).enumerate() {
                    let right = f32::from(right);
                    let difference = line[k] - middle[k];
                    let off = difference - (self.slopes[0][k] * right + self.slopes[1][k] * y);
                    let most = slack[k] + length(right, y) * slack_step[k];
                    let is_on = (line[k] > 0.0) & (off.abs() <= most);
                    ones[at] = if is_on { 1.0 } else { 0.0 };
                    differences[at] = if is_on { difference } else { 0.0 };
                }
                let [n, x, xx] = moments(ones);
                let [d, xd, _] = moments(differences);
                let terms = [n, x, y * n, d, xx, y * x, y * y * n, xd, y * d];
                for (sum, term) in sums.iter_mut().zip(terms) {
                    sum[k] += term;
                }
            }
        }
        let [ones, xs, ys, ds, xxs, xys, yys, xds, yds] = &sums;
        let mut planes = Self::LEVEL;
        for k in 0..TILE {
            let [n, x, y, d] = [ones[k].max(1.0), xs[k], ys[k], ds[k]];
            let [xx, xy] = [xxs[k] - x * x / n, xys[k] - x * y / n];
            let yy = yys[k] - y * y / n;
            let [xd, yd] = [xds[k] - x * d / n, yds[k] - y * d / n];
            let determinant = xx * yy - xy * xy;
            // The smaller of the two variances is at least the determinant by the trace.
            let is_told = (n >= FEWEST) & (determinant >= LEAST_WIDTH * (xx + yy) * n);
            let if_told = |value: f32| if is_told { value } else { 0.0 };
            let right = if_told((yy * xd - xy * yd) / determinant);
            let down = if_told((xx * yd - xy * xd) / determinant);
            planes.slopes[0][k] = right;
            planes.slopes[1][k] = down;
            planes.offsets[k] = if_told((d - right * x - down * y) / n);
            planes.are_told[k] = is_told;
        }
        planes
    }

    /// Through windows of a spacing: first through the pixels that differ from their middle by no more
    /// than `slack` and `slope_step` a pixel, then through those that differ from that plane by no more
    /// than `slack` and its own error, all in inverse depth.
    #[inline(always)]
    fn over(
        window: &Window<'_>,
        spacing: usize,
        slack: &[f32; TILE],
        slope_step: &[f32; TILE],
    ) -> Self {
        let (mut slope_step, mut error_step) = (*slope_step, *slack);
        for k in 0..TILE {
            slope_step[k] *= spacing as f32;
            error_step[k] *= ERROR_STEP;
        }
        Self::LEVEL
            .fitted(window, spacing, slack, &slope_step)
            .fitted(window, spacing, slack, &error_step)
    }
}

/// Computes all pixels of a line alike, as the processor likes it: `columns` and `row` are their
/// coordinates on the image plane at depth 1.
///
/// Normals are those of planes through the pixels of a window that exist and lie on the surface: first
/// those that differ by no more than noise and slope allow, then those that differ from the plane so
/// found by no more than noise and that plane's own error. The noisier the depth, the wider the
/// window. Where it holds too few, a small one takes its place, as on what is thin, or else a larger one.
///
/// It is compiled for several instruction sets, of which the machine's is chosen. Results are the same: no
/// fused multiply-add is made of two operations. What it calls must be inlined, or else is not among them: long
/// closures in `map` of an array are not.
#[multiversion(targets("x86_64+avx512f+avx512vl", "x86_64+avx2"))]
pub(super) fn compute<'a>(
    window: &Window<'a>,
    columns: &[f32; TILE],
    row: f32,
    optics: &Optics,
    pixels: &mut Pixels,
) {
    let depth = window.depth();
    let inverse = window.line(window.inverses, 0, 0);
    let farthest = depth.iter().copied().fold(0.0, f32::max);
    if farthest == 0.0 {
        return;
    }
    let spacing = optics.spacing(farthest);
    let mut deviations = [0.0; TILE];
    let (mut slack, mut slope_step) = ([0.0; TILE], [0.0; TILE]);
    for k in 0..TILE {
        let (z, w) = (depth[k], inverse[k]);
        deviations[k] = optics.model.deviation(z);
        slack[k] = DEVIATIONS * deviations[k] * w * w;
        slope_step[k] = STEEPEST_IN_WINDOW / STEEPEST * optics.slope_step * w;
    }
    let mut planes = Planes::LEVEL;
    let spacings = [spacing, 1, (2 * spacing).min(WIDEST)];
    for (attempt, other) in spacings.into_iter().enumerate() {
        let are_all_told = (0..TILE).all(|k| planes.are_told[k] | (depth[k] == 0.0));
        if are_all_told || (attempt > 0 && other == spacing) {
            continue;
        }
        let others = Planes::over(window, other, &slack, &slope_step);
        for k in 0..TILE {
            if !planes.are_told[k] {
                for axis in 0..2 {
                    planes.slopes[axis][k] = others.slopes[axis][k] / other as f32;
                }
                planes.offsets[k] = others.offsets[k];
                planes.are_told[k] = others.are_told[k];
            }
        }
    }
    // Largest difference of depth from one pixel to the next on a surface.
    let mut limits = [0.0; TILE];
    for k in 0..TILE {
        limits[k] = DEVIATIONS * deviations[k] + optics.slope_step * depth[k];
        pixels.flies[k] = !planes.are_told[k] | (planes.offsets[k].abs() > slack[k]);
    }
    for (right, down) in [(-1, 0), (1, 0), (0, -1), (0, 1)] {
        let beside = window.line(window.depths, right, down);
        for k in 0..TILE {
            pixels.flies[k] |= (beside[k] > 0.0) & ((beside[k] - depth[k]).abs() > limits[k]);
        }
    }
    for k in 0..TILE {
        let (z, w) = (depth[k], inverse[k]);
        let ray = Vec3::new(columns[k], row, 1.0);
        // On the plane n · p = 1: n.x x / z + n.y y / z + n.z = 1 / z.
        let [x, y] = [0, 1].map(|axis| planes.slopes[axis][k] * optics.focal[axis]);
        let w = w + planes.offsets[k];
        let normal = Vec3::new(x, y, w - (x * ray.x + y * ray.y));
        let towards = if normal.dot(ray) > 0.0 { -1.0 } else { 1.0 };
        let normal = normal * (towards / normal.length());
        let point = optics.origin + optics.rotation * (z * ray);
        let normal = optics.rotation * normal;
        for axis in 0..3 {
            pixels.points[axis][k] = point[axis];
            pixels.normals[axis][k] = normal[axis];
        }
        pixels.radii[k] = length(optics.footprint * z, deviations[k]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;

    /// A window's pixels: column and row in pixels from its middle, and inverse depth.
    type Seen = Vec<[f64; 3]>;

    /// Slopes a pixel and inverse depth in the middle of the least-squares plane, by Cramer's rule on
    /// plain sums; nothing where there are too few pixels, or no more than a row of them.
    fn least_squares(seen: &Seen, spacing: f64) -> Option<[f64; 3]> {
        let sum = |term: &dyn Fn(&[f64; 3]) -> f64| seen.iter().map(term).sum::<f64>();
        let columns = [
            [sum(&|p| p[0] * p[0]), sum(&|p| p[0] * p[1]), sum(&|p| p[0])],
            [sum(&|p| p[0] * p[1]), sum(&|p| p[1] * p[1]), sum(&|p| p[1])],
            [sum(&|p| p[0]), sum(&|p| p[1]), seen.len() as f64],
        ];
        let right_side = [sum(&|p| p[0] * p[2]), sum(&|p| p[1] * p[2]), sum(&|p| p[2])];
        let determinant = |m: [[f64; 3]; 3]| {
            let minor = |i: usize, j: usize| m[1][i] * m[2][j] - m[1][j] * m[2][i];
            m[0][0] * minor(1, 2) - m[0][1] * minor(0, 2) + m[0][2] * minor(0, 1)
        };
        let whole = determinant(columns);
        let n = seen.len() as f64;
        let [mean_x, mean_y] = [0, 1].map(|axis| sum(&|p| p[axis]) / n);
        let squares = sum(&|p| (p[0] - mean_x).powi(2) + (p[1] - mean_y).powi(2));
        let width = whole / n / squares / n;
        let is_told = n >= f64::from(FEWEST) && width >= f64::from(LEAST_WIDTH) * spacing * spacing;
        is_told.then(|| {
            std::array::from_fn(|k| {
                let mut replaced = columns;
                replaced[k] = right_side;
                determinant(replaced) / whole
            })
        })
    }

    /// Planes with noise, a step beyond some column and a third to two thirds empty, at all spacings
    /// that matter.
    #[test]
    fn planes_are_those_of_least_squares() {
        const STRIDE: usize = TILE + 2 * REACH;
        const NOISE: f32 = 2e-3;
        const FEW: f32 = 1.5 * NOISE;
        let mut rng = Rng::with_seed(7);
        let [mut told, mut untold] = [0, 0];
        for spacing in [1, 2, 3, 7, WIDEST] {
            // The slack is what few pixels exceed. The last one is so large that only empty pixels are off.
            for (share, slack) in [(0.0, FEW), (0.33, FEW), (0.67, FEW), (0.67, 2.0)] {
                let slope = [rng.f32() - 0.5, rng.f32() - 0.5].map(|s| 5e-3 * s);
                let edge = REACH + rng.usize(..TILE);
                let inverses: Vec<f32> = (0..STRIDE * (2 * REACH + 1))
                    .map(|at| {
                        let [u, v] = [at % STRIDE, at / STRIDE];
                        let plane = 1.0 + slope[0] * u as f32 + slope[1] * v as f32;
                        let step = if u > edge { 0.3 } else { 0.0 };
                        let noise = NOISE * (rng.f32() + rng.f32() + rng.f32() - 1.5);
                        let is_empty = rng.f32() < share;
                        if is_empty { 0.0 } else { plane + step + noise }
                    })
                    .collect();
                let first = REACH * STRIDE + REACH;
                let window = Window {
                    depths: &[],
                    inverses: &inverses,
                    first,
                    stride: STRIDE,
                };
                // As steep surfaces need.
                let slope_step = 4e-3;
                let planes = Planes::over(&window, spacing, &[slack; TILE], &[slope_step; TILE]);
                for k in 0..TILE {
                    let middle = f64::from(inverses[first + k]);
                    let seen = |plane: [f64; 2], step: f64| -> Seen {
                        let mut seen = Vec::new();
                        for place in 0..25 {
                            let [x, y] = [place % 5, place / 5].map(|p| (p - 2) * spacing as isize);
                            let at = (first + k) as isize + y * STRIDE as isize + x;
                            let inverse = f64::from(inverses[at as usize]);
                            let [x, y] = [x as f64, y as f64];
                            let off = inverse - middle - plane[0] * x - plane[1] * y;
                            let most = f64::from(slack) + step * x.hypot(y);
                            if inverse > 0.0 && off.abs() <= most {
                                seen.push([x, y, inverse]);
                            }
                        }
                        seen
                    };
                    if middle == 0.0 {
                        continue;
                    }
                    let spacing = spacing as f64;
                    let level = seen([0.0; 2], f64::from(slope_step));
                    let [x, y, _] = least_squares(&level, spacing).unwrap_or_default();
                    // Three standard errors over a spacing are a fifth of what a pixel may differ by.
                    let on_plane = seen([x, y], 0.2 * f64::from(slack) / spacing);
                    let truth = least_squares(&on_plane, spacing);
                    assert_eq!(planes.are_told[k], truth.is_some(), "{spacing} {share} {k}");
                    let Some([x, y, inverse]) = truth else {
                        untold += 1;
                        continue;
                    };
                    told += 1;
                    let found = [planes.slopes[0][k], planes.slopes[1][k], planes.offsets[k]];
                    let truth = [x * spacing, y * spacing, inverse - middle];
                    // Inverse depths about 1 are rounded to 1e-7; a pixel more or less moves a plane
                    // by a tenth of the noise, 2e-4.
                    for (found, truth) in found.into_iter().zip(truth) {
                        let error = (f64::from(found) - truth).abs();
                        assert!(error < 2e-6, "{spacing} {share} {k}: {found}, not {truth}");
                    }
                }
            }
        }
        assert!(told > 100 && untold > 5, "{told} {untold}");
    }
}
