//! One submission: upload, dispatch, read back.

mod parts;
mod results;

use crate::batch_buffers::BatchBuffers;
use crate::buffers::{Growable, most_bytes};
use crate::counters::Counters;
use crate::layout::{
    CONTACT_WORDS, COUNTERS, GROUP, MAX_VIEWS, PAIR_WORDS, VIEW_BYTES, is_for_device,
    lives_on_device,
};
use crate::pipelines::Pipeline;
use crate::resident::Resident;
use crate::sources::{DepthCamera, Sources};
use crate::timer::Timer;
use crate::upload::Upload;
use crate::{Gpu, GpuError, StageTime, Traffic};
use tldi::{Backend, BackendError, CpuBackend, DeviceCloud, PairQuery, PairResult, PatchScratch};

/// Workgroups along x of a dispatch.
const MAX_GROUPS: u32 = 65_535;

/// Compares batches on a GPU.
///
/// What it does not take is compared on the CPU meanwhile, with the same results: pairs with an
/// exact surface, [uneven clouds](tldi::PointCloud::is_uneven), [`Variant::Paper`](tldi::Variant::Paper), perspective
/// cameras; pairs of which a pixel has more than 1024 fragments, and pairs that need larger buffers than the device
/// allows. An uneven cloud and one that only the device holds
/// are compared by their mean radii: a body smaller than the points are apart may pass where these are coarse. A batch costs one submission and one readback,
/// whatever the number of pairs, and uploads of clouds with new content. A batch that needs larger buffers than the
/// device allows is halved until it does not.
///
/// ```
/// use tldi::{Backend, PairQuery, Params, PointCloud, Surface, View};
/// use tldi::glamx::{Pose3, Vec3};
/// use tldi_wgpu::{AdapterChoice, Gpu, WgpuBackend};
///
/// let mut backend = match Gpu::open(AdapterChoice::Any).and_then(WgpuBackend::new) {
///     Ok(backend) => backend,
///     Err(error) => return Ok(eprintln!("SKIPPED: {error}")),
/// };
/// let points: Vec<Vec3> = (0..441)
///     .map(|i| Vec3::new((i % 21) as f32 * 0.05, 0.0, (i / 21) as f32 * 0.05))
///     .collect();
/// let sheet = PointCloud::builder(&points).radius(0.05).build()?;
/// let mut results = Vec::new();
/// backend.compare(
///     &[PairQuery {
///         a: Surface::Cloud(&sheet),
///         b: Surface::Cloud(&sheet),
///         a_from_b: Pose3::translation(0.0, 0.02, 0.0),
///         view: View::aimed(),
///         params: Params::for_radius(0.05),
///     }],
///     &mut results,
/// )?;
/// assert!((results[0].gap.unwrap() - 0.02).abs() < 1e-4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct WgpuBackend {
    gpu: Gpu,
    resident: Resident,
    sources: Sources,
    buffers: BatchBuffers,
    /// Elements that the buffers hold: what batches have needed so far.
    capacities: Counters,
    /// Elements that the buffers begin with, and the most that the device takes.
    least: Counters,
    most: Counters,
    /// What the bind groups were made of.
    bound: Vec<Option<wgpu::Buffer>>,
    bind_groups: Vec<wgpu::BindGroup>,
    upload: Upload,
    patches: PatchScratch,
    cpu: CpuBackend,
    pairs_on_cpu: usize,
    /// What the last batch, or its last part, needed.
    last: Counters,
    /// Contacts that are read back with the rest: about as many as the last batch had.
    expected_contacts: u32,
    traffic: Traffic,
    timer: Option<Timer>,
    times: Vec<StageTime>,
}

impl WgpuBackend {
    /// A backend on a device. Compiles the stages.
    ///
    /// # Errors
    /// [`GpuError::Failed`] where the device refuses a stage, [`GpuError::TooLarge`] where it
    /// allows no buffers.
    pub fn new(gpu: Gpu) -> Result<Self, GpuError> {
        let gpu = gpu.with_own_tally();
        gpu.pipelines();
        let resident = Resident::new(&gpu)?;
        gpu.check()?;
        let most = Counters::most(most_bytes(&gpu));
        let least = Counters::LEAST.min(&most);
        Ok(Self {
            gpu,
            resident,
            sources: Sources::default(),
            buffers: BatchBuffers::default(),
            capacities: least,
            least,
            most,
            bound: Vec::new(),
            bind_groups: Vec::new(),
            upload: Upload::default(),
            patches: PatchScratch::default(),
            cpu: CpuBackend::new(),
            pairs_on_cpu: 0,
            last: Counters::default(),
            expected_contacts: results::LEAST_EXPECTED,
            traffic: Traffic::default(),
            timer: None,
            times: Vec::new(),
        })
    }

    /// The device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    /// Measures the stages from now on; `false` where the device has no timestamps. Every stage is
    /// then a pass of its own, which costs a little.
    pub fn measure_stages(&mut self) -> bool {
        self.timer = Timer::new(&self.gpu, self.gpu.pipelines().len());
        self.timer.is_some()
    }

    /// Time of each stage in the last batch, or in its last part where it was halved; empty where none is measured.
    pub fn stage_times(&self) -> &[StageTime] {
        &self.times
    }

    /// Takes points that already live in a buffer of this device, without a copy to the host: `x`,
    /// `y`, `z` in metres and the radius of each, four `f32`; `cloud` tells the rest, its number is
    /// set here. They are read anew in every batch that uses the cloud, by a copy on the device (16
    /// bytes a point). Points that are not numbers are left out.
    ///
    /// # Errors
    /// [`GpuError::BadSource`] where the buffer is too small or cannot be copied from (it needs
    /// [`wgpu::BufferUsages::COPY_SRC`]), or `cloud` makes no sense.
    pub fn adopt(
        &mut self,
        points: &wgpu::Buffer,
        cloud: DeviceCloud,
    ) -> Result<DeviceCloud, GpuError> {
        self.sources.adopt(points, cloud)
    }

    /// Adds a depth camera, whose images become points on the device; returns its number.
    ///
    /// # Errors
    /// [`GpuError::BadSource`] where the camera makes no sense.
    pub fn add_depth_camera(&mut self, camera: DepthCamera) -> Result<u64, GpuError> {
        self.sources.add_camera(camera)
    }

    /// Uploads an image of a depth camera, row by row, 2 bytes a pixel; the cloud, in the camera's
    /// frame, to be used until the next image.
    ///
    /// # Errors
    /// [`GpuError::BadSource`] where there is no such camera, or the image is not of its size or
    /// holds no depth in its range.
    pub fn set_depth(&mut self, camera: u64, image: &[u16]) -> Result<DeviceCloud, GpuError> {
        self.sources.set_depth(&self.gpu, camera, image)
    }

    /// Forgets a cloud, or a camera, of this device by its number.
    pub fn release(&mut self, id: u64) {
        self.sources.remove(id);
    }

    /// Pairs of the last batch that were left to the CPU.
    pub fn pairs_on_cpu(&self) -> usize {
        self.pairs_on_cpu
    }

    /// What the stages of the last batch, or of its last part where it was halved, had to read and
    /// write at least, each element once, bytes.
    pub fn needed_bytes(&self) -> Vec<(&'static str, u64)> {
        self.last.bytes(&self.upload)
    }

    /// How many elements of each kind the last batch needed, or its last part where it was halved.
    pub fn needed_elements(&self) -> [(&'static str, u32); 7] {
        self.last.named()
    }

    /// What was sent and submitted for the last batch.
    pub fn traffic(&self) -> Traffic {
        self.traffic
    }

    /// Compares the batch if at least so many points are in blocks that both sides of a pair reach;
    /// else returns `false`.
    pub(crate) fn compare_if_large(
        &mut self,
        least_points: usize,
        batch: &[PairQuery<'_>],
        results: &mut Vec<PairResult>,
    ) -> Result<bool, BackendError> {
        let mut left_to_cpu = Vec::new();
        for (pair, query) in batch.iter().enumerate() {
            let is_for_device = is_for_device(query);
            // The check refuses points that only the device has.
            if !is_for_device || !lives_on_device(query) {
                query
                    .check()
                    .map_err(|reason| BackendError::Unsupported { pair, reason })?;
            }
            if !is_for_device {
                left_to_cpu.push(pair);
            }
        }
        self.upload.select(batch, 0..batch.len());
        if self.upload.points() < least_points {
            return Ok(false);
        }
        results.resize_with(batch.len(), PairResult::default);
        results.iter_mut().for_each(PairResult::clear);
        self.compare_on_device(batch, results, &mut left_to_cpu)?;
        Ok(true)
    }

    /// Uploads and submits the batch.
    fn submit(&mut self) -> Result<(), GpuError> {
        let data = self.upload.batch_data(&self.capacities)?;
        self.buffers.fit(&self.gpu, &data, &self.upload)?;
        self.bind();
        let Self {
            gpu,
            resident,
            sources,
            buffers,
            bind_groups,
            timer,
            traffic,
            expected_contacts,
            ..
        } = self;
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        sources.encode(gpu, &mut encoder, resident.points())?;
        // Only what is counted must be zero: the counters up to the tiles, the views, and what is
        // read back of the pairs. Tiles and pixels are cleared by stages, which know how many there are.
        let counted = 4 * u64::from(data.tiles_at);
        let pairs_found = 4 * u64::from(data.pairs) * u64::from(PAIR_WORDS);
        for (buffer, bytes) in [
            (&buffers.work, counted),
            (
                &buffers.views,
                u64::from(MAX_VIEWS) * u64::from(data.pairs) * VIEW_BYTES,
            ),
            (&buffers.found, pairs_found),
        ] {
            if let Some(buffer) = buffer.get() {
                traffic.filled += bytes;
                encoder.clear_buffer(buffer, 0, Some(bytes));
            }
        }
        let pipelines = gpu.pipelines();
        let direct = |count: u32| [count.min(MAX_GROUPS), count.div_ceil(MAX_GROUPS), 1];
        let by_survivor = direct(data.items.min(data.survivors.div_ceil(GROUP)));
        let dispatch = |pass: &mut wgpu::ComputePass, k: usize| {
            let Pipeline {
                stage, pipeline, ..
            } = &pipelines[k];
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &bind_groups[k], &[]);
            let mut indirect = |groups: &Growable, words: u64| {
                if let Some(groups) = groups.get() {
                    pass.dispatch_workgroups_indirect(groups, 4 * words);
                }
            };
            match stage.name {
                "columns_clear" | "columns_touch" => return indirect(&buffers.groups, 0),
                "pixels_clear" | "alloc" | "sweep" => return indirect(&buffers.groups, 3),
                "compare" => return indirect(&buffers.groups, 6),
                "splat" => return indirect(&buffers.splat_groups, 0),
                _ => {}
            }
            let [x, y, z] = match stage.name {
                "cull" => direct(data.items),
                "normals_alloc" => direct(data.cells.div_ceil(GROUP)),
                "aim" => direct(data.pairs),
                "columns_tiles" | "columns_pixels" => [1, 1, 1],
                _ => by_survivor,
            };
            pass.dispatch_workgroups(x, y, z);
        };
        let needed = |k: &usize| {
            // Without bare clouds there is nothing to sort.
            data.cells > 0 || !pipelines[*k].stage.name.starts_with("normals")
        };
        let stages = (0..pipelines.len()).filter(needed);
        traffic.dispatches += stages.clone().count() as u32;
        match timer {
            None => {
                let mut pass = encoder.begin_compute_pass(&Default::default());
                stages.for_each(|k| dispatch(&mut pass, k));
            }
            Some(timer) => {
                timer.begin();
                for k in stages {
                    let mut pass = timer.pass(&mut encoder, pipelines[k].stage.name);
                    dispatch(&mut pass, k);
                }
                timer.resolve(&mut encoder);
            }
        }
        let contacts = (*expected_contacts).min(data.contacts);
        let contacts = 4 * u64::from(contacts) * u64::from(CONTACT_WORDS);
        if let (Some(work), Some(found), Some(readback)) = (
            buffers.work.get(),
            buffers.found.get(),
            buffers.readback.get(),
        ) {
            let counters = 4 * u64::from(COUNTERS);
            encoder.copy_buffer_to_buffer(work, 0, readback, 0, counters);
            encoder.copy_buffer_to_buffer(found, 0, readback, counters, pairs_found + contacts);
        }
        gpu.queue.submit([encoder.finish()]);
        traffic.submissions += 1;
        traffic.read_back += 4 * u64::from(COUNTERS) + pairs_found + contacts;
        gpu.check()
    }

    /// Makes the bind groups, if a buffer is new.
    fn bind(&mut self) {
        let bound = self.buffers.bound(&self.resident);
        if bound == self.bound {
            return;
        }
        self.bind_groups.clear();
        for Pipeline { stage, layout, .. } in self.gpu.pipelines() {
            let entries: Vec<_> = (stage.bindings.iter())
                .filter_map(|&binding| {
                    Some(wgpu::BindGroupEntry {
                        binding,
                        resource: bound[binding as usize].as_ref()?.as_entire_binding(),
                    })
                })
                .collect();
            self.bind_groups.push(
                self.gpu
                    .device
                    .create_bind_group(&wgpu::BindGroupDescriptor {
                        label: Some(stage.name),
                        layout,
                        entries: &entries,
                    }),
            );
        }
        self.bound = bound;
    }
}

impl std::fmt::Debug for WgpuBackend {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("WgpuBackend")
            .field("adapter", &self.gpu.adapter())
            .finish_non_exhaustive()
    }
}

impl Backend for WgpuBackend {
    fn name(&self) -> &str {
        "gpu"
    }

    fn adapter(&self) -> Option<&str> {
        Some(self.gpu.adapter())
    }

    fn compare(
        &mut self,
        batch: &[PairQuery<'_>],
        results: &mut Vec<PairResult>,
    ) -> Result<(), BackendError> {
        self.compare_if_large(0, batch, results).map(|_| ())
    }
}
