//! Inputs of convolutions, laid out so that a tap meets contiguous runs of them.
//!
//! The input is copied once with zeros around it, split by residues of the stride. Then what one
//! tap of the kernel meets of one channel, for all output cells in memory order, is a run that
//! begins at some place. Rows of the padded planes are wider than the output's; the columns
//! between are computed and dropped.

use super::product::LANES;
use super::views::Planes;
use crate::simd::vectorised;

/// Values of results and inputs that are worked on at a time: a quarter of a megabyte stays in a
/// core's own cache while one panel of weights after the other passes over it.
const STRIP: usize = 64 * 1024;

/// Columns of a strip, at least where there are as many: each weight that comes from memory is used
/// for so many cells. Layers of few cells have more weights than any cache holds, which would
/// else come anew for every two or three rows.
const LEAST_COLUMNS: usize = 192;

/// Padded planes: `planes[((c * phases + ry) * phases + rx) * size ..]` holds, in rows of
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

    /// Values of all planes, and the room that products need beyond them.
    pub(super) fn len(&self) -> usize {
        self.channels * self.phases * self.phases * self.size() + LANES
    }

    /// Lays out the input.
    pub(super) fn fill(&self, x: Planes<'_>, planes: &mut [f32]) {
        vectorised!(self.copy(x, planes));
    }

    #[inline(always)]
    fn copy(&self, x: Planes<'_>, planes: &mut [f32]) {
        let mut lines = planes.chunks_exact_mut(self.width.max(1));
        for channel in 0..self.channels {
            let plane = x.channel(channel);
            for phase in 0..self.phases * self.phases {
                let (ry, rx) = (phase / self.phases, phase % self.phases);
                for q in 0..self.height {
                    let Some(line) = lines.next() else { return };
                    let row = (self.stride * q + ry)
                        .checked_sub(self.padding)
                        .filter(|&iy| iy < x.height);
                    match row {
                        Some(iy) => {
                            let row = &plane[iy * x.width..][..x.width];
                            copy_line(row, rx, self.stride, self.padding, line);
                        }
                        None => line.fill(0.0),
                    }
                }
            }
        }
    }

    /// Where the runs begin that taps meet, channel by channel: `taps` are [`Self::tap`]s.
    pub(super) fn offsets(&self, taps: impl Iterator<Item = u32> + Clone, offsets: &mut Vec<u32>) {
        offsets.clear();
        let all = (self.phases * self.phases * self.size()) as u32;
        for channel in 0..self.channels as u32 {
            offsets.extend(taps.clone().map(|tap| channel * all + tap));
        }
    }

    /// Where the run begins that a tap meets of the first channel, by its residue of the stride
    /// and by how many rows and columns it is shifted.
    pub(super) fn tap(&self, phase: [usize; 2], shift: [usize; 2]) -> u32 {
        let plane = phase[0] * self.phases + phase[1];
        (plane * self.size() + shift[0] * self.width + shift[1]) as u32
    }

    /// Rows of each strip of an output of `out` channels and `height` rows.
    pub(super) fn strip(&self, out: usize, height: usize) -> usize {
        let inputs = self.channels * self.phases * self.phases;
        strip(out + inputs, self.width, height)
    }

    /// Columns of the product that gives `rows` rows of an output that is `width` wide: what is
    /// dropped behind the last row is not computed.
    pub(super) fn columns(&self, rows: usize, width: usize) -> usize {
        rows * self.width - (self.width - width)
    }
}

/// Rows at a time, of `height` rows of `width` cells with so many results and inputs each: they fit
/// into the cache, unless the weights would pass through it too often.
pub(super) fn strip(values: usize, width: usize, height: usize) -> usize {
    let fitting = STRIP / (values * width).max(1);
    let enough = LEAST_COLUMNS.div_ceil(width.max(1));
    let rows = fitting.max(enough).clamp(1, height.max(1));
    // Strips of equal size.
    height.div_ceil(height.div_ceil(rows).max(1)).max(1)
}

/// `line[o] = row[o·stride + tap − padding]`, 0 outside the row.
#[inline(always)]
fn copy_line(row: &[f32], tap: usize, stride: usize, padding: usize, line: &mut [f32]) {
    let begin = padding.saturating_sub(tap).div_ceil(stride).min(line.len());
    let end = (row.len() + padding)
        .saturating_sub(tap)
        .div_ceil(stride)
        .clamp(begin, line.len());
    line[..begin].fill(0.0);
    line[end..].fill(0.0);
    if begin == end {
        return;
    }
    let from = &row[begin * stride + tap - padding..];
    let line = &mut line[begin..end];
    match stride {
        1 => line.copy_from_slice(&from[..line.len()]),
        2 => {
            // Pairs vectorise; the last one may lack its second half.
            let (last, head) = line.split_last_mut().expect("begin < end");
            *last = from[2 * head.len()];
            head.iter_mut()
                .zip(from.as_chunks::<2>().0)
                .for_each(|(to, pair)| *to = pair[0]);
        }
        _ => line
            .iter_mut()
            .zip(from.iter().step_by(stride))
            .for_each(|(to, &v)| *to = v),
    }
}
