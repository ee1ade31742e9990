//! Stage `normals`, last part: beside an edge or a corner, a normal is that of the face.
//!
//! A neighbourhood that reaches over an edge has a plane between the faces, and pixels there would
//! be on neither. So a point whose neighbours are not on a plane takes the plane of a flat
//! neighbour, if the point lies on it. At a corner no flat neighbour is near enough; there, a
//! second pass takes what the neighbours have taken. Where a surface bends or is noisy, nothing is
//! flat, and normals stay as they are.

use crate::cpu::lanes::multiversioned;
use crate::cpu::normals::estimate::NormalScratch;
use crate::cpu::normals::near_values::NearValues;
use crate::cpu::normals::planes::{LANES, Neighborhood, Plane, SUPPORT};
use crate::cpu::normals::sorted::{RUN, Sorted};
use glamx::Vec3;

/// Variance at which neighbours are plainly not on a plane, in units of that up to which they are. Half or twice: no
/// change.
const OFF_PLANE: f32 = 4.0;

/// Deviation from a plane, in mean radii, at which it is not flat, or a point is not on it. Half or twice: no change.
const FLAT_PLANE: f32 = 0.05;

/// For [`stage_constants`](crate::pair::plan::stage_constants).
pub(crate) const CONSTANTS: [(&str, f64); 2] = [
    ("OFF_PLANE", OFF_PLANE as f64),
    ("FLAT_PLANE", FLAT_PLANE as f64),
];

/// Memory of the stage, kept from call to call.
#[derive(Default)]
pub(crate) struct SharpenScratch {
    flat: FlatPlanes,
    flat_around: NearValues<VALUES>,
    /// Sorted points that are not on their planes.
    rough: Vec<u32>,
    /// Those that adopt a plane, and which.
    adopted: Vec<(u32, Plane)>,
}

/// What is known of a flat plane: its point, its normal, and its variance and height as in [`Plane`].
const VALUES: usize = 8;

/// In place of a plane: out of reach of any point.
const NO_PLANE: [f32; VALUES] = {
    let far = f32::INFINITY;
    [far, far, far, 0.0, 0.0, 0.0, far, 0.0]
};

/// The flat planes, in the order of the sorted points that they are of.
#[derive(Default)]
struct FlatPlanes {
    /// How many there are before each sorted point, and in all.
    before: Vec<usize>,
    /// And [`RUN`] more of no meaning.
    values: [Vec<f32>; VALUES],
}

impl FlatPlanes {
    /// Finds those with less than a `misfit`.
    fn find(&mut self, sorted: &Sorted, planes: &[Plane], misfit: f32) {
        let Self { before, values } = self;
        before.clear();
        before.reserve(planes.len() + 1);
        for values in &mut *values {
            values.resize(planes.len() + RUN, 0.0);
        }
        let mut count = 0;
        for (k, plane) in planes.iter().enumerate() {
            before.push(count);
            if plane.variance < misfit {
                let ([x, y, z], [u, v, w]) = (sorted.position(k).into(), plane.normal.into());
                let known = [x, y, z, u, v, w, plane.variance, plane.height];
                for (to, value) in values.iter_mut().zip(known) {
                    to[count] = value;
                }
                count += 1;
            }
        }
        before.push(count);
    }

    /// Collects those around a cell.
    fn gather(&self, sorted: &Sorted, cell: u32, around: &mut NearValues<VALUES>) {
        let rows = sorted.rows(cell as usize);
        let rows = rows.map(|row| self.before[row.start]..self.before[row.end]);
        around.gather(rows, &self.values, NO_PLANE);
    }
}

/// Sharpens the normals that were just estimated. Cost: less than estimating, and only for points whose neighbours lie on
/// no plane.
pub(crate) fn sharpen(
    around: &Neighborhood,
    estimated: &mut NormalScratch,
    scratch: &mut SharpenScratch,
    normals: &mut [Vec3],
) {
    let NormalScratch { sorted, planes, .. } = estimated;
    let SharpenScratch {
        flat,
        flat_around,
        rough,
        adopted,
    } = scratch;
    let (radius, on_plane) = (around.radius, around.on_plane());
    let limits = [radius * radius, (FLAT_PLANE / SUPPORT * radius).powi(2)];
    let is_rough = |k: &u32, planes: &[Plane]| planes[*k as usize].variance > on_plane;
    rough.clear();
    rough.extend(sorted.wanted().filter(|k| is_rough(k, planes)));
    for _ in 0..2 {
        if rough.is_empty() {
            break;
        }
        flat.find(sorted, planes, limits[1]);
        adopted.clear();
        let cell = |k: &u32| sorted.entries[*k as usize].cell;
        for in_cell in rough.chunk_by(|k, l| cell(k) == cell(l)) {
            flat.gather(sorted, cell(&in_cell[0]), flat_around);
            if flat_around.is_empty() {
                continue;
            }
            for &k in in_cell {
                let (point, own) = (sorted.position(k as usize), &planes[k as usize]);
                let Some((face, weight)) = mean(point, own, limits, flat_around) else {
                    continue;
                };
                let off_plane = (own.variance / on_plane - 1.0) / (OFF_PLANE - 1.0);
                let share = off_plane.clamp(0.0, 1.0) * weight.min(1.0);
                adopted.push((k, own.towards(&face, share)));
            }
        }
        for &(k, plane) in &*adopted {
            planes[k as usize] = plane;
        }
        rough.retain(|k| is_rough(k, planes));
    }
    for (normal, k) in normals.iter_mut().zip(sorted.wanted()) {
        *normal = planes[k as usize].normal;
    }
}

/// The mean, at `point`, of the flat planes around it, and their total weight. Its normal is on the side of the point's
/// `own`. `limits` bound the square distance and the misfit.
fn mean(
    point: Vec3,
    own: &Plane,
    limits: [f32; 2],
    flat: &NearValues<VALUES>,
) -> Option<(Plane, f32)> {
    let [weight, x, y, z, variance, height] = sums(point, own.normal, limits, flat);
    let normal = Vec3::new(x, y, z).try_normalize()?;
    let plane = Plane::new(normal, variance / weight, height / weight);
    Some((plane, weight))
}

multiversioned! {
/// Sums of the weights of the planes, which fall from 1 where they fit, and of weighted normals, variances and heights.
fn sums(p: Vec3, side: Vec3, [reach, most]: [f32; 2], flat: &NearValues<VALUES>) -> [f32; 6] {
    let per_misfit = 1.0 / most;
    let mut sums = [[0.0f32; LANES]; 6];
    let [x, y, z, nx, ny, nz, variance, height] = flat.lanes();
    for k in 0..x.len() {
        let ([x, y, z], [nx, ny, nz]) = ([x[k], y[k], z[k]], [nx[k], ny[k], nz[k]]);
        let (variance, height) = (variance[k], height[k]);
        for l in 0..LANES {
            let (dx, dy, dz) = (p.x - x[l], p.y - y[l], p.z - z[l]);
            let above = nx[l] * dx + ny[l] * dy + nz[l] * dz + height[l];
            let misfit = variance[l] + above * above;
            let counts = (dx * dx + dy * dy + dz * dz <= reach) & (misfit < most);
            let keep = |value: f32| if counts { value } else { 0.0 };
            let weight = keep(1.0 - misfit * per_misfit);
            let is_beyond = nx[l] * side.x + ny[l] * side.y + nz[l] * side.z < 0.0;
            let facing = if is_beyond { -weight } else { weight };
            sums[0][l] += weight;
            sums[1][l] += facing * nx[l];
            sums[2][l] += facing * ny[l];
            sums[3][l] += facing * nz[l];
            sums[4][l] += weight * keep(variance[l]);
            sums[5][l] += facing * keep(above);
        }
    }
    sums.map(|of_lane| of_lane.into_iter().sum())
}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cpu::normals::estimate::estimate;
    use glamx::Quat;
    use std::f32::consts::{FRAC_PI_4, TAU};

    /// With a mean radius of 1.
    const POINTS_PER_AREA: f32 = 0.94;

    /// Points that `is_wanted`, with estimated and with sharpened normals.
    fn normals(
        points: &[Vec3],
        is_wanted: impl Fn(Vec3) -> bool,
        noise: f32,
    ) -> [Vec<(Vec3, Vec3)>; 2] {
        let support: Vec<u32> = (0..points.len() as u32).collect();
        let (mut targets, mut normals) = (vec![], vec![]);
        let mut scratch = NormalScratch::default();
        let around = Neighborhood {
            radius: SUPPORT,
            noise,
        };
        // Turned, so that neighbours on one face have normals either way.
        let turn = Quat::from_rotation_z(FRAC_PI_4);
        estimate(
            &support,
            |i| turn * points[i as usize],
            |k| is_wanted(points[k]),
            &around,
            &mut scratch,
            &mut targets,
            &mut normals,
        );
        let placed = |normals: &[Vec3]| {
            let targets = targets.iter().map(|&i| points[i as usize]);
            let normals = normals.iter().map(|&n| turn.inverse() * n);
            targets.zip(normals).collect()
        };
        let estimated = placed(&normals);
        let mut own = SharpenScratch::default();
        sharpen(&around, &mut scratch, &mut own, &mut normals);
        [estimated, placed(&normals)]
    }

    /// Random points on quarter planes of 12 radii that meet in the origin: all three of a corner, or two of an edge.
    fn faces(count: usize, rng: &mut fastrand::Rng) -> Vec<Vec3> {
        let edge = 12.0;
        let mut points = Vec::new();
        for face in 0..count {
            for _ in 0..(POINTS_PER_AREA * edge * edge) as usize {
                let mut p = [edge * rng.f32(), edge * rng.f32(), 0.0];
                p.rotate_right(face);
                points.push(Vec3::from_array(p));
            }
        }
        points
    }

    /// Share of normals that are more than 5° off the axis of a face which their point is on.
    fn off_face(normals: &[(Vec3, Vec3)]) -> f32 {
        let off = normals.iter().filter(|(point, normal)| {
            let on = (0..3).filter(|&k| point[k].abs() < 1e-4);
            on.map(|k| normal[k].abs()).fold(0.0, f32::max) < 5.0_f32.to_radians().cos()
        });
        off.count() as f32 / normals.len() as f32
    }

    #[test]
    fn edges_and_corners_have_the_normals_of_their_faces() {
        for (faces_that_meet, before, after) in [(2, 0.2, 0.05), (3, 0.2, 0.1)] {
            let mut all = [vec![], vec![]];
            for seed in 0..20 {
                let mut rng = fastrand::Rng::with_seed(seed);
                let points = faces(faces_that_meet, &mut rng);
                // Not what is at the rim of the faces; of an edge, not its ends.
                let is_wanted = |p: Vec3| match faces_that_meet {
                    2 => p.max_element() < 8.0 && p.y > 4.0,
                    _ => p.max_element() < 8.0,
                };
                for (all, found) in all.iter_mut().zip(normals(&points, is_wanted, 0.0)) {
                    all.extend(found);
                }
            }
            let [estimated, sharp] = all.map(|all| off_face(&all));
            assert!(estimated > before, "{estimated} of {faces_that_meet} faces");
            assert!(sharp < after, "{sharp} of {faces_that_meet} faces");
        }
    }

    /// What is round or noisy has no face to take a normal of.
    #[test]
    fn round_and_noisy_normals_stay() {
        let mut rng = fastrand::Rng::with_seed(1);
        for radius in [4.0, 6.0, 8.0] {
            let count = (POINTS_PER_AREA * 2.0 * TAU * radius * radius) as usize;
            let ball: Vec<Vec3> = (0..count)
                .map(|_| {
                    let (z, turn) = (2.0 * rng.f32() - 1.0, TAU * rng.f32());
                    let across = (1.0 - z * z).sqrt();
                    radius * Vec3::new(across * turn.cos(), across * turn.sin(), z)
                })
                .collect();
            let [estimated, sharp] = normals(&ball, |_| true, 0.0);
            assert_eq!(estimated, sharp, "a ball of {radius} radii");
        }
        for (noise, told) in [(0.25, 0.0), (0.25, 0.25), (1.0, 0.0), (1.0, 1.0)] {
            let mut points = faces(1, &mut rng);
            // The sum of twelve has the standard deviation of a normal distribution.
            let normal = |rng: &mut fastrand::Rng| (0..12).map(|_| rng.f32()).sum::<f32>() - 6.0;
            points
                .iter_mut()
                .for_each(|p| p.z += noise * normal(&mut rng));
            let [estimated, sharp] = normals(&points, |_| true, told);
            let changed = estimated.iter().zip(&sharp).filter(|(m, n)| m != n);
            // At the rim, where some neighbours are few, or by chance on a plane.
            let share = changed.count() as f32 / points.len() as f32;
            assert!(share < 0.02, "{share} with noise of {noise}, told {told}");
        }
    }
}
