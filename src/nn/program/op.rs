//! Operations.

use super::{BufferId, ConstantId, GraphSize, Map, Matrix};

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

    /// The constants that are read.
    #[must_use]
    pub fn constants(&self) -> Vec<ConstantId> {
        match *self {
            Self::Conv2d { weight, bias, .. }
            | Self::ConvTranspose2d { weight, bias, .. }
            | Self::Linear { weight, bias, .. } => vec![weight, bias],
            Self::Gat { attention, .. } => vec![attention],
            Self::MaxPool2d { .. }
            | Self::GlobalMeanPool { .. }
            | Self::MeanRows { .. }
            | Self::RegionMean { .. }
            | Self::SignMean { .. }
            | Self::RegionForm { .. }
            | Self::Paint { .. }
            | Self::Upsample { .. }
            | Self::Broadcast { .. }
            | Self::RepeatRow { .. }
            | Self::CopyRows { .. } => Vec::new(),
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
