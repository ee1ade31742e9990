//! What the device is, and how long it takes to get it ready.

use anyhow::Context;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::time::Instant;
use tldi_wgpu::{AdapterChoice, Gpu, WgpuBackend, wgpu};

/// The device and its driver.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Card {
    /// Name of the adapter.
    pub name: String,
    /// Hardware, virtual, or a driver that computes on the CPU.
    pub device_type: String,
    /// Vulkan, Metal or DX12.
    pub api: String,
    /// Name of the driver.
    pub driver: String,
    /// Its version, as it says it.
    pub driver_info: String,
    /// Threads that run in step, least and most.
    pub subgroup_sizes: [u32; 2],
    /// What the adapter offers. The names are those of WebGPU.
    pub offered_limits: BTreeMap<String, u64>,
    /// What the backend asked for of these.
    pub used_limits: BTreeMap<String, u64>,
    /// Features that the adapter offers.
    pub offered_features: Vec<String>,
    /// Features that the backend asked for.
    pub used_features: Vec<String>,
    /// To open the adapter and its device, seconds.
    pub open_seconds: f64,
    /// To compile all stages for the first time in this process, seconds. A driver may have kept them from an
    /// earlier one.
    pub compile_seconds: f64,
    /// To compile all stages once more for another device, seconds.
    pub compile_again_seconds: f64,
}

/// The device that the other parts use, and what it is.
pub(super) fn open() -> anyhow::Result<(Gpu, Card)> {
    // First of all, so that the driver is loaded within the time.
    let start = Instant::now();
    let gpu = Gpu::open(AdapterChoice::Any)?;
    let open_seconds = start.elapsed().as_secs_f64();
    let adapter = any_adapter()?;
    let compile_seconds = seconds_to_compile(&gpu)?;
    let compile_again_seconds = seconds_to_compile(&Gpu::open(AdapterChoice::Any)?)?;
    let info = gpu.device().adapter_info();
    let card = Card {
        name: info.name,
        device_type: format!("{:?}", info.device_type),
        api: info.backend.to_string(),
        driver: info.driver,
        driver_info: info.driver_info,
        subgroup_sizes: [info.subgroup_min_size, info.subgroup_max_size],
        offered_limits: limits(&adapter.limits()),
        used_limits: limits(&gpu.device().limits()),
        offered_features: features(adapter.features()),
        used_features: features(gpu.device().features()),
        open_seconds,
        compile_seconds,
        compile_again_seconds,
    };
    Ok((gpu, card))
}

/// A device that is given only what every WebGPU device has.
pub(super) fn open_with_defaults() -> anyhow::Result<Gpu> {
    let adapter = any_adapter()?;
    let opened = adapter.request_device(&wgpu::DeviceDescriptor::default());
    let (device, queue) = pollster::block_on(opened)?;
    Ok(Gpu::shared(device, queue))
}

/// The adapter that [`Gpu::open`] takes.
fn any_adapter() -> anyhow::Result<wgpu::Adapter> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
    let options = wgpu::RequestAdapterOptions {
        power_preference: wgpu::PowerPreference::HighPerformance,
        ..Default::default()
    };
    let asked = wgpu::Instance::new(descriptor);
    pollster::block_on(asked.request_adapter(&options))
        .context("no adapter: install the GPU's driver, or Mesa's software Vulkan")
}

fn seconds_to_compile(gpu: &Gpu) -> anyhow::Result<f64> {
    let start = Instant::now();
    WgpuBackend::new(gpu.clone())?;
    Ok(start.elapsed().as_secs_f64())
}

fn features(all: wgpu::Features) -> Vec<String> {
    all.iter_names().map(|(name, _)| name.to_owned()).collect()
}

/// Those that a compute backend meets.
fn limits(all: &wgpu::Limits) -> BTreeMap<String, u64> {
    macro_rules! named {
        ($($limit:ident)*) => { [$((stringify!($limit), u64::from(all.$limit))),*] };
    }
    let named = named! {
        max_storage_buffers_per_shader_stage
        max_storage_buffer_binding_size
        max_buffer_size
        min_storage_buffer_offset_alignment
        max_compute_workgroup_storage_size
        max_compute_invocations_per_workgroup
        max_compute_workgroup_size_x
        max_compute_workgroups_per_dimension
        max_immediate_size
    };
    let owned = named.map(|(name, value)| (name.to_owned(), value));
    owned.into_iter().collect()
}
