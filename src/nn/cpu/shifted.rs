//! Convolutions as sums of matrix products with shifted views of a padded input.
//!
//! The input is laid out once with zeros around it (and split by residues of the stride). Then
//! what one tap of the kernel meets, for all output cells in memory order, is one contiguous run
//! of each plane: a matrix product per tap adds it up, and nothing is unfolded. Rows of the
//! padded planes are wider than the output's; the columns between are computed and dropped.

use super::matmul::{Operand, matmul};
use super::views::{MatMut, Planes};

/// Values of results and inputs that are worked on at a time: half a megabyte stays in a core's
/// own cache while one tap after the other passes over it.
const STRIP: usize = 128 * 1024;

/// Padded planes: `planes[((ry * phases + rx) * channels + c) * size ..]` holds, in rows of
/// `width`, the input cells `(stride·q + r − padding)` of channel `c`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Padded {
    pub(super) channels: usize,
    pub(super) height: usize,
    pub(super) width: usize,
    pub(super) stride: usize,
    pub(super) padding: usize,
    /// Residues of the stride that are needed, from 0 on.
    pub(super) phases: usize,
}

impl Padded {
    /// Values of one plane.
    fn size(&self) -> usize {
        self.height * self.width
    }

    /// Values of all planes.
    pub(super) fn len(&self) -> usize {
        self.phases * self.phases * self.channels * self.size()
    }

    /// Lays out the input.
    pub(super) fn fill(&self, x: Planes<'_>, planes: &mut [f32]) {
        let mut lines = planes.chunks_exact_mut(self.width.max(1));
        for phase in 0..self.phases * self.phases {
            let (ry, rx) = (phase / self.phases, phase % self.phases);
            for channel in 0..self.channels {
                let plane = x.channel(channel);
                for q in 0..self.height {
                    let Some(line) = lines.next() else { return };
                    let row = (self.stride * q + ry)
                        .checked_sub(self.padding)
                        .filter(|&iy| iy < x.height);
                    match row {
                        Some(iy) => {
                            let row = &plane[iy * x.width..][..x.width];
                            super::conv2d::copy_line(row, rx, self.stride, self.padding, line);
                        }
                        None => line.fill(0.0),
                    }
                }
            }
        }
    }

    /// Rows of a strip whose results and inputs fit into the cache.
    pub(super) fn strip(&self, out: usize) -> usize {
        (STRIP / ((out + self.channels) * self.width).max(1)).max(1)
    }
}

/// One tap: which part of the planes it meets, and its weights.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tap<'a> {
    /// Residues of the stride.
    pub(super) phase: [usize; 2],
    /// Rows and columns by which it is shifted.
    pub(super) shift: [usize; 2],
    /// The weights, (out, channels).
    pub(super) weight: Operand<'a>,
}

/// `tile = Σ weight · plane shifted`, for `rows` rows of the output from `first` on; `tile` has
/// `out` rows of `rows · width` values.
pub(super) fn sum_of_taps<'a>(
    padded: &Padded,
    planes: &[f32],
    taps: impl Iterator<Item = Tap<'a>>,
    [first, rows, out]: [usize; 3],
    tile: &mut [f32],
    threads: usize,
) {
    let (width, size, channels) = (padded.width, padded.size(), padded.channels);
    for (count, tap) in taps.enumerate() {
        let phase = tap.phase[0] * padded.phases + tap.phase[1];
        let begin = phase * channels * size + (first + tap.shift[0]) * width + tap.shift[1];
        // The last row's dropped columns would reach beyond the planes' end.
        let columns = rows * width - (width - 1).min(tap.shift[1]);
        let run = Operand::new(&planes[begin..], size);
        let y = MatMut {
            data: &mut *tile,
            rows: out,
            columns,
            stride: rows * width,
        };
        matmul(y, tap.weight, run, channels, count > 0, threads);
    }
}
