//! What the device can move: the floor of all stages.

use crate::buffers::create;
use crate::{Gpu, GpuError};
use std::time::Instant;
use wgpu::BufferUsages;

/// Bytes of a copy, and copies in one submission.
const BYTES: u64 = 1 << 26;
const COPIES: u32 = 16;

/// Bytes per second, read plus written, of copies between two buffers of 64 MiB: the best of three. Waits for
/// the device, which a browser cannot.
///
/// # Errors
/// Where the device fails, or has no room for the buffers.
pub fn copy_bandwidth(gpu: &Gpu) -> Result<f64, GpuError> {
    let usage = BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
    let (from, to) = (
        create(gpu, "copied from", usage, BYTES)?,
        create(gpu, "copied to", usage, BYTES)?,
    );
    let mut least = f64::INFINITY;
    for _ in 0..4 {
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        for _ in 0..COPIES {
            encoder.copy_buffer_to_buffer(&from, 0, &to, 0, BYTES);
        }
        let start = Instant::now();
        gpu.queue.submit([encoder.finish()]);
        gpu.wait(None)?;
        least = least.min(start.elapsed().as_secs_f64());
    }
    Ok(2.0 * BYTES as f64 * f64::from(COPIES) / least)
}
