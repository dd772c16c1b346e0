//! Between regions, transitions and cells.

use super::math::sum;
use super::matmul::{Operand, matmul};
use super::views::{Mat, MatMut, Planes, PlanesMut};
use crate::nn::program::Sign;

impl Sign {
    /// Whether a literal has this sign.
    #[must_use]
    pub fn matches(self, literal: f32) -> bool {
        match self {
            Self::Positive => literal > 0.0,
            Self::Negative => literal < 0.0,
        }
    }
}

/// Row `i` of `y` is the mean of `x` over the cells, weighted by channel `i` of `mask`; zero where
/// the channel is empty.
pub fn region_mean(x: Planes<'_>, mask: Planes<'_>, mut y: MatMut<'_>) {
    let cells = x.height * x.width;
    let features = Operand::new(x.data, cells).transposed();
    matmul(
        y.reborrow(),
        Operand::new(mask.data, cells),
        features,
        cells,
        false,
        1,
    );
    for i in 0..y.rows {
        let weight = sum(mask.channel(i));
        let scale = if weight > 0.0 { 1.0 / weight } else { 0.0 };
        y.row(i).iter_mut().for_each(|v| *v *= scale);
    }
}

/// For each row of `literals` the mean of the rows of `x` whose entry has the sign, zero if none.
pub fn sign_mean(literals: Mat<'_>, x: Mat<'_>, sign: Sign, mut y: MatMut<'_>) {
    for t in 0..y.rows {
        let chosen = literals
            .row(t)
            .iter()
            .enumerate()
            .filter(|&(_, &e)| sign.matches(e));
        mean_of(chosen.map(|(region, _)| x.row(region)), y.row(t));
    }
}

/// For each column of `literals` the mean of the rows of `x` whose entry has the sign, zero if none.
pub fn region_form(literals: Mat<'_>, x: Mat<'_>, sign: Sign, mut y: MatMut<'_>) {
    for region in 0..y.rows {
        let chosen = (0..literals.rows).filter(|&t| sign.matches(literals.row(t)[region]));
        mean_of(chosen.map(|t| x.row(t)), y.row(region));
    }
}

fn mean_of<'a>(rows: impl Iterator<Item = &'a [f32]>, mean: &mut [f32]) {
    mean.fill(0.0);
    let mut count = 0u32;
    for row in rows {
        count += 1;
        mean.iter_mut().zip(row).for_each(|(sum, v)| *sum += v);
    }
    if count > 1 {
        let scale = 1.0 / count as f32;
        mean.iter_mut().for_each(|v| *v *= scale);
    }
}

/// `Σ mask_i ⊗ colour_i`: (labels, R, R) × (labels, K) → (K, R, R).
pub fn paint(mask: Planes<'_>, colour: Mat<'_>, y: PlanesMut<'_>) {
    let cells = y.height * y.width;
    let out = MatMut::new(y.data, y.channels, cells);
    let colours = Operand::from_mat(colour).transposed();
    matmul(
        out,
        colours,
        Operand::new(mask.data, cells),
        mask.channels,
        false,
        1,
    );
}
