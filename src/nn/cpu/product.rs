//! The product that convolutions and linear layers are made of.
//!
//! The left matrix comes in panels of eight rows, packed when weights are loaded. The right one is
//! not packed at all: each of its rows is a run of some buffer, told by where it begins. So what
//! the taps of a kernel meet of a padded input is multiplied where it stands (an implicit matrix
//! product), and sums stay in registers over the whole depth. The loops follow Goto and van de
//! Geijn, *Anatomy of high-performance matrix multiplication* (2008), section 4, without the
//! packing of the right matrix. Instructions are chosen when the program runs (crate `pulp`).

use pulp::{Arch, Simd, WithSimd};

/// Rows of a panel.
pub const PANEL: usize = 8;

/// Columns are computed in vectors of at most this many values: right matrices need that much
/// room beyond their end, and results have rows of a multiple of it.
pub const LANES: usize = 16;

/// Depth of a block: its panel, 16 KiB, stays in the first cache while the columns pass by.
const DEPTH: usize = 512;

/// `y = a · b`.
#[derive(Debug)]
pub(super) struct Product<'a> {
    /// The left matrix (rows, depth) in panels: shape (⌈rows / [`PANEL`]⌉, depth, [`PANEL`]).
    pub(super) left: &'a [f32],
    /// Where each row of the right matrix begins, in `right`.
    pub(super) offsets: &'a [u32],
    /// The values that rows of the right matrix are runs of; some may begin before others end.
    pub(super) right: &'a [f32],
    /// The number of rows.
    pub(super) rows: usize,
    /// The number of columns.
    pub(super) columns: usize,
}

impl Product<'_> {
    /// Computes the product: row `i` of the result begins at `i * stride` of `y`.
    ///
    /// Of each row the columns are written, and others up to the next multiple of [`LANES`] may be.
    ///
    /// # Panics
    /// If a slice is shorter than that needs.
    pub(super) fn run(self, y: &mut [f32], stride: usize) {
        debug_assert!(self.columns.next_multiple_of(LANES) <= stride || self.rows <= 1);
        if self.offsets.is_empty() {
            for row in y.chunks_mut(stride.max(1)).take(self.rows) {
                row[..self.columns].fill(0.0);
            }
            return;
        }
        Arch::new().dispatch(Blocks {
            product: self,
            y,
            stride,
        });
    }
}

struct Blocks<'a> {
    product: Product<'a>,
    y: &'a mut [f32],
    stride: usize,
}

impl WithSimd for Blocks<'_> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) {
        let Self { product, y, stride } = self;
        let depth = product.offsets.len();
        let height = if S::REGISTER_COUNT >= 32 { PANEL } else { 6 };
        for first in (0..product.rows).step_by(height) {
            let panels = &product.left[first / PANEL * PANEL * depth..];
            let (upper, rest) = panels.split_at(PANEL * depth);
            // Where there is no next panel no row is of it.
            let lower = rest.get(..PANEL * depth).unwrap_or(upper);
            let blocks = upper.chunks(DEPTH * PANEL).zip(lower.chunks(DEPTH * PANEL));
            for (block, (left, offsets)) in blocks.zip(product.offsets.chunks(DEPTH)).enumerate() {
                let tile = Tile {
                    left: left.into(),
                    offsets,
                    right: product.right,
                    columns: product.columns,
                    add: block > 0,
                    stride,
                };
                let (y, rows) = (&mut y[first * stride..], product.rows - first);
                match first % PANEL {
                    0 => tile.rows::<S, 0>(simd, y, rows),
                    2 => tile.rows::<S, 2>(simd, y, rows),
                    4 => tile.rows::<S, 4>(simd, y, rows),
                    _ => tile.rows::<S, 6>(simd, y, rows),
                }
            }
        }
    }
}

/// Some rows of the left matrix times a block of the right one.
#[derive(Clone, Copy)]
struct Tile<'a> {
    /// The panel that the first row is of, and the next one.
    left: [&'a [f32]; 2],
    offsets: &'a [u32],
    right: &'a [f32],
    columns: usize,
    /// Whether to add to the result.
    add: bool,
    stride: usize,
}

impl Tile<'_> {
    /// As many rows as registers hold the sums of, at most `rows`, from row `FROM` of the panel on. With 32 registers that is a panel
    /// by three vectors. With sixteen six rows by two: four by three would just fit, but compilers keep some of these sums in memory,
    /// which takes twice as long. Six rows may be of two panels.
    #[inline(always)]
    fn rows<S: Simd, const FROM: usize>(self, simd: S, y: &mut [f32], rows: usize) {
        let many = S::REGISTER_COUNT >= 32;
        match rows {
            1 => self.strips::<S, FROM, 1, 6>(simd, y),
            2 if !many => self.strips::<S, FROM, 2, 4>(simd, y),
            2..=4 if many => self.strips::<S, FROM, 4, 3>(simd, y),
            2..=4 => self.strips::<S, FROM, 4, 2>(simd, y),
            _ if many => self.strips::<S, FROM, 8, 3>(simd, y),
            _ => self.strips::<S, FROM, 6, 2>(simd, y),
        }
    }

    /// `ROWS` rows; all columns, `WIDEST` vectors at a time.
    #[inline(always)]
    fn strips<S: Simd, const FROM: usize, const ROWS: usize, const WIDEST: usize>(
        self,
        simd: S,
        y: &mut [f32],
    ) {
        let vectors = self.columns.div_ceil(S::F32_LANES);
        let mut done = 0;
        while done < vectors {
            let column = done * S::F32_LANES;
            done += match vectors - done {
                1 => self.strip::<S, FROM, ROWS, 1>(simd, y, column),
                // Four by threes are two and two: a single vector's products wait for their factors.
                4 if WIDEST == 3 => self.strip::<S, FROM, ROWS, 2>(simd, y, column),
                left if left >= WIDEST => self.strip::<S, FROM, ROWS, WIDEST>(simd, y, column),
                _ => self.strip::<S, FROM, ROWS, 2>(simd, y, column),
            };
        }
    }

    /// `VECTORS` vectors of columns; returns their number.
    #[inline(always)]
    fn strip<S: Simd, const FROM: usize, const ROWS: usize, const VECTORS: usize>(
        self,
        simd: S,
        y: &mut [f32],
        column: usize,
    ) -> usize {
        let width = VECTORS * S::F32_LANES;
        let mut sums = [[simd.splat_f32s(0.0); VECTORS]; ROWS];
        let right = &self.right[column..];
        let [upper, lower] = self.left.map(|panel| panel.as_chunks::<PANEL>().0);
        for ((upper, lower), &offset) in upper.iter().zip(lower).zip(self.offsets) {
            let run = &right[offset as usize..][..width];
            let run = S::as_simd_f32s(run).0;
            let values: [S::f32s; VECTORS] = std::array::from_fn(|j| run[j]);
            for (i, sums) in sums.iter_mut().enumerate() {
                let row = FROM + i;
                let factor = if row < PANEL {
                    upper[row]
                } else {
                    lower[row - PANEL]
                };
                let factor = simd.splat_f32s(factor);
                for (sum, &value) in sums.iter_mut().zip(&values) {
                    *sum = simd.mul_add_e_f32s(factor, value, *sum);
                }
            }
        }
        for (i, sums) in sums.iter().enumerate() {
            let row = &mut y[i * self.stride + column..][..width];
            let row = S::as_mut_simd_f32s(row).0;
            for (to, &sum) in row.iter_mut().zip(sums) {
                *to = if self.add {
                    simd.add_f32s(*to, sum)
                } else {
                    sum
                };
            }
        }
        VECTORS
    }
}

/// Packs a matrix (rows, depth), given by its elements, into panels; rows beyond the last are 0.
pub(super) fn fill_panels(
    packed: &mut [f32],
    rows: usize,
    depth: usize,
    element: impl Fn(usize, usize) -> f32,
) {
    for (panel, values) in packed.chunks_exact_mut((depth * PANEL).max(1)).enumerate() {
        let first = panel * PANEL;
        let filled = rows.saturating_sub(first).min(PANEL);
        for (k, lane) in values.as_chunks_mut::<PANEL>().0.iter_mut().enumerate() {
            for (i, to) in lane.iter_mut().enumerate() {
                *to = if i < filled {
                    element(first + i, k)
                } else {
                    0.0
                };
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn panels(rows: usize, depth: usize, element: impl Fn(usize, usize) -> f32) -> Vec<f32> {
        let mut packed = vec![0.0; rows.next_multiple_of(PANEL) * depth];
        fill_panels(&mut packed, rows, depth, element);
        packed
    }

    #[test]
    fn products_of_all_shapes_match_the_definition() {
        let value = |i: usize| ((i * 37 + 11) % 23) as f32 - 11.0;
        for rows in [1, 2, 3, 4, 5, 6, 8, 9, 12, 17, 22, 24, 27] {
            for columns in [1, 15, 16, 17, 48, 49, 97, 130] {
                for depth in [0, 1, 3, 513, 1030] {
                    let left = panels(rows, depth, |i, k| value(i * 31 + k * 7));
                    // Rows overlap, as those of shifted maps do.
                    let offsets: Vec<u32> = (0..depth).map(|k| (k * 5 % 64) as u32).collect();
                    let right: Vec<f32> = (0..64 + columns + LANES).map(value).collect();
                    let stride = columns.next_multiple_of(LANES);
                    let mut y = vec![f32::NAN; rows * stride + 7 * stride];
                    let product = Product {
                        left: &left,
                        offsets: &offsets,
                        right: &right,
                        rows,
                        columns,
                    };
                    product.run(&mut y, stride);
                    for i in [0, rows / 2, rows - 1] {
                        for j in [0, columns / 2, columns - 1] {
                            let exact: f32 = (0..depth)
                                .map(|k| value(i * 31 + k * 7) * right[offsets[k] as usize + j])
                                .sum();
                            assert_eq!(y[i * stride + j], exact, "{rows} {columns} {depth}");
                        }
                    }
                }
            }
        }
    }
}
