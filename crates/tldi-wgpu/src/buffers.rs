//! Buffers that are reused from step to step and grow by doubling.

use crate::{Gpu, GpuError};
use wgpu::BufferUsages;

/// A buffer that grows.
#[derive(Debug)]
pub(crate) struct Growable {
    name: &'static str,
    usage: BufferUsages,
    buffer: Option<wgpu::Buffer>,
}

impl Growable {
    pub(crate) fn new(name: &'static str, usage: BufferUsages) -> Self {
        Self {
            name,
            usage,
            buffer: None,
        }
    }

    /// The buffer, of at least `bytes` bytes; its content is lost where it grows.
    pub(crate) fn ensure(&mut self, gpu: &Gpu, bytes: u64) -> Result<&wgpu::Buffer, GpuError> {
        if self.buffer.as_ref().is_none_or(|b| b.size() < bytes) {
            self.buffer = Some(create(gpu, self.name, self.usage, bytes)?);
        }
        // It was made above, if it was not there.
        self.buffer.as_ref().ok_or(GpuError::TooLarge {
            buffer: self.name,
            needed: bytes,
            allowed: 0,
        })
    }

    /// Leaves the buffer to those that still use it; the next one is new.
    pub(crate) fn give_up(&mut self) {
        self.buffer = None;
    }

    /// The buffer, where it was ensured.
    pub(crate) fn get(&self) -> Option<&wgpu::Buffer> {
        self.buffer.as_ref()
    }

    /// Writes `data` to the start.
    pub(crate) fn write<T: bytemuck::NoUninit>(
        &mut self,
        gpu: &Gpu,
        data: &[T],
    ) -> Result<(), GpuError> {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let buffer = self.ensure(gpu, bytes.len() as u64)?;
        gpu.write(buffer, 0, bytes);
        Ok(())
    }
}

/// Bytes of the largest buffer that the stages can use. They are whole words, though drivers tell 2³¹ - 1: no other buffer
/// can be bound or copied. A stage gets them in a word.
pub(crate) fn most_bytes(gpu: &Gpu) -> u64 {
    let limits = gpu.device.limits();
    let most = (limits.max_buffer_size).min(limits.max_storage_buffer_binding_size);
    let told = most.min(u64::from(u32::MAX));
    told - told % wgpu::COPY_BUFFER_ALIGNMENT
}

/// A new buffer of at least `bytes` bytes, rounded up to a power of two.
pub(crate) fn create(
    gpu: &Gpu,
    name: &'static str,
    usage: BufferUsages,
    bytes: u64,
) -> Result<wgpu::Buffer, GpuError> {
    let allowed = most_bytes(gpu);
    let size = bytes.next_power_of_two().clamp(256, allowed.max(256));
    if size < bytes {
        return Err(GpuError::TooLarge {
            buffer: name,
            needed: bytes,
            allowed,
        });
    }
    // In a browser, what a scope caught is only told later: there, the device's failure tells it.
    let scope = cfg!(not(target_arch = "wasm32"))
        .then(|| gpu.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory));
    let buffer = gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(name),
        size,
        usage,
        mapped_at_creation: false,
    });
    match scope.and_then(|scope| pollster::block_on(scope.pop())) {
        Some(_) => Err(GpuError::OutOfMemory {
            buffer: name,
            needed: size,
        }),
        None => Ok(buffer),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing;

    /// The largest buffer can be copied as a whole, also where the device's limit is odd.
    #[test]
    fn an_odd_limit_gives_whole_words() {
        let Some(gpu) = testing::open_small((1 << 16) - 1) else {
            return;
        };
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC | BufferUsages::COPY_DST;
        let [from, to] = [(); 2].map(|()| {
            let largest = create(&gpu, "largest", usage, most_bytes(&gpu));
            largest.expect("it is allowed")
        });
        assert!(from.size() > 65_528, "{}", from.size());
        let mut encoder = gpu.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(&from, 0, &to, 0, from.size());
        gpu.queue.submit([encoder.finish()]);
        gpu.wait(None).expect("it is copied");
    }
}
