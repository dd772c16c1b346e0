//! Rows times weights.

use super::math::{activate, finish};
use super::product::{LANES, PANEL, Product};
use super::views::{Mat, MatMut, Scratch, at_least};
use crate::nn::program::Activation;

/// `y = activation([x, second] · weightᵀ + bias)`, the two inputs side by side; `weight` in the
/// layout of the operation, `bias` (out).
pub fn linear(
    [x, second]: [Option<Mat<'_>>; 2],
    weight: &[f32],
    bias: &[f32],
    activation: Activation,
    mut y: MatMut<'_>,
    scratch: &mut Scratch,
) {
    let out = bias.len();
    let stride = out.next_multiple_of(LANES);
    let inputs = weight.len() / stride.max(1);
    let Scratch {
        panel,
        tile,
        offsets,
        ..
    } = scratch;
    // Here the rows are the left matrix, and weights the right one.
    let left = at_least(panel, y.rows.next_multiple_of(PANEL) * inputs);
    let mut first = 0;
    for part in [x, second].into_iter().flatten() {
        pack(part, left, inputs, first);
        first += part.columns;
    }
    offsets.clear();
    offsets.extend((0..inputs).map(|k| (k * stride) as u32));
    let tile = at_least(tile, y.rows.next_multiple_of(PANEL) * stride);
    let product = Product {
        left,
        offsets,
        right: weight,
        rows: y.rows,
        columns: out,
    };
    product.run(tile, stride);
    for (i, values) in tile.chunks_exact(stride).take(y.rows).enumerate() {
        let row = y.row(i);
        row.iter_mut()
            .zip(values)
            .zip(bias)
            .for_each(|((to, v), b)| *to = v + b);
        match activation {
            Activation::None => {}
            Activation::Sigmoid => row.iter_mut().for_each(|v| *v = activate(*v, activation)),
            _ => finish(row, 0.0, activation),
        }
    }
}

/// Packs the rows of `x` into panels of depth `inputs`, from depth `first` on.
fn pack(x: Mat<'_>, panels: &mut [f32], inputs: usize, first: usize) {
    for i in 0..x.rows {
        let panel = &mut panels[(i / PANEL * inputs + first) * PANEL..];
        let lanes = panel.as_chunks_mut::<PANEL>().0;
        for (lane, &value) in lanes.iter_mut().zip(x.row(i)) {
            lane[i % PANEL] = value;
        }
    }
}
