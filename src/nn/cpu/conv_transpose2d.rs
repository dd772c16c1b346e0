//! Transposed convolution.

use super::conv2d::{Kernel, PANEL, copy_line};
use super::math::finish;
use super::matmul::{Operand, matmul};
use super::views::{MatMut, Planes, PlanesMut, Scratch, at_least};
use crate::nn::program::Window;

/// `y = activation(transposed convolution of x + bias)`.
///
/// Output cells that have the same residue modulo the stride are an ordinary convolution with
/// every stride-th tap of the kernel: no product is wasted on inserted zeros and nothing is
/// scattered. The layout of the weights is told at [`crate::nn::program::Op::ConvTranspose2d`].
pub fn conv_transpose2d(x: Planes<'_>, k: &Kernel<'_>, y: PlanesMut<'_>, scratch: &mut Scratch) {
    let stride = k.window.stride;
    let taps = k.window.taps();
    let depth = x.channels * taps * taps;
    let widest = y.width.div_ceil(stride);
    let strip = (PANEL / (depth * widest).max(1)).max(1);
    let PlanesMut {
        data,
        channels,
        height,
        width,
    } = y;
    for residue in 0..stride.min(height) {
        let lines = (height - residue).div_ceil(stride);
        for first in (0..lines).step_by(strip) {
            let rows = strip.min(lines - first);
            let tile = channels * rows * widest;
            for column in 0..stride.min(width) {
                let columns = (width - column).div_ceil(stride);
                let part = Part {
                    window: k.window,
                    residues: [residue, column],
                    first,
                    rows,
                    columns,
                };
                let panel = at_least(&mut scratch.panel, depth * rows * columns);
                part.unfold(x, panel);
                let weight =
                    &k.weight[(residue * stride + column) * channels * depth..][..channels * depth];
                let out = &mut at_least(&mut scratch.tile, stride * tile)[column * tile..];
                let out = MatMut {
                    data: out,
                    rows: channels,
                    columns: rows * columns,
                    stride: rows * widest,
                };
                let b = Operand::new(panel, rows * columns);
                matmul(
                    out,
                    Operand::new(weight, depth),
                    b,
                    depth,
                    false,
                    scratch.threads,
                );
            }
            for channel in 0..channels {
                for r in 0..rows {
                    let at = (channel * height + residue + stride * (first + r)) * width;
                    let line = &mut data[at..at + width];
                    let source = |column: usize| {
                        let columns = (width - column).div_ceil(stride);
                        &scratch.tile[column * tile + channel * rows * widest + r * columns..]
                            [..columns]
                    };
                    interleave(line, stride, source);
                    finish(line, k.bias[channel], k.activation);
                }
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

/// The output cells of one pair of residues in some rows.
struct Part {
    window: Window,
    residues: [usize; 2],
    first: usize,
    rows: usize,
    columns: usize,
}

impl Part {
    /// Writes for each (channel, tap) the input that the tap meets in these output cells.
    fn unfold(&self, x: Planes<'_>, panel: &mut [f32]) {
        let taps = self.window.taps();
        let [qy, qx] = self
            .residues
            .map(|r| (r + self.window.padding) / self.window.stride);
        let mut lines = panel.chunks_exact_mut(self.columns.max(1));
        for channel in 0..x.channels {
            let plane = x.channel(channel);
            for tap in 0..taps * taps {
                let (ty, tx) = (tap / taps, tap % taps);
                for n in self.first..self.first + self.rows {
                    let Some(line) = lines.next() else { return };
                    let row = (qy + n).checked_sub(ty).filter(|&iy| iy < x.height);
                    match row {
                        Some(iy) => copy_line(&plane[iy * x.width..][..x.width], qx, 1, tx, line),
                        None => line.fill(0.0),
                    }
                }
            }
        }
    }
}
