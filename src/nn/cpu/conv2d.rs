//! Convolution.

use super::math::finish;
use super::matmul::{Operand, matmul};
use super::views::{MatMut, Planes, PlanesMut, Scratch, at_least};
use crate::nn::program::{Activation, Window};

/// Values of unfolded input that are worked on at a time: half a megabyte stays in a core's own cache.
pub(super) const PANEL: usize = 128 * 1024;

/// The weights of a convolution: `weight` (out, in · kernel · kernel), `bias` (out).
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

/// `y = activation(weight ∗ x + bias + residual)`, as products with unfolded strips of the input.
pub fn conv2d(
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
        matmul(
            out,
            Operand::new(k.weight, depth),
            unfolded,
            depth,
            false,
            scratch.threads,
        );
        for channel in 0..y.channels {
            let at = channel * cells + begin;
            let values = &mut y.data[at..at + columns];
            if let Some(residual) = residual {
                let other = &residual.data[at..at + columns];
                values.iter_mut().zip(other).for_each(|(v, r)| *v += r);
            }
            finish(values, k.bias[channel], k.activation);
        }
    }
}

/// Writes for each (channel, tap) the input that the tap meets in `rows` rows of the output.
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
    for channel in 0..x.channels {
        let plane = x.channel(channel);
        for tap in 0..kernel * kernel {
            let (ky, kx) = (tap / kernel, tap % kernel);
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
