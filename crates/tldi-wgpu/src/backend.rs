//! The backend: what it keeps from batch to batch.

mod in_flight;
mod parts;
mod results;
mod submit;

pub use in_flight::InFlight;

use crate::batch_buffers::BatchBuffers;
use crate::buffers::most_bytes;
use crate::counters::Counters;
use crate::division::{is_for_device, lives_on_device};
use crate::measure::stage_bytes::stage_bytes;
use crate::measure::timer::Timer;
use crate::resident::Resident;
use crate::sources::{DepthCamera, Sources};
use crate::upload::Upload;
use crate::{Gpu, GpuError, StageTime, Traffic};
use submit::Asked;
use tldi::{
    Backend, BackendError, CpuBackend, DeviceCloud, PairQuery, PairResult, PatchScratch, Surface,
};

/// Compares batches on a GPU.
///
/// What it does not take is compared on the CPU meanwhile, with the same results: pairs with an
/// exact surface, [uneven clouds](tldi::PointCloud::is_uneven), [`Variant::Paper`](tldi::Variant::Paper), perspective
/// cameras; clouds whose splats are larger than 70 pixels in radius, or 64 times as crowded as those with radii from
/// neighbours; pairs of which a pixel has more than 1024 fragments, and pairs that need larger buffers than the device
/// allows. An uneven cloud and one that only the device holds are compared by their mean radii: a body smaller than the
/// points are apart may pass where these are coarse.
///
/// A batch costs one submission and one readback, whatever the number of pairs, and uploads of blocks with new content that
/// come into reach. Where a pair is asked about in [all directions](tldi::CameraPolicy::AllDirections) and shows no crossing,
/// its further views cost a second submission. A batch that needs larger buffers than the device allows is
/// halved until it does not.
///
/// [`compare`](Backend::compare) waits for the device. [`begin`](Self::begin) does not.
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
    /// Elements for which there is room: what batches have needed so far; of tiles and pixels, what this part
    /// will need.
    capacities: Counters,
    /// The most that the device takes.
    most: Counters,
    /// How many times as many tiles, or pixels, as were foreseen the last part needed; at least 1.
    shortfall: f32,
    /// What was submitted and has not come back.
    asked: Option<Asked>,
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
    /// allows no buffers, [`GpuError::OutOfMemory`] where it has no memory for them.
    pub fn new(gpu: Gpu) -> Result<Self, GpuError> {
        let gpu = gpu.with_own_tally();
        gpu.pipelines();
        let resident = Resident::new(&gpu)?;
        gpu.check()?;
        let most = Counters::most(most_bytes(&gpu));
        Ok(Self {
            gpu,
            resident,
            sources: Sources::default(),
            buffers: BatchBuffers::default(),
            capacities: Counters::LEAST.min(&most),
            most,
            shortfall: 1.0,
            asked: None,
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
    /// bytes a point); until a batch is finished they must stay as they are, since it may be compared in parts. Points
    /// that are not finite, and those without a finite radius above 0, are left out; larger radii than the told largest
    /// one count as that.
    ///
    /// # Errors
    /// [`GpuError::BadSource`] where the buffer is too small or cannot be copied from (it needs
    /// [`wgpu::BufferUsages::COPY_SRC`]), or [`DeviceCloud::check`] refuses `cloud`.
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
    /// holds no depth in its range, or [`DeviceCloud::check`] refuses its points.
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
        stage_bytes(&self.upload, &self.last)
    }

    /// How many elements of each kind the last batch needed, or its last part where it was halved.
    pub fn needed_elements(&self) -> [(&'static str, u32); 7] {
        self.last.named()
    }

    /// What was sent and submitted for the last batch.
    pub fn traffic(&self) -> Traffic {
        self.traffic
    }

    /// Compares the batch if at least so many points are in blocks that both sides of a pair reach, or if only the
    /// device has some of them; else returns `false`.
    pub(crate) fn compare_if_large(
        &mut self,
        least_points: usize,
        batch: &[PairQuery<'_>],
        results: &mut Vec<PairResult>,
    ) -> Result<bool, BackendError> {
        let left_to_cpu = self.select(batch)?;
        if self.upload.points() < least_points && !batch.iter().any(lives_on_device) {
            return Ok(false);
        }
        let reused = std::mem::take(results);
        *results = self.start(batch, reused, left_to_cpu)?.finish()?;
        Ok(true)
    }

    /// Selects the pairs for the device; those that it does not take.
    fn select(&mut self, batch: &[PairQuery<'_>]) -> Result<Vec<usize>, BackendError> {
        let mut left_to_cpu = Vec::new();
        for (pair, query) in batch.iter().enumerate() {
            let is_for_device = is_for_device(query);
            let checked = match is_for_device && lives_on_device(query) {
                true => self.check_on_device(query),
                // It refuses points that only the device has.
                false => query.check(),
            };
            checked.map_err(|reason| BackendError::Unsupported { pair, reason })?;
            if !is_for_device {
                left_to_cpu.push(pair);
            }
        }
        self.upload.select(batch, 0..batch.len());
        Ok(left_to_cpu)
    }

    /// Whether the device can compare a pair of which it alone has points; if not, why.
    fn check_on_device(&self, query: &PairQuery<'_>) -> Result<(), &'static str> {
        query.check_numbers()?;
        [query.a, query.b].iter().try_for_each(|side| match side {
            Surface::Device(cloud) => self.sources.check(cloud),
            _ => Ok(()),
        })
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
