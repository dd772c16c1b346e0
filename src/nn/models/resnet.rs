//! ResNet trunks with torchvision's tensor names (stride in the 3×3 convolution).

use crate::nn::config::{StatePaper, Trunk};
use crate::nn::program::{Activation, Extent, Map, Matrix, Op, Program, Window};
use crate::nn::weights::{Norm, TensorSource};

/// A convolution and its norm by torchvision's names.
struct Layer<'a> {
    prefix: &'a str,
    conv: &'a str,
    norm: &'a str,
    window: Window,
    out: usize,
}

impl Layer<'_> {
    fn push(
        &self,
        source: &mut TensorSource<'_>,
        program: &mut Program,
        x: Map,
        residual: Option<Map>,
        activation: Activation,
    ) -> Map {
        let (conv, norm) = (
            format!("{}.{}", self.prefix, self.conv),
            format!("{}.{}", self.prefix, self.norm),
        );
        let shape = [self.out, x.channels];
        let (weight, bias) = source.conv(
            program,
            &conv,
            Norm::Batch(&norm),
            shape,
            self.window.kernel,
        );
        let y = program.map(
            self.out,
            self.window.reduced(x.height),
            self.window.reduced(x.width),
        );
        program.push(Op::Conv2d {
            x,
            weight,
            bias,
            window: self.window,
            residual,
            activation,
            y,
        });
        y
    }
}

/// The trunk, up to the global mean.
pub(super) fn trunk(
    source: &mut TensorSource<'_>,
    program: &mut Program,
    c: &StatePaper,
    x: Map,
) -> Matrix {
    let relu = Activation::Relu;
    let stem = Layer {
        prefix: "trunk",
        conv: "conv1",
        norm: "bn1",
        window: Window::new(7, 2, 3),
        out: c.trunk_widths[0],
    };
    let x = stem.push(source, program, x, None, relu);
    let window = Window::new(3, 2, 1);
    let mut y = program.map(
        x.channels,
        window.reduced(x.height),
        window.reduced(x.width),
    );
    program.push(Op::MaxPool2d { x, window, y });
    for (l, (&width, &blocks)) in c.trunk_widths.iter().zip(&c.trunk_blocks).enumerate() {
        for b in 0..blocks {
            let stride = if l > 0 && b == 0 { 2 } else { 1 };
            y = block(
                source,
                program,
                c.trunk,
                &format!("trunk.layer{}.{b}", l + 1),
                y,
                width,
                stride,
            );
        }
    }
    let mean = program.matrix(Extent::Fixed(1), y.channels);
    program.push(Op::GlobalMeanPool { x: y, y: mean });
    mean
}

/// One residual block.
fn block(
    source: &mut TensorSource<'_>,
    program: &mut Program,
    kind: Trunk,
    prefix: &str,
    x: Map,
    width: usize,
    stride: usize,
) -> Map {
    let (relu, none) = (Activation::Relu, Activation::None);
    let layer = |conv, norm, window, out| Layer {
        prefix,
        conv,
        norm,
        window,
        out,
    };
    let out = if kind == Trunk::Bottleneck {
        4 * width
    } else {
        width
    };
    let shortcut = if stride == 1 && x.channels == out {
        x
    } else {
        let window = Window::new(1, stride, 0);
        layer("downsample.0", "downsample.1", window, out).push(source, program, x, None, none)
    };
    match kind {
        Trunk::Basic => {
            let y = layer("conv1", "bn1", Window::new(3, stride, 1), width)
                .push(source, program, x, None, relu);
            layer("conv2", "bn2", Window::new(3, 1, 1), width).push(
                source,
                program,
                y,
                Some(shortcut),
                relu,
            )
        }
        Trunk::Bottleneck => {
            let y = layer("conv1", "bn1", Window::new(1, 1, 0), width)
                .push(source, program, x, None, relu);
            let y = layer("conv2", "bn2", Window::new(3, stride, 1), width)
                .push(source, program, y, None, relu);
            layer("conv3", "bn3", Window::new(1, 1, 0), out).push(
                source,
                program,
                y,
                Some(shortcut),
                relu,
            )
        }
    }
}
