//! The bindings that all kernels share.

use wgpu::{BindGroupLayout, BufferBindingType, Device, PipelineLayout};

/// One layout serves every kernel: parameters, and six storage buffers.
#[derive(Debug)]
pub(super) struct Layout {
    pub(super) bindings: BindGroupLayout,
    pub(super) pipelines: PipelineLayout,
}

impl Layout {
    pub(super) fn new(device: &Device) -> Self {
        let entry = |binding, ty, has_dynamic_offset| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty,
                has_dynamic_offset,
                min_binding_size: None,
            },
            count: None,
        };
        let storage =
            |binding, read_only| entry(binding, BufferBindingType::Storage { read_only }, false);
        let entries = [
            entry(0, BufferBindingType::Uniform, true),
            storage(1, true),
            storage(2, true),
            storage(3, false),
            storage(4, true),
            storage(5, true),
            storage(6, true),
        ];
        let bindings = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("kernel"),
            entries: &entries,
        });
        let pipelines = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("kernel"),
            bind_group_layouts: &[Some(&bindings)],
            immediate_size: 0,
        });
        Self {
            bindings,
            pipelines,
        }
    }
}

/// The next multiple of `step`.
pub(super) fn round_up(value: usize, step: usize) -> usize {
    value.div_ceil(step) * step
}
