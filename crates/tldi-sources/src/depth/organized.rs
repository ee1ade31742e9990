//! Radii and normals of points that come in rows and columns, from the pixels beside.

use super::cloud::DepthCloud;
use super::ray_window::{Frame, PIXELS, Pixel, Plane, Steps, along_row, is_mixed, place};
use super::sensor::SensorModel;
use super::tile::{COVER, DEVIATIONS, SLOPE_ERROR, STEEPEST_IN_WINDOW, TILE, WIDEST};
use rayon::prelude::*;
use std::f32::consts::SQRT_2;
use tldi::glamx::{Vec2, Vec3};

/// Sum of squares of the pixels' places along an axis of a full window, in its spacing.
const SQUARES: f32 = 50.0;
/// Pairs of pixels that the angle from one to the next is taken of: the median of half as many is the same within
/// some percent.
const PAIRS: usize = 1024;

/// Points in rows and columns as a sensor saw them from one place: a depth image, an organised message or file, or
/// the turn of a laser scanner, a row for each ring.
///
/// ```
/// use tldi_sources::depth::{OrganizedCloud, SensorModel};
/// use tldi::glamx::Vec3;
/// // A wall 2 m ahead, of which one pixel saw nothing.
/// let mut points: Vec<Vec3> = (0..20 * 10)
///     .map(|k| Vec3::new(0.01 * (k % 20) as f32, 0.01 * (k / 20) as f32, 2.0))
///     .collect();
/// points[0] = Vec3::NAN;
/// let frame = OrganizedCloud::new(&points, [20, 10], Vec3::ZERO).expect("as many as pixels");
/// let seen = frame.surface(&SensorModel::time_of_flight(0.002, [0.1, 10.0]));
/// assert_eq!((seen.points.len(), seen.empty, seen.flying), (199, 1, 0));
/// assert!(seen.normals.iter().all(|n| n.distance(-Vec3::Z) < 0.01));
/// ```
#[derive(Clone, Copy, Debug)]
pub struct OrganizedCloud<'a> {
    points: &'a [Vec3],
    size: [usize; 2],
    sensor: Vec3,
}

impl<'a> OrganizedCloud<'a> {
    /// Points row by row, `size` columns and rows, in any frame, metres; a pixel that saw nothing is not finite, or
    /// at the sensor, which was at `sensor` in that frame. Nothing if the points are not as many as the pixels.
    pub fn new(points: &'a [Vec3], size: [usize; 2], sensor: Vec3) -> Option<Self> {
        (size[0].checked_mul(size[1]) == Some(points.len())).then_some(Self {
            points,
            size,
            sensor,
        })
    }

    /// Points on surfaces, with radii and with normals towards the sensor, in the frame of the points.
    ///
    /// - Normals are those of planes through the pixels of a window that lie on the surface, as for
    ///   [`DepthCamera`](super::DepthCamera). Surfaces may be as steep as the ground is for a scanner: three pixels in a
    ///   line tell the slope along it.
    /// - Radii cover the grid on surfaces up to 70° from facing the sensor; what is steeper is sampled too thinly.
    /// - Pixels that are on no surface are left out and counted: `flying`.
    ///
    /// Cost: less than 1 µs a pixel on one core, shared by all cores.
    pub fn surface(&self, model: &SensorModel) -> DepthCloud {
        let rays: Vec<Vec3> = (self.points.iter())
            .map(|point| {
                let ray = *point - self.sensor;
                let range = ray.length();
                let is_seen = range >= model.range[0] && range <= model.range[1] && range > 0.0;
                if is_seen { ray } else { Vec3::ZERO }
            })
            .collect();
        let [width, height] = self.size;
        let steps = [[1, 0], [0, 1]].map(|offset| self.step(&rays, offset));
        let tiles: Vec<DepthCloud> = (0..height.div_ceil(TILE))
            .into_par_iter()
            .map(|tile| {
                let mut cloud = DepthCloud::default();
                for left in (0..width).step_by(TILE) {
                    for v in tile * TILE..((tile + 1) * TILE).min(height) {
                        for u in left..(left + TILE).min(width) {
                            self.push(&rays, steps, model, [u, v], &mut cloud);
                        }
                    }
                }
                cloud
            })
            .collect();
        DepthCloud::gathered(&tiles)
    }

    /// The median angle from a pixel to the one beside, radians; 0 where no two are.
    fn step(&self, rays: &[Vec3], [right, down]: [usize; 2]) -> f32 {
        let [width, height] = self.size;
        let mut angles: Vec<f32> = Vec::with_capacity(PAIRS);
        let stride = (rays.len() / PAIRS).max(1);
        // Wherever a pair is incomplete, the next complete one takes its place.
        let mut next = 0;
        for k in 0..rays.len() {
            let is_inside = k % width + right < width && k / width + down < height;
            if k >= next && is_inside {
                let [a, b] = [rays[k], rays[k + right + down * width]];
                if a != Vec3::ZERO && b != Vec3::ZERO {
                    angles.push(a.angle_between(b));
                    next = k + stride;
                }
            }
        }
        let middle = angles.len() / 2;
        if angles.is_empty() {
            return 0.0;
        }
        *angles.select_nth_unstable_by(middle, f32::total_cmp).1
    }

    /// The ray of the pixel that is so many columns and rows beside; zero where there is none.
    fn beside(&self, rays: &[Vec3], [u, v]: [usize; 2], [right, down]: [isize; 2]) -> Vec3 {
        let (u, v) = (u.checked_add_signed(right), v.checked_add_signed(down));
        match (u, v) {
            (Some(u), Some(v)) if u < self.size[0] && v < self.size[1] => {
                rays[v * self.size[0] + u]
            }
            _ => Vec3::ZERO,
        }
    }

    /// Adds what a pixel shows.
    fn push(
        &self,
        rays: &[Vec3],
        steps: Steps,
        model: &SensorModel,
        at: [usize; 2],
        cloud: &mut DepthCloud,
    ) {
        let index = at[1] * self.size[0] + at[0];
        let ray = rays[index];
        if ray == Vec3::ZERO {
            cloud.empty += 1;
            return;
        }
        let range = ray.length();
        let deviation = model.deviation(range);
        let frame = Frame::new(ray / range);
        // Of the inverse depth.
        let error = deviation / (range * range);
        let window = |spacing: [usize; 2]| self.window(rays, at, spacing, &frame);
        let ones = window([1, 1]);
        if is_mixed(&ones, steps, error) {
            cloud.flying += 1;
            return;
        }
        let spacing = steps.map(|step| {
            let needed = deviation / (range * step * SQUARES.sqrt() * SLOPE_ERROR);
            (needed.ceil() as usize).clamp(1, WIDEST)
        });
        let wider = spacing.map(|spacing| (2 * spacing).min(WIDEST));
        let plane = [spacing, [1, 1], wider]
            .into_iter()
            .enumerate()
            .filter(|(attempt, other)| *attempt == 0 || *other != spacing)
            .find_map(|(_, spacing)| {
                let pixels = if spacing == [1, 1] {
                    ones
                } else {
                    window(spacing)
                };
                let angles = [0, 1].map(|axis| spacing[axis] as f32 * steps[axis]);
                Plane::through(&pixels, angles, error)
            });
        let is_on = |plane: &Plane| {
            plane.middle > 0.0 && (plane.middle - 1.0 / range).abs() <= DEVIATIONS * error
        };
        let Some(plane) = plane.filter(is_on) else {
            cloud.flying += 1;
            return;
        };
        let tangent = plane.slope / plane.middle;
        let along_row = along_row(&ones);
        let spread = |step: f32, direction: Vec2| {
            let steepness = tangent.dot(direction).abs().min(STEEPEST_IN_WINDOW);
            range * step * (1.0 + steepness * steepness).sqrt()
        };
        let spacing = Vec2::new(
            spread(steps[0], along_row),
            spread(steps[1], along_row.perp()),
        );
        let radius = (COVER / SQRT_2 * spacing.length()).hypot(deviation);
        let normal = frame.world([plane.slope.x, plane.slope.y, plane.middle]);
        cloud.points.push(self.points[index]);
        cloud.normals.push(-normal.normalize());
        cloud.radii.push(radius);
    }

    fn window(
        &self,
        rays: &[Vec3],
        at: [usize; 2],
        spacing: [usize; 2],
        frame: &Frame,
    ) -> [Pixel; PIXELS] {
        std::array::from_fn(|k| {
            let [right, down] = place(k);
            let offset = [right * spacing[0] as isize, down * spacing[1] as isize];
            frame.pixel(self.beside(rays, at, offset))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;
    use std::f32::consts::TAU;

    const COLUMNS: usize = 360;
    const ROWS: usize = 32;
    const HEIGHT: f32 = 1.5;
    /// Half the edge of a square room.
    const WALL: f32 = 20.0;
    const DEVIATION: f32 = 0.01;

    /// What a turn of a scanner sees of a floor and four walls, with the true normals; its rows are rings, the lowest
    /// first. A share of the pixels is empty.
    fn sweep(seed: u64, empty: f32) -> (Vec<Vec3>, Vec<Vec3>) {
        let mut rng = Rng::with_seed(seed);
        (0..ROWS * COLUMNS)
            .map(|k| {
                let (u, v) = (k % COLUMNS, k / COLUMNS);
                let elevation = -0.45 + 0.02 * v as f32;
                // Not exactly below each other.
                let azimuth = (u as f32 + 0.5 * rng.f32()) * TAU / COLUMNS as f32;
                let (sin, cos) = azimuth.sin_cos();
                let ray = Vec3::new(cos, sin, 0.0) * elevation.cos() + elevation.sin() * Vec3::Z;
                let sides = [
                    (-HEIGHT / ray.z, Vec3::Z),
                    (WALL / ray.x.abs(), -ray.x.signum() * Vec3::X),
                    (WALL / ray.y.abs(), -ray.y.signum() * Vec3::Y),
                ];
                let (range, normal) = sides
                    .into_iter()
                    .filter(|(range, _)| *range > 0.0)
                    .min_by(|a, b| a.0.total_cmp(&b.0))
                    .expect("walls all around");
                let gauss = (0..12).map(|_| rng.f32()).sum::<f32>() - 6.0;
                let is_empty = rng.f32() < empty;
                let point = ray * (range + DEVIATION * gauss);
                (if is_empty { Vec3::NAN } else { point }, normal)
            })
            .unzip()
    }

    fn model() -> SensorModel {
        SensorModel::time_of_flight(DEVIATION, [0.5, 50.0])
    }

    /// Floor and walls of a room, up to 86 degrees from facing the scanner, have their normals, of the whole sweep
    /// and of one with half of its pixels.
    #[test]
    fn a_sweep_has_the_normals_of_the_room() {
        for (seed, empty) in [(1, 0.0), (2, 0.0), (3, 0.5), (4, 0.5)] {
            let (points, truth) = sweep(seed, empty);
            let frame = OrganizedCloud::new(&points, [COLUMNS, ROWS], Vec3::ZERO).expect("fits");
            let cloud = frame.surface(&model());
            let seen = points.iter().filter(|p| p.is_finite()).count();
            assert_eq!(cloud.points.len() + cloud.flying, seen);
            assert_eq!(cloud.empty, points.len() - seen);
            let mut errors: Vec<f32> = (cloud.points.iter().zip(&cloud.normals))
                .map(|(point, normal)| {
                    let k = points.iter().position(|p| p == point).expect("one of them");
                    normal.angle_between(truth[k]).to_degrees()
                })
                .collect();
            errors.sort_unstable_by(f32::total_cmp);
            let tenth = errors[errors.len() * 9 / 10];
            eprintln!(
                "{seed}: {} of {seen}, {:.1} {tenth:.1}",
                errors.len(),
                errors[errors.len() / 2]
            );
            // Edges of the room are among them.
            assert!(tenth < 15.0, "{seed}: {tenth}");
            // At 20 m the floor is 86 degrees from facing the scanner; where half is empty, many pixels of it are alone.
            let share = if empty > 0.0 { 5 } else { 25 };
            assert!(cloud.flying * share < seen, "{seed}: {}", cloud.flying);
            for (point, radius) in cloud.points.iter().zip(&cloud.radii) {
                // A cell seen from the front is 1 by 1.15 degrees.
                let range = point.length();
                let front = 0.53 * range * (TAU / COLUMNS as f32).hypot(0.02);
                assert!(
                    *radius > 0.8 * front && *radius < 3.2 * front + DEVIATION,
                    "{radius} {range}"
                );
            }
        }
    }

    /// A pixel between a wall and what is before it is on neither; those beside it are kept.
    #[test]
    fn what_is_between_two_surfaces_flies() {
        let [width, height] = [40, 30];
        let depth = |u: usize| match u {
            0..20 => 2.0,
            20 => 2.5,
            _ => 3.0,
        };
        let points: Vec<Vec3> = (0..width * height)
            .map(|k| {
                let [u, v] = [k % width, k / width].map(|k| 0.005 * k as f32);
                Vec3::new(u, v, 1.0) * depth(k % width)
            })
            .collect();
        let frame = OrganizedCloud::new(&points, [width, height], Vec3::ZERO).expect("fits");
        let cloud = frame.surface(&SensorModel::time_of_flight(0.003, [0.5, 50.0]));
        assert_eq!((cloud.flying, cloud.empty), (height, 0));
        assert!(cloud.points.iter().all(|p| p.z != 2.5));
        for normal in &cloud.normals {
            assert!(normal.distance(-Vec3::Z) < 0.01, "{normal}");
        }
    }

    /// What is no grid, is empty, or a single row gives no points, and no panic.
    #[test]
    fn what_tells_no_surface_has_no_points() {
        let line: Vec<Vec3> = (0..9).map(|k| Vec3::new(k as f32, 0.0, 9.0)).collect();
        assert!(OrganizedCloud::new(&line, [4, 2], Vec3::ZERO).is_none());
        for size in [[9, 1], [1, 9]] {
            let frame = OrganizedCloud::new(&line, size, Vec3::ZERO).expect("fits");
            let cloud = frame.surface(&model());
            assert_eq!((cloud.points.len(), cloud.flying), (0, 9));
        }
        let nothing = OrganizedCloud::new(&[], [0, 0], Vec3::ZERO).expect("fits");
        assert_eq!(nothing.surface(&model()).points.len(), 0);
        let empty = [Vec3::NAN; 9];
        let frame = OrganizedCloud::new(&empty, [3, 3], Vec3::ZERO).expect("fits");
        assert_eq!(frame.surface(&model()).empty, 9);
    }
}
