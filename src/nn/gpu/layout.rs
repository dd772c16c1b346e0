//! The bindings that all kernels share.

use wgpu::{BindGroupLayout, Buffer, BufferBindingType, BufferUsages, Device, PipelineLayout};

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

/// A buffer for at least so many values.
pub(super) fn storage(device: &Device, label: &str, values: usize) -> Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: 4 * values.max(4).next_multiple_of(4) as u64,
        usage: BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    })
}
