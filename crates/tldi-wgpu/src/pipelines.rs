//! The stages as pipelines, made once.

use crate::Gpu;
use tldi_shaders::numbers::MAX_GROUPS;
use tldi_shaders::{STAGES, Stage};

/// A stage that can be dispatched.
#[derive(Debug)]
pub(crate) struct Pipeline {
    pub(crate) stage: &'static Stage,
    pub(crate) pipeline: wgpu::ComputePipeline,
    pub(crate) layout: wgpu::BindGroupLayout,
}

/// A stage's shader, without the counters that `wgpu` puts into loops, lest these never end. Its indices are checked.
pub(crate) fn module(device: &wgpu::Device, stage: &Stage) -> wgpu::ShaderModule {
    let descriptor = wgpu::ShaderModuleDescriptor {
        label: Some(stage.name),
        source: wgpu::ShaderSource::Wgsl(stage.source.into()),
    };
    let mut checks = wgpu::ShaderRuntimeChecks::checked();
    checks.force_loop_bounding = false;
    // SAFETY: all loops of the stages end, and only that is not checked. A `for` counts towards a bound that was read before
    // it began; a `while` or `loop` says above it why it ends. A test of `tldi-shaders` holds all of them to that.
    unsafe { device.create_shader_module_trusted(descriptor, checks) }
}

/// All stages, in their order, with these constants.
pub(crate) fn pipelines(gpu: &Gpu, constants: &[(&'static str, f64)]) -> Vec<Pipeline> {
    STAGES
        .iter()
        .map(|stage| {
            let module = module(&gpu.device, stage);
            let pipeline = gpu
                .device
                .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                    label: Some(stage.name),
                    layout: None,
                    module: &module,
                    entry_point: Some(stage.name),
                    compilation_options: wgpu::PipelineCompilationOptions {
                        constants,
                        ..Default::default()
                    },
                    cache: None,
                });
            Pipeline {
                stage,
                layout: pipeline.get_bind_group_layout(0),
                pipeline,
            }
        })
        .collect()
}

/// Sizes of a dispatch of so many workgroups.
pub(crate) fn direct(groups: u32) -> [u32; 3] {
    [groups.min(MAX_GROUPS), groups.div_ceil(MAX_GROUPS), 1]
}

/// Whether a batch needs a stage. Without bare clouds there is nothing to sort; with them, `normals` places the images.
pub(crate) fn is_needed(stage: &str, has_bare_sides: bool) -> bool {
    match stage {
        "columns_pixels" => !has_bare_sides,
        _ => has_bare_sides || !stage.starts_with("normals"),
    }
}
