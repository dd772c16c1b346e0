//! Transposed convolution.

use super::conv2d::Kernel;
use super::math::finish;
use super::matmul::Operand;
use super::shifted::{Padded, Tap, sum_of_taps};
use super::views::{Planes, PlanesMut, Scratch, at_least};

/// `y = activation(transposed convolution of x + bias)`.
///
/// Output cells that have the same residue modulo the stride are an ordinary convolution with
/// every stride-th tap of the kernel: no product is wasted on inserted zeros and nothing is
/// scattered. The layout of the weights is told at [`crate::nn::program::Op::ConvTranspose2d`].
pub fn conv_transpose2d(x: Planes<'_>, k: &Kernel<'_>, y: PlanesMut<'_>, scratch: &mut Scratch) {
    let PlanesMut {
        data,
        channels,
        height,
        width,
    } = y;
    let (stride, taps) = (k.window.stride, k.window.taps());
    let depth = x.channels * taps * taps;
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
        tile,
        threads,
    } = scratch;
    let planes = at_least(panel, padded.len());
    padded.fill(x, planes);
    let strip = padded.strip(stride * channels);
    for residue in 0..stride.min(height) {
        let lines = count(residue, height);
        for first in (0..lines).step_by(strip) {
            let rows = strip.min(lines - first);
            let part = channels * rows * padded.width;
            let tile = at_least(tile, stride * part);
            for column in 0..stride.min(width) {
                let weight = &k.weight[(residue * stride + column) * channels * depth..];
                let taps = (0..taps * taps).map(|tap| Tap {
                    phase: [0, 0],
                    // Later taps meet earlier cells.
                    shift: [
                        ahead(residue) + taps - 1 - tap / taps,
                        ahead(column) + taps - 1 - tap % taps,
                    ],
                    weight: Operand {
                        data: &weight[tap * x.channels..],
                        row_stride: depth,
                        column_stride: 1,
                    },
                });
                let tile = &mut tile[column * part..][..part];
                sum_of_taps(
                    &padded,
                    planes,
                    taps,
                    [first, rows, channels],
                    tile,
                    *threads,
                );
            }
            for line in 0..channels * rows {
                let (channel, row) = (line / rows, residue + stride * (first + line % rows));
                let to = &mut data[(channel * height + row) * width..][..width];
                let source = |column: usize| {
                    &tile[column * part + line * padded.width..][..count(column, width)]
                };
                interleave(to, stride, source);
                finish(to, k.bias[channel], k.activation);
            }
        }
    }
}

/// `line[column + stride·n] = source(column)[n]`.
fn interleave<'a>(line: &mut [f32], stride: usize, source: impl Fn(usize) -> &'a [f32]) {
    if stride == 2 && line.len() > 1 {
        let (even, odd) = (source(0), source(1));
        let mut pairs = line.chunks_exact_mut(2);
        for ((pair, &a), &b) in pairs.by_ref().zip(even).zip(odd) {
            pair[0] = a;
            pair[1] = b;
        }
        if let [last] = pairs.into_remainder() {
            *last = even[even.len() - 1];
        }
        return;
    }
    for column in 0..stride.min(line.len()) {
        line[column..]
            .iter_mut()
            .step_by(stride)
            .zip(source(column))
            .for_each(|(to, &v)| *to = v);
    }
}
