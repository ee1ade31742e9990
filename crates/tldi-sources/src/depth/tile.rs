//! Points, normals and radii of the pixels of a tile's line, all at once.

use super::camera::{Intrinsics, SensorModel};
use tldi::glamx::{Mat3, Pose3, Vec3};

/// Edge in pixels of the tiles in which points come: their bounds are tight, so that what is out of
/// reach is passed over.
pub(super) const TILE: usize = 16;
/// Pixels to each side over which normals are fitted.
pub(super) const NORMAL_REACHES: [usize; 2] = [2, 4];
/// Standard deviations of the difference of two pixels that a surface may show.
pub(super) const DEVIATIONS: f32 = 3.0 * std::f32::consts::SQRT_2;
/// Steepest surface, as the tangent of the angle between it and the image plane, that is not taken
/// for a jump in depth (80°).
const STEEPEST: f32 = 5.67;
/// Radius that covers a square grid, in its spacing, with a little overlap.
const COVER: f32 = 0.75;

/// What is the same for all pixels of a column or row.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    /// Its coordinate on the image plane at depth 1.
    ray: f32,
    /// Weights of the differences over [`NORMAL_REACHES`] in the slope across columns or rows.
    weights: [f32; 2],
    /// What is taken off a difference before it is judged: infinite where it goes beyond the image and
    /// does not count, minus infinity where none counts and there is no slope.
    slack: [f32; 2],
}

impl Line {
    /// Line `at` of `count`; the weights times `focal`, in pixels, are slopes on the image plane.
    pub(super) fn new(at: usize, count: usize, focal: f32, center: f32) -> Self {
        let free = at.min((count - 1).saturating_sub(at));
        let is_free = NORMAL_REACHES.map(|reach| reach <= free);
        let spans = [0, 1].map(|k| f32::from(u8::from(is_free[k])) * NORMAL_REACHES[k] as f32);
        let squares: f32 = spans.iter().map(|span| 2.0 * span * span).sum();
        Self {
            ray: (at as f32 - center) / focal,
            weights: spans.map(|span| focal * span / squares.max(1.0)),
            slack: match is_free {
                [false, _] => [f32::NEG_INFINITY; 2],
                [true, is_free] => [0.0, if is_free { 0.0 } else { f32::INFINITY }],
            },
        }
    }

    /// The slope of inverse depth among neighbours over [`NORMAL_REACHES`] before (the farther first)
    /// and after, and whether the surface goes on there: differences to `middle` of at most `step` a
    /// pixel.
    #[inline(always)]
    fn slope(&self, middle: f32, [a, b, c, d]: [f32; 4], step: f32) -> (f32, bool) {
        let sum = self.weights[0] * (c - b) + self.weights[1] * (d - a);
        let off = |before: f32, after: f32| larger((before - middle).abs(), (after - middle).abs());
        let [reach, far_reach] = NORMAL_REACHES.map(|reach| reach as f32);
        // A missing one is as far off as can be.
        let worst = larger(
            off(b, c) - reach * step - self.slack[0],
            off(a, d) - far_reach * step - self.slack[1],
        );
        (sum, worst <= 0.0)
    }
}

/// `f32::max` of numbers, in one instruction.
#[inline(always)]
fn larger(a: f32, b: f32) -> f32 {
    if a > b { a } else { b }
}

/// What is the same for all pixels of a frame.
pub(super) struct Optics {
    /// Metres that a depth may change by from one pixel to the next on a surface: by its noise, at a
    /// depth of 1 m, and by its slope, for each metre of depth.
    noise_step: f32,
    slope_step: f32,
    /// Metres that a pixel covers, and deviation of its depth, at a depth of 1 m.
    footprint: f32,
    noise: f32,
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
            noise_step: DEVIATIONS * model.noise,
            slope_step: STEEPEST / fx,
            footprint: COVER / fx.min(fy),
            noise: model.noise,
            rotation: Mat3::from_quat(world_from_camera.rotation),
            origin: world_from_camera.translation,
        }
    }
}

/// Depths around a line of a tile, [`TILE`] of each.
pub(super) struct Window<'a> {
    pub(super) depth: &'a [f32],
    /// Of the pixels to the left, to the right, above and below.
    pub(super) around: [&'a [f32]; 4],
    /// The inverse of `depth`.
    pub(super) inverse: &'a [f32],
    /// Inverses over [`NORMAL_REACHES`] to the left (the farther first) and to the right.
    pub(super) across: [&'a [f32]; 4],
    /// Likewise above and below.
    pub(super) down: [&'a [f32]; 4],
}

/// What the pixels of a line show, in the frame of the world, metres; anything where there is no depth.
#[derive(Default)]
pub(super) struct Pixels {
    pub(super) points: [[f32; 3]; TILE],
    pub(super) normals: [[f32; 3]; TILE],
    pub(super) radii: [f32; TILE],
    /// Whether a neighbour is farther off than a surface may be.
    pub(super) jumps: [bool; TILE],
}

/// Computes all pixels alike, as the processor likes it.
///
/// Normals are from the slopes of inverse depth, which on a plane is linear in the image:
/// differences over a few pixels, along rows and columns. Where neighbours are missing, or nearer
/// or farther than a surface may be, they are towards the camera.
#[inline]
pub(super) fn compute(
    window: &Window<'_>,
    columns: &[Line],
    row: &Line,
    optics: &Optics,
    pixels: &mut Pixels,
) {
    let Window {
        depth,
        around,
        inverse,
        across,
        down,
    } = window;
    for k in 0..TILE {
        let (z, w, column) = (depth[k], inverse[k], &columns[k]);
        // Largest difference of depth from one pixel to the next on a surface, and of its inverse.
        let limit = z * (optics.noise_step * z + optics.slope_step);
        let step = optics.noise_step + optics.slope_step * w;
        let is_off = |other: f32| (other > 0.0) & ((other - z).abs() > limit);
        pixels.jumps[k] = is_off(around[0][k])
            | is_off(around[1][k])
            | is_off(around[2][k])
            | is_off(around[3][k]);
        let (x, goes_on) = column.slope(w, across.map(|list| list[k]), step);
        let (y, goes_down) = row.slope(w, down.map(|list| list[k]), step);
        let ray = Vec3::new(column.ray, row.ray, 1.0);
        // On the plane n · p = 1: n.x x / z + n.y y / z + n.z = 1 / z.
        let plane = Vec3::new(x, y, w - (x * ray.x + y * ray.y));
        let has_slope = goes_on & goes_down & (plane.length_squared() > 0.0);
        let normal = if has_slope { plane } else { ray };
        let towards = if normal.dot(ray) > 0.0 { -1.0 } else { 1.0 };
        let normal = normal * (towards / normal.length());
        pixels.points[k] = (optics.origin + optics.rotation * (z * ray)).to_array();
        pixels.normals[k] = (optics.rotation * normal).to_array();
        let (covered, deviation) = (optics.footprint * z, optics.noise * z * z);
        pixels.radii[k] = (covered * covered + deviation * deviation).sqrt();
    }
}
