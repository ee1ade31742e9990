//! A device of their own for tests that change or break it.

#[allow(
    dead_code,
    unreachable_pub,
    reason = "a part of another package, of which this one uses a part"
)]
#[path = "../../../tests/testkit/skip.rs"]
mod skip;

use crate::{AdapterChoice, Gpu, GpuError};

/// A device that no other test has; `None` (said loudly) where there is none.
///
/// # Panics
/// There, if the variable `TLDI_REQUIRE_GPU` is set.
pub(crate) fn open() -> Option<Gpu> {
    told(Gpu::open(AdapterChoice::Any))
}

/// The same with so many bytes in a buffer.
pub(crate) fn open_small(bytes: u64) -> Option<Gpu> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapter = pollster::block_on(instance.request_adapter(&Default::default())).ok();
    let limits = wgpu::Limits {
        max_storage_buffer_binding_size: bytes,
        ..wgpu::Limits::default()
    };
    let opened = adapter.and_then(|adapter| {
        let descriptor = wgpu::DeviceDescriptor {
            required_limits: limits,
            ..Default::default()
        };
        pollster::block_on(adapter.request_device(&descriptor)).ok()
    });
    let missing = GpuError::NoAdapter {
        reason: "no small device".to_owned(),
    };
    told(opened.map_or(Err(missing), |(device, queue)| {
        Ok(Gpu::shared(device, queue))
    }))
}

fn told(opened: Result<Gpu, GpuError>) -> Option<Gpu> {
    let said = |error: GpuError| skip::skip(&error.to_string(), skip::REQUIRE_GPU);
    opened.map_err(said).ok()
}
