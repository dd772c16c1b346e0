//! Convolution.

use super::math::finish_into;
use super::padded::Padded;
use super::product::{LANES, PANEL, Product};
use super::views::{Kernel, Planes, PlanesMut, Scratch, at_least};
use super::winograd::Winograd;
use crate::nn::program::Window;
use crate::simd::vectorised;

/// `y = activation(weight ∗ x + bias + residual)`.
pub fn conv2d(
    x: Planes<'_>,
    k: &Kernel<'_>,
    residual: Option<Planes<'_>>,
    y: PlanesMut<'_>,
    scratch: &mut Scratch,
) {
    if let Some(method) = Winograd::of_conv(k.window, x.channels, &y) {
        return method.run(x, k, residual, y, scratch);
    }
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
        tiles,
        offsets,
        threads,
        ..
    } = scratch;
    // A 1×1 convolution meets the input as it stands, if there is room behind it.
    let planes = if k.window == Window::new(1, 1, 0) && x.has_room() {
        x.data
    } else {
        let planes = at_least(panel, padded.len());
        padded.fill(x, planes);
        planes
    };
    let taps = (0..kernel * kernel).map(|tap| {
        let (ky, kx) = (tap / kernel, tap % kernel);
        padded.tap([ky % stride, kx % stride], [ky / stride, kx / stride])
    });
    padded.offsets(taps, offsets);
    let (cells, width) = (y.height * y.width, y.width);
    let strip = padded.strip(y.channels, y.height);
    let multiply_adds = y.data.len() * offsets.len();
    super::share(
        *threads,
        y,
        multiply_adds,
        tiles,
        |first_channel, y, tile| {
            let left = &k.weight[first_channel * offsets.len()..];
            for first in (0..y.height).step_by(strip) {
                let rows = strip.min(y.height - first);
                let columns = padded.columns(rows, width);
                let length = columns.next_multiple_of(LANES);
                let tile = at_least(tile, y.channels.next_multiple_of(PANEL) * length);
                let product = Product {
                    left,
                    offsets,
                    right: &planes[first * padded.width..],
                    rows: y.channels,
                    columns,
                };
                product.run(tile, length);
                // Where no columns are dropped, rows follow one another.
                let line = if padded.width == width { rows } else { 1 } * width;
                let step = line.max(padded.width);
                vectorised!({
                    for (c, values) in tile.chunks_exact(length).take(y.channels).enumerate() {
                        let channel = first_channel + c;
                        for r in 0..rows * width / line {
                            let at = first * width + r * line;
                            let residual =
                                residual.map(|x| &x.data[channel * cells + at..][..line]);
                            let to = &mut y.data[c * cells + at..][..line];
                            let values = &values[r * step..][..line];
                            finish_into(to, values, residual, k.bias[channel], k.activation);
                        }
                    }
                });
            }
        },
    );
}
