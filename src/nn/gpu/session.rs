//! A program on a device: its buffers, its kernels, and how they are recorded.

use half::slice::HalfFloatSliceExt as _;
use wgpu::{BindGroup, Buffer, BufferUsages, Device, Queue};

use super::Abilities;
use super::kernels::TileRule;
use super::layout::{Layout, storage};
use super::lower::{Dispatch, Slot, lower};
use super::pipelines::Pipelines;
use super::uploads::{EdgeBuffer, Uploads};
use crate::nn::inputs::Inputs;
use crate::nn::program::{GraphSize, Op, Program};

/// Bytes between the parameters of one operation and the next: the largest alignment that the
/// default limits allow devices to ask for.
const PARAMS_STRIDE: u64 = 256;

/// A program's place on a device.
#[derive(Debug)]
pub(super) struct GpuSession {
    constants: Vec<Buffer>,
    params: Buffer,
    nothing: Buffer,
    /// Whether the weights of products are 16-bit floats.
    half: bool,
    /// Whether products are computed in 16-bit floats.
    pub(super) narrow: bool,
    /// Whether sums take subgroup operations.
    subgroups: bool,
    room: Option<Room>,
}

/// Buffers and bind groups for automata up to some size.
#[derive(Debug)]
struct Room {
    capacity: GraphSize,
    buffers: Vec<Buffer>,
    edges: Buffer,
    groups: Vec<BindGroup>,
}

impl GpuSession {
    /// Uploads a program's weights.
    pub(super) fn new(
        device: &Device,
        queue: &Queue,
        program: &Program,
        abilities: &Abilities,
    ) -> Self {
        let half = abilities.half && program.half;
        let halved = halved(program, half);
        let constants = program
            .constants
            .iter()
            .zip(halved)
            .map(|(values, halved)| {
                if halved {
                    let words: Vec<half::f16> =
                        values.iter().map(|&v| half::f16::from_f32(v)).collect();
                    let buffer = storage(device, "weights", words.len().div_ceil(2));
                    // Weights of products come in multiples of eight.
                    queue.write_buffer(&buffer, 0, bytemuck::cast_slice(words.reinterpret_cast()));
                    return buffer;
                }
                let buffer = storage(device, "weights", values.len());
                queue.write_buffer(&buffer, 0, bytemuck::cast_slice(&values[..]));
                buffer
            })
            .collect();
        let params = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("parameters"),
            size: PARAMS_STRIDE * program.ops.len().max(1) as u64,
            usage: BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let nothing = storage(device, "nothing", 64);
        Self {
            constants,
            params,
            nothing,
            half,
            narrow: abilities.narrow(program),
            subgroups: abilities.subgroups,
            room: None,
        }
    }

    /// Bytes of the output.
    pub(super) fn output_bytes(program: &Program, size: GraphSize) -> u64 {
        let output = program.output.expect("a program has an output");
        4 * (output.rows.rows(size) * output.columns) as u64
    }

    /// Uploads an encoded mission, as far as that was not done for another program, and returns
    /// the dispatches that compute its output.
    pub(super) fn prepare<'a>(
        &mut self,
        on: (&Device, &Queue, &Layout, TileRule),
        program: &'a Program,
        inputs: &Inputs<'a>,
        edges: &EdgeBuffer,
        uploads: &mut Uploads<'a>,
    ) -> Vec<Dispatch> {
        let (device, queue, layout, tiles) = on;
        let size = inputs.size();
        self.make_room(device, layout, program, size, &edges.buffer);
        let room = self.room.as_ref().expect("room was just made");
        // Inputs that share a buffer are uploaded together.
        let mut filled: Vec<usize> = program.inputs.iter().map(|i| i.at.buffer.index()).collect();
        filled.sort_unstable();
        filled.dedup();
        for index in filled {
            let list = program.inputs.iter();
            let list: Vec<_> = list.filter(|i| i.at.buffer.index() == index).collect();
            let len = program.buffers[index].len(size);
            uploads.fill(queue, inputs, &list, &room.buffers[index], len);
        }
        let mut words = vec![0u8; PARAMS_STRIDE as usize * program.ops.len().max(1)];
        let mut dispatches = Vec::with_capacity(program.ops.len());
        for (op, at) in program
            .ops
            .iter()
            .zip(words.chunks_exact_mut(PARAMS_STRIDE as usize))
        {
            let mut dispatch = lower(op, size, &edges.offsets, tiles, at);
            let kernel = &mut dispatch.kernel;
            kernel.half = self.half && kernel.tile.is_some();
            kernel.narrow = self.narrow && kernel.tile.is_some();
            kernel.subgroups = self.subgroups && kernel.reduces();
            dispatches.push(dispatch);
        }
        queue.write_buffer(&self.params, 0, &words);
        dispatches
    }

    /// Records the operations and the copy of the output to `target`.
    pub(super) fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        pipelines: &Pipelines,
        dispatches: &[Dispatch],
    ) {
        let Some(room) = &self.room else { return };
        let descriptor = wgpu::ComputePassDescriptor {
            label: Some("network"),
            timestamp_writes: None,
        };
        let mut pass = encoder.begin_compute_pass(&descriptor);
        for (k, (dispatch, group)) in dispatches.iter().zip(&room.groups).enumerate() {
            let Some(pipeline) = pipelines.get(dispatch.kernel) else {
                continue;
            };
            if dispatch.groups.contains(&0) {
                continue;
            }
            let [x, y, z] = dispatch.groups;
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, group, &[k as u32 * PARAMS_STRIDE as u32]);
            pass.dispatch_workgroups(x, y, z);
        }
    }

    /// Records the copy of the output to `target`.
    pub(super) fn record_output(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        program: &Program,
        size: GraphSize,
        target: &Buffer,
        at: u64,
    ) {
        let output = program.output.expect("a program has an output");
        let bytes = Self::output_bytes(program, size);
        if let (Some(room), true) = (&self.room, bytes > 0) {
            let from = &room.buffers[output.buffer.index()];
            encoder.copy_buffer_to_buffer(from, 4 * output.offset as u64, target, at, bytes);
        }
    }

    /// Makes buffers and bind groups for an automaton, unless those at hand are large enough.
    fn make_room(
        &mut self,
        device: &Device,
        layout: &Layout,
        program: &Program,
        size: GraphSize,
        edges: &Buffer,
    ) {
        if let Some(room) = &self.room
            && room.capacity.states >= size.states
            && room.capacity.transitions >= size.transitions
            && room.edges == *edges
        {
            return;
        }
        // Half as much again spares the next, slightly larger automaton a new start.
        let old = self.room.take().map(|r| r.capacity).unwrap_or_default();
        let grown = |need: usize, had: usize| if need > had { need + need / 2 } else { had };
        let capacity = GraphSize {
            states: grown(size.states, old.states),
            transitions: grown(size.transitions, old.transitions),
        };
        let buffers: Vec<Buffer> = program
            .buffers
            .iter()
            .map(|b| storage(device, "values", b.len(capacity)))
            .collect();
        let groups = program
            .ops
            .iter()
            .map(|op| self.group(device, layout, &buffers, edges, op))
            .collect();
        self.room = Some(Room {
            capacity,
            buffers,
            edges: edges.clone(),
            groups,
        });
    }

    fn group(
        &self,
        device: &Device,
        layout: &Layout,
        buffers: &[Buffer],
        edges: &Buffer,
        op: &Op,
    ) -> BindGroup {
        let slots = super::lower::slots(op);
        let pick = |slot: Slot| match slot {
            Slot::Nothing => &self.nothing,
            Slot::Values(id) => &buffers[id.index()],
            Slot::Constant(id) => &self.constants[id.index()],
        };
        let bound = [slots.x, slots.second, slots.y, slots.weight, slots.bias].map(pick);
        let storage = bound
            .into_iter()
            .chain([edges])
            .map(|buffer| (buffer, None));
        let params = (&self.params, wgpu::BufferSize::new(PARAMS_STRIDE));
        let entries: Vec<_> = std::iter::once(params)
            .chain(storage)
            .zip(0..)
            .map(|((buffer, size), binding)| wgpu::BindGroupEntry {
                binding,
                resource: wgpu::BindingResource::Buffer(wgpu::BufferBinding {
                    buffer,
                    offset: 0,
                    size,
                }),
            })
            .collect();
        device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(op.name()),
            layout: &layout.bindings,
            entries: &entries,
        })
    }
}

/// For each constant whether it is stored as 16-bit floats: the weights of products, if `half`.
fn halved(program: &Program, half: bool) -> Vec<bool> {
    let mut halved = vec![false; program.constants.len()];
    for op in &program.ops {
        if let Op::Conv2d { weight, .. }
        | Op::ConvTranspose2d { weight, .. }
        | Op::Linear { weight, .. } = op
        {
            halved[weight.index()] = half;
        }
    }
    halved
}
