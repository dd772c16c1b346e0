//! A program on a device: its buffers, its kernels, and how they are recorded.

use half::slice::HalfFloatSliceExt as _;
use wgpu::{BindGroup, Buffer, BufferUsages, Device, Queue};

use super::kernels::TileRule;
use super::layout::{Layout, round_up};
use super::lower::{Dispatch, EdgeOffsets, Slot, lower};
use super::pipelines::Pipelines;
use crate::nn::inputs::Inputs;
use crate::nn::program::{Edges, GraphSize, Op, Program};

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
    room: Option<Room>,
    staging: Vec<f32>,
}

/// Buffers and bind groups for automata up to some size.
#[derive(Debug)]
struct Room {
    capacity: GraphSize,
    edge_capacity: usize,
    buffers: Vec<Buffer>,
    edges: Buffer,
    groups: Vec<BindGroup>,
}

impl GpuSession {
    /// Uploads a program's weights; `half` says whether the device unpacks 16-bit floats.
    pub(super) fn new(device: &Device, queue: &Queue, program: &Program, half: bool) -> Self {
        let half = half && program.half;
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
            room: None,
            staging: Vec::new(),
        }
    }

    /// Bytes of the output.
    pub(super) fn output_bytes(program: &Program, size: GraphSize) -> u64 {
        let output = program.output.expect("a program has an output");
        4 * (output.rows.rows(size) * output.columns) as u64
    }

    /// Uploads an encoded mission and returns the dispatches that compute its output.
    pub(super) fn prepare(
        &mut self,
        device: &Device,
        queue: &Queue,
        layout: &Layout,
        tiles: TileRule,
        program: &Program,
        inputs: &Inputs<'_>,
    ) -> Vec<Dispatch> {
        let size = inputs.size();
        let (edges, offsets) = edge_words(inputs);
        self.make_room(device, layout, program, size, edges.len());
        let room = self.room.as_ref().expect("room was just made");
        queue.write_buffer(&room.edges, 0, bytemuck::cast_slice(&edges));
        // Inputs that share a buffer are uploaded together.
        let mut filled: Vec<usize> = program.inputs.iter().map(|i| i.at.buffer.index()).collect();
        filled.sort_unstable();
        filled.dedup();
        for index in filled {
            let len = program.buffers[index].len(size);
            self.staging.clear();
            self.staging.resize(len, 0.0);
            for input in program
                .inputs
                .iter()
                .filter(|i| i.at.buffer.index() == index)
            {
                inputs.fill(input, &mut self.staging);
            }
            queue.write_buffer(&room.buffers[index], 0, bytemuck::cast_slice(&self.staging));
        }
        let mut words = vec![0u8; PARAMS_STRIDE as usize * program.ops.len().max(1)];
        let mut dispatches = Vec::with_capacity(program.ops.len());
        for (op, at) in program
            .ops
            .iter()
            .zip(words.chunks_exact_mut(PARAMS_STRIDE as usize))
        {
            let mut dispatch = lower(op, size, &offsets, tiles, at);
            dispatch.kernel.half = self.half && dispatch.kernel.tile.is_some();
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
        edges: usize,
    ) {
        if let Some(room) = &self.room
            && room.capacity.states >= size.states
            && room.capacity.transitions >= size.transitions
            && room.edge_capacity >= edges
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
        let edge_capacity = edges + edges / 2;
        let buffers: Vec<Buffer> = program
            .buffers
            .iter()
            .map(|b| storage(device, "values", b.len(capacity)))
            .collect();
        let edges = storage(device, "edges", edge_capacity);
        let groups = program
            .ops
            .iter()
            .map(|op| self.group(device, layout, &buffers, &edges, op))
            .collect();
        self.room = Some(Room {
            capacity,
            edge_capacity,
            buffers,
            edges,
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

fn storage(device: &Device, label: &str, values: usize) -> Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: 4 * round_up(values.max(4), 4) as u64,
        usage: BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC,
        mapped_at_creation: false,
    })
}

/// The edges of all types one after the other, and where each type's begin.
fn edge_words(inputs: &Inputs<'_>) -> (Vec<u32>, EdgeOffsets) {
    let (mut words, mut offsets) = (Vec::new(), EdgeOffsets::default());
    for edges in Edges::ALL {
        let list = edges.incoming(inputs.graph);
        offsets.0[edges as usize] = (
            words.len() as u32,
            (words.len() + list.offsets.len()) as u32,
        );
        words.extend(list.offsets);
        words.extend(list.sources);
    }
    (words, offsets)
}
