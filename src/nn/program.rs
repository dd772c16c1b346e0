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

mod constant;
mod op;
mod prune;
mod views;

pub use constant::Constant;
pub use op::{Activation, Edges, Op, Sign, Window};
pub use views::{Buffer, BufferId, ConstantId, Extent, GraphSize, Map, Matrix};

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
    /// Lengths of ways between regions and the start, which is last, (labels + 1, labels + 1).
    Ways,
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
    pub constants: Vec<Constant>,
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
