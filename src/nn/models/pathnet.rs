//! PathNet: where good paths run.

use super::automaton::{LayerInput, PLANES, graph_feature, look, plain_widths, stack};
use super::unet::{HALF, conv, unet, up};
use crate::nn::config::{Fusion, PathPaint, PathPaper, Skip};
use crate::nn::program::{Activation, Extent, Map, Matrix, Op, Program, Sign, Source, Window};
use crate::nn::weights::{Norm, TensorSource};

/// The last convolution: 1×1 to one channel, sigmoid.
fn head(source: &mut TensorSource<'_>, program: &mut Program, x: Map) -> Map {
    let (weight, bias) = source.conv(program, "head", Norm::Bias, [1, x.channels], 1);
    let y = program.map(1, x.height, x.width);
    let (window, activation) = (Window::new(1, 1, 0), Activation::Sigmoid);
    program.push(Op::Conv2d {
        x,
        weight,
        bias,
        window,
        residual: None,
        activation,
        y,
    });
    y
}

/// A linear layer without activation, written to `y`.
fn project(source: &mut TensorSource<'_>, program: &mut Program, name: &str, x: Matrix, y: Matrix) {
    let (weight, bias) = source.linear(program, name, y.columns, x.columns);
    program.push(Op::Linear {
        x,
        second: None,
        weight,
        bias,
        activation: Activation::None,
        y,
    });
}

/// A linear layer whose values are the same in every cell of `y`.
fn project_broadcast(
    source: &mut TensorSource<'_>,
    program: &mut Program,
    name: &str,
    x: Matrix,
    y: Map,
) {
    let values = program.matrix(Extent::Fixed(1), y.channels);
    project(source, program, name, x, values);
    program.push(Op::Broadcast {
        x: values,
        add: false,
        y,
    });
}

/// `variant: "paper"` (`nngtl.md`, IV-C).
pub(super) fn paper(source: &mut TensorSource<'_>, program: &mut Program, c: &PathPaper) {
    let input = LayerInput::new(program, plain_widths(c.labels), false);
    input.plain(program, c.labels);
    let after = stack(source, program, input, &c.graph);
    let feature = graph_feature(program, after[after.len() - 1]);

    let sizes: Vec<usize> = std::iter::successors(Some(c.resolution), |&s| Some(HALF.reduced(s)))
        .take(6)
        .collect();
    let widths: Vec<usize> = (0..5).map(|i| c.n1 << i).collect();
    let third = c.skip == Skip::Third;
    // What the first and the third decoder block read, with room for what is joined there.
    let bottleneck = program.map(2 * widths[4], sizes[5], sizes[5]);
    let middle = program.map(
        widths[3] + if third { 2 * widths[2] } else { 0 },
        sizes[3],
        sizes[3],
    );

    let mut x = program.map(1 + c.labels, c.resolution, c.resolution);
    program.input(Source::Raster, x.as_matrix());
    for (i, &width) in widths.iter().enumerate() {
        let y = match i {
            2 if third => middle.channels(widths[3], width),
            4 => bottleneck.channels(0, width),
            _ => program.map(width, sizes[i + 1], sizes[i + 1]),
        };
        conv(source, program, &format!("encoder.{i}"), HALF, x, y, None);
        x = y;
    }
    let fused = bottleneck.channels(widths[4], widths[4]);
    match c.fusion {
        Fusion::Dense => project(source, program, "fusion", feature, fused.as_row()),
        Fusion::Broadcast => project_broadcast(source, program, "fusion", feature, fused),
    }
    if third {
        let feature = graph_feature(program, after[2]);
        let y = middle.channels(widths[3] + widths[2], widths[2]);
        project_broadcast(source, program, "skip", feature, y);
    }
    let mut x = bottleneck;
    for (i, &width) in widths.iter().rev().enumerate() {
        let y = if i == 1 {
            middle.channels(0, width)
        } else {
            program.map(width, sizes[4 - i], sizes[4 - i])
        };
        up(source, program, &format!("decoder.{i}"), x, y);
        x = if i == 1 { middle } else { y };
    }
    let y = head(source, program, x);
    program.output = Some(y.as_row());
}

/// `variant: "paint"`.
pub(super) fn paint(source: &mut TensorSource<'_>, program: &mut Program, c: &PathPaint) {
    let input = if c.look > 0 {
        let planes = program.map(PLANES, c.look, c.look);
        look(program, planes, c.labels, c.reverse)
    } else {
        let input = LayerInput::new(program, plain_widths(c.labels), c.reverse);
        input.plain(program, c.labels);
        input
    };
    let literals = input.own().transition.columns(0, c.labels);
    let after = stack(source, program, input, &c.graph);
    let nodes = after[after.len() - 1];
    let feature = graph_feature(program, nodes);

    let width = nodes.transition.columns;
    let forms = program.matrix(Extent::Fixed(c.labels), 2 * width);
    for (k, sign) in [Sign::Positive, Sign::Negative].into_iter().enumerate() {
        let y = forms.columns(k * width, width);
        program.push(Op::RegionForm {
            literals,
            x: nodes.transition,
            sign,
            y,
        });
    }
    let colour = program.matrix(Extent::Fixed(c.labels), c.embedding);
    let parts = [("paint.need.weight", width), ("paint.forbid.weight", width)];
    let (weight, bias) = source.summed(program, &parts, "paint.bias", c.embedding);
    program.push(Op::Linear {
        x: forms,
        second: None,
        weight,
        bias,
        activation: Activation::Relu,
        y: colour,
    });

    let side = c.resolution;
    let x = program.map(2 + c.embedding, side, side);
    program.input(Source::Obstacles, x.channels(0, 1).as_matrix());
    program.input(Source::Start, x.channels(1, 1).as_matrix());
    let mask = program.map(c.labels, side, side);
    program.input(Source::Regions, mask.as_matrix());
    program.push(Op::Paint {
        mask,
        colour,
        y: x.channels(2, c.embedding),
    });

    let deepest = c.unet.widths[c.unet.widths.len() - 1];
    let condition = program.matrix(Extent::Fixed(1), deepest);
    project(source, program, "condition", feature, condition);
    let x = unet(source, program, &c.unet, x, Some(condition), 0, 0);
    let finest = if c.unet.stem == 4 { side / 2 } else { side };
    let y = program.map(c.top, finest, finest);
    if c.unet.stem == 1 {
        let norm = Norm::Batch("top.norm");
        let (weight, bias) = source.conv(program, "top.conv", norm, [c.top, x.channels], 3);
        let (window, activation) = (Window::new(3, 1, 1), Activation::Relu);
        program.push(Op::Conv2d {
            x,
            weight,
            bias,
            window,
            residual: None,
            activation,
            y,
        });
    } else {
        up(source, program, "top", x, y);
    }
    let y = head(source, program, y);
    let output = if finest == c.output {
        y
    } else {
        let full = program.map(1, c.output, c.output);
        program.push(Op::Upsample { x: y, y: full });
        full
    };
    program.output = Some(output.as_row());
}
