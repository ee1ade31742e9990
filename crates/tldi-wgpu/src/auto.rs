//! The GPU where it gains, else the CPU; and the CPU where the GPU fails.

use crate::crossover::crossover;
use crate::{AdapterChoice, Gpu, GpuError, WgpuBackend};
use std::sync::OnceLock;
use tldi::{Backend, BackendError, CpuBackend, PairQuery, PairResult};

/// Compares large batches on a hardware GPU, where there is one, and the others on the CPU. From
/// which size on the GPU gains is measured when the backend is made. A GPU whose answers are not those
/// of the CPU, in what is measured, is not used.
///
/// A GPU that fails is given up: its batch, and all further ones, are compared on the CPU, and
/// [`fallback`](Backend::fallback) tells why. A batch that only has too much for the GPU is no failure:
/// see [`WgpuBackend`].
#[derive(Debug)]
pub struct AutoBackend {
    gpu: Option<WgpuBackend>,
    cpu: CpuBackend,
    least_points: usize,
    was_on_gpu: bool,
    fallback: Option<String>,
}

impl AutoBackend {
    /// On the hardware GPU of this process; from which size on it gains, and whether its answers are
    /// those of the CPU, is measured once, which takes some tenths of a second where there is one.
    pub fn new() -> Self {
        static MEASURED: OnceLock<Result<usize, GpuError>> = OnceLock::new();
        let opened = Gpu::of_process(AdapterChoice::Hardware).and_then(WgpuBackend::new);
        Self::measured(opened, |gpu| {
            MEASURED.get_or_init(|| crossover(gpu)).clone()
        })
    }

    fn measured(
        opened: Result<WgpuBackend, GpuError>,
        measure: impl FnOnce(&mut WgpuBackend) -> Result<usize, GpuError>,
    ) -> Self {
        let measured = opened.and_then(|mut gpu| {
            let least_points = measure(&mut gpu)?;
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipelines::pipelines;
    use crate::testing;
    use tldi::plan::stage_constants;

    /// A device that agrees with the CPU is used; one whose stages compute something else is refused,
    /// with an error that says what differs.
    #[test]
    fn a_device_that_disagrees_is_refused() {
        let Some(gpu) = testing::open() else {
            return;
        };
        let agreeing = AutoBackend::measured(WgpuBackend::new(gpu), crossover);
        assert_eq!(agreeing.fallback(), None);
        // Fewer neighbours for a normal; no surface that is seen face on.
        for (constant, factor) in [("MAX_CANDIDATES", 0.02), ("EDGE_ON", 100.0)] {
            let Some(gpu) = testing::open() else {
                return;
            };
            let mut constants = stage_constants();
            let value = constants.iter_mut().find(|(name, _)| *name == constant);
            value.expect("there is such a constant").1 *= factor;
            let wrong = pipelines(&gpu, &constants);
            gpu.set_pipelines(wrong);
            let refused = AutoBackend::measured(WgpuBackend::new(gpu), crossover);
            let reason = refused.fallback().unwrap_or("it is used");
            assert!(
                reason.contains("not those of the CPU"),
                "{constant}: {reason}"
            );
            assert_eq!(
                (refused.name(), refused.least_points()),
                ("cpu", usize::MAX)
            );
        }
    }
}
