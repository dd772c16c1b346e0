//! A network as a list of operations over named buffers.
//!
//! Models are built into a [`Program`] once, when their weights are loaded; the executors
//! ([`crate::nn::cpu`], [`crate::nn::gpu`]) know operations and no models. All values are `f32`.
//!
//! A buffer is a row-major matrix. A *map* of shape (channels, x, y) is a buffer with one row per
//! channel; a concatenation along channels or columns is a buffer that several operations write
//! parts of, so it costs nothing. The number of rows may depend on the automaton ([`Extent`]).
//!
//! Invariant ([`Program::check`]): no operation reads the buffer that it writes, with the
//! exception of [`Op::Broadcast`] that adds.

use std::sync::Arc;

/// The number of nodes of an automaton graph.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GraphSize {
    /// State nodes.
    pub states: usize,
    /// Transition nodes.
    pub transitions: usize,
}

/// A number of rows, known when the automaton is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Extent {
    /// The same for every automaton.
    Fixed(usize),
    /// One per state node.
    States,
    /// One per transition node.
    Transitions,
}

impl Extent {
    /// The number of rows for a graph of this size.
    #[must_use]
    pub fn rows(self, size: GraphSize) -> usize {
        match self {
            Self::Fixed(rows) => rows,
            Self::States => size.states,
            Self::Transitions => size.transitions,
        }
    }
}

/// The number of a buffer of a [`Program`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BufferId(pub u32);

impl BufferId {
    /// The buffer's number as an index into arrays.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// The number of a constant of a [`Program`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ConstantId(pub u32);

impl ConstantId {
    /// The constant's number as an index into arrays.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// What a buffer holds room for: a row-major matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Buffer {
    /// The number of rows.
    pub rows: Extent,
    /// The number of columns.
    pub columns: usize,
}

impl Buffer {
    /// How many values the buffer holds for a graph of this size.
    #[must_use]
    pub fn len(self, size: GraphSize) -> usize {
        self.rows.rows(size) * self.columns
    }
}

/// A block of columns of a buffer, or one of its rows as a vector.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Matrix {
    /// The buffer it lies in.
    pub buffer: BufferId,
    /// Index of the first value.
    pub offset: usize,
    /// The number of rows.
    pub rows: Extent,
    /// The number of columns.
    pub columns: usize,
    /// The distance between rows: the buffer's columns.
    pub stride: usize,
}

impl Matrix {
    /// The columns from `first` on, `columns` of them.
    #[must_use]
    pub fn columns(self, first: usize, columns: usize) -> Self {
        Self {
            offset: self.offset + first,
            columns,
            ..self
        }
    }

    /// `rows` rows from `first` on.
    #[must_use]
    pub fn rows(self, first: usize, rows: usize) -> Self {
        Self {
            offset: self.offset + first * self.stride,
            rows: Extent::Fixed(rows),
            ..self
        }
    }
}

/// A block of channels of a buffer: shape (channels, height, width), contiguous.
///
/// `height` counts along x and `width` along y, as in the map raster's axes (channel, x, y).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Map {
    /// The buffer it lies in.
    pub buffer: BufferId,
    /// Index of the first value.
    pub offset: usize,
    /// The number of channels.
    pub channels: usize,
    /// The cells along the first axis.
    pub height: usize,
    /// The cells along the second axis.
    pub width: usize,
}

impl Map {
    /// The number of cells of one channel.
    #[must_use]
    pub fn cells(self) -> usize {
        self.height * self.width
    }

    /// The number of values.
    #[must_use]
    pub fn len(self) -> usize {
        self.channels * self.cells()
    }

    /// Whether there is no value at all.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.len() == 0
    }

    /// `channels` channels from `first` on.
    #[must_use]
    pub fn channels(self, first: usize, channels: usize) -> Self {
        Self {
            offset: self.offset + first * self.cells(),
            channels,
            ..self
        }
    }

    /// The same values as a matrix of one row per channel.
    #[must_use]
    pub fn as_matrix(self) -> Matrix {
        Matrix {
            buffer: self.buffer,
            offset: self.offset,
            rows: Extent::Fixed(self.channels),
            columns: self.cells(),
            stride: self.cells(),
        }
    }

    /// The same values as one row.
    #[must_use]
    pub fn as_row(self) -> Matrix {
        Matrix {
            buffer: self.buffer,
            offset: self.offset,
            rows: Extent::Fixed(1),
            columns: self.len(),
            stride: self.len(),
        }
    }
}

/// What is applied to each value of a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum Activation {
    /// Nothing.
    None = 0,
    /// `max(x, 0)`.
    Relu = 1,
    /// `x` if positive, else `0.2·x`.
    LeakyRelu = 2,
    /// `1 / (1 + e⁻ˣ)`.
    Sigmoid = 3,
}

/// A type of edges of the automaton graph along which messages are weighed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Edges {
    /// From the source state of each transition.
    StateToTransition,
    /// From the target state of each transition.
    TargetToTransition,
    /// To the target state of each transition.
    TransitionToState,
    /// To the source state of each transition.
    TransitionToSource,
    /// From every state to the pool node.
    StateToPool,
    /// From every transition to the pool node.
    TransitionToPool,
}

impl Edges {
    /// All types, in the order in which executors store them.
    pub const ALL: [Self; 6] = [
        Self::StateToTransition,
        Self::TargetToTransition,
        Self::TransitionToState,
        Self::TransitionToSource,
        Self::StateToPool,
        Self::TransitionToPool,
    ];
}

/// Whether a literal asks for a region or forbids it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sign {
    /// Entries of 1.
    Positive,
    /// Entries of −1.
    Negative,
}

/// The size of a square window and how it moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Window {
    /// Cells per side of the window.
    pub kernel: usize,
    /// Cells between one position and the next (for transposed convolutions: of the output).
    pub stride: usize,
    /// Cells added on each side (for transposed convolutions: removed from the output).
    pub padding: usize,
}

impl Window {
    /// A window of `kernel` cells, moved by `stride`, with `padding` cells on each side.
    #[must_use]
    pub fn new(kernel: usize, stride: usize, padding: usize) -> Self {
        Self {
            kernel,
            stride,
            padding,
        }
    }

    /// The output size of a convolution or pooling over `size` cells.
    #[must_use]
    pub fn reduced(self, size: usize) -> usize {
        (size + 2 * self.padding)
            .checked_sub(self.kernel)
            .map_or(0, |room| room / self.stride + 1)
    }

    /// The output size of a transposed convolution from `size` cells.
    #[must_use]
    pub fn enlarged(self, size: usize, output_padding: usize) -> usize {
        ((size.max(1) - 1) * self.stride + self.kernel + output_padding)
            .saturating_sub(2 * self.padding)
    }

    /// For transposed convolutions: how many taps of one axis meet each output cell.
    #[must_use]
    pub fn taps(self) -> usize {
        self.kernel.div_ceil(self.stride)
    }
}

/// One operation. `x` is read, `y` is written; shapes are in the views.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)] // the fields' meaning is told once, in the variants' text
pub enum Op {
    /// `y = activation(weight ∗ x + bias (+ residual))`.
    /// `weight` is the matrix (out, in · kernel · kernel) in panels of eight rows: shape
    /// (⌈out / 8⌉, in, kernel · kernel, 8), 0 beyond the last row. `bias` (out).
    Conv2d {
        x: Map,
        weight: ConstantId,
        bias: ConstantId,
        window: Window,
        residual: Option<Map>,
        activation: Activation,
        y: Map,
    },
    /// `y = activation(transposed convolution of x + bias)`.
    ///
    /// `weight` holds one convolution matrix per residue (p, q) of the output's cell modulo the
    /// stride, p major, in panels of eight rows: shape (stride, stride, ⌈out / 8⌉, in,
    /// taps · taps, 8) with taps as in [`Window::taps`]; tap `t` of residue `p` is entry `(p + padding) mod stride + stride·t` of
    /// the kernel and meets the input cell `(p + padding) div stride + n − t` for output `p + stride·n`.
    ConvTranspose2d {
        x: Map,
        weight: ConstantId,
        bias: ConstantId,
        window: Window,
        activation: Activation,
        y: Map,
    },
    /// The largest value under the window; padding never wins.
    MaxPool2d { x: Map, window: Window, y: Map },
    /// The mean over all cells of each channel, as one row.
    GlobalMeanPool { x: Map, y: Matrix },
    /// `y = activation([x, second] · weightᵀ + bias)`, the two inputs side by side; `weight` is
    /// turned, with rows padded by zeros to a multiple of sixteen: shape (in, ⌈out / 16⌉ · 16).
    /// `bias` (out).
    Linear {
        x: Matrix,
        second: Option<Matrix>,
        weight: ConstantId,
        bias: ConstantId,
        activation: Activation,
        y: Matrix,
    },
    /// The attention of a GAT edge type: row `t` of `y` is `Σ α x_s` over the incoming edges of
    /// target `t`, with `α` the softmax of `leaky_relu(a_src · x_s + a_dst · x_t)`; zero without
    /// edges. `attention` holds `a_src` (source columns) and then `a_dst` (target columns),
    /// already multiplied with the projections, which follow as [`Op::Linear`]: they commute
    /// with the weighted sum.
    Gat {
        source: Matrix,
        target: Matrix,
        attention: ConstantId,
        edges: Edges,
        y: Matrix,
    },
    /// The mean of the rows as one row; zero without rows.
    MeanRows { x: Matrix, y: Matrix },
    /// Row `i` of `y` is the mean of `x` over the cells, weighted by channel `i` of `mask`.
    RegionMean { x: Map, mask: Map, y: Matrix },
    /// For each row of `literals` the mean of the rows of `x` whose entry has the sign, zero if
    /// none: (T, labels) × (labels, C) → (T, C).
    SignMean {
        literals: Matrix,
        x: Matrix,
        sign: Sign,
        y: Matrix,
    },
    /// For each column of `literals` the mean of the rows of `x` whose entry has the sign, zero
    /// if none: (labels, T) × (T, C) → (labels, C).
    RegionForm {
        literals: Matrix,
        x: Matrix,
        sign: Sign,
        y: Matrix,
    },
    /// `Σ mask_i ⊗ colour_i`: (labels, R, R) × (labels, K) → (K, R, R).
    Paint { mask: Map, colour: Matrix, y: Map },
    /// Bilinear interpolation, `align_corners = false`.
    Upsample { x: Map, y: Map },
    /// Value `c` of the row `x` in every cell of channel `c`, or added to it.
    Broadcast { x: Matrix, add: bool, y: Map },
    /// The row `x` in every row of `y`.
    RepeatRow { x: Matrix, y: Matrix },
    /// `y = x`.
    CopyRows { x: Matrix, y: Matrix },
}

impl Op {
    /// The name of the operation: that of its shader and of its CPU twin.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Conv2d { .. } => "conv2d",
            Self::ConvTranspose2d { .. } => "conv_transpose2d",
            Self::MaxPool2d { .. } => "max_pool2d",
            Self::GlobalMeanPool { .. } => "global_mean_pool",
            Self::Linear { .. } => "linear",
            Self::Gat { .. } => "gat",
            Self::MeanRows { .. } => "mean_rows",
            Self::RegionMean { .. } => "region_mean",
            Self::SignMean { .. } => "sign_mean",
            Self::RegionForm { .. } => "region_form",
            Self::Paint { .. } => "paint",
            Self::Upsample { .. } => "upsample",
            Self::Broadcast { .. } => "broadcast",
            Self::RepeatRow { .. } | Self::CopyRows { .. } => "copy_rows",
        }
    }

    /// The buffers that are read.
    #[must_use]
    pub fn reads(&self) -> Vec<BufferId> {
        match self {
            Self::Conv2d { x, residual, .. } => std::iter::once(x.buffer)
                .chain(residual.map(|r| r.buffer))
                .collect(),
            Self::ConvTranspose2d { x, .. }
            | Self::MaxPool2d { x, .. }
            | Self::GlobalMeanPool { x, .. }
            | Self::Upsample { x, .. } => vec![x.buffer],
            Self::Linear { x, second, .. } => std::iter::once(x.buffer)
                .chain(second.map(|m| m.buffer))
                .collect(),
            Self::MeanRows { x, .. }
            | Self::Broadcast { x, .. }
            | Self::RepeatRow { x, .. }
            | Self::CopyRows { x, .. } => vec![x.buffer],
            Self::Gat { source, target, .. } => vec![source.buffer, target.buffer],
            Self::RegionMean { x, mask, .. } => vec![x.buffer, mask.buffer],
            Self::SignMean { literals, x, .. } | Self::RegionForm { literals, x, .. } => {
                vec![literals.buffer, x.buffer]
            }
            Self::Paint { mask, colour, .. } => vec![mask.buffer, colour.buffer],
        }
    }

    /// The buffer that is written.
    #[must_use]
    pub fn writes(&self) -> BufferId {
        match self {
            Self::Conv2d { y, .. }
            | Self::ConvTranspose2d { y, .. }
            | Self::MaxPool2d { y, .. }
            | Self::Paint { y, .. }
            | Self::Upsample { y, .. }
            | Self::Broadcast { y, .. } => y.buffer,
            Self::GlobalMeanPool { y, .. }
            | Self::Linear { y, .. }
            | Self::Gat { y, .. }
            | Self::MeanRows { y, .. }
            | Self::RegionMean { y, .. }
            | Self::SignMean { y, .. }
            | Self::RegionForm { y, .. }
            | Self::RepeatRow { y, .. }
            | Self::CopyRows { y, .. } => y.buffer,
        }
    }

    /// Multiplications with an addition (only those that grow with the product of two sizes).
    #[must_use]
    pub fn multiply_adds(&self, size: GraphSize) -> u64 {
        let product = |parts: [usize; 3]| parts.iter().map(|&p| p as u64).product::<u64>();
        match self {
            Self::Conv2d { x, window, y, .. } => product([
                x.channels * window.kernel * window.kernel,
                y.channels,
                y.cells(),
            ]),
            Self::ConvTranspose2d { x, window, y, .. } => product([
                x.channels * window.taps() * window.taps(),
                y.channels,
                y.cells(),
            ]),
            Self::Linear { x, second, y, .. } => {
                let inputs = x.columns + second.map_or(0, |m| m.columns);
                product([x.rows.rows(size), inputs, y.columns])
            }
            Self::Gat {
                source, target, y, ..
            } => {
                let rows = source.rows.rows(size) + target.rows.rows(size);
                product([rows.max(size.transitions), y.columns, 1])
            }
            Self::RegionMean { x, mask, .. } => product([x.channels, mask.channels, x.cells()]),
            Self::SignMean { literals, x, .. } | Self::RegionForm { literals, x, .. } => {
                product([literals.rows.rows(size), literals.columns, x.columns])
            }
            Self::Paint { mask, y, .. } => product([mask.channels, y.channels, y.cells()]),
            _ => 0,
        }
    }
}

/// What an input buffer is filled with before a run.
#[derive(Clone, Debug, PartialEq)]
pub enum Source {
    /// The whole raster, (1 + labels, R, R).
    Raster,
    /// The obstacles alone: max(status, 0), (1, R, R).
    Obstacles,
    /// The start's cell alone: max(−status, 0), (1, R, R).
    Start,
    /// The region channels, (labels, R, R).
    Regions,
    /// 1 wherever some region is, (1, R, R).
    AnyRegion,
    /// The regions and then the start averaged down by area: (labels + 1, h, h).
    Masks,
    /// Coordinates of the cells, and of them relative to the start: (5, h, h) (`lookup`, step 2).
    Planes,
    /// Features of the state nodes, (states, 3).
    StateFeatures,
    /// Literals of the transition nodes, (transitions, labels).
    Literals,
    /// The same value everywhere.
    Constant(f32),
    /// Values from outside: the entry of this number of [`Inputs::given`](super::inputs::Inputs::given).
    Given(usize),
}

/// An input: what goes where.
#[derive(Clone, Debug, PartialEq)]
pub struct Input {
    /// What is written.
    pub source: Source,
    /// Where; a map is given as one row per channel.
    pub at: Matrix,
}

/// A network, ready to be run by an executor.
#[derive(Clone, Debug, Default)]
pub struct Program {
    /// The buffers.
    pub buffers: Vec<Buffer>,
    /// The weights, in the layout that the operations ask for.
    pub constants: Vec<Arc<[f32]>>,
    /// What is filled in before a run.
    pub inputs: Vec<Input>,
    /// The operations, in order.
    pub ops: Vec<Op>,
    /// The result.
    pub output: Option<Matrix>,
    /// Cells per side of the raster.
    pub resolution: usize,
    /// Region channels.
    pub labels: usize,
    /// Whether adapters may store the weights of products as 16-bit floats: the file does.
    pub half: bool,
}

impl Program {
    /// Adds a buffer and returns it as a matrix.
    pub fn matrix(&mut self, rows: Extent, columns: usize) -> Matrix {
        let buffer = BufferId(self.buffers.len() as u32);
        self.buffers.push(Buffer { rows, columns });
        Matrix {
            buffer,
            offset: 0,
            rows,
            columns,
            stride: columns,
        }
    }

    /// Adds a buffer and returns it as a map.
    pub fn map(&mut self, channels: usize, height: usize, width: usize) -> Map {
        let matrix = self.matrix(Extent::Fixed(channels), height * width);
        Map {
            buffer: matrix.buffer,
            offset: 0,
            channels,
            height,
            width,
        }
    }

    /// Adds a constant.
    pub fn constant(&mut self, values: Vec<f32>) -> ConstantId {
        self.constants.push(values.into());
        ConstantId(self.constants.len() as u32 - 1)
    }

    /// Says what `at` is filled with before each run.
    pub fn input(&mut self, source: Source, at: Matrix) {
        self.inputs.push(Input { source, at });
    }

    /// Adds an operation.
    pub fn push(&mut self, op: Op) {
        self.ops.push(op);
    }

    /// Multiply-adds of one run.
    #[must_use]
    pub fn multiply_adds(&self, size: GraphSize) -> u64 {
        self.ops.iter().map(|op| op.multiply_adds(size)).sum()
    }

    /// The invariants that executors rely on; broken only by a mistake in a model's builder.
    ///
    /// # Panics
    /// If an operation reads the buffer that it writes, or a buffer is read before it is written.
    pub fn check(&self) {
        let mut written: Vec<bool> = vec![false; self.buffers.len()];
        for input in &self.inputs {
            written[input.at.buffer.index()] = true;
        }
        for op in &self.ops {
            for read in op.reads() {
                assert!(read != op.writes(), "{} reads what it writes", op.name());
                assert!(
                    written[read.index()],
                    "{} reads a buffer before it is written",
                    op.name()
                );
            }
            written[op.writes().index()] = true;
        }
        let output = self.output.expect("a program has an output");
        assert!(
            written[output.buffer.index()],
            "the output is never written"
        );
    }
}
