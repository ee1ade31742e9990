//! The stages as pipelines, made once.

use crate::Gpu;
use tldi_shaders::{STAGES, Stage};

/// A stage that can be dispatched.
#[derive(Debug)]
pub(crate) struct Pipeline {
    pub(crate) stage: &'static Stage,
    pub(crate) pipeline: wgpu::ComputePipeline,
    pub(crate) layout: wgpu::BindGroupLayout,
}

/// All stages, in their order, with these constants.
pub(crate) fn pipelines(gpu: &Gpu, constants: &[(&'static str, f64)]) -> Vec<Pipeline> {
    STAGES
        .iter()
        .map(|stage| {
            let module = gpu
                .device
                .create_shader_module(wgpu::ShaderModuleDescriptor {
                    label: Some(stage.name),
                    source: wgpu::ShaderSource::Wgsl(stage.source.into()),
                });
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
