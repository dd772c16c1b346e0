//! Transposed convolution.

use super::interleave::interleave;
use super::math::finish;
use super::padded::Padded;
use super::product::{LANES, PANEL, Product};
use super::views::{Kernel, Planes, PlanesMut, Scratch, at_least};
use super::winograd::Winograd;
use crate::simd::vectorised;

/// `y = activation(transposed convolution of x + bias)`.
///
/// Output cells that have the same residue modulo the stride are an ordinary convolution with
/// every stride-th tap of the kernel: no product is wasted on inserted zeros and nothing is
/// scattered. The layout of the weights is told at [`crate::nn::program::Op::ConvTranspose2d`].
pub fn conv_transpose2d(x: Planes<'_>, k: &Kernel<'_>, y: PlanesMut<'_>, scratch: &mut Scratch) {
    if let Some(method) = Winograd::of_transposed(k.window, x.channels, &y) {
        return method.run(x, k, None, y, scratch);
    }
    let (height, width) = (y.height, y.width);
    let (stride, taps) = (k.window.stride, k.window.taps());
    // Residue `p` begins at input cell `ahead(p)`, and has every stride-th output cell.
    let ahead = |residue: usize| (residue + k.window.padding) / stride;
    let count = |residue: usize, size: usize| (size - residue).div_ceil(stride);
    let extent = |size: usize| {
        let ends = (0..stride.min(size)).map(|residue| count(residue, size) + ahead(residue));
        ends.max().unwrap_or(0) + taps - 1
    };
    let padded = Padded {
        channels: x.channels,
        height: extent(height),
        width: extent(width),
        stride: 1,
        padding: taps - 1,
        phases: 1,
    };
    let Scratch {
        panel,
        tiles,
        offsets,
        threads,
        ..
    } = scratch;
    let planes = at_least(panel, padded.len());
    padded.fill(x, planes);
    // Residues differ in where they begin alone. Later taps meet earlier cells.
    let tap = |tap: usize| padded.tap([0, 0], [taps - 1 - tap / taps, taps - 1 - tap % taps]);
    padded.offsets((0..taps * taps).map(tap), offsets);
    let depth = offsets.len();
    let of_residue = y.channels.next_multiple_of(PANEL) * depth;
    let strip = padded.strip(stride * y.channels, height.div_ceil(stride));
    let multiply_adds = y.data.len() * depth;
    super::share(
        *threads,
        y,
        multiply_adds,
        tiles,
        |first_channel, y, tile| {
            let channels = y.channels;
            for residue in 0..stride.min(height) {
                let lines = count(residue, height);
                for first in (0..lines).step_by(strip) {
                    let rows = strip.min(lines - first);
                    let length = (rows * padded.width).next_multiple_of(LANES);
                    let part = channels.next_multiple_of(PANEL) * length;
                    let tile = at_least(tile, stride * part);
                    for column in 0..stride.min(width) {
                        let left = (residue * stride + column) * of_residue + first_channel * depth;
                        let begin = (first + ahead(residue)) * padded.width + ahead(column);
                        let product = Product {
                            left: &k.weight[left..],
                            offsets,
                            right: &planes[begin..],
                            rows: channels,
                            columns: padded.columns(rows, count(column, width)),
                        };
                        product.run(&mut tile[column * part..], length);
                    }
                    vectorised!({
                        for line in 0..channels * rows {
                            let (c, r) = (line / rows, line % rows);
                            let row = residue + stride * (first + r);
                            let to = &mut y.data[(c * height + row) * width..][..width];
                            let at = c * length + r * padded.width;
                            let source =
                                |column: usize| &tile[column * part + at..][..count(column, width)];
                            interleave(to, stride, source);
                            finish(to, k.bias[first_channel + c], k.activation);
                        }
                    });
                }
            }
        },
    );
}
