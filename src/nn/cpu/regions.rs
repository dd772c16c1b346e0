//! Between regions, transitions and cells.

use super::math::sum;
use super::product::{LANES, PANEL, Product, fill_panels};
use super::views::{Mat, MatMut, Planes, PlanesMut, Scratch, at_least};
use crate::nn::program::Sign;

/// Cells that are painted at a time.
const STRIP: usize = 128 * LANES;

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
pub fn region_mean(x: Planes<'_>, mask: Planes<'_>, mut y: MatMut<'_>, scratch: &mut Scratch) {
    for i in 0..y.rows {
        // Regions are small: few cells count.
        let mask = mask.channel(i);
        let cells = &mut scratch.offsets;
        cells.clear();
        cells.extend((0..).zip(mask).filter(|&(_, &m)| m != 0.0).map(|(k, _)| k));
        let weight = sum(mask);
        let scale = if weight > 0.0 { 1.0 / weight } else { 0.0 };
        for (channel, to) in y.row(i).iter_mut().enumerate() {
            let plane = x.channel(channel);
            let products = cells.iter().map(|&k| mask[k as usize] * plane[k as usize]);
            *to = products.sum::<f32>() * scale;
        }
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
///
/// # Panics
/// If there is no room behind the mask's values ([`LANES`]).
pub fn paint(mask: Planes<'_>, colour: Mat<'_>, y: PlanesMut<'_>, scratch: &mut Scratch) {
    assert!(mask.has_room(), "a product reads beyond its values");
    let cells = y.height * y.width;
    let Scratch {
        panel,
        tile,
        offsets,
        ..
    } = scratch;
    let left = at_least(panel, y.channels.next_multiple_of(PANEL) * mask.channels);
    fill_panels(left, y.channels, mask.channels, |k, label| {
        colour.row(label)[k]
    });
    offsets.clear();
    offsets.extend((0..mask.channels).map(|label| (label * cells) as u32));
    let tile = at_least(tile, y.channels.next_multiple_of(PANEL) * STRIP);
    for first in (0..cells).step_by(STRIP) {
        let columns = STRIP.min(cells - first);
        let product = Product {
            left,
            offsets,
            right: &mask.data[first..],
            rows: y.channels,
            columns,
        };
        product.run(tile, STRIP);
        for (values, plane) in tile.chunks_exact(STRIP).zip(y.data.chunks_exact_mut(cells)) {
            plane[first..first + columns].copy_from_slice(&values[..columns]);
        }
    }
}
