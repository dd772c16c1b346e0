//! Borrowed matrices, maps and weights.

use super::product::LANES;
use crate::nn::program::{Activation, Constant, Window};

/// A row-major matrix; row `i` begins at `i * stride`.
#[derive(Clone, Copy, Debug)]
pub struct Mat<'a> {
    /// The values, from the first on.
    pub data: &'a [f32],
    /// The number of rows.
    pub rows: usize,
    /// The number of columns.
    pub columns: usize,
    /// The distance between rows.
    pub stride: usize,
}

impl<'a> Mat<'a> {
    /// A matrix without gaps between its rows.
    #[must_use]
    pub fn new(data: &'a [f32], rows: usize, columns: usize) -> Self {
        Self {
            data,
            rows,
            columns,
            stride: columns,
        }
    }

    /// Row `i`.
    #[must_use]
    pub fn row(&self, i: usize) -> &'a [f32] {
        &self.data[i * self.stride..][..self.columns]
    }
}

/// A row-major matrix that is written.
#[derive(Debug)]
pub struct MatMut<'a> {
    /// The values, from the first on.
    pub data: &'a mut [f32],
    /// The number of rows.
    pub rows: usize,
    /// The number of columns.
    pub columns: usize,
    /// The distance between rows.
    pub stride: usize,
}

impl<'a> MatMut<'a> {
    /// A matrix without gaps between its rows.
    #[must_use]
    pub fn new(data: &'a mut [f32], rows: usize, columns: usize) -> Self {
        Self {
            data,
            rows,
            columns,
            stride: columns,
        }
    }

    /// Row `i`.
    pub fn row(&mut self, i: usize) -> &mut [f32] {
        &mut self.data[i * self.stride..][..self.columns]
    }

    /// The same matrix, borrowed for a shorter time.
    pub fn reborrow(&mut self) -> MatMut<'_> {
        MatMut {
            data: self.data,
            rows: self.rows,
            columns: self.columns,
            stride: self.stride,
        }
    }
}

/// A map of shape (channels, height, width), contiguous.
#[derive(Clone, Copy, Debug)]
pub struct Planes<'a> {
    /// The values, and perhaps more behind them.
    pub data: &'a [f32],
    /// The number of channels.
    pub channels: usize,
    /// The cells along the first axis.
    pub height: usize,
    /// The cells along the second axis.
    pub width: usize,
}

impl<'a> Planes<'a> {
    /// Whether there is room behind the values for products to read beyond them.
    pub(super) fn has_room(&self) -> bool {
        self.data.len() >= self.channels * self.height * self.width + LANES
    }

    /// The values of one channel.
    #[must_use]
    pub fn channel(&self, c: usize) -> &'a [f32] {
        let cells = self.height * self.width;
        &self.data[c * cells..][..cells]
    }
}

/// A map that is written.
#[derive(Debug)]
pub struct PlanesMut<'a> {
    /// The values.
    pub data: &'a mut [f32],
    /// The number of channels.
    pub channels: usize,
    /// The cells along the first axis.
    pub height: usize,
    /// The cells along the second axis.
    pub width: usize,
}

impl PlanesMut<'_> {
    /// The same map, borrowed for a shorter time.
    pub fn reborrow(&mut self) -> PlanesMut<'_> {
        PlanesMut {
            data: self.data,
            channels: self.channels,
            height: self.height,
            width: self.width,
        }
    }
}

/// The weights of a convolution: `weight` as in the operation, `bias` (out).
#[derive(Clone, Copy, Debug)]
pub struct Kernel<'a> {
    /// The weights, in the layout of the operation.
    pub weight: &'a Constant,
    /// One value per output channel.
    pub bias: &'a [f32],
    /// The window.
    pub window: Window,
    /// What is applied to each result.
    pub activation: Activation,
}

/// Memory that kernels use between their steps, kept from one run to the next.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    /// Padded input of convolutions, packed rows of linear layers.
    pub panel: Vec<f32>,
    /// Results before they go to their places.
    pub tile: Vec<f32>,
    /// The same for each thread that shares in a layer.
    pub tiles: Vec<Vec<f32>>,
    /// Where the rows of products' right matrices begin.
    pub offsets: Vec<u32>,
    /// How many threads a kernel may use; 0 counts as 1.
    pub threads: usize,
}

/// The first `len` values of `memory`, which grows when it must.
pub(super) fn at_least(memory: &mut Vec<f32>, len: usize) -> &mut [f32] {
    if memory.len() < len {
        memory.resize(len, 0.0);
    }
    &mut memory[..len]
}
