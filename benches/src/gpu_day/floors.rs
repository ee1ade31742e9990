//! What the device cannot do faster: copies, dependent dispatches, a submission, a readback, an upload.

use super::budget::Budget;
use super::spread::Spread;
use serde::{Deserialize, Serialize};
use std::time::{Duration, Instant};
use tldi_wgpu::{Gpu, wgpu};
use wgpu::BufferUsages as Usage;

/// What was measured of all of it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Floors {
    /// From buffer to buffer on the device. Those of 512 MB and more fit no cache.
    pub copies: Vec<Moved>,
    /// Each reads what the one before it wrote.
    pub dispatches: Vec<Dispatches>,
    /// An empty submission until it is known to be done.
    pub submit: Option<Spread>,
    /// A copy to the host, mapped and copied, after it was submitted.
    pub readbacks: Vec<Moved>,
    /// `Queue::write_buffer` until the device has the bytes.
    pub uploads: Vec<Moved>,
}

/// Bytes that were moved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Moved {
    /// Of the buffer.
    pub bytes: u64,
    /// To move them once.
    pub time: Spread,
    /// At the median: read plus written on the device, or sent.
    pub bytes_per_second: f64,
}

/// Dispatches of one workgroup in one pass.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Dispatches {
    /// In one submission.
    pub count: u32,
    /// Sizes from the host.
    pub direct: Spread,
    /// Sizes from a buffer.
    pub indirect: Spread,
}

const MB: u64 = 1_000_000;

/// Times that each is measured.
const REPEATS: usize = 20;

impl Floors {
    /// Measures with buffers of up to `most_bytes` bytes, or what the device allows.
    pub(super) fn measure(gpu: &Gpu, most_bytes: u64, budget: &mut Budget) -> anyhow::Result<Self> {
        let mut floors = Self::default();
        let allowed = gpu.device().limits().max_buffer_size;
        for bytes in [1, 4, 16, 64, 256, 512, 1000].map(|n| n * MB) {
            if bytes > most_bytes {
                budget.skip(format!("copies of {} MB: not asked for", bytes / MB));
                continue;
            }
            if bytes > allowed {
                budget.skip(format!(
                    "copies of {} MB: the device allows less",
                    bytes / MB
                ));
                continue;
            }
            if !budget.has_time(&format!("copies of {} MB", bytes / MB), 1.0) {
                continue;
            }
            // Enough of them that the submission does not count.
            let copies = (256 * MB / bytes).clamp(1, 64);
            floors.copies.extend(copy(gpu, bytes, copies)?);
        }
        if budget.has_time("submissions and dispatches", 2.0) {
            floors.submit = Spread::of(times(REPEATS, || submit(gpu, |_| {}))?);
            let chain = Chain::new(gpu);
            for count in [1, 4, 16, 64] {
                let [direct, indirect] = [false, true]
                    .map(|is_indirect| times(REPEATS, || chain.run(gpu, count, is_indirect)));
                if let (Some(direct), Some(indirect)) = (Spread::of(direct?), Spread::of(indirect?))
                {
                    floors.dispatches.push(Dispatches {
                        count,
                        direct,
                        indirect,
                    });
                }
            }
        }
        for bytes in [1000, 64_000, MB, 16 * MB, 64 * MB, 256 * MB] {
            let fits = bytes <= most_bytes.min(allowed);
            if fits && budget.has_time(&format!("readback and upload of {bytes} bytes"), 2.0) {
                floors.readbacks.extend(read_back(gpu, bytes)?);
                floors.uploads.extend(upload(gpu, bytes)?);
            }
        }
        Ok(floors)
    }

    /// Bytes per second, read plus written, of the largest copies.
    pub fn bandwidth(&self) -> Option<f64> {
        self.copies.last().map(|copy| copy.bytes_per_second)
    }
}

fn moved(bytes: u64, counted: u64, seconds: Vec<f64>) -> Option<Moved> {
    let time = Spread::of(seconds)?;
    Some(Moved {
        bytes,
        time,
        bytes_per_second: counted as f64 / (time.p50_ms * 1e-3),
    })
}

/// Seconds of each repeat, after one that does not count.
fn times(repeats: usize, mut run: impl FnMut() -> anyhow::Result<f64>) -> anyhow::Result<Vec<f64>> {
    run()?;
    (0..repeats).map(|_| run()).collect()
}

fn wait(gpu: &Gpu) -> anyhow::Result<()> {
    let patience = Some(Duration::from_secs(60));
    gpu.device().poll(wgpu::PollType::Wait {
        submission_index: None,
        timeout: patience,
    })?;
    Ok(())
}

/// Seconds from the submission of what `encode` says until it is done.
fn submit(gpu: &Gpu, encode: impl FnOnce(&mut wgpu::CommandEncoder)) -> anyhow::Result<f64> {
    let mut encoder = gpu.device().create_command_encoder(&Default::default());
    encode(&mut encoder);
    let commands = encoder.finish();
    let start = Instant::now();
    gpu.queue().submit([commands]);
    wait(gpu)?;
    Ok(start.elapsed().as_secs_f64())
}

fn buffer(gpu: &Gpu, bytes: u64, usage: Usage) -> wgpu::Buffer {
    gpu.device().create_buffer(&wgpu::BufferDescriptor {
        label: Some("floor"),
        size: bytes,
        usage,
        mapped_at_creation: false,
    })
}

fn copy(gpu: &Gpu, bytes: u64, copies: u64) -> anyhow::Result<Option<Moved>> {
    let usage = Usage::COPY_SRC | Usage::COPY_DST;
    let (from, to) = (buffer(gpu, bytes, usage), buffer(gpu, bytes, usage));
    let all = times(5, || {
        submit(gpu, |encoder| {
            for _ in 0..copies {
                encoder.copy_buffer_to_buffer(&from, 0, &to, 0, bytes);
            }
        })
    })?;
    let once = all.into_iter().map(|seconds| seconds / copies as f64);
    Ok(moved(bytes, 2 * bytes, once.collect()))
}

fn read_back(gpu: &Gpu, bytes: u64) -> anyhow::Result<Option<Moved>> {
    let from = buffer(gpu, bytes, Usage::COPY_SRC | Usage::COPY_DST);
    let to = buffer(gpu, bytes, Usage::MAP_READ | Usage::COPY_DST);
    let mut host = vec![0u8; bytes as usize];
    let all = times(5, || {
        let start = Instant::now();
        submit(gpu, |encoder| {
            encoder.copy_buffer_to_buffer(&from, 0, &to, 0, bytes);
        })?;
        let slice = to.slice(..);
        slice.map_async(wgpu::MapMode::Read, |_| {});
        wait(gpu)?;
        host.copy_from_slice(&slice.get_mapped_range()?);
        std::hint::black_box(&host);
        to.unmap();
        Ok(start.elapsed().as_secs_f64())
    })?;
    Ok(moved(bytes, bytes, all))
}

fn upload(gpu: &Gpu, bytes: u64) -> anyhow::Result<Option<Moved>> {
    let to = buffer(gpu, bytes, Usage::COPY_DST);
    let data = vec![1u8; bytes as usize];
    let all = times(5, || {
        let start = Instant::now();
        gpu.queue().write_buffer(&to, 0, &data);
        submit(gpu, |_| {})?;
        Ok(start.elapsed().as_secs_f64())
    })?;
    Ok(moved(bytes, bytes, all))
}

/// One workgroup that adds 1 to each of 64 words.
struct Chain {
    pipeline: wgpu::ComputePipeline,
    bind_group: wgpu::BindGroup,
    groups: wgpu::Buffer,
}

const ADD: &str = "
@group(0) @binding(0) var<storage, read_write> words: array<u32>;
@compute @workgroup_size(64)
fn add(@builtin(local_invocation_index) lane: u32) {
    words[lane] += 1u;
}
";

impl Chain {
    fn new(gpu: &Gpu) -> Self {
        let device = gpu.device();
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("add"),
            source: wgpu::ShaderSource::Wgsl(ADD.into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("add"),
            layout: None,
            module: &module,
            entry_point: Some("add"),
            compilation_options: Default::default(),
            cache: None,
        });
        let words = buffer(gpu, 256, Usage::STORAGE);
        let bind_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("add"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[wgpu::BindGroupEntry {
                binding: 0,
                resource: words.as_entire_binding(),
            }],
        });
        let groups = buffer(gpu, 12, Usage::INDIRECT | Usage::COPY_DST);
        let one: [u8; 12] = [1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0];
        gpu.queue().write_buffer(&groups, 0, &one);
        Self {
            pipeline,
            bind_group,
            groups,
        }
    }

    fn run(&self, gpu: &Gpu, count: u32, is_indirect: bool) -> anyhow::Result<f64> {
        submit(gpu, |encoder| {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(&self.pipeline);
            pass.set_bind_group(0, &self.bind_group, &[]);
            for _ in 0..count {
                match is_indirect {
                    true => pass.dispatch_workgroups_indirect(&self.groups, 0),
                    false => pass.dispatch_workgroups(1, 1, 1),
                }
            }
        })
    }
}
