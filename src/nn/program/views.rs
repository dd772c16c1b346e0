//! Buffers and the parts of them that operations read and write.

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

/// The number of a buffer of a [`Program`](super::Program).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct BufferId(pub u32);

impl BufferId {
    /// The buffer's number as an index into arrays.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// The number of a constant of a [`Program`](super::Program).
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
