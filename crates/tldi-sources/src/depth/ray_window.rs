//! The pixels around a ray, and the plane through those on its surface.

use super::tile::{DEVIATIONS, ERROR_STEP, FEWEST, LEAST_WIDTH, STEEPEST, STEEPEST_IN_WINDOW};
use tldi::glamx::{Vec2, Vec3};

/// Columns and rows of a window to each side of its middle, in its spacing.
const SIDE: isize = 2;
const EDGE: usize = 2 * SIDE as usize + 1;
pub(super) const PIXELS: usize = EDGE * EDGE;
/// Standard deviations of a second difference of three pixels that a plane may show. Half: the test of normals of a
/// sweep fails; twice: none does.
const BEND: f32 = 3.0 * 2.449_49;

/// From one pixel to the next, radians; along rows, and along columns.
pub(super) type Steps = [f32; 2];

/// A pixel of a window: its place beside the middle on the plane at depth 1 along the ray of the middle, and its
/// inverse depth along that ray.
#[derive(Clone, Copy, Default)]
pub(super) struct Pixel {
    is_seen: bool,
    place: Vec2,
    inverse: f32,
}

/// The plane `inverse = middle + slope · place`.
#[derive(Clone, Copy)]
pub(super) struct Plane {
    pub(super) slope: Vec2,
    pub(super) middle: f32,
}

/// Columns and rows of a window's pixel from its middle, in its spacing.
pub(super) fn place(k: usize) -> [isize; 2] {
    [k % EDGE, k / EDGE].map(|k| k as isize - SIDE)
}

/// The window's pixel at a place.
fn index([right, down]: [isize; 2]) -> usize {
    ((down + SIDE) * EDGE as isize + right + SIDE) as usize
}

/// A frame whose third axis is a ray.
pub(super) struct Frame {
    axes: [Vec3; 3],
}

impl Frame {
    pub(super) fn new(ray: Vec3) -> Self {
        let (a, b) = ray.any_orthonormal_pair();
        Self { axes: [a, b, ray] }
    }

    #[inline]
    pub(super) fn pixel(&self, ray: Vec3) -> Pixel {
        let [x, y, z] = self.axes.map(|axis| axis.dot(ray));
        // What is not before the middle's plane is not beside it.
        if z > 0.0 {
            Pixel {
                is_seen: true,
                place: Vec2::new(x, y) / z,
                inverse: 1.0 / z,
            }
        } else {
            Pixel::default()
        }
    }

    pub(super) fn world(&self, local: [f32; 3]) -> Vec3 {
        let [x, y, z] = self.axes;
        x * local[0] + y * local[1] + z * local[2]
    }
}

/// The direction of the row through the middle; the first axis where it shows no other pixel.
pub(super) fn along_row(window: &[Pixel; PIXELS]) -> Vec2 {
    let beside = [-1, 1, -2, 2].map(|right| window[index([right, 0])]);
    (beside.into_iter())
        .find_map(|pixel| pixel.place.try_normalize().filter(|_| pixel.is_seen))
        .unwrap_or(Vec2::X)
}

/// How inverse depth changes from the middle to the next pixel along an axis: by the three pixels in a line on one side,
/// or on both, that are on a plane within `error`; nothing where none are.
fn slope(window: &[Pixel; PIXELS], axis: usize, error: f32) -> Option<f32> {
    let middle = window[index([0, 0])].inverse;
    let side = |sign: isize| {
        let at = |k: isize| {
            window[index(if axis == 0 {
                [sign * k, 0]
            } else {
                [0, sign * k]
            })]
        };
        let (next, last) = (at(1), at(2));
        let bend = middle - 2.0 * next.inverse + last.inverse;
        let is_straight = next.is_seen && last.is_seen && bend.abs() <= BEND * error;
        is_straight.then_some(0.5 * sign as f32 * (last.inverse - middle))
    };
    match (side(-1), side(1)) {
        (Some(before), Some(behind)) => Some(0.5 * (before + behind)),
        (one, other) => one.or(other),
    }
}

/// Whether the middle is between what is before and what is behind: along a row or a column of neighbours it is
/// straight with neither side, and farther from a neighbour than a steep surface is.
pub(super) fn is_mixed(window: &[Pixel; PIXELS], steps: Steps, error: f32) -> bool {
    let middle = window[index([0, 0])].inverse;
    (0..2).any(|axis| {
        let most = DEVIATIONS * error + STEEPEST * steps[axis] * middle;
        let is_off = [-1, 1].into_iter().any(|sign| {
            let pixel = window[index(if axis == 0 { [sign, 0] } else { [0, sign] })];
            pixel.is_seen && (pixel.inverse - middle).abs() > most
        });
        is_off && slope(window, axis, error).is_none()
    })
}

impl Plane {
    /// The plane through the pixels of the surface that the middle is on, where they are enough: first those near what
    /// its row and column show, then those near that plane. `angles` are between its columns and rows.
    pub(super) fn through(window: &[Pixel; PIXELS], angles: [f32; 2], error: f32) -> Option<Self> {
        let middle = window[index([0, 0])].inverse;
        let slack = DEVIATIONS * error;
        let slopes = [0, 1].map(|axis| slope(window, axis, error));
        // Three standard errors of a slope that is known; of one that is not, what a surface may show.
        let errors = [0, 1].map(|axis| match slopes[axis] {
            Some(_) => 0.5 * slack,
            None => STEEPEST_IN_WINDOW * angles[axis] * middle,
        });
        let slopes = slopes.map(|slope| slope.unwrap_or(0.0));
        let first = Self::fitted(window, |_, [right, down]| {
            let expected = slopes[0] * right + slopes[1] * down;
            let most = slack + errors[0] * right.abs() + errors[1] * down.abs();
            (middle + expected, most)
        })?;
        Self::fitted(window, |pixel, [right, down]| {
            let most = slack * (1.0 + ERROR_STEP * right.hypot(down));
            (middle + first.slope.dot(pixel.place), most)
        })
    }

    /// The least-squares plane of those pixels that differ from an expected inverse depth by no more than a limit;
    /// `expected` gives both.
    fn fitted(
        window: &[Pixel; PIXELS],
        expected: impl Fn(&Pixel, [f32; 2]) -> (f32, f32),
    ) -> Option<Self> {
        let middle = window[index([0, 0])].inverse;
        let (mut n, mut sum, mut height) = (0.0, Vec2::ZERO, 0.0);
        let ([mut xx, mut xy, mut yy], mut moment) = ([0.0; 3], Vec2::ZERO);
        // The same of places in the window, which tell whether they are more than a row.
        let (mut grid, [mut gxx, mut gxy, mut gyy]) = (Vec2::ZERO, [0.0_f32; 3]);
        for (k, pixel) in window.iter().enumerate() {
            let [right, down] = place(k).map(|k| k as f32);
            let (inverse, most) = expected(pixel, [right, down]);
            if !pixel.is_seen || (pixel.inverse - inverse).abs() > most {
                continue;
            }
            let (p, d) = (pixel.place, pixel.inverse - middle);
            n += 1.0;
            sum += p;
            height += d;
            xx += p.x * p.x;
            xy += p.x * p.y;
            yy += p.y * p.y;
            moment += d * p;
            grid += Vec2::new(right, down);
            gxx += right * right;
            gxy += right * down;
            gyy += down * down;
        }
        if n < FEWEST {
            return None;
        }
        let mean = grid / n;
        (gxx, gxy, gyy) = (
            gxx - n * mean.x * mean.x,
            gxy - n * mean.x * mean.y,
            gyy - n * mean.y * mean.y,
        );
        if gxx * gyy - gxy * gxy < LEAST_WIDTH * (gxx + gyy) * n {
            return None;
        }
        let mean = sum / n;
        (xx, xy, yy) = (
            xx - n * mean.x * mean.x,
            xy - n * mean.x * mean.y,
            yy - n * mean.y * mean.y,
        );
        moment -= height * mean;
        let determinant = xx * yy - xy * xy;
        let slope =
            Vec2::new(yy * moment.x - xy * moment.y, xx * moment.y - xy * moment.x) / determinant;
        let plane = Self {
            slope,
            middle: middle + height / n - slope.dot(mean),
        };
        (plane.slope.is_finite() && plane.middle.is_finite()).then_some(plane)
    }
}
