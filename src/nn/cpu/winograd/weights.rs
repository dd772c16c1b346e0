//! Kernels as products meet them.

use super::super::product::PANEL;
use super::Winograd;

/// A value for each row of a panel.
type Lane = [f32; PANEL];

impl Winograd {
    /// From the layout of the operation to matrices (out, inputs) in panels, one for each residue of an output's row and
    /// column and each pair of points, in this order.
    pub(super) fn weights(&self, weight: &[f32], channels: usize, out: usize) -> Vec<f32> {
        let (taps, points) = (self.form.taps, self.form.points());
        let (kernel, squared) = (taps * self.stride, self.stride * self.stride);
        let depth = channels * squared;
        let panels = out.div_ceil(PANEL);
        let matrices = self.residues * self.residues * points * points;
        let mut values = vec![0.0; matrices * panels * depth * PANEL];
        let lanes = values.as_chunks_mut::<PANEL>().0;
        let kernels = weight.as_chunks::<PANEL>().0.chunks_exact(kernel * kernel);
        for (n, kernel_lanes) in kernels.enumerate() {
            let (residues, channel) = (n / channels / panels, n % channels);
            let panel = n / channels % panels;
            for residue in 0..squared {
                let (ry, rx) = (residue / self.stride, residue % self.stride);
                let tap = |i: usize, j: usize| {
                    // Later taps of a transposed convolution meet earlier cells.
                    let [i, j] = [i, j].map(|i| if self.transposed { taps - 1 - i } else { i });
                    &kernel_lanes[(self.stride * i + ry) * kernel + self.stride * j + rx]
                };
                for point in 0..points * points {
                    let [a, b] = [point / points, point % points].map(|p| factors(taps, p));
                    let matrix = residues * points * points + point;
                    let row = (matrix * panels + panel) * depth + channel * squared + residue;
                    lanes[row] = weighted(taps, a, b, tap);
                }
            }
        }
        values
    }
}

/// What a point's product takes of each tap.
fn factors(taps: usize, point: usize) -> [f32; 3] {
    match (taps, point) {
        (_, 0) => [1.0, 0.0, 0.0],
        (2, 1) => [1.0, 1.0, 0.0],
        (2, _) => [0.0, 1.0, 0.0],
        (_, 1) => [0.5, 0.5, 0.5],
        (_, 2) => [0.5, -0.5, 0.5],
        _ => [0.0, 0.0, 1.0],
    }
}

fn weighted<'a>(
    taps: usize,
    a: [f32; 3],
    b: [f32; 3],
    tap: impl Fn(usize, usize) -> &'a Lane,
) -> Lane {
    let mut sum = [0.0; PANEL];
    for (i, a) in a.iter().enumerate().take(taps) {
        for (j, b) in b.iter().enumerate().take(taps) {
            let factor = a * b;
            if factor != 0.0 {
                let pairs = sum.iter_mut().zip(tap(i, j));
                pairs.for_each(|(sum, w)| *sum += factor * w);
            }
        }
    }
    sum
}
