//! From a depth image to points with radii and normals.

use super::cloud::DepthCloud;
use super::frame_size::FrameSizeError;
use super::sensor::{Intrinsics, SensorModel};
use super::tile::{DEVIATIONS, Optics, Pixels, REACH, TILE, Window, compute};
use rayon::prelude::*;
use tldi::glamx::{Pose3, Vec3};

/// Fewest different depths of a frame that tell their common step: so many multiples of twice the step are among others
/// less often than once in 10⁹ frames. With half as many it would be once in 60,000, with twice as many coarse frames of
/// level surfaces would tell nothing.
const FEWEST_DEPTHS: usize = 32;
/// Pixels without depth around the image, so that all of its pixels have neighbours.
const FRINGE: usize = REACH;

/// Turns depth images into points; keeps its memory.
#[derive(Clone, Debug)]
pub struct DepthCamera {
    /// Geometry of the camera.
    pub intrinsics: Intrinsics,
    /// Errors of the camera.
    pub model: SensorModel,
    /// Depths in metres, 0 where there is none, with the fringe (see [`Self::index`]).
    depths: Vec<f32>,
    /// Their inverses, 0 where there is none.
    inverses: Vec<f32>,
    /// Whether a pixel gave a point, in rows of [`Self::stride`], without the fringe above and before them.
    gave: Vec<bool>,
    /// The points of each row of tiles.
    rows: Vec<DepthCloud>,
}

impl DepthCamera {
    /// A camera that has seen nothing yet.
    pub fn new(intrinsics: Intrinsics, model: SensorModel) -> Self {
        Self {
            intrinsics,
            model: SensorModel {
                step: model.step.max(intrinsics.depth_unit),
                ..model
            },
            depths: Vec::new(),
            inverses: Vec::new(),
            gave: Vec::new(),
            rows: Vec::new(),
        }
    }

    /// Pixels from one row to the next, with the fringe and up to whole tiles.
    fn stride(&self) -> usize {
        self.intrinsics.size[0].next_multiple_of(TILE) + 2 * FRINGE
    }

    /// Where the lists of depths hold a pixel.
    fn index(&self, u: usize, v: usize) -> usize {
        (v + FRINGE) * self.stride() + u + FRINGE
    }

    /// The points of a frame, row by row in units of [`Intrinsics::depth_unit`], in the frame that
    /// `world_from_camera` leads into. 0 and 65535 mean no measurement.
    ///
    /// Where all depths of a frame are multiples of a larger step than the model knows, it is the model's
    /// ([`SensorModel::step`]) from this frame on: a sensor that tells whole millimetres in units of a tenth.
    ///
    /// Cost: some 45 ns a pixel on one core with AVX-512, shared by all cores: half of it are the normals, a quarter the
    /// memory of the points.
    ///
    /// # Errors
    /// [`FrameSizeError`] unless there is one depth for each pixel of [`Intrinsics::size`], without padding between rows.
    /// The camera then knows the frame before.
    pub fn points(
        &mut self,
        frame: &[u16],
        world_from_camera: &Pose3,
    ) -> Result<DepthCloud, FrameSizeError> {
        FrameSizeError::check(self.intrinsics.size, frame.len())?;
        if let Some(step) = common_step(frame) {
            let step = f32::from(step) * self.intrinsics.depth_unit;
            self.model.step = self.model.step.max(step);
        }
        self.take_depths(frame);
        let Intrinsics {
            size: [width, height],
            focal,
            center,
            ..
        } = self.intrinsics;
        let columns: Vec<f32> = (0..width.next_multiple_of(TILE))
            .map(|u| (u as f32 - center[0]) / focal[0])
            .collect();
        let mut rows = std::mem::take(&mut self.rows);
        rows.resize_with(height.div_ceil(TILE), DepthCloud::default);
        let stride = self.stride();
        let mut gave = std::mem::take(&mut self.gave);
        gave.clear();
        gave.resize(stride * height, false);
        let camera = &*self;
        let optics = Optics::new(&self.intrinsics, &self.model, world_from_camera);
        let tiles = rows.par_iter_mut().zip(gave.par_chunks_mut(stride * TILE));
        tiles.enumerate().for_each(|(row, (cloud, gave))| {
            cloud.clear();
            let mut pixels = Pixels::default();
            for left in (0..width).step_by(TILE) {
                for (v, gave) in (row * TILE..).zip(gave.chunks_mut(stride)) {
                    let gave = &mut gave[left..left + TILE];
                    camera.tile_line([left, v], &columns, &optics, &mut pixels, cloud, gave);
                }
            }
        });
        let mut cloud = DepthCloud::gathered(&rows);
        cloud.empty = width * height - cloud.points.len() - cloud.flying;
        (self.rows, self.gave) = (rows, gave);
        Ok(cloud)
    }

    /// Depths in metres of those pixels that the sensor is believed in, and their inverses.
    fn take_depths(&mut self, frame: &[u16]) {
        let [width, height] = self.intrinsics.size;
        let [near, far] = self.model.range;
        let unit = self.intrinsics.depth_unit;
        let (stride, first) = (self.stride(), self.index(0, 0));
        for list in [&mut self.depths, &mut self.inverses] {
            list.clear();
            list.resize(stride * (height + 2 * FRINGE), 0.0);
        }
        let depths = self.depths[first..].chunks_mut(stride);
        let inverses = self.inverses[first..].chunks_mut(stride);
        for ((row, depths), inverses) in frame
            .chunks(width.max(1))
            .take(height)
            .zip(depths)
            .zip(inverses)
        {
            for ((&raw, depth), inverse) in row.iter().zip(depths).zip(inverses) {
                let z = f32::from(raw) * unit;
                let is_seen = (raw != u16::MAX) & (z >= near) & (z <= far) & (z > 0.0);
                *depth = if is_seen { z } else { 0.0 };
                *inverse = if is_seen { 1.0 / z } else { 0.0 };
            }
        }
    }

    /// The points of a line of a tile, from pixel `[left, v]` on; `columns` are the coordinates of all columns on the
    /// image plane at depth 1. Tells which of its pixels gave one.
    #[inline]
    fn tile_line(
        &self,
        [left, v]: [usize; 2],
        columns: &[f32],
        optics: &Optics,
        pixels: &mut Pixels,
        cloud: &mut DepthCloud,
        gave: &mut [bool],
    ) {
        let window = Window {
            depths: &self.depths,
            inverses: &self.inverses,
            first: self.index(left, v),
            stride: self.stride(),
        };
        let columns = &columns[left..].as_chunks().0[0];
        let row = (v as f32 - self.intrinsics.center[1]) / self.intrinsics.focal[1];
        compute(&window, columns, row, optics, pixels);
        let depth = window.depth();
        let (mut kept, mut count) = ([0; TILE], 0);
        for (k, (z, gave)) in depth.iter().zip(gave).enumerate() {
            let is_seen = *z > 0.0;
            *gave = is_seen & !pixels.flies[k];
            cloud.flying += usize::from(is_seen & pixels.flies[k]);
            kept[count] = k;
            count += usize::from(*gave);
        }
        let kept = kept[..count].iter();
        cloud.points.extend(kept.clone().map(|k| pixels.point(*k)));
        cloud
            .normals
            .extend(kept.clone().map(|k| pixels.normal(*k)));
        cloud.radii.extend(kept.map(|k| pixels.radii[*k]));
    }

    /// Whether a point of the world is where the last frame saw through: in view, nearer than what
    /// is seen there by more than the sensor errs.
    pub fn sees_through(&self, point: Vec3, camera_from_world: &Pose3) -> bool {
        self.seen_behind(point, camera_from_world)
            .is_some_and(|(z, seen, _)| seen - z > DEVIATIONS * self.model.deviation(seen))
    }

    /// Whether a point of the world is where the last frame saw a surface at that depth. Flying pixels show none.
    pub fn sees(&self, point: Vec3, camera_from_world: &Pose3) -> bool {
        self.seen_behind(point, camera_from_world)
            .is_some_and(|(z, seen, gave)| {
                gave && (seen - z).abs() <= DEVIATIONS * self.model.deviation(seen)
            })
    }

    /// Whether a point of the world is before the camera and in its image, seen or hidden.
    pub fn is_in_view(&self, point: Vec3, camera_from_world: &Pose3) -> bool {
        self.pixel_of(point, camera_from_world).is_some()
    }

    /// The depth of a point, metres, and column and row of its pixel.
    fn pixel_of(&self, point: Vec3, camera_from_world: &Pose3) -> Option<(f32, [usize; 2])> {
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
        inside.then_some((p.z, [u as usize, v as usize]))
    }

    /// The depth of a point, and of what the last frame shows in its pixel, and whether that is a point.
    fn seen_behind(&self, point: Vec3, camera_from_world: &Pose3) -> Option<(f32, f32, bool)> {
        let (z, [u, v]) = self.pixel_of(point, camera_from_world)?;
        let seen = *self.depths.get(self.index(u, v))?;
        let gave = *self.gave.get(v * self.stride() + u)?;
        (seen > 0.0).then_some((z, seen, gave))
    }
}

/// The largest step, in units of the image, of which all differences of depths in a frame are multiples; nothing where
/// there are too few different ones.
fn common_step(frame: &[u16]) -> Option<u16> {
    let mut occurs = vec![false; usize::from(u16::MAX) + 1];
    for raw in frame {
        occurs[usize::from(*raw)] = true;
    }
    let mut depths = (1..u16::MAX).filter(|raw| occurs[usize::from(*raw)]);
    let first = depths.next()?;
    let (mut count, mut step) = (1, 0);
    for depth in depths {
        count += 1;
        step = greatest_common_divisor(depth - first, step);
        if step == 1 {
            return None;
        }
    }
    (count >= FEWEST_DEPTHS).then_some(step)
}

fn greatest_common_divisor(a: u16, b: u16) -> u16 {
    if b == 0 {
        a
    } else {
        greatest_common_divisor(b, a % b)
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
                floor: 0.0,
                step: 0.0,
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

    /// The points of a frame of the camera's size.
    fn points(camera: &mut DepthCamera, frame: &[u16], pose: &Pose3) -> DepthCloud {
        camera.points(frame, pose).expect("a depth for each pixel")
    }

    #[test]
    fn a_plane_is_a_plane_with_its_normal() {
        let normal = Vec3::new(0.3, -0.5, -0.8).normalize();
        let pose = Pose3::from_parts(Vec3::new(1.0, 2.0, 3.0), Quat::from_rotation_y(0.8));
        // Depths are rounded to 0.2 mm, 1 mrad over the 8 pixels of a normal; noise of some 3 mm over
        // 25 cm is 15 mrad in each direction, and 4.5 deviations of it are the worst of 1,800.
        // The last camera expects noise of 11 cm at 1.5 m, and so has wide windows.
        for (noise, expected, angle) in [(0.0, 1e-3, 2e-3), (1e-3, 1e-3, 0.07), (0.0, 0.05, 2e-3)] {
            let mut camera = camera();
            camera.model.noise = expected;
            let cloud = points(&mut camera, &plane(normal, -1.5, noise), &pose);
            let counts = (cloud.points.len(), cloud.empty, cloud.flying);
            assert_eq!(counts, (64 * 48, 0, 0));
            let world_normal = pose.rotation * normal;
            let mut inner = 0;
            for (k, p) in cloud.points.iter().enumerate() {
                let local = pose.inverse() * *p;
                let error = (normal.dot(local) + 1.5).abs();
                assert!(error < 1e-3 + 4.0 * noise * local.z * local.z);
                // A pixel wide and as noisy as its range says.
                let radius = (0.75 * local.z / 58.0).hypot(expected * local.z * local.z);
                assert!((cloud.radii[k] - radius).abs() < 1e-5);
                let Intrinsics { focal, center, .. } = camera.intrinsics;
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

    /// Sizes that are no multiples of a tile, down to nothing: every pixel of a level wall gives its
    /// point and its normal, once; those of a single row or column, which tell no plane, are counted.
    #[test]
    fn every_pixel_counts_in_images_of_any_size() {
        let sizes = [
            [37, 21],
            [16, 16],
            [6, 5],
            [3, 2],
            [17, 1],
            [1, 9],
            [0, 5],
            [5, 0],
        ];
        for size in sizes {
            let intrinsics = Intrinsics {
                size,
                center: [3.0, 2.0],
                ..camera().intrinsics
            };
            let mut camera = DepthCamera::new(intrinsics, camera().model);
            let frame = vec![5000; size[0] * size[1]];
            let cloud = points(&mut camera, &frame, &Pose3::IDENTITY);
            if size.contains(&1) {
                assert_eq!((cloud.points.len(), cloud.flying), (0, size[0] * size[1]));
                continue;
            }
            let mut pixels: Vec<[i32; 2]> = (cloud.points.iter())
                .map(|p| [p.y * 58.0 + 2.0, p.x * 60.0 + 3.0].map(|c| c.round() as i32))
                .collect();
            pixels.sort_unstable();
            let all = (0..size[1]).flat_map(|v| (0..size[0]).map(move |u| [v as i32, u as i32]));
            assert!(pixels.into_iter().eq(all), "{size:?}");
            for normal in &cloud.normals {
                assert!(normal.distance(-Vec3::Z) < 1e-4, "{size:?} {normal}");
            }
        }
    }

    /// A regular grid of empty pixels, and half of the others at random, as where a frame is
    /// registered to another camera.
    #[test]
    fn empty_pixels_leave_normals() {
        let normal = Vec3::new(0.3, -0.5, -0.8).normalize();
        let mut frame = plane(normal, -1.5, 1e-3);
        let mut rng = Rng::with_seed(2);
        for (k, depth) in frame.iter_mut().enumerate() {
            let (u, v) = (k % 64, k / 64);
            if u % 5 == 2 || v % 6 == 1 || rng.bool() {
                *depth = 0;
            }
        }
        let seen = frame.iter().filter(|depth| **depth > 0).count();
        let cloud = points(&mut camera(), &frame, &Pose3::IDENTITY);
        // Windows hold eight pixels in the mean. One in seven holds less than six, and so does one in fifty
        // together with the next larger, more of them at the rim of the image.
        assert!(cloud.points.len() * 10 > 9 * seen, "{}", cloud.flying);
        let mut errors: Vec<f32> = (cloud.normals.iter())
            .map(|n| n.angle_between(normal).to_degrees())
            .collect();
        errors.sort_unstable_by(f32::total_cmp);
        let tenth_worst = errors[errors.len() * 9 / 10];
        assert!(tenth_worst < 15.0, "{tenth_worst}");
    }

    /// A sensor whose depths are 3 mm apart in an image of units of 0.2 mm: the step is that of the frame, and stays. Few
    /// depths, or one that is no multiple, tell none.
    #[test]
    fn the_step_is_what_the_frame_shows() {
        let mut frame = plane(Vec3::new(0.3, -0.5, -0.8).normalize(), -1.5, 1e-3);
        for depth in &mut frame {
            *depth = *depth / 15 * 15 + 4;
        }
        let mut camera = camera();
        points(&mut camera, &[5000; 64 * 48], &Pose3::IDENTITY);
        let few: Vec<u16> = (0..64 * 48).map(|k| 4000 + 500 * (k % 31)).collect();
        points(&mut camera, &few, &Pose3::IDENTITY);
        assert_eq!(camera.model.step, 0.0002);
        let mut off = frame.clone();
        off[100] += 1;
        points(&mut camera, &off, &Pose3::IDENTITY);
        assert_eq!(camera.model.step, 0.0002);
        points(&mut camera, &frame, &Pose3::IDENTITY);
        assert!((camera.model.step - 0.003).abs() < 1e-6);
        points(&mut camera, &off, &Pose3::IDENTITY);
        assert!((camera.model.step - 0.003).abs() < 1e-6);
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
        let cloud = points(&mut camera(), &frame, &Pose3::IDENTITY);
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
    }

    /// Rows with padding would be read as sheared ones.
    #[test]
    fn a_frame_of_another_size_is_refused() {
        let mut camera = camera();
        let wall = |depths: usize| vec![5000; depths]; // 1 m
        let seen = |camera: &DepthCamera| camera.sees(Vec3::Z, &Pose3::IDENTITY);
        for found in [0, 64 * 47, 64 * 48 - 1, 64 * 48 + 1, 80 * 48] {
            let size = [64, 48];
            let refused = camera.points(&wall(found), &Pose3::IDENTITY);
            assert_eq!(refused.err(), Some(FrameSizeError { size, found }));
            assert!(!seen(&camera));
        }
        assert!(camera.points(&wall(64 * 48), &Pose3::IDENTITY).is_ok());
        assert!(camera.points(&[], &Pose3::IDENTITY).is_err() && seen(&camera));
        // More pixels than can be counted.
        camera.intrinsics.size = [usize::MAX, 2];
        assert!(camera.points(&wall(64 * 48), &Pose3::IDENTITY).is_err());
    }

    #[test]
    fn free_space_is_known() {
        let mut camera = camera();
        let pose = Pose3::from_translation(Vec3::X);
        points(&mut camera, &plane(Vec3::Z, 2.0, 0.0), &pose);
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
