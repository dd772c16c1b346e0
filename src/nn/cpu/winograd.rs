//! Convolutions with fewer multiplications.
//!
//! Two neighbouring outputs of a kernel of two taps share a product: of inputs d and taps g,
//!
//! ```text
//! m₀ = (d₀ − d₁)·g₀    m₁ = d₁·(g₀ + g₁)    m₂ = (d₁ − d₂)·g₁
//! y₀ = m₀ + m₁         y₁ = m₁ − m₂
//! ```
//!
//! takes three for four, and of three taps four for six (Winograd, *Arithmetic complexity of
//! computations*, 1980; nested for planes as F(2×2, r×r) by Lavin and Gray, *Fast algorithms for
//! convolutional neural networks*, 2016). So a plane of 2 × 2 outputs takes 9 for 16, or 16 for 36.
//! With stride 2 the kernel of four taps is one of two for each residue of the input's cells, and
//! a transposed one is one of two for each residue of the output's: these are what PathNet is made of.
//!
//! The differences are taken of a strip of rows at a time ([`planes`]), each tile of two cells in
//! one place of a run, so that products meet them where they stand, as they do those of a plain convolution.
//! Kernels are added up when a layer first runs ([`weights`]).

mod planes;
#[cfg(test)]
mod tests;
mod weights;

use super::interleave::interleave;
use super::math::finish;
use super::padded::strip;
use super::product::{LANES, PANEL, Product};
use super::views::{Kernel, Planes, PlanesMut, Scratch, at_least};
use crate::nn::program::Window;
use crate::simd::vectorised;
use planes::{Form, Tiled};

/// Fewer input planes, or output channels, have too few products to save for what the sums take.
const LEAST_CHANNELS: usize = 64;

/// Layers of fewer tiles wait for their weights, of which there are more here.
const LEAST_TILES: usize = 100;

/// A convolution or transposed convolution that takes fewer multiplications this way.
#[derive(Clone, Copy, Debug)]
pub(super) struct Winograd {
    form: Form,
    /// Cells between the inputs that an output and the next one meet first.
    stride: usize,
    padding: usize,
    /// Residues of the output's cells along an axis; each has kernels of its own.
    residues: usize,
    /// A residue's first input is `(residue + ahead) / residues` cells from the first of all.
    ahead: usize,
    /// Whether taps meet cells in the opposite order.
    transposed: bool,
}

impl Winograd {
    /// How a convolution with this window, `inputs` channels and this output is computed, if that pays.
    pub(super) fn of_conv(window: Window, inputs: usize, y: &PlanesMut<'_>) -> Option<Self> {
        Self::conv(window).filter(|method| method.pays(inputs, y))
    }

    /// As [`Self::of_conv`], of a transposed convolution.
    pub(super) fn of_transposed(window: Window, inputs: usize, y: &PlanesMut<'_>) -> Option<Self> {
        Self::transposed(window).filter(|method| method.pays(inputs, y))
    }

    fn conv(window: Window) -> Option<Self> {
        let form = match (window.kernel, window.stride) {
            (4, 2) => Form::TWO,
            (3, 1) => Form::THREE,
            _ => return None,
        };
        Some(Self {
            form,
            stride: window.stride,
            padding: window.padding,
            residues: 1,
            ahead: 0,
            transposed: false,
        })
    }

    fn transposed(window: Window) -> Option<Self> {
        (window.taps() == 2).then_some(Self {
            form: Form::TWO_EITHER,
            stride: 1,
            padding: 1,
            residues: window.stride,
            ahead: window.padding,
            transposed: true,
        })
    }

    fn pays(&self, inputs: usize, y: &PlanesMut<'_>) -> bool {
        let [height, width] = [y.height, y.width].map(|size| self.tiles(size));
        inputs * self.stride * self.stride >= LEAST_CHANNELS
            && y.channels >= LEAST_CHANNELS
            && height * width >= LEAST_TILES
    }

    /// What tells its kernels from those of other methods.
    fn key(&self) -> [usize; 3] {
        [self.form.taps, self.stride, self.residues]
    }

    /// Tiles along an axis of so many output cells.
    fn tiles(&self, size: usize) -> usize {
        size.div_ceil(2 * self.residues)
    }

    /// By how many cells the first input of a residue is from the first of all.
    fn begin(&self, residue: usize) -> usize {
        (residue + self.ahead) / self.residues
    }

    /// `y = activation(result + bias + residual)`.
    pub(super) fn run(
        &self,
        x: Planes<'_>,
        k: &Kernel<'_>,
        residual: Option<Planes<'_>>,
        mut y: PlanesMut<'_>,
        scratch: &mut Scratch,
    ) {
        let weights = k.weight.transformed(self.key(), |weight| {
            self.weights(weight, x.channels, y.channels)
        });
        let tiles = [y.height, y.width].map(|size| self.tiles(size));
        let shift = self.form.shift(self.begin(self.residues - 1));
        let (inputs, width) = (self.stride * self.stride * x.channels, tiles[1] + shift);
        let at_once = strip(y.channels + inputs, width, tiles[0]);
        let tiled = Tiled {
            form: self.form,
            stride: self.stride,
            padding: self.padding,
            channels: x.channels,
            height: at_once + shift,
            width,
        };
        let Scratch {
            panel,
            tile,
            tiles: memory,
            offsets,
            threads,
        } = scratch;
        tiled.offsets(offsets);
        // Of the whole layer, as strips follow one another quickly.
        let squared = self.form.points().pow(2) * self.residues.pow(2);
        let multiply_adds = squared * offsets.len() * tiles[0] * width * y.channels;
        for first in (0..tiles[0]).step_by(at_once) {
            let planes = at_least(panel, tiled.len());
            tiled.fill(x, first, tile, planes);
            let rows = at_once.min(tiles[0] - first);
            let columns = rows * width - shift;
            let strip = Strip {
                method: self,
                kernel: k,
                residual,
                weights,
                of_matrix: y.channels.next_multiple_of(PANEL) * offsets.len(),
                tiled,
                planes,
                offsets,
                first,
                rows,
                tiles: tiles[1],
                columns,
                length: columns.next_multiple_of(LANES),
            };
            let work = |first_channel, y: PlanesMut<'_>, tile: &mut Vec<f32>| {
                strip.work(first_channel, y, tile);
            };
            super::share(*threads, y.reborrow(), multiply_adds, memory, work);
        }
    }
}

/// Some rows of tiles of an output.
struct Strip<'a> {
    method: &'a Winograd,
    kernel: &'a Kernel<'a>,
    residual: Option<Planes<'a>>,
    weights: &'a [f32],
    /// Values of the matrix of one pair of points.
    of_matrix: usize,
    tiled: Tiled,
    planes: &'a [f32],
    offsets: &'a [u32],
    /// The first row of tiles, and how many there are.
    first: usize,
    rows: usize,
    /// Tiles of a row.
    tiles: usize,
    /// Columns of products, of which some are dropped behind each row, and with what makes them whole vectors.
    columns: usize,
    length: usize,
}

impl Strip<'_> {
    /// Computes the rows of the channels of `y`, of which the first is `first_channel` of all.
    fn work(&self, first_channel: usize, mut y: PlanesMut<'_>, tile: &mut Vec<f32>) {
        let residues = self.method.residues;
        let products = self.method.form.points().pow(2);
        let part = y.channels.next_multiple_of(PANEL) * self.length;
        // Products, then for each residue of a column the four cells of tiles.
        let (products, cells) =
            at_least(tile, (products + 4 * residues) * part).split_at_mut(products * part);
        for row in 0..residues {
            for (column, cells) in cells.chunks_exact_mut(4 * part).enumerate() {
                self.multiply([row, column], first_channel, y.channels, products);
                let used = y.channels * self.length;
                self.method.form.outputs(products, used, part, cells);
            }
            vectorised!(self.finish(row, first_channel, cells, &mut y));
        }
    }

    /// The products of all pairs of points, for output cells of these residues.
    fn multiply(
        &self,
        residues: [usize; 2],
        first_channel: usize,
        channels: usize,
        products: &mut [f32],
    ) {
        let (method, depth) = (self.method, self.offsets.len());
        let points = method.form.points();
        let part = channels.next_multiple_of(PANEL) * self.length;
        let begin = residues.map(|residue| method.begin(residue));
        let of_residues = (residues[0] * method.residues + residues[1]) * points * points;
        for (pair, to) in products.chunks_exact_mut(part).enumerate() {
            let down = method.form.point(pair / points, begin[0]);
            let right = method.form.point(pair % points, begin[1]);
            let matrix = &self.weights[(of_residues + pair) * self.of_matrix..];
            let product = Product {
                left: &matrix[first_channel * depth..],
                offsets: self.offsets,
                right: &self.planes[self.tiled.place(down, right)..],
                rows: channels,
                columns: self.columns,
            };
            product.run(to, self.length);
        }
    }

    /// Puts the rows of a residue together and applies what follows.
    #[inline(always)]
    fn finish(&self, residue: usize, first_channel: usize, cells: &[f32], y: &mut PlanesMut<'_>) {
        let (residues, kernel) = (self.method.residues, self.kernel);
        let part = cells.len() / (4 * residues);
        let (height, width) = (y.height, y.width);
        for (c, plane) in y.data.chunks_exact_mut(height * width).enumerate() {
            let channel = first_channel + c;
            for r in 0..2 * self.rows {
                let row = residues * (2 * self.first + r) + residue;
                if row >= height {
                    break;
                }
                let begin = c * self.length + r / 2 * self.tiled.width;
                // Cell k of a tile: its residue is k modulo their number.
                let source = |k: usize| {
                    let (column, second) = (k % residues, k / residues);
                    let cell = 4 * column + 2 * (r % 2) + second;
                    &cells[cell * part + begin..][..self.tiles]
                };
                let line = &mut plane[row * width..][..width];
                interleave(line, 2 * residues, source);
                if let Some(residual) = self.residual {
                    let values = &residual.channel(channel)[row * width..];
                    line.iter_mut().zip(values).for_each(|(to, v)| *to += v);
                }
                finish(line, kernel.bias[channel], kernel.activation);
            }
        }
    }
}
