//! Operations that move values without arithmetic, or nearly so.

use super::views::{Mat, MatMut, Planes, PlanesMut, Scratch, at_least};
use crate::simd::vectorised;

/// Bilinear interpolation, `align_corners = false`: cell `i` of the output has its centre at
/// `(i + ½)·in/out − ½` of the input, and the border's values go on outside.
pub fn upsample(x: Planes<'_>, mut y: PlanesMut<'_>, scratch: &mut Scratch) {
    vectorised!(interpolate(x, y.reborrow(), scratch));
}

#[inline(always)]
fn interpolate(x: Planes<'_>, y: PlanesMut<'_>, scratch: &mut Scratch) {
    let (down, across) = (Axis::new(x.height, y.height), Axis::new(x.width, y.width));
    let Scratch {
        panel,
        tile,
        offsets,
        ..
    } = scratch;
    let wide = at_least(tile, x.height * y.width);
    let shares = at_least(panel, y.width);
    offsets.clear();
    for (j, to) in shares.iter_mut().enumerate() {
        let (j0, j1, share) = across.at(j);
        offsets.extend([j0 as u32, j1 as u32]);
        *to = share;
    }
    for (channel, plane) in y
        .data
        .chunks_exact_mut((y.height * y.width).max(1))
        .enumerate()
    {
        // Along the rows first, once for every row of the input.
        let from = x.channel(channel);
        let lines = wide.chunks_exact_mut(y.width.max(1));
        for (row, line) in from.chunks_exact(x.width.max(1)).zip(lines) {
            let ends = offsets.as_chunks::<2>().0;
            for ((to, &[j0, j1]), &share) in line.iter_mut().zip(ends).zip(&*shares) {
                let (a, b) = (row[j0 as usize], row[j1 as usize]);
                *to = a + (b - a) * share;
            }
        }
        for (i, line) in plane.chunks_exact_mut(y.width.max(1)).enumerate() {
            let (i0, i1, share) = down.at(i);
            let (upper, lower) = (
                &wide[i0 * y.width..][..y.width],
                &wide[i1 * y.width..][..y.width],
            );
            for ((to, &a), &b) in line.iter_mut().zip(upper).zip(lower) {
                *to = a + (b - a) * share;
            }
        }
    }
}

/// Positions along one axis.
struct Axis {
    cells: usize,
    scale: f32,
}

impl Axis {
    fn new(from: usize, to: usize) -> Self {
        Self {
            cells: from,
            scale: from as f32 / to.max(1) as f32,
        }
    }

    /// The two cells that output cell `i` lies between, and the share of the second.
    fn at(&self, i: usize) -> (usize, usize, f32) {
        let place = ((i as f32 + 0.5) * self.scale - 0.5).max(0.0);
        let first = (place as usize).min(self.cells - 1);
        (first, (first + 1).min(self.cells - 1), place - first as f32)
    }
}

/// Value `c` of the row in every cell of channel `c`, or added to what is there.
pub fn broadcast(x: &[f32], add: bool, y: PlanesMut<'_>) {
    let cells = y.height * y.width;
    for (plane, &value) in y.data.chunks_exact_mut(cells.max(1)).zip(x) {
        if add {
            plane.iter_mut().for_each(|v| *v += value);
        } else {
            plane.fill(value);
        }
    }
}

/// `y = x`; a single row of `x` goes to every row of `y`.
pub fn copy_rows(x: Mat<'_>, mut y: MatMut<'_>) {
    for i in 0..y.rows {
        let from = x.row(if x.rows == 1 { 0 } else { i });
        y.row(i).copy_from_slice(from);
    }
}
