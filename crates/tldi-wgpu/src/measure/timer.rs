//! Device time of each stage, by timestamps.

use crate::answer::Answer;
use crate::{Gpu, GpuError};

/// How long a stage took.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StageTime {
    /// Name of the stage.
    pub stage: &'static str,
    /// Device time in seconds.
    pub seconds: f64,
}

/// Timestamps at the begin and the end of every stage.
#[derive(Debug)]
pub(crate) struct Timer {
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    readback: wgpu::Buffer,
    seconds_per_tick: f64,
    stages: Vec<&'static str>,
}

impl Timer {
    /// `None` where the device has no timestamps.
    pub(crate) fn new(gpu: &Gpu, stages: usize) -> Option<Self> {
        let features = gpu.device.features();
        if !features.contains(wgpu::Features::TIMESTAMP_QUERY) {
            return None;
        }
        let count = 2 * stages as u32;
        let buffer = |label, usage| {
            gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: 8 * u64::from(count),
                usage,
                mapped_at_creation: false,
            })
        };
        use wgpu::BufferUsages as Usage;
        Some(Self {
            queries: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("timestamps"),
                ty: wgpu::QueryType::Timestamp,
                count,
            }),
            resolved: buffer("timestamps", Usage::QUERY_RESOLVE | Usage::COPY_SRC),
            readback: buffer("timestamps read back", Usage::MAP_READ | Usage::COPY_DST),
            seconds_per_tick: f64::from(gpu.queue.get_timestamp_period()) * 1e-9,
            stages: Vec::new(),
        })
    }

    pub(crate) fn begin(&mut self) {
        self.stages.clear();
    }

    /// A pass whose time is that of `stage`.
    pub(crate) fn pass<'a>(
        &mut self,
        encoder: &'a mut wgpu::CommandEncoder,
        stage: &'static str,
    ) -> wgpu::ComputePass<'a> {
        let first = 2 * self.stages.len() as u32;
        self.stages.push(stage);
        encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(stage),
            timestamp_writes: Some(wgpu::ComputePassTimestampWrites {
                query_set: &self.queries,
                beginning_of_pass_write_index: Some(first),
                end_of_pass_write_index: Some(first + 1),
            }),
        })
    }

    pub(crate) fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        let count = 2 * self.stages.len() as u32;
        encoder.resolve_query_set(&self.queries, 0..count, &self.resolved, 0);
        let bytes = 8 * u64::from(count);
        encoder.copy_buffer_to_buffer(&self.resolved, 0, &self.readback, 0, bytes);
    }

    /// Asks for the times of what was submitted.
    pub(crate) fn ask(&self) -> Answer {
        Answer::to_reading(self.readback.slice(..))
    }

    /// Adds the times that came back to those of the same stages.
    pub(crate) fn take(&self, gpu: &Gpu, times: &mut Vec<StageTime>) -> Result<(), GpuError> {
        let view =
            (self.readback.slice(..).get_mapped_range()).map_err(|e| gpu.failed(e.to_string()))?;
        let ticks: &[[u64; 2]] = bytemuck::cast_slice(&view);
        for (&stage, [begin, end]) in self.stages.iter().zip(ticks) {
            let seconds = end.saturating_sub(*begin) as f64 * self.seconds_per_tick;
            match times.iter_mut().find(|time| time.stage == stage) {
                Some(time) => time.seconds += seconds,
                None => times.push(StageTime { stage, seconds }),
            }
        }
        drop(view);
        self.readback.unmap();
        Ok(())
    }
}
