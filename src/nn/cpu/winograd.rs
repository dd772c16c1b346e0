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
//! The differences are taken of the whole input at once ([`planes`]), each tile of two cells in
//! one place of a run, so that products meet them where they stand, as they do those of a plain convolution.
//! Kernels are added up when a layer first runs ([`weights`]).

mod planes;
#[cfg(test)]
mod tests;
mod weights;

use super::conv2d::Kernel;
use super::interleave::interleave;
use super::math::finish;
use super::padded::strip;
use super::product::{LANES, PANEL, Product};
use super::views::{Planes, PlanesMut, Scratch, at_least};
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
    /// For each residue by how many cells its first input is from the first of all; as
    /// `(residue + ahead) / residues`.
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
        let weights = k
            .weight
            .transformed(|weight| self.weights(weight, x.channels, y.channels));
        let (height, width) = (y.height, y.width);
        let points = self.form.points();
        let squared = points * points;
        let tiles = [height, width].map(|size| self.tiles(size));
        let shift = self.form.shift(self.begin(self.residues - 1));
        let wide = tiles[1] + shift;
        let rows_at_once = strip(
            y.channels + self.stride * self.stride * x.channels,
            wide,
            tiles[0],
        );
        let tiled = Tiled {
            form: self.form,
            stride: self.stride,
            padding: self.padding,
            channels: x.channels,
            height: rows_at_once + shift,
            width: wide,
        };
        let Scratch {
            panel,
            tile,
            offsets,
            threads,
        } = scratch;
        tiled.offsets(offsets);
        let depth = offsets.len();
        let of_matrix = y.channels.next_multiple_of(PANEL) * depth;
        for first in (0..tiles[0]).step_by(rows_at_once) {
            let rows = rows_at_once.min(tiles[0] - first);
            let planes = at_least(panel, tiled.len());
            tiled.fill(x, first, tile, planes);
            let planes = &*planes;
            let columns = rows * tiled.width - (tiled.width - tiles[1]);
            let length = columns.next_multiple_of(LANES);
            let multiply_adds = squared * depth * columns * self.residues.pow(2);
            super::share(
                *threads,
                y.reborrow(),
                multiply_adds,
                tile,
                |first_channel, y, tile| {
                    let part = y.channels.next_multiple_of(PANEL) * length;
                    // Products, then for each residue of a column the two rows' two cells.
                    let (products, results) = at_least(tile, (squared + 4 * self.residues) * part)
                        .split_at_mut(squared * part);
                    for residue in 0..self.residues {
                        for column in 0..self.residues {
                            for point in 0..squared {
                                let at = [(residue, point / points), (column, point % points)];
                                let [down, right] =
                                    at.map(|(r, point)| self.form.point(point, self.begin(r)));
                                let matrix = (residue * self.residues + column) * squared + point;
                                let product = Product {
                                    left: &weights[matrix * of_matrix + first_channel * depth..],
                                    offsets,
                                    right: &planes[tiled.place(down, right)..],
                                    rows: y.channels,
                                    columns,
                                };
                                product.run(&mut products[point * part..], length);
                            }
                            let cells = &mut results[4 * column * part..][..4 * part];
                            self.form
                                .outputs(products, y.channels * length, part, cells);
                        }
                        vectorised!({
                            for c in 0..y.channels {
                                let channel = first_channel + c;
                                for r in 0..2 * rows {
                                    let row = self.residues * (2 * first + r) + residue;
                                    if row >= height {
                                        break;
                                    }
                                    let at = c * length + r / 2 * tiled.width;
                                    // Cell k of a tile: its residue is k modulo their number.
                                    let source = |k: usize| {
                                        let (column, second) =
                                            (k % self.residues, k / self.residues);
                                        let cells = 4 * column + 2 * (r % 2) + second;
                                        &results[cells * part + at..][..tiles[1]]
                                    };
                                    let to = &mut y.data[(c * height + row) * width..][..width];
                                    interleave(to, 2 * self.residues, source);
                                    if let Some(residual) = residual {
                                        let line = (channel * height + row) * width;
                                        add(to, &residual.data[line..][..width]);
                                    }
                                    finish(to, k.bias[channel], k.activation);
                                }
                            }
                        });
                    }
                },
            );
        }
    }
}

fn add(to: &mut [f32], values: &[f32]) {
    to.iter_mut().zip(values).for_each(|(to, v)| *to += v);
}
