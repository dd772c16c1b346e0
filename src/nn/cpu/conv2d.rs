//! Convolution.

use super::math::finish;
use super::matmul::{Operand, matmul};
use super::shifted::{Padded, Tap, sum_of_taps};
use super::views::{MatMut, Planes, PlanesMut, Scratch, at_least};
use crate::nn::program::{Activation, Window};

/// Values of unfolded input that are worked on at a time: half a megabyte stays in a core's own cache.
const PANEL: usize = 128 * 1024;

/// The weights of a convolution: `weight` (out, kernel · kernel, in), `bias` (out).
#[derive(Clone, Copy, Debug)]
pub struct Kernel<'a> {
    /// The weights, in the layout of the operation.
    pub weight: &'a [f32],
    /// One value per output channel.
    pub bias: &'a [f32],
    /// The window.
    pub window: Window,
    /// What is applied to each result.
    pub activation: Activation,
}

/// With fewer input channels than this, products per tap are too thin and the input is unfolded.
const FEW_CHANNELS: usize = 8;

/// `y = activation(weight ∗ x + bias + residual)`.
pub fn conv2d(
    x: Planes<'_>,
    k: &Kernel<'_>,
    residual: Option<Planes<'_>>,
    y: PlanesMut<'_>,
    scratch: &mut Scratch,
) {
    if k.window == Window::new(1, 1, 0) || x.channels < FEW_CHANNELS {
        unfolded(x, k, residual, y, scratch);
    } else {
        shifted(x, k, residual, y, scratch);
    }
}

/// As a sum over taps of products with shifted views of the input.
fn shifted(
    x: Planes<'_>,
    k: &Kernel<'_>,
    residual: Option<Planes<'_>>,
    y: PlanesMut<'_>,
    scratch: &mut Scratch,
) {
    let Window {
        kernel,
        stride,
        padding,
    } = k.window;
    let reach = k.window.taps() - 1;
    let padded = Padded {
        channels: x.channels,
        height: y.height + reach,
        width: y.width + reach,
        stride,
        padding,
        phases: kernel.min(stride),
    };
    let Scratch {
        panel,
        tile,
        threads,
    } = scratch;
    let planes = at_least(panel, padded.len());
    padded.fill(x, planes);
    let taps = || {
        (0..kernel * kernel).map(|tap| {
            let (ky, kx) = (tap / kernel, tap % kernel);
            let weight = Operand {
                data: &k.weight[tap * x.channels..],
                row_stride: kernel * kernel * x.channels,
                column_stride: 1,
            };
            Tap {
                phase: [ky % stride, kx % stride],
                shift: [ky / stride, kx / stride],
                weight,
            }
        })
    };
    let (cells, strip) = (y.height * y.width, padded.strip(y.channels));
    for first in (0..y.height).step_by(strip) {
        let rows = strip.min(y.height - first);
        let tile = at_least(tile, y.channels * rows * padded.width);
        sum_of_taps(
            &padded,
            planes,
            taps(),
            [first, rows, y.channels],
            tile,
            *threads,
        );
        for (line, values) in tile.chunks_exact(padded.width).enumerate() {
            let (channel, row) = (line / rows, first + line % rows);
            let at = channel * cells + row * y.width;
            let to = &mut y.data[at..at + y.width];
            to.copy_from_slice(&values[..y.width]);
            add(to, residual, at);
            finish(to, k.bias[channel], k.activation);
        }
    }
}

fn add(values: &mut [f32], residual: Option<Planes<'_>>, at: usize) {
    if let Some(residual) = residual {
        let other = &residual.data[at..at + values.len()];
        values.iter_mut().zip(other).for_each(|(v, r)| *v += r);
    }
}

/// As products with unfolded strips of the input.
fn unfolded(
    x: Planes<'_>,
    k: &Kernel<'_>,
    residual: Option<Planes<'_>>,
    y: PlanesMut<'_>,
    scratch: &mut Scratch,
) {
    let cells = y.height * y.width;
    let depth = x.channels * k.window.kernel * k.window.kernel;
    let direct = k.window == Window::new(1, 1, 0);
    let strip = (PANEL / (depth * y.width).max(1)).clamp(1, y.height.max(1));
    for first in (0..y.height).step_by(strip) {
        let rows = strip.min(y.height - first);
        let (begin, columns) = (first * y.width, rows * y.width);
        let unfolded = if direct {
            Operand::new(&x.data[begin..], cells)
        } else {
            let panel = at_least(&mut scratch.panel, depth * columns);
            unfold(x, k.window, first, rows, y.width, panel);
            Operand::new(panel, columns)
        };
        let out = MatMut {
            data: &mut y.data[begin..],
            rows: y.channels,
            columns,
            stride: cells,
        };
        let weight = Operand::new(k.weight, depth);
        matmul(out, weight, unfolded, depth, false, scratch.threads);
        for channel in 0..y.channels {
            let at = channel * cells + begin;
            let values = &mut y.data[at..at + columns];
            add(values, residual, at);
            finish(values, k.bias[channel], k.activation);
        }
    }
}

/// Writes for each (tap, channel) the input that the tap meets in `rows` rows of the output.
fn unfold(
    x: Planes<'_>,
    window: Window,
    first: usize,
    rows: usize,
    width: usize,
    panel: &mut [f32],
) {
    let Window {
        kernel,
        stride,
        padding,
    } = window;
    let mut lines = panel.chunks_exact_mut(width.max(1));
    for tap in 0..kernel * kernel {
        let (ky, kx) = (tap / kernel, tap % kernel);
        for channel in 0..x.channels {
            let plane = x.channel(channel);
            for oy in first..first + rows {
                let Some(line) = lines.next() else { return };
                let row = (oy * stride + ky)
                    .checked_sub(padding)
                    .filter(|&iy| iy < x.height);
                match row {
                    Some(iy) => {
                        copy_line(&plane[iy * x.width..][..x.width], kx, stride, padding, line)
                    }
                    None => line.fill(0.0),
                }
            }
        }
    }
}

/// `line[o] = row[o·stride + tap − padding]`, 0 outside the row.
pub(super) fn copy_line(row: &[f32], tap: usize, stride: usize, padding: usize, line: &mut [f32]) {
    let begin = padding.saturating_sub(tap).div_ceil(stride).min(line.len());
    let end = (row.len() + padding)
        .saturating_sub(tap)
        .div_ceil(stride)
        .clamp(begin, line.len());
    line[..begin].fill(0.0);
    line[end..].fill(0.0);
    if begin == end {
        return;
    }
    let from = &row[begin * stride + tap - padding..];
    let line = &mut line[begin..end];
    match stride {
        1 => line.copy_from_slice(&from[..line.len()]),
        2 => {
            // Pairs vectorise; the last one may lack its second half.
            let (last, head) = line.split_last_mut().expect("begin < end");
            *last = from[2 * head.len()];
            head.iter_mut()
                .zip(from.chunks_exact(2))
                .for_each(|(to, pair)| *to = pair[0]);
        }
        _ => line
            .iter_mut()
            .zip(from.iter().step_by(stride))
            .for_each(|(to, &v)| *to = v),
    }
}
