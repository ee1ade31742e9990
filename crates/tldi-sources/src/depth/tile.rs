//! Points, normals and radii of the pixels of a tile's line, all at once.

use super::camera::{Intrinsics, SensorModel};
use tldi::glamx::{Mat3, Pose3, Vec3};

/// Edge in pixels of the tiles in which points come: their bounds are tight, so that what is out of
/// reach is passed over.
pub(super) const TILE: usize = 16;
/// Pixels of a window to each side of its middle, in its spacing.
const ARM: isize = 2;
/// Widest spacing of a window in pixels.
const WIDEST: usize = 10;
/// Pixels that a window reaches to each side at most.
pub(super) const REACH: usize = ARM as usize * WIDEST;
/// Standard error of a slope, in radians, that a full window is made wide enough for. Half of its
/// pixels leave 4°, of which nine in ten directions are within 9°.
const SLOPE_ERROR: f32 = 0.05;
/// Fewest pixels of a window, its middle included, that tell a plane: twice its unknowns.
const FEWEST: f32 = 6.0;
/// Least variance of those pixels across their main direction, in squares of the spacing: fewer are a row.
const LEAST_WIDTH: f32 = 0.1;
/// Standard deviations of the difference of two pixels that a surface may show.
pub(super) const DEVIATIONS: f32 = 3.0 * std::f32::consts::SQRT_2;
/// Steepest surface, as the tangent of the angle between it and the image plane, that is not taken
/// for a jump in depth (80°).
const STEEPEST: f32 = 5.67;
/// The same over the pixels of a window (70°): so few surfaces are steeper that pixels beyond are rather
/// those of another one. The second fit follows what is steeper.
const STEEPEST_IN_WINDOW: f32 = 2.75;
/// Radius that covers a square grid, in its spacing, with a little overlap.
const COVER: f32 = 0.75;

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
    fn line(&self, list: &'a [f32], right: isize, down: isize) -> &'a [f32] {
        let at = (self.first as isize + down * self.stride as isize + right) as usize;
        &list[at..at + TILE]
    }

    /// Depths of the line.
    pub(super) fn depth(&self) -> &'a [f32] {
        self.line(self.depths, 0, 0)
    }
}

/// What the pixels of a line show, in the frame of the world, metres; anything where there is no depth.
#[derive(Default)]
pub(super) struct Pixels {
    pub(super) points: [[f32; 3]; TILE],
    pub(super) normals: [[f32; 3]; TILE],
    pub(super) radii: [f32; TILE],
    /// Whether it is on no surface: a neighbour is farther off than a surface may be, or the pixels
    /// around tell no plane, or one that it is off.
    pub(super) flies: [bool; TILE],
}

/// Planes through the windows of a line's pixels: inverse depth, which on a plane is linear in the
/// image, over columns and rows.
#[derive(Clone, Copy)]
struct Planes {
    /// Change of inverse depth from one pixel to the next, to the right and downwards.
    slopes: [[f32; 2]; TILE],
    /// Inverse depth in the middle, beside that of the pixel itself.
    offsets: [f32; TILE],
    /// Whether there are pixels enough.
    is_told: [bool; TILE],
}

impl Planes {
    const LEVEL: Self = Self {
        slopes: [[0.0; 2]; TILE],
        offsets: [0.0; TILE],
        is_told: [false; TILE],
    };

    /// Fits planes to the pixels of the windows that differ from these planes through the pixel itself
    /// by `slack` and `slack_step` a pixel of distance at most, in inverse depth.
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
        for row in -ARM..=ARM {
            for column in -ARM..=ARM {
                let [x, y] = [column, row].map(|k| (k * spacing as isize) as f32);
                let away = x.hypot(y);
                let line = window.line(
                    window.inverses,
                    column * spacing as isize,
                    row * spacing as isize,
                );
                for k in 0..TILE {
                    let difference = line[k] - middle[k];
                    let off = difference - (self.slopes[k][0] * x + self.slopes[k][1] * y);
                    let is_on = (line[k] > 0.0) & (off.abs() <= slack[k] + away * slack_step[k]);
                    let one = if is_on { 1.0 } else { 0.0 };
                    let d = if is_on { difference } else { 0.0 };
                    let terms = [
                        one,
                        one * x,
                        one * y,
                        d,
                        one * x * x,
                        one * x * y,
                        one * y * y,
                        x * d,
                        y * d,
                    ];
                    for (sum, term) in sums.iter_mut().zip(terms) {
                        sum[k] += term;
                    }
                }
            }
        }
        let mut planes = Self::LEVEL;
        for k in 0..TILE {
            let [n, x, y, d, xx, xy, yy, xd, yd] = sums.map(|sum| sum[k]);
            let n = n.max(1.0);
            let [xx, xy, yy] = [xx - x * x / n, xy - x * y / n, yy - y * y / n];
            let [xd, yd] = [xd - x * d / n, yd - y * d / n];
            let determinant = xx * yy - xy * xy;
            // The smaller of the two variances is at least the determinant by the trace.
            let width = determinant / ((xx + yy).max(f32::MIN_POSITIVE) * n);
            let least = LEAST_WIDTH * (spacing * spacing) as f32;
            planes.is_told[k] = (n >= FEWEST) & (width >= least);
            if planes.is_told[k] {
                let slopes =
                    [yy * xd - xy * yd, xx * yd - xy * xd].map(|slope| slope / determinant);
                planes.slopes[k] = slopes;
                planes.offsets[k] = (d - slopes[0] * x - slopes[1] * y) / n;
            }
        }
        planes
    }
}

/// Computes all pixels of a line alike, as the processor likes it: `columns` and `row` are their
/// coordinates on the image plane at depth 1.
///
/// Normals are those of planes through the pixels of a window that exist and lie on the surface: first
/// those that differ by no more than noise and slope allow, then those that differ from the plane so
/// found by no more than noise and that plane's own error. The noisier the depth, the wider the
/// window. Where it holds too few, a small one takes its place, as on what is thin, or else a larger one.
#[inline]
pub(super) fn compute(
    window: &Window<'_>,
    columns: &[f32],
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
    let (mut slack, mut slope_step, mut error_step) = ([0.0; TILE], [0.0; TILE], [0.0; TILE]);
    for k in 0..TILE {
        let (z, w) = (depth[k], inverse[k]);
        deviations[k] = optics.model.deviation(z);
        slack[k] = DEVIATIONS * deviations[k] * w * w;
        slope_step[k] = STEEPEST_IN_WINDOW / STEEPEST * optics.slope_step * w;
        // Three standard errors of the slope of the first plane, of half of the pixels.
        error_step[k] = slack[k] / (5.0 * spacing as f32);
    }
    let plane_over = |spacing: usize| {
        let first = Planes::LEVEL.fitted(window, spacing, &slack, &slope_step);
        first.fitted(window, spacing, &slack, &error_step)
    };
    let mut planes = plane_over(spacing);
    for other in [1, (2 * spacing).min(WIDEST)] {
        let is_untold = (0..TILE).any(|k| depth[k] > 0.0 && !planes.is_told[k]);
        if other == spacing || !is_untold {
            continue;
        }
        let others = plane_over(other);
        for k in (0..TILE).filter(|k| others.is_told[*k]) {
            if !planes.is_told[k] {
                planes.slopes[k] = others.slopes[k];
                planes.offsets[k] = others.offsets[k];
                planes.is_told[k] = true;
            }
        }
    }
    let around = [(-1, 0), (1, 0), (0, -1), (0, 1)]
        .map(|(right, down)| window.line(window.depths, right, down));
    for k in 0..TILE {
        let (z, w) = (depth[k], inverse[k]);
        // Largest difference of depth from one pixel to the next on a surface.
        let limit = DEVIATIONS * deviations[k] + optics.slope_step * z;
        let is_off = |other: f32| (other > 0.0) & ((other - z).abs() > limit);
        let jumps = around.iter().any(|line| is_off(line[k]));
        let is_off_plane = planes.offsets[k].abs() > slack[k];
        pixels.flies[k] = jumps | !planes.is_told[k] | is_off_plane;
        let ray = Vec3::new(columns[k], row, 1.0);
        // On the plane n · p = 1: n.x x / z + n.y y / z + n.z = 1 / z.
        let [x, y] = [0, 1].map(|axis| planes.slopes[k][axis] * optics.focal[axis]);
        let w = w + planes.offsets[k];
        let normal = Vec3::new(x, y, w - (x * ray.x + y * ray.y));
        let towards = if normal.dot(ray) > 0.0 { -1.0 } else { 1.0 };
        let normal = normal * (towards / normal.length());
        pixels.points[k] = (optics.origin + optics.rotation * (z * ray)).to_array();
        pixels.normals[k] = (optics.rotation * normal).to_array();
        pixels.radii[k] = (optics.footprint * z).hypot(deviations[k]);
    }
}
