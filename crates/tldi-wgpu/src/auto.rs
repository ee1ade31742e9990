//! The GPU where it gains, else the CPU; and the CPU where the GPU fails.

use crate::{AdapterChoice, Gpu, GpuError, WgpuBackend};
use std::sync::OnceLock;
use std::time::Instant;
use tldi::glamx::{Pose3, Vec3};
use tldi::{
    Backend, BackendError, CpuBackend, PairQuery, PairResult, Params, PointCloud, Surface, View,
};

/// Compares large batches on a hardware GPU, where there is one, and the others on the CPU. From
/// which size on the GPU gains is measured when the backend is made.
///
/// A GPU that fails is given up: its batch, and all further ones, are compared on the CPU, and
/// [`fallback`](Backend::fallback) tells why.
#[derive(Debug)]
pub struct AutoBackend {
    gpu: Option<WgpuBackend>,
    cpu: CpuBackend,
    least_points: usize,
    was_on_gpu: bool,
    fallback: Option<String>,
}

impl AutoBackend {
    /// On the hardware GPU of this process; from which size on it gains is measured once, which takes
    /// some tenths of a second where there is one.
    pub fn new() -> Self {
        let opened = Gpu::of_process(AdapterChoice::Hardware);
        let measured = opened.and_then(WgpuBackend::new).and_then(|mut gpu| {
            let least_points = crossover_of_process(&mut gpu)?;
            Ok((gpu, least_points))
        });
        match measured {
            Ok((gpu, least_points)) => Self::with_gpu(gpu, least_points),
            Err(error) => Self {
                gpu: None,
                cpu: CpuBackend::new(),
                least_points: usize::MAX,
                was_on_gpu: false,
                fallback: Some(error.to_string()),
            },
        }
    }

    /// Compares batches with at least `least_points` points in reach on this GPU.
    pub fn with_gpu(gpu: WgpuBackend, least_points: usize) -> Self {
        Self {
            gpu: Some(gpu),
            cpu: CpuBackend::new(),
            least_points,
            was_on_gpu: false,
            fallback: None,
        }
    }

    /// Points in reach of each other, over both sides of all pairs of a batch, from which on the
    /// GPU is used.
    pub fn least_points(&self) -> usize {
        self.least_points
    }
}

impl Default for AutoBackend {
    fn default() -> Self {
        Self::new()
    }
}

impl Backend for AutoBackend {
    fn name(&self) -> &str {
        if self.was_on_gpu { "gpu" } else { "cpu" }
    }

    fn adapter(&self) -> Option<&str> {
        let gpu = self.gpu.as_ref().filter(|_| self.was_on_gpu)?;
        gpu.adapter()
    }

    fn fallback(&self) -> Option<&str> {
        self.fallback.as_deref()
    }

    fn compare(
        &mut self,
        batch: &[PairQuery<'_>],
        results: &mut Vec<PairResult>,
    ) -> Result<(), BackendError> {
        self.was_on_gpu = false;
        if let Some(gpu) = &mut self.gpu {
            match gpu.compare_if_large(self.least_points, batch, results) {
                Ok(is_done) => self.was_on_gpu = is_done,
                Err(BackendError::Device(reason)) => {
                    self.gpu = None;
                    self.fallback = Some(reason);
                }
                Err(error) => return Err(error),
            }
        }
        match self.was_on_gpu {
            true => Ok(()),
            false => self.cpu.compare(batch, results),
        }
    }
}

/// Points of the sheets that are timed.
const TIMED: [usize; 2] = [1 << 13, 1 << 16];

/// [`crossover`], measured by the first who asks.
fn crossover_of_process(gpu: &mut WgpuBackend) -> Result<usize, GpuError> {
    static MEASURED: OnceLock<usize> = OnceLock::new();
    if let Some(points) = MEASURED.get() {
        return Ok(*points);
    }
    let points = crossover(gpu)?;
    Ok(*MEASURED.get_or_init(|| points))
}

/// Points from which on the GPU is faster than the CPU, by two sheets that touch, of two sizes:
/// what the GPU needs for a batch of any size, and what both need for a point more.
fn crossover(gpu: &mut WgpuBackend) -> Result<usize, GpuError> {
    let mut cpu = CpuBackend::new();
    let mut seconds = [[0.0; 2]; 2];
    for (k, points) in TIMED.into_iter().enumerate() {
        for (backend, seconds) in [gpu as &mut dyn Backend, &mut cpu]
            .into_iter()
            .zip(&mut seconds)
        {
            seconds[k] = time(backend, points).map_err(|source| GpuError::NotMeasured {
                reason: source.to_string(),
            })?;
        }
    }
    let step = (TIMED[1] - TIMED[0]) as f64;
    let [on_gpu, on_cpu] = seconds.map(|[small, large]| {
        let a_point = (large - small).max(0.0) / step;
        (small - a_point * TIMED[0] as f64, a_point)
    });
    let gain = on_cpu.1 - on_gpu.1;
    Ok(match gain > 0.0 {
        // Both sheets are in reach of each other.
        true => (2.0 * (on_gpu.0 - on_cpu.0).max(0.0) / gain) as usize,
        false => usize::MAX,
    })
}

/// Seconds for two sheets of `points` points each that touch, new in every frame: the least of
/// three.
fn time(backend: &mut dyn Backend, points: usize) -> Result<f64, BackendError> {
    let edge = (points as f32).sqrt() as usize;
    let radius = 1.0 / edge as f32;
    let position = |i: usize| Vec3::new((i % edge) as f32, 0.0, (i / edge) as f32) * radius;
    let positions: Vec<Vec3> = (0..edge * edge).map(position).collect();
    let mut results = Vec::new();
    let mut least = f64::INFINITY;
    for _ in 0..4 {
        let sheet = || {
            let cloud = PointCloud::builder(&positions).radius(radius);
            cloud
                .build()
                .map_err(|e| BackendError::Device(e.to_string()))
        };
        let (a, b) = (sheet()?, sheet()?);
        let query = PairQuery {
            a: Surface::Cloud(&a),
            b: Surface::Cloud(&b),
            a_from_b: Pose3::translation(0.0, radius, 0.0),
            view: View::aimed(),
            params: Params::for_radius(radius),
        };
        let start = Instant::now();
        backend.compare(&[query], &mut results)?;
        least = least.min(start.elapsed().as_secs_f64());
    }
    Ok(least)
}
