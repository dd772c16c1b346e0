//! Rows times weights.

use super::math::{activate, finish};
use super::matmul::{Operand, matmul};
use super::views::{Mat, MatMut};
use crate::nn::program::Activation;

/// `y = activation([x, second] · weightᵀ + bias)`, the two inputs side by side; `weight` has shape
/// (out, in), `bias` (out).
pub fn linear(
    [x, second]: [Option<Mat<'_>>; 2],
    weight: &[f32],
    bias: &[f32],
    activation: Activation,
    mut y: MatMut<'_>,
    threads: usize,
) {
    let inputs = weight.len() / bias.len().max(1);
    let mut first = 0;
    for part in [x, second].into_iter().flatten() {
        let weights = Operand::new(&weight[first..], inputs).transposed();
        matmul(
            y.reborrow(),
            Operand::from_mat(part),
            weights,
            part.columns,
            first > 0,
            threads,
        );
        first += part.columns;
    }
    for i in 0..y.rows {
        let row = y.row(i);
        row.iter_mut().zip(bias).for_each(|(v, b)| *v += b);
        match activation {
            Activation::None => {}
            Activation::Sigmoid => row.iter_mut().for_each(|v| *v = activate(*v, activation)),
            _ => finish(row, 0.0, activation),
        }
    }
}
