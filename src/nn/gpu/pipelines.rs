//! Compiled kernels.

use std::collections::HashMap;

use rayon::prelude::*;
use wgpu::{ComputePipeline, Device, PipelineCache};

use super::kernels::Kernel;
use super::layout::Layout;
use super::lower::Dispatch;

/// Pipelines by kernel; programs on one device share them.
#[derive(Debug, Default)]
pub(super) struct Pipelines(HashMap<Kernel, ComputePipeline>);

impl Pipelines {
    /// The pipeline of a kernel that was made.
    pub(super) fn get(&self, kernel: Kernel) -> Option<&ComputePipeline> {
        self.0.get(&kernel)
    }

    /// Compiles what these dispatches need and is not there yet, kernels side by side. Returns how
    /// many.
    pub(super) fn make<'a>(
        &mut self,
        device: &Device,
        layout: &Layout,
        cache: Option<&PipelineCache>,
        dispatches: impl Iterator<Item = &'a Dispatch>,
    ) -> usize {
        let mut missing: Vec<Kernel> = dispatches
            .map(|d| d.kernel)
            .filter(|kernel| !self.0.contains_key(kernel))
            .collect();
        missing.sort_unstable();
        missing.dedup();
        let count = missing.len();
        let made: Vec<(Kernel, ComputePipeline)> = match missing.as_slice() {
            [] => return 0,
            [kernel] => vec![(*kernel, pipeline(device, layout, cache, *kernel))],
            _ => missing
                .into_par_iter()
                .map(|kernel| (kernel, pipeline(device, layout, cache, kernel)))
                .collect(),
        };
        self.0.extend(made);
        count
    }
}

fn pipeline(
    device: &Device,
    layout: &Layout,
    cache: Option<&PipelineCache>,
    kernel: Kernel,
) -> ComputePipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some(kernel.name),
        source: wgpu::ShaderSource::Wgsl(kernel.source().into()),
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some(kernel.name),
        layout: Some(&layout.pipelines),
        module: &module,
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache,
    })
}
