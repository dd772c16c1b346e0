//! The map network that our variants share.

use crate::nn::config::UNet;
use crate::nn::program::{Activation, Map, Matrix, Op, Program, Window};
use crate::nn::weights::{Norm, TensorSource};

/// Stride 2 with a 4×4 kernel: what encoders halve and decoders double with.
pub(super) const HALF: Window = Window {
    kernel: 4,
    stride: 2,
    padding: 1,
};

/// A convolution with its norm; tensors `{name}.conv` and `{name}.norm`.
pub(super) fn conv(
    source: &mut TensorSource<'_>,
    program: &mut Program,
    name: &str,
    window: Window,
    x: Map,
    y: Map,
    residual: Option<Map>,
) {
    let norm = format!("{name}.norm");
    let shape = [y.channels, x.channels];
    let (weight, bias) = source.conv(
        program,
        &format!("{name}.conv"),
        Norm::Batch(&norm),
        shape,
        window.kernel,
    );
    program.push(Op::Conv2d {
        x,
        weight,
        bias,
        window,
        residual,
        activation: Activation::LeakyRelu,
        y,
    });
}

/// A transposed convolution with its norm and ReLU.
pub(super) fn up(source: &mut TensorSource<'_>, program: &mut Program, name: &str, x: Map, y: Map) {
    let norm = format!("{name}.norm");
    let shape = [y.channels, x.channels];
    let (weight, bias) = source.conv_transpose(
        program,
        &format!("{name}.conv"),
        Norm::Batch(&norm),
        shape,
        HALF,
    );
    program.push(Op::ConvTranspose2d {
        x,
        weight,
        bias,
        window: HALF,
        activation: Activation::Relu,
        y,
    });
}

/// The U-Net from `x` down to level `stop`: `2·w_stop` channels.
///
/// `extra` more channels are left at the end of the result for the caller to fill; the view that
/// is returned has them.
pub(super) fn unet(
    source: &mut TensorSource<'_>,
    program: &mut Program,
    config: &UNet,
    x: Map,
    condition: Option<Matrix>,
    stop: usize,
    extra: usize,
) -> Map {
    let (widths, sizes) = (&config.widths, config.sizes(x.height));
    let last = widths.len() - 1;
    // Level i's output is the second half of what the decoder joins there.
    let joined: Vec<Map> = (0..last)
        .map(|i| {
            let more = if i == stop { extra } else { 0 };
            program.map(2 * widths[i] + more, sizes[i], sizes[i])
        })
        .collect();
    let mut from = x;
    for (i, &width) in widths.iter().enumerate() {
        let to = match joined.get(i) {
            Some(map) => map.channels(width, width),
            None => program.map(width, sizes[i], sizes[i]),
        };
        let window = match (i, config.stem) {
            (0, 1) => Window::new(3, 1, 1),
            (0, 4) => Window::new(4, 4, 0),
            _ => HALF,
        };
        conv(
            source,
            program,
            &format!("encoder.{i}"),
            window,
            from,
            to,
            None,
        );
        from = to;
    }
    if let Some(condition) = condition {
        program.push(Op::Broadcast {
            x: condition,
            add: true,
            y: from,
        });
    }
    for j in 0..config.middle {
        let to = program.map(from.channels, from.height, from.width);
        conv(
            source,
            program,
            &format!("middle.{j}"),
            Window::new(3, 1, 1),
            from,
            to,
            Some(from),
        );
        from = to;
    }
    for i in (stop..last).rev() {
        up(
            source,
            program,
            &format!("decoder.{}", i + 1),
            from,
            joined[i].channels(0, widths[i]),
        );
        from = joined[i].channels(0, 2 * widths[i]);
    }
    Map {
        channels: from.channels + extra,
        ..from
    }
}
