//! Clouds that are born on the device: in a buffer of the caller's, or from a depth image.

use crate::buffers::Growable;
use crate::error::numbered;
use crate::layout::GROUP;
use crate::pipelines::{direct, module};
use crate::resident::{Place, Resident};
use crate::{Gpu, GpuError};
use bytemuck::{Pod, Zeroable};
use std::collections::HashMap;
use std::sync::atomic::{AtomicU64, Ordering};
use tldi::glamx::Vec3;
use tldi::{Aabb, DeviceCloud};
use wgpu::BufferUsages;

/// Words of a point: x, y, z, radius.
const POINT_WORDS: u64 = 4;

/// A camera whose depth images become clouds, in its optical frame (x right, y down, z forward).
///
/// ```
/// use tldi_wgpu::DepthCamera;
/// // A Kinect, millimetres.
/// let camera = DepthCamera {
///     size: [640, 480],
///     focal_px: [585.0, 585.0],
///     principal_px: [320.0, 240.0],
///     metres_per_unit: 0.001,
///     range: [0.4, 5.0],
///     radius_px: 0.8,
/// };
/// assert_eq!(camera.size[0] * camera.size[1], 307_200);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthCamera {
    /// Columns and rows.
    pub size: [u32; 2],
    /// Focal lengths in pixels.
    pub focal_px: [f32; 2],
    /// Principal point in pixels; the centre of the first pixel is at 0.
    pub principal_px: [f32; 2],
    /// Metres along the optical axis of one unit of depth.
    pub metres_per_unit: f32,
    /// Nearest and farthest depth that is trusted, metres. 0 and 65535 units are no measurement.
    pub range: [f32; 2],
    /// Radius of a point in pixels at its depth: 0.7 reaches the neighbours on a surface that is
    /// seen face on, more those of slopes.
    pub radius_px: f32,
}

impl DepthCamera {
    fn pixels(&self) -> usize {
        self.size[0] as usize * self.size[1] as usize
    }
}

/// See `DepthCamera` in WGSL.
#[repr(C)]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub(crate) struct CameraData {
    pub(crate) size: [u32; 2],
    pub(crate) focal_px: [f32; 2],
    pub(crate) principal_px: [f32; 2],
    pub(crate) metres_per_unit: f32,
    pub(crate) near: f32,
    pub(crate) far: f32,
    pub(crate) radius_px: f32,
    pub(crate) first_point: u32,
    padding: u32,
}

#[derive(Debug)]
enum Source {
    /// With so many points.
    Buffer(wgpu::Buffer, usize),
    Depth {
        camera: DepthCamera,
        depths: Growable,
        uniform: Growable,
        /// What was told of the last image.
        told: Option<DeviceCloud>,
    },
}

/// The clouds that are born on the device, by their numbers.
#[derive(Debug, Default)]
pub(crate) struct Sources {
    all: HashMap<u64, Source>,
    unproject: Option<wgpu::ComputePipeline>,
    /// Those of the current batch, with the first words of their points, and how many points they have.
    used: Vec<(u64, u32, u32)>,
}

impl Sources {
    fn add(&mut self, source: Source) -> u64 {
        // Not among the numbers of clouds with points on the host, nor among those of other backends.
        static LAST: AtomicU64 = AtomicU64::new(u64::MAX);
        let id = LAST.fetch_sub(1, Ordering::Relaxed);
        self.all.insert(id, source);
        id
    }

    /// Takes the points in a buffer of the caller's.
    pub(crate) fn adopt(
        &mut self,
        points: &wgpu::Buffer,
        mut cloud: DeviceCloud,
    ) -> Result<DeviceCloud, GpuError> {
        told(&cloud)?;
        let needed = 4 * POINT_WORDS * cloud.len as u64;
        if points.size() < needed || !points.usage().contains(BufferUsages::COPY_SRC) {
            return Err(GpuError::BadSource {
                reason: format!(
                    "the buffer has {} bytes and usages {:?}; {} points need {needed} bytes and COPY_SRC",
                    points.size(),
                    points.usage(),
                    cloud.len
                ),
            });
        }
        cloud.id = self.add(Source::Buffer(points.clone(), cloud.len));
        Ok(cloud)
    }

    /// Whether the points of a cloud are here; if not, why, and what to do.
    pub(crate) fn check(&self, cloud: &DeviceCloud) -> Result<(), &'static str> {
        match self.all.get(&cloud.id) {
            Some(Source::Buffer(_, len)) if *len == cloud.len => Ok(()),
            Some(Source::Buffer(..)) => {
                Err("the cloud has not as many points as it was adopted with: adopt it anew")
            }
            Some(Source::Depth { told, .. }) if told.as_ref() == Some(cloud) => Ok(()),
            Some(Source::Depth { .. }) => {
                Err("the cloud is not that of its camera's last image: use what `set_depth` gave")
            }
            None => Err("the cloud is not of this backend, or was released: adopt it"),
        }
    }

    /// A camera without an image yet.
    pub(crate) fn add_camera(&mut self, camera: DepthCamera) -> Result<u64, GpuError> {
        let is_positive = |v: f32| v.is_finite() && v > 0.0;
        let [near, far] = camera.range;
        let is_valid = camera.size.iter().all(|n| (1..=16_384).contains(n))
            && camera.focal_px.into_iter().all(is_positive)
            && camera.principal_px.into_iter().all(f32::is_finite)
            && is_positive(camera.metres_per_unit)
            && is_positive(camera.radius_px)
            && is_positive(far)
            && (0.0..far).contains(&near);
        if !is_valid {
            return Err(GpuError::BadSource {
                reason: format!(
                    "a depth camera needs 1 to 16384 columns and rows, positive focal lengths, scale \
                     and radius, and a range from near to far: {camera:?}"
                ),
            });
        }
        Ok(self.add(Source::Depth {
            camera,
            depths: Growable::new("depths", BufferUsages::STORAGE | BufferUsages::COPY_DST),
            uniform: Growable::new(
                "depth camera",
                BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            ),
            told: None,
        }))
    }

    /// Uploads an image, row by row; what there is to know of its points.
    pub(crate) fn set_depth(
        &mut self,
        gpu: &Gpu,
        id: u64,
        image: &[u16],
    ) -> Result<DeviceCloud, GpuError> {
        let bad = |reason: String| GpuError::BadSource { reason };
        let Some(Source::Depth {
            camera,
            depths,
            told: last,
            ..
        }) = self.all.get_mut(&id)
        else {
            return Err(bad(format!("there is no depth camera {id}")));
        };
        let len = camera.pixels();
        if image.len() != len {
            return Err(bad(format!(
                "the image has {} depths, the camera {} x {}",
                image.len(),
                camera.size[0],
                camera.size[1]
            )));
        }
        let measured = image.iter().filter(|&&d| d != 0 && d != u16::MAX);
        let metres = measured.map(|&d| f32::from(d) * camera.metres_per_unit);
        let [near, far] = camera.range;
        let (mut count, mut sum, mut low, mut high) = (0.0, 0.0, far, near);
        for depth in metres.filter(|d| (near..=far).contains(d)) {
            count += 1.0;
            sum += f64::from(depth);
            (low, high) = (depth.min(low), depth.max(high));
        }
        if count == 0.0 {
            return Err(bad(
                "no depth of the image is in the camera's range".to_owned()
            ));
        }
        let radius = |depth: f32| camera.radius_px * depth / camera.focal_px[0];
        let corner = |column: f32, row: f32, depth: f32| {
            let [fx, fy] = camera.focal_px;
            let [cx, cy] = camera.principal_px;
            Vec3::new((column - cx) / fx * depth, (row - cy) / fy * depth, depth)
        };
        let [columns, rows] = camera.size.map(|n| (n - 1) as f32);
        let mut bounds = Aabb::EMPTY;
        for depth in [low, high] {
            bounds = bounds.including(corner(0.0, 0.0, depth));
            bounds = bounds.including(corner(columns, rows, depth));
        }
        let cloud = DeviceCloud {
            id,
            len,
            bounds,
            mean_radius: radius((sum / count) as f32),
            max_radius: radius(high),
        };
        told(&cloud)?;
        let words: Vec<u32> = image
            .chunks(2)
            .map(|pair| u32::from(pair[0]) | u32::from(*pair.get(1).unwrap_or(&0)) << 16)
            .collect();
        depths.write(gpu, &words)?;
        *last = Some(cloud.clone());
        Ok(cloud)
    }

    /// Forgets a cloud.
    pub(crate) fn remove(&mut self, id: u64) {
        self.all.remove(&id);
    }

    pub(crate) fn begin(&mut self) {
        self.used.clear();
    }

    /// Where the points of a cloud that was checked will be.
    pub(crate) fn place(
        &mut self,
        gpu: &Gpu,
        cloud: &DeviceCloud,
        resident: &mut Resident,
    ) -> Result<Place, GpuError> {
        let words = numbered("points", POINT_WORDS * cloud.len as u64)?;
        let (first, _) = resident.reserve(gpu, cloud.id, words, None)?;
        if !self.used.iter().any(|(id, ..)| *id == cloud.id) {
            self.used.push((cloud.id, first, cloud.len as u32));
        }
        Ok(Place::interleaved(first))
    }

    /// Encodes what brings the points of the batch to their places, once: later, they may be those of another frame.
    pub(crate) fn encode(
        &mut self,
        gpu: &Gpu,
        encoder: &mut wgpu::CommandEncoder,
        points: &wgpu::Buffer,
    ) -> Result<(), GpuError> {
        for (id, first, len) in self.used.drain(..) {
            match self.all.get_mut(&id) {
                Some(Source::Buffer(source, _)) => {
                    let (at, bytes) = (4 * u64::from(first), 4 * POINT_WORDS * u64::from(len));
                    encoder.copy_buffer_to_buffer(source, 0, points, at, bytes);
                }
                Some(Source::Depth {
                    camera,
                    depths,
                    uniform,
                    ..
                }) => {
                    let [near, far] = camera.range;
                    let data = CameraData {
                        size: camera.size,
                        focal_px: camera.focal_px,
                        principal_px: camera.principal_px,
                        metres_per_unit: camera.metres_per_unit,
                        near,
                        far,
                        radius_px: camera.radius_px,
                        first_point: first,
                        padding: 0,
                    };
                    uniform.write(gpu, &[data])?;
                    let pipeline = self.unproject.get_or_insert_with(|| unproject(gpu));
                    let (Some(depths), Some(uniform)) = (depths.get(), uniform.get()) else {
                        continue;
                    };
                    let entries = [(0, uniform), (1, depths), (2, points)].map(
                        |(binding, buffer): (u32, &wgpu::Buffer)| wgpu::BindGroupEntry {
                            binding,
                            resource: buffer.as_entire_binding(),
                        },
                    );
                    let bind_group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
                        label: Some("unproject"),
                        layout: &pipeline.get_bind_group_layout(0),
                        entries: &entries,
                    });
                    let [x, y, z] = direct(len.div_ceil(GROUP));
                    let mut pass = encoder.begin_compute_pass(&Default::default());
                    pass.set_pipeline(pipeline);
                    pass.set_bind_group(0, &bind_group, &[]);
                    pass.dispatch_workgroups(x, y, z);
                }
                None => {}
            }
        }
        Ok(())
    }
}

/// What is told of a cloud, if it can be true.
fn told(cloud: &DeviceCloud) -> Result<(), GpuError> {
    (cloud.check()).map_err(|reason| GpuError::BadSource {
        reason: format!("{reason}: {cloud:?}"),
    })
}

fn unproject(gpu: &Gpu) -> wgpu::ComputePipeline {
    let stage = tldi_shaders::UNPROJECT;
    let module = module(&gpu.device, &stage);
    gpu.device
        .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(stage.name),
            layout: None,
            module: &module,
            entry_point: Some(stage.name),
            compilation_options: Default::default(),
            cache: None,
        })
}
