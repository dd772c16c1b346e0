//! Sharing out the channels of a result among threads.

use rayon::prelude::*;

use super::product::PANEL;
use super::views::PlanesMut;

/// Below this many multiply-adds one thread is faster than several (some tenths of a millisecond
/// of work, against the tens of microseconds that waking threads takes).
const MULTIPLY_ADDS_PER_THREAD: usize = 20_000_000;

/// Runs `work` on groups of channels of `y`, whole panels of them, with at most `threads` threads
/// where that pays for a layer of so many multiply-adds. Work is handed the number of its first channel, its channels, and memory
/// for itself, one of `tiles`, which is kept from one run to the next.
pub(super) fn share(
    threads: usize,
    y: PlanesMut<'_>,
    multiply_adds: usize,
    tiles: &mut Vec<Vec<f32>>,
    work: impl Fn(usize, PlanesMut<'_>, &mut Vec<f32>) + Sync,
) {
    let parts = threads
        .min(multiply_adds / MULTIPLY_ADDS_PER_THREAD)
        .min(y.channels.div_ceil(PANEL))
        .max(1);
    if tiles.len() < parts {
        tiles.resize_with(parts, Vec::new);
    }
    if parts == 1 {
        work(0, y, &mut tiles[0]);
        return;
    }
    let channels = y.channels.div_ceil(PANEL).div_ceil(parts) * PANEL;
    let (height, width) = (y.height, y.width);
    let cells = height * width;
    y.data
        .par_chunks_mut(channels * cells)
        .zip(tiles)
        .enumerate()
        .for_each(|(part, (data, tile))| {
            let y = PlanesMut {
                channels: data.len() / cells,
                data,
                height,
                width,
            };
            work(part * channels, y, tile);
        });
}
