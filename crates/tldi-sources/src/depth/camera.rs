//! From a depth image to points with radii and normals.

use rayon::prelude::*;
use tldi::glamx::{Mat3, Pose3, Vec3};
use tldi::{CloudBuilder, PointCloud};

/// Edge in pixels of the tiles in which points come: their bounds are tight, so that what is out of
/// reach is passed over.
const TILE: usize = 16;
/// Steepest surface, as the tangent of the angle between it and the image plane, that is not taken
/// for a jump in depth (80°).
const STEEPEST: f32 = 5.67;
/// Standard deviations of the difference of two pixels that a surface may show.
const DEVIATIONS: f32 = 3.0 * std::f32::consts::SQRT_2;
/// Pixels to each side over which normals are fitted.
const NORMAL_REACHES: [usize; 2] = [2, 4];
/// Radius that covers a square grid, in its spacing, with a little overlap.
const COVER: f32 = 0.75;

/// A pinhole camera without distortion. Pixel (u, v) at depth z sees the point
/// ((u − cx) z / fx, (v − cy) z / fy, z) of the camera's frame: x right, y down, z ahead.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intrinsics {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Focal lengths in pixels.
    pub focal: [f32; 2],
    /// Principal point in pixels.
    pub center: [f32; 2],
    /// Metres in a unit of the image.
    pub depth_unit: f32,
}

/// How a sensor errs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorModel {
    /// Standard deviation of depth at a range of 1 m, metres. It grows with the square of the range,
    /// as in all that triangulates.
    pub noise: f32,
    /// Nearest and farthest range that is believed, metres.
    pub range: [f32; 2],
}

impl Default for SensorModel {
    /// A Kinect: Khoshelham and Elberink 2012, doi:10.3390/s120201437.
    fn default() -> Self {
        Self {
            noise: 1.42e-3,
            range: [0.3, 8.0],
        }
    }
}

impl SensorModel {
    /// Standard deviation of the depth `z`, both in metres.
    pub fn deviation(&self, z: f32) -> f32 {
        self.noise * z * z
    }
}

/// Turns depth images into points; keeps its memory.
#[derive(Clone, Debug)]
pub struct DepthCamera {
    /// Geometry of the camera.
    pub intrinsics: Intrinsics,
    /// Errors of the camera.
    pub model: SensorModel,
    /// Depths in metres, 0 where there is none.
    depths: Vec<f32>,
    /// Their inverses, 0 where there is none.
    inverses: Vec<f32>,
}

/// Points of one frame, with an entry for each in all lists.
#[derive(Clone, Debug, Default)]
pub struct DepthCloud {
    /// Positions, metres.
    pub points: Vec<Vec3>,
    /// Radii: what a pixel covers at its range and the deviation of its depth, together, metres.
    pub radii: Vec<f32>,
    /// Unit normals towards the camera.
    pub normals: Vec<Vec3>,
    /// Pixels without a measurement, or out of the sensor's range.
    pub empty: usize,
    /// Pixels left out at jumps in depth, where a sensor mixes what is before and behind.
    pub flying: usize,
}

impl DepthCloud {
    /// Hands the points to a builder.
    pub fn into_builder(self) -> CloudBuilder<'static> {
        PointCloud::builder(self.points)
            .radii(self.radii)
            .normals(self.normals)
    }
}

impl DepthCamera {
    /// A camera that has seen nothing yet.
    pub fn new(intrinsics: Intrinsics, model: SensorModel) -> Self {
        Self {
            intrinsics,
            model,
            depths: Vec::new(),
            inverses: Vec::new(),
        }
    }

    /// The points of a frame, row by row in units of [`Intrinsics::depth_unit`], in the frame that
    /// `world_from_camera` leads into. 0 and 65535 mean no measurement. Of a frame that is too short
    /// the missing pixels have none either.
    ///
    /// Cost: some 25 ns a pixel, on all cores.
    pub fn points(&mut self, frame: &[u16], world_from_camera: &Pose3) -> DepthCloud {
        let [width, height] = self.intrinsics.size;
        let [near, far] = self.model.range;
        let unit = self.intrinsics.depth_unit;
        self.depths.clear();
        self.depths
            .extend(frame.iter().take(width * height).map(|&raw| {
                let z = f32::from(raw) * unit;
                if raw != u16::MAX && (near..=far).contains(&z) {
                    z
                } else {
                    0.0
                }
            }));
        self.depths.resize(width * height, 0.0);
        self.inverses.clear();
        (self.inverses).extend(
            self.depths
                .iter()
                .map(|z| if *z > 0.0 { 1.0 / z } else { 0.0 }),
        );
        let rows: Vec<DepthCloud> = (0..height.div_ceil(TILE))
            .into_par_iter()
            .map(|row| self.tile_row(row * TILE, world_from_camera))
            .collect();
        let mut cloud = DepthCloud::default();
        let count = rows.iter().map(|row| row.points.len()).sum();
        cloud.points.reserve(count);
        cloud.radii.reserve(count);
        cloud.normals.reserve(count);
        for row in rows {
            cloud.points.extend_from_slice(&row.points);
            cloud.radii.extend_from_slice(&row.radii);
            cloud.normals.extend_from_slice(&row.normals);
            cloud.empty += row.empty;
            cloud.flying += row.flying;
        }
        cloud
    }

    /// The points of the tiles from row `top` on.
    fn tile_row(&self, top: usize, world_from_camera: &Pose3) -> DepthCloud {
        let [width, height] = self.intrinsics.size;
        let rotation = Mat3::from_quat(world_from_camera.rotation);
        let origin = world_from_camera.translation;
        let mut cloud = DepthCloud::default();
        cloud.points.reserve(TILE * width);
        cloud.radii.reserve(TILE * width);
        cloud.normals.reserve(TILE * width);
        for left in (0..width).step_by(TILE) {
            for v in top..(top + TILE).min(height) {
                for u in left..(left + TILE).min(width) {
                    let z = self.depths[v * width + u];
                    if z == 0.0 {
                        cloud.empty += 1;
                        continue;
                    }
                    let step = self.largest_step(z);
                    if self.is_at_jump(u, v, z, step) {
                        cloud.flying += 1;
                        continue;
                    }
                    let point = self.point(u, v, z);
                    let normal = self.normal(u, v, point, step);
                    cloud.points.push(origin + rotation * point);
                    cloud.normals.push(rotation * normal);
                    cloud.radii.push(self.radius(z));
                }
            }
        }
        cloud
    }

    /// Whether a point of the world is where the last frame saw through: in view, nearer than what
    /// is seen there by more than the sensor errs.
    pub fn sees_through(&self, point: Vec3, camera_from_world: &Pose3) -> bool {
        self.seen_behind(point, camera_from_world)
            .is_some_and(|(z, seen)| seen - z > DEVIATIONS * self.model.deviation(seen))
    }

    /// Whether a point of the world is where the last frame saw a surface at that depth.
    pub fn sees(&self, point: Vec3, camera_from_world: &Pose3) -> bool {
        self.seen_behind(point, camera_from_world)
            .is_some_and(|(z, seen)| (seen - z).abs() <= DEVIATIONS * self.model.deviation(seen))
    }

    /// The depth of a point, and of what the last frame shows in its pixel.
    fn seen_behind(&self, point: Vec3, camera_from_world: &Pose3) -> Option<(f32, f32)> {
        let p = *camera_from_world * point;
        let Intrinsics {
            size,
            focal,
            center,
            ..
        } = self.intrinsics;
        let u = (p.x / p.z * focal[0] + center[0]).round();
        let v = (p.y / p.z * focal[1] + center[1]).round();
        let inside = p.z > 0.0 && u >= 0.0 && v >= 0.0 && u < size[0] as f32 && v < size[1] as f32;
        let seen = inside.then(|| self.depths.get(v as usize * size[0] + u as usize))?;
        seen.copied()
            .filter(|seen| *seen > 0.0)
            .map(|seen| (p.z, seen))
    }

    #[inline]
    fn point(&self, u: usize, v: usize, z: f32) -> Vec3 {
        let Intrinsics { focal, center, .. } = self.intrinsics;
        Vec3::new(
            (u as f32 - center[0]) * z / focal[0],
            (v as f32 - center[1]) * z / focal[1],
            z,
        )
    }

    /// Largest difference of depth from one pixel to the next on a surface at depth `z`.
    #[inline]
    fn largest_step(&self, z: f32) -> f32 {
        DEVIATIONS * self.model.deviation(z) + STEEPEST * z / self.intrinsics.focal[0]
    }

    #[inline]
    fn is_at_jump(&self, u: usize, v: usize, z: f32, limit: f32) -> bool {
        let [width, height] = self.intrinsics.size;
        let k = v * width + u;
        let jumps = |is_there: bool, k: usize| {
            is_there && self.depths[k] > 0.0 && (self.depths[k] - z).abs() > limit
        };
        jumps(u > 0, k.wrapping_sub(1))
            || jumps(u + 1 < width, k + 1)
            || jumps(v > 0, k.wrapping_sub(width))
            || jumps(v + 1 < height, k + width)
    }

    fn radius(&self, z: f32) -> f32 {
        let footprint = COVER * z / self.intrinsics.focal[0].min(self.intrinsics.focal[1]);
        let deviation = self.model.deviation(z);
        (footprint * footprint + deviation * deviation).sqrt()
    }

    /// From the slopes of inverse depth, which on a plane is linear in the image: differences over a
    /// few pixels, along rows and columns. Where neighbours are missing or more than `step` a pixel
    /// nearer or farther, towards the camera.
    #[inline]
    fn normal(&self, u: usize, v: usize, point: Vec3, step: f32) -> Vec3 {
        let [width, height] = self.intrinsics.size;
        let [fx, fy] = self.intrinsics.focal;
        let k = v * width + u;
        let inverse = self.inverses[k];
        let step = step * inverse * inverse;
        let across = self.slope(k, u.min(width - 1 - u), 1, inverse, step);
        let down = self.slope(k, v.min(height - 1 - v), width, inverse, step);
        let (Some(across), Some(down)) = (across, down) else {
            return -point.normalize_or(Vec3::Z);
        };
        // On the plane n · p = 1: n.x x / z + n.y y / z + n.z = 1 / z.
        let [x, y] = [across * fx, down * fy];
        let rest = inverse - inverse * (x * point.x + y * point.y);
        let normal = Vec3::new(x, y, rest).normalize_or(Vec3::Z);
        if normal.dot(point) > 0.0 {
            -normal
        } else {
            normal
        }
    }

    /// Change of inverse depth a pixel along a row or a column of pixels `stride` apart, of which
    /// `free` are there on both sides.
    #[inline]
    fn slope(&self, k: usize, free: usize, stride: usize, inverse: f32, step: f32) -> Option<f32> {
        let (mut sum, mut weight, mut worst) = (0.0, 0.0, 0.0_f32);
        for reach in NORMAL_REACHES.into_iter().filter(|reach| *reach <= free) {
            let before = self.inverses[k - reach * stride];
            let after = self.inverses[k + reach * stride];
            let span = reach as f32;
            let off = (before - inverse).abs().max((after - inverse).abs());
            // A missing one is as far off as can be.
            worst = worst.max(off - span * step);
            sum += span * (after - before);
            weight += 2.0 * span * span;
        }
        (weight > 0.0 && worst <= 0.0).then(|| sum / weight)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;
    use tldi::glamx::Quat;

    fn camera() -> DepthCamera {
        let intrinsics = Intrinsics {
            size: [64, 48],
            focal: [60.0, 58.0],
            center: [31.5, 23.5],
            depth_unit: 0.0002,
        };
        DepthCamera::new(
            intrinsics,
            SensorModel {
                noise: 1e-3,
                range: [0.2, 10.0],
            },
        )
    }

    /// A frame that sees the plane `normal · p = offset` of the camera's frame.
    fn plane(normal: Vec3, offset: f32, noise: f32) -> Vec<u16> {
        let Intrinsics {
            size,
            focal,
            center,
            depth_unit,
        } = camera().intrinsics;
        let mut rng = Rng::with_seed(1);
        (0..size[0] * size[1])
            .map(|k| {
                let [u, v] = [(k % size[0]) as f32, (k / size[0]) as f32];
                let ray = Vec3::new((u - center[0]) / focal[0], (v - center[1]) / focal[1], 1.0);
                let z = offset / normal.dot(ray);
                let error = 2.0 * noise * z * z * (rng.f32() + rng.f32() + rng.f32() - 1.5);
                ((z + error) / depth_unit).round() as u16
            })
            .collect()
    }

    #[test]
    fn a_plane_is_a_plane_with_its_normal() {
        let normal = Vec3::new(0.3, -0.5, -0.8).normalize();
        let pose = Pose3::from_parts(Vec3::new(1.0, 2.0, 3.0), Quat::from_rotation_y(0.8));
        // Depths are rounded to 0.2 mm, 1 mrad over the 8 pixels of a normal; noise of some 3 mm over
        // 25 cm is 15 mrad in each direction, and 4.5 deviations of it are the worst of 1,800.
        for (noise, angle) in [(0.0_f32, 2e-3_f32), (1e-3, 0.07)] {
            let cloud = camera().points(&plane(normal, -1.5, noise), &pose);
            let counts = (cloud.points.len(), cloud.empty, cloud.flying);
            assert_eq!(counts, (64 * 48, 0, 0));
            let world_normal = pose.rotation * normal;
            let mut inner = 0;
            for (k, p) in cloud.points.iter().enumerate() {
                let local = pose.inverse() * *p;
                let error = (normal.dot(local) + 1.5).abs();
                assert!(error < 1e-3 + 4.0 * noise * local.z * local.z);
                // A pixel wide and as noisy as its range says.
                let radius = (0.75 * local.z / 58.0).hypot(1e-3 * local.z * local.z);
                assert!((cloud.radii[k] - radius).abs() < 1e-5);
                let Intrinsics { focal, center, .. } = camera().intrinsics;
                let u = local.x / local.z * focal[0] + center[0];
                let v = local.y / local.z * focal[1] + center[1];
                // At the rim there are fewer neighbours.
                if (4.5..58.5).contains(&u) && (4.5..42.5).contains(&v) {
                    inner += 1;
                    let off = cloud.normals[k].angle_between(world_normal);
                    assert!(off < angle, "{noise}: {off} at {u} {v}");
                }
            }
            assert!(inner > 50 * 36, "{inner}");
        }
    }

    #[test]
    fn jumps_fly_and_gaps_are_empty() {
        let mut frame = vec![5000; 64 * 48]; // 1 m
        for v in 10..30 {
            for u in 20..40 {
                frame[v * 64 + u] = 4000; // 20 cm before it
            }
            frame[v * 64 + 40] = 4500; // a mixture of both
        }
        frame[0] = 0;
        frame[1] = u16::MAX;
        frame[2] = 100; // 2 cm: nearer than the sensor sees
        let cloud = camera().points(&frame, &Pose3::IDENTITY);
        assert_eq!(cloud.empty, 3);
        // The rims on both sides of the jump, and the mixture.
        let inside = 20 * 20 - 18 * 18;
        assert!(
            (inside..3 * inside).contains(&cloud.flying),
            "{}",
            cloud.flying
        );
        for p in &cloud.points {
            assert!((p.z - 1.0).abs() < 1e-3 || (p.z - 0.8).abs() < 1e-3, "{p}");
        }
        assert_eq!(cloud.points.len() + cloud.empty + cloud.flying, 64 * 48);
        // A frame that ends early.
        assert_eq!(
            camera().points(&frame[..640], &Pose3::IDENTITY).empty,
            3 + 64 * 38
        );
    }

    #[test]
    fn free_space_is_known() {
        let mut camera = camera();
        let pose = Pose3::from_translation(Vec3::X);
        camera.points(&plane(Vec3::Z, 2.0, 0.0), &pose);
        let camera_from_world = pose.inverse();
        let at = |z: f32| Vec3::new(1.0, 0.1, z);
        assert!(camera.sees_through(at(1.5), &camera_from_world));
        assert!(camera.sees(at(2.0), &camera_from_world));
        // Hidden, beside the view, behind the camera.
        for p in [at(2.5), Vec3::new(9.0, 0.0, 1.5), at(-1.0)] {
            assert!(
                !camera.sees_through(p, &camera_from_world) && !camera.sees(p, &camera_from_world)
            );
        }
    }
}
