//! The memory of a program and its execution.

use super::product::LANES;
use super::views::{Mat, MatMut, Planes, PlanesMut, Scratch};
use super::{
    Kernel, broadcast, conv_transpose2d, conv2d, copy_rows, gat, global_mean_pool, linear,
    max_pool2d, mean_rows, paint, region_form, region_mean, sign_mean, upsample,
};
use crate::encoding::{AutomatonGraph, Incoming};
use crate::nn::inputs::Inputs;
use crate::nn::program::{ConstantId, Edges, GraphSize, Map, Matrix, Op, Program};

/// The buffers of one program between runs: nothing is allocated by a run whose automaton is not
/// larger than those before it, except when its edges change.
#[derive(Clone, Debug, Default)]
pub struct Session {
    buffers: Vec<Vec<f32>>,
    edges: EdgeLists,
    size: GraphSize,
    scratch: Scratch,
}

impl Session {
    /// A session whose kernels may use `threads` threads where that pays.
    #[must_use]
    pub fn new(threads: usize) -> Self {
        let scratch = Scratch {
            threads,
            ..Scratch::default()
        };
        Self {
            scratch,
            ..Self::default()
        }
    }

    /// Runs the program and returns its output, row by row without gaps.
    ///
    /// # Panics
    /// If the program is not one that [`Program::check`] accepts, or the map is not of the
    /// program's resolution.
    pub fn run<'a>(&'a mut self, program: &Program, inputs: &Inputs<'_>) -> &'a [f32] {
        self.prepare(program, inputs);
        for op in &program.ops {
            self.step(program, op);
        }
        let output = program.output.expect("a program has an output");
        let values = self.read(output);
        debug_assert_eq!(values.stride, values.columns, "outputs are contiguous");
        &self.buffers[output.buffer.index()][output.offset..][..values.rows * values.columns]
    }

    /// The values of a view after a run: for tests that look inside.
    #[must_use]
    pub fn values(&self, view: Matrix) -> Vec<f32> {
        let m = self.read(view);
        (0..m.rows).flat_map(|i| m.row(i).iter().copied()).collect()
    }

    /// Makes room and fills the inputs.
    fn prepare(&mut self, program: &Program, inputs: &Inputs<'_>) {
        assert!(
            [0, inputs.map.resolution].contains(&program.resolution),
            "the map has another resolution"
        );
        self.size = inputs.size();
        self.buffers.resize_with(program.buffers.len(), Vec::new);
        for (values, buffer) in self.buffers.iter_mut().zip(&program.buffers) {
            values.resize(buffer.len(self.size) + LANES, 0.0);
        }
        for input in &program.inputs {
            inputs.fill(input, &mut self.buffers[input.at.buffer.index()]);
        }
        self.edges.set(inputs.graph);
    }

    /// Runs one operation. The written buffer is taken out meanwhile, so the rest can be read.
    fn step(&mut self, program: &Program, op: &Op) {
        let target = op.writes().index();
        let mut scratch = std::mem::take(&mut self.scratch);
        let mut written = std::mem::take(&mut self.buffers[target]);
        self.apply(program, op, &mut written, &mut scratch);
        self.buffers[target] = written;
        self.scratch = scratch;
    }

    fn apply(&self, program: &Program, op: &Op, out: &mut [f32], scratch: &mut Scratch) {
        let size = self.size;
        let constant = |id: ConstantId| &program.constants[id.index()];
        match *op {
            Op::Conv2d {
                x,
                weight,
                bias,
                window,
                residual,
                activation,
                y,
            } => {
                let kernel = Kernel {
                    weight: constant(weight),
                    bias: constant(bias),
                    window,
                    activation,
                };
                let residual = residual.map(|r| self.planes(r));
                conv2d(
                    self.planes(x),
                    &kernel,
                    residual,
                    planes_mut(out, y),
                    scratch,
                );
            }
            Op::ConvTranspose2d {
                x,
                weight,
                bias,
                window,
                activation,
                y,
            } => {
                let kernel = Kernel {
                    weight: constant(weight),
                    bias: constant(bias),
                    window,
                    activation,
                };
                conv_transpose2d(self.planes(x), &kernel, planes_mut(out, y), scratch);
            }
            Op::MaxPool2d { x, window, y } => {
                max_pool2d(self.planes(x), window, planes_mut(out, y))
            }
            Op::GlobalMeanPool { x, y } => global_mean_pool(self.planes(x), mat_mut(out, y, size)),
            Op::Linear {
                x,
                second,
                weight,
                bias,
                activation,
                y,
            } => {
                let (x, y) = (
                    [Some(x), second].map(|m| m.map(|m| self.read(m))),
                    mat_mut(out, y, size),
                );
                linear(x, constant(weight), constant(bias), activation, y, scratch);
            }
            Op::Gat {
                source,
                target,
                attention,
                edges,
                y,
            } => {
                let (source, target) = (self.read(source), self.read(target));
                let edges = self.edges.get(edges);
                gat(
                    source,
                    target,
                    constant(attention),
                    edges,
                    mat_mut(out, y, size),
                    scratch,
                );
            }
            Op::MeanRows { x, y } => mean_rows(self.read(x), mat_mut(out, y, size)),
            Op::RegionMean { x, mask, y } => {
                let (x, mask) = (self.planes(x), self.planes(mask));
                region_mean(x, mask, mat_mut(out, y, size), scratch);
            }
            Op::SignMean {
                literals,
                x,
                sign,
                y,
            } => {
                sign_mean(
                    self.read(literals),
                    self.read(x),
                    sign,
                    mat_mut(out, y, size),
                );
            }
            Op::RegionForm {
                literals,
                x,
                sign,
                y,
            } => {
                region_form(
                    self.read(literals),
                    self.read(x),
                    sign,
                    mat_mut(out, y, size),
                );
            }
            Op::Paint { mask, colour, y } => {
                paint(
                    self.planes(mask),
                    self.read(colour),
                    planes_mut(out, y),
                    scratch,
                );
            }
            Op::Upsample { x, y } => upsample(self.planes(x), planes_mut(out, y), scratch),
            Op::Broadcast { x, add, y } => broadcast(self.read(x).row(0), add, planes_mut(out, y)),
            Op::RepeatRow { x, y } | Op::CopyRows { x, y } => {
                copy_rows(self.read(x), mat_mut(out, y, size));
            }
        }
    }

    fn read(&self, m: Matrix) -> Mat<'_> {
        let rows = m.rows.rows(self.size);
        let data = &self.buffers[m.buffer.index()];
        // A matrix without rows begins nowhere.
        let data = if rows == 0 { &[] } else { &data[m.offset..] };
        Mat {
            data,
            rows,
            columns: m.columns,
            stride: m.stride,
        }
    }

    fn planes(&self, m: Map) -> Planes<'_> {
        let data = &self.buffers[m.buffer.index()][m.offset..];
        Planes {
            data,
            channels: m.channels,
            height: m.height,
            width: m.width,
        }
    }
}

fn mat_mut(data: &mut [f32], m: Matrix, size: GraphSize) -> MatMut<'_> {
    let rows = m.rows.rows(size);
    let data = if rows == 0 {
        &mut []
    } else {
        &mut data[m.offset..]
    };
    MatMut {
        data,
        rows,
        columns: m.columns,
        stride: m.stride,
    }
}

fn planes_mut(data: &mut [f32], m: Map) -> PlanesMut<'_> {
    let data = &mut data[m.offset..][..m.len()];
    PlanesMut {
        data,
        channels: m.channels,
        height: m.height,
        width: m.width,
    }
}

/// The incoming edges of every type, remembered for the automaton they were made from.
#[derive(Clone, Debug, Default)]
struct EdgeLists {
    ends: Vec<(u32, u32)>,
    lists: Vec<Incoming>,
}

impl EdgeLists {
    fn set(&mut self, graph: &AutomatonGraph) {
        let states = graph.states.len();
        let known = self.lists.get(Edges::TransitionToState as usize);
        if known.is_some_and(|l| l.offsets.len() == states + 1) && self.ends == graph.ends {
            return;
        }
        self.ends.clone_from(&graph.ends);
        self.lists = Edges::ALL
            .iter()
            .map(|edges| edges.incoming(graph))
            .collect();
    }

    fn get(&self, edges: Edges) -> &Incoming {
        &self.lists[edges as usize]
    }
}

impl Edges {
    /// The edges of this type in `graph`, by target.
    #[must_use]
    pub fn incoming(self, graph: &AutomatonGraph) -> Incoming {
        match self {
            Self::StateToTransition => graph.state_to_transition(),
            Self::TargetToTransition => graph.target_to_transition(),
            Self::TransitionToState => graph.transition_to_state(),
            Self::TransitionToSource => graph.transition_to_source(),
            Self::StateToPool => Incoming::pool(graph.states.len()),
            Self::TransitionToPool => Incoming::pool(graph.transitions()),
        }
    }
}
