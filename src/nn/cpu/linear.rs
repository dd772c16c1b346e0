//! Rows times weights.

use pulp::{Arch, Simd, WithSimd};

use super::math::{activate, finish_into};
use super::product::LANES;
use super::views::{Mat, MatMut, Scratch, at_least};
use crate::nn::program::Activation;

/// Rows that are computed at a time, at most.
const BLOCK: usize = 8;

/// Columns of the inputs that are looked up at a time.
const CHUNK: usize = 8;

/// `y = activation([x, second] · weightᵀ + bias)`, the two inputs side by side; `weight` in the
/// layout of the operation, `bias` (out).
///
/// Few rows meet many weights here, so nothing is packed: values are taken from the rows where they stand.
pub fn linear(
    [x, second]: [Option<Mat<'_>>; 2],
    weight: &[f32],
    bias: &[f32],
    activation: Activation,
    y: MatMut<'_>,
    scratch: &mut Scratch,
) {
    let stride = bias.len().max(1).next_multiple_of(LANES);
    let mut rest = weight;
    let parts = [x, second].map(|x| {
        let x = x?;
        let weight;
        (weight, rest) = rest.split_at(x.columns * stride);
        Some(Part { x, weight })
    });
    Arch::new().dispatch(Blocks {
        parts,
        bias,
        activation,
        tile: at_least(&mut scratch.tile, BLOCK * stride),
        y,
    });
}

/// One of the inputs, and the weights that meet it: a row of them for each of its columns.
#[derive(Clone, Copy)]
struct Part<'a> {
    x: Mat<'a>,
    weight: &'a [f32],
}

struct Blocks<'a> {
    parts: [Option<Part<'a>>; 2],
    bias: &'a [f32],
    activation: Activation,
    /// Sums of a block of rows.
    tile: &'a mut [f32],
    y: MatMut<'a>,
}

impl WithSimd for Blocks<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let most = if S::REGISTER_COUNT >= 32 { BLOCK } else { 4 };
        let mut first = 0;
        while first < self.y.rows {
            let rows = (self.y.rows - first).min(most);
            match rows {
                1 => self.sums::<S, 1>(simd, first),
                2..=4 => self.sums::<S, 4>(simd, first),
                _ => self.sums::<S, BLOCK>(simd, first),
            }
            self.finish(first, rows);
            first += rows;
        }
    }
}

impl Blocks<'_> {
    /// `ROWS` rows from row `first` on, in strips of vectors; where there are not as many rows the last one is
    /// computed again.
    #[inline(always)]
    fn sums<S: Simd, const ROWS: usize>(&mut self, simd: S, first: usize) {
        let vectors = self.bias.len().div_ceil(S::F32_LANES);
        let mut done = 0;
        while done < vectors {
            let column = done * S::F32_LANES;
            done += match vectors - done {
                1 => self.strip::<S, ROWS, 1>(simd, first, column),
                n if ROWS == 1 && n >= 6 => self.strip::<S, ROWS, 6>(simd, first, column),
                _ => self.strip::<S, ROWS, 2>(simd, first, column),
            };
        }
    }

    /// `VECTORS` vectors of columns; returns their number.
    #[inline(always)]
    fn strip<S: Simd, const ROWS: usize, const VECTORS: usize>(
        &mut self,
        simd: S,
        first: usize,
        column: usize,
    ) -> usize {
        let width = VECTORS * S::F32_LANES;
        let stride = self.tile.len() / BLOCK;
        let mut sums = [[simd.splat_f32s(0.0); VECTORS]; ROWS];
        for Part { x, weight } in self.parts.into_iter().flatten() {
            let rows: [&[f32]; ROWS] = std::array::from_fn(|i| x.row((first + i).min(x.rows - 1)));
            let chunks = rows.map(|row| row.as_chunks::<CHUNK>());
            let (full, rest) = weight.split_at(x.columns / CHUNK * CHUNK * stride);
            for (c, weights) in full.chunks_exact(CHUNK * stride).enumerate() {
                let columns: [&[f32; CHUNK]; ROWS] = std::array::from_fn(|i| &chunks[i].0[c]);
                for (k, weights) in weights.chunks_exact(stride).take(CHUNK).enumerate() {
                    let factor = |i: usize| columns[i][k];
                    add::<S, ROWS, VECTORS>(simd, &mut sums, factor, &weights[column..]);
                }
            }
            for (k, weights) in rest.chunks_exact(stride).enumerate() {
                let factor = |i: usize| chunks[i].1[k];
                add::<S, ROWS, VECTORS>(simd, &mut sums, factor, &weights[column..]);
            }
        }
        for (sums, row) in sums.iter().zip(self.tile.chunks_exact_mut(stride)) {
            S::as_mut_simd_f32s(&mut row[column..][..width])
                .0
                .copy_from_slice(sums);
        }
        VECTORS
    }

    /// Takes rows from the tile to their places.
    #[inline(always)]
    fn finish(&mut self, first: usize, rows: usize) {
        let stride = self.tile.len() / BLOCK;
        for (i, sums) in self.tile.chunks_exact(stride).take(rows).enumerate() {
            let row = self.y.row(first + i);
            let sums = &sums[..row.len()];
            match self.activation {
                Activation::Sigmoid => {
                    let values = sums.iter().zip(self.bias);
                    row.iter_mut().zip(values).for_each(|(to, (v, b))| {
                        *to = activate(v + b, Activation::Sigmoid);
                    });
                }
                other => finish_into(row, sums, Some(self.bias), 0.0, other),
            }
        }
    }
}

/// Adds the products of one column's values and its weights.
#[inline(always)]
fn add<S: Simd, const ROWS: usize, const VECTORS: usize>(
    simd: S,
    sums: &mut [[S::f32s; VECTORS]; ROWS],
    factor: impl Fn(usize) -> f32,
    weights: &[f32],
) {
    let weights = S::as_simd_f32s(&weights[..VECTORS * S::F32_LANES]).0;
    let values: [S::f32s; VECTORS] = std::array::from_fn(|j| weights[j]);
    for (i, sums) in sums.iter_mut().enumerate() {
        let factor = simd.splat_f32s(factor(i));
        for (sum, &value) in sums.iter_mut().zip(&values) {
            *sum = simd.mul_add_e_f32s(factor, value, *sum);
        }
    }
}
