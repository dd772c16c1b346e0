//! StateNet: which automaton states good paths visit.

use super::automaton::{LayerInput, PLANES, PerType, look, plain_widths, see, stack};
use super::{resnet, unet::unet};
use crate::nn::config::{StateLookup, StatePaper, StateWays};
use crate::nn::program::{Activation, Extent, Matrix, Op, Program, Source, Window};
use crate::nn::weights::{Norm, TensorSource};

/// Width of the hidden layer of the paper's head.
const PAPER_HEAD: usize = 256;

/// Two linear layers on the states; the last of `logits` values becomes the probability.
fn head(
    source: &mut TensorSource<'_>,
    program: &mut Program,
    states: Matrix,
    hidden: usize,
    logits: usize,
) {
    let (weight, bias) = source.linear(program, "head.0", hidden, states.columns);
    let y = program.matrix(Extent::States, hidden);
    program.push(Op::Linear {
        x: states,
        second: None,
        weight,
        bias,
        activation: Activation::Relu,
        y,
    });
    let (weight, bias) = source.last_row(program, "head.1", logits, hidden);
    let output = program.matrix(Extent::States, 1);
    program.push(Op::Linear {
        x: y,
        second: None,
        weight,
        bias,
        activation: Activation::Sigmoid,
        y: output,
    });
    program.output = Some(output);
}

/// `variant: "paper"` (`nngtl.md`, IV-C).
pub(super) fn paper(source: &mut TensorSource<'_>, program: &mut Program, c: &StatePaper) {
    let raster = program.map(1 + c.labels, c.resolution, c.resolution);
    program.input(Source::Raster, raster.as_matrix());
    let (weight, bias) = source.conv(program, "squeeze", Norm::Bias, [3, raster.channels], 1);
    let squeezed = program.map(3, c.resolution, c.resolution);
    let (window, activation) = (Window::new(1, 1, 0), Activation::None);
    program.push(Op::Conv2d {
        x: raster,
        weight,
        bias,
        window,
        residual: None,
        activation,
        y: squeezed,
    });
    let mean = resnet::trunk(source, program, c, squeezed);
    let feature = program.matrix(Extent::Fixed(1), c.map_feature);
    let (weight, bias) = source.linear(program, "project", c.map_feature, mean.columns);
    program.push(Op::Linear {
        x: mean,
        second: None,
        weight,
        bias,
        activation,
        y: feature,
    });

    let input = LayerInput::new(program, plain_widths(c.labels), false);
    input.plain(program, c.labels);
    let next = LayerInput::new(program, PerType::same(c.first + c.map_feature), false);
    let PerType {
        state,
        transition,
        pool,
    } = next.own();
    let first = |m: Matrix| m.columns(0, c.first);
    let to = PerType {
        state: first(state),
        transition: first(transition),
        pool: first(pool),
    };
    let activation = if c.first_relu {
        Activation::Relu
    } else {
        Activation::None
    };
    input.layer(source, program, "first", activation, to);
    for nodes in [state, transition, pool] {
        let y = nodes.columns(c.first, c.map_feature);
        program.push(Op::RepeatRow { x: feature, y });
    }
    let after = stack(source, program, next, &c.graph);
    head(source, program, after[after.len() - 1].state, PAPER_HEAD, 2);
}

/// `variant: "lookup"`.
pub(super) fn lookup(source: &mut TensorSource<'_>, program: &mut Program, c: &StateLookup) {
    let side = c.resolution;
    let x = program.map(3, side, side);
    for (k, input) in [Source::Obstacles, Source::Start, Source::AnyRegion]
        .into_iter()
        .enumerate()
    {
        program.input(input, x.channels(k, 1).as_matrix());
    }
    let features = unet(source, program, &c.unet, x, None, c.stop, PLANES);
    let input = look(program, features, c.labels, c.reverse);
    let after = stack(source, program, input, &c.graph);
    head(source, program, after[after.len() - 1].state, c.head, 1);
}

/// `variant: "ways"`.
pub(super) fn ways(source: &mut TensorSource<'_>, program: &mut Program, c: &StateWays) {
    let rows = program.matrix(Extent::Fixed(c.labels + 1), c.labels + 1);
    program.input(Source::Ways, rows);
    let input = see(program, rows, c.labels, c.reverse);
    let after = stack(source, program, input, &c.graph);
    head(source, program, after[after.len() - 1].state, c.head, 1);
}
