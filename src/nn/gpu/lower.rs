//! From operations to dispatches.

use super::kernels::{Kernel, Tile, TileRule};
use super::params::{self, Params};
use crate::nn::program::{BufferId, ConstantId, Edges, GraphSize, Matrix, Op, Sign};

/// Threads of a workgroup of kernels that have one thread per value.
const THREADS: usize = 64;

/// The most workgroups along one axis that the default limits allow.
const MAX_GROUPS: usize = 65_535;

/// A kernel and how many workgroups of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dispatch {
    pub(super) kernel: Kernel,
    pub(super) groups: [u32; 3],
}

/// For each edge type where its offsets and its sources begin in the edge buffer.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct EdgeOffsets(pub(super) [(u32, u32); Edges::ALL.len()]);

/// What is bound to a kernel.
#[derive(Clone, Copy, Debug)]
pub(super) enum Slot {
    Nothing,
    Values(BufferId),
    Constant(ConstantId),
}

/// The buffers that an operation's kernel is bound to, by binding.
#[derive(Clone, Copy, Debug)]
pub(super) struct Slots {
    pub(super) x: Slot,
    pub(super) second: Slot,
    pub(super) y: Slot,
    pub(super) weight: Slot,
    pub(super) bias: Slot,
}

/// The bindings of an operation.
pub(super) fn slots(op: &Op) -> Slots {
    let none = Slot::Nothing;
    // `Op::reads` names first what kernels call x, then what they call second.
    let mut reads = op.reads().into_iter().map(Slot::Values);
    let (x, second) = (reads.next().unwrap_or(none), reads.next().unwrap_or(none));
    let mut slots = Slots {
        x,
        second,
        y: Slot::Values(op.writes()),
        weight: none,
        bias: none,
    };
    match op {
        Op::Conv2d { weight, bias, .. }
        | Op::ConvTranspose2d { weight, bias, .. }
        | Op::Linear { weight, bias, .. } => {
            (slots.weight, slots.bias) = (Slot::Constant(*weight), Slot::Constant(*bias));
        }
        Op::Gat { attention, .. } => slots.bias = Slot::Constant(*attention),
        // These read their literals second.
        Op::SignMean { .. } | Op::RegionForm { .. } => {
            (slots.x, slots.second) = (slots.second, slots.x);
        }
        _ => {}
    }
    slots
}

/// The dispatch of an operation; its parameters are written to `at`.
pub(super) fn lower(
    op: &Op,
    size: GraphSize,
    edges: &EdgeOffsets,
    tile: TileRule,
    at: &mut [u8],
) -> Dispatch {
    let n = |value: usize| value as u32;
    let rows = |m: Matrix| m.rows.rows(size);
    let values = |m: Matrix| rows(m) * m.columns;
    match *op {
        Op::Conv2d {
            x,
            window,
            residual,
            activation,
            y,
            ..
        } => {
            let p = params::Conv2d {
                x_offset: n(x.offset),
                channels: n(x.channels),
                height: n(x.height),
                width: n(x.width),
                y_offset: n(y.offset),
                out: n(y.channels),
                out_height: n(y.height),
                out_width: n(y.width),
                kernel: n(window.kernel),
                stride: n(window.stride),
                padding: n(window.padding),
                activation: activation as u32,
                has_residual: u32::from(residual.is_some()),
                residual_offset: residual.map_or(0, |r| n(r.offset)),
            };
            product(
                p,
                tile(y.channels, y.cells()),
                [y.channels, y.cells(), 1],
                at,
            )
        }
        Op::ConvTranspose2d {
            x,
            window,
            activation,
            y,
            ..
        } => {
            let p = params::ConvTranspose2d {
                x_offset: n(x.offset),
                channels: n(x.channels),
                height: n(x.height),
                width: n(x.width),
                y_offset: n(y.offset),
                out: n(y.channels),
                out_height: n(y.height),
                out_width: n(y.width),
                taps: n(window.taps()),
                stride: n(window.stride),
                padding: n(window.padding),
                activation: activation as u32,
            };
            let cells = y.height.div_ceil(window.stride) * y.width.div_ceil(window.stride);
            product(
                p,
                tile(y.channels, cells),
                [y.channels, cells, window.stride * window.stride],
                at,
            )
        }
        Op::Linear {
            x,
            second,
            activation,
            y,
            ..
        } => {
            let p = params::Linear {
                x_offset: n(x.offset),
                x_stride: n(x.stride),
                x_columns: n(x.columns),
                second_offset: second.map_or(0, |m| n(m.offset)),
                second_stride: second.map_or(0, |m| n(m.stride)),
                second_columns: second.map_or(0, |m| n(m.columns)),
                y_offset: n(y.offset),
                y_stride: n(y.stride),
                rows: n(rows(y)),
                out: n(y.columns),
                activation: activation as u32,
            };
            product(p, tile(y.columns, rows(y)), [y.columns, rows(y), 1], at)
        }
        Op::Gat {
            source,
            target,
            edges: kind,
            y,
            ..
        } => {
            let (offsets_at, sources_at) = edges.0[kind as usize];
            let p = params::Gat {
                x_offset: n(source.offset),
                x_stride: n(source.stride),
                x_columns: n(source.columns),
                target_offset: n(target.offset),
                target_stride: n(target.stride),
                target_columns: n(target.columns),
                y_offset: n(y.offset),
                y_stride: n(y.stride),
                targets: n(rows(y)),
                offsets_at,
                sources_at,
            };
            groups(p, rows(y), at)
        }
        Op::MaxPool2d { x, window, y } => {
            let p = params::MaxPool2d {
                x_offset: n(x.offset),
                height: n(x.height),
                width: n(x.width),
                y_offset: n(y.offset),
                out_height: n(y.height),
                out_width: n(y.width),
                kernel: n(window.kernel),
                stride: n(window.stride),
                padding: n(window.padding),
                count: n(y.len()),
            };
            threads(p, y.len(), at)
        }
        Op::GlobalMeanPool { x, y } => {
            let p = params::GlobalMeanPool {
                x_offset: n(x.offset),
                channels: n(x.channels),
                cells: n(x.cells()),
                y_offset: n(y.offset),
            };
            groups(p, x.channels, at)
        }
        Op::MeanRows { x, y } => {
            let p = params::MeanRows {
                x_offset: n(x.offset),
                x_stride: n(x.stride),
                rows: n(rows(x)),
                y_offset: n(y.offset),
                count: n(y.columns),
            };
            threads(p, y.columns, at)
        }
        Op::RegionMean { x, mask, y } => {
            let p = params::RegionMean {
                x_offset: n(x.offset),
                channels: n(x.channels),
                cells: n(x.cells()),
                mask_offset: n(mask.offset),
                y_offset: n(y.offset),
                y_stride: n(y.stride),
                count: n(values(y)),
            };
            groups(p, values(y), at)
        }
        Op::SignMean {
            literals,
            x,
            sign,
            y,
        } => {
            let p = params::SignMean {
                x_offset: n(x.offset),
                x_stride: n(x.stride),
                columns: n(x.columns),
                literals_offset: n(literals.offset),
                literals_stride: n(literals.stride),
                labels: n(literals.columns),
                negative: u32::from(sign == Sign::Negative),
                y_offset: n(y.offset),
                y_stride: n(y.stride),
                count: n(values(y)),
            };
            threads(p, values(y), at)
        }
        Op::RegionForm {
            literals,
            x,
            sign,
            y,
        } => {
            let p = params::RegionForm {
                x_offset: n(x.offset),
                x_stride: n(x.stride),
                columns: n(x.columns),
                literals_offset: n(literals.offset),
                literals_stride: n(literals.stride),
                rows: n(rows(literals)),
                negative: u32::from(sign == Sign::Negative),
                y_offset: n(y.offset),
                y_stride: n(y.stride),
                count: n(values(y)),
            };
            threads(p, values(y), at)
        }
        Op::Paint { mask, colour, y } => {
            let p = params::Paint {
                x_offset: n(mask.offset),
                labels: n(mask.channels),
                cells: n(mask.cells()),
                colour_offset: n(colour.offset),
                colour_stride: n(colour.stride),
                y_offset: n(y.offset),
                count: n(y.len()),
            };
            threads(p, y.len(), at)
        }
        Op::Upsample { x, y } => {
            let p = params::Upsample {
                x_offset: n(x.offset),
                height: n(x.height),
                width: n(x.width),
                y_offset: n(y.offset),
                out_height: n(y.height),
                out_width: n(y.width),
                count: n(y.len()),
            };
            threads(p, y.len(), at)
        }
        Op::Broadcast { x, add, y } => {
            let p = params::Broadcast {
                x_offset: n(x.offset),
                cells: n(y.cells()),
                add: u32::from(add),
                y_offset: n(y.offset),
                count: n(y.len()),
            };
            threads(p, y.len(), at)
        }
        Op::RepeatRow { x, y } => copy(x, 0, y, values(y), at),
        Op::CopyRows { x, y } => copy(x, x.stride, y, values(y), at),
    }
}

fn copy(x: Matrix, stride: usize, y: Matrix, count: usize, at: &mut [u8]) -> Dispatch {
    let p = params::CopyRows {
        x_offset: x.offset as u32,
        x_stride: stride as u32,
        columns: y.columns as u32,
        y_offset: y.offset as u32,
        y_stride: y.stride as u32,
        count: count as u32,
    };
    threads(p, count, at)
}

fn write<P: Params>(params: P, at: &mut [u8]) -> Kernel {
    let bytes = bytemuck::bytes_of(&params);
    at[..bytes.len()].copy_from_slice(bytes);
    Kernel::new(P::KERNEL)
}

/// One thread per value; kernels go on where the grid ends.
fn threads<P: Params>(params: P, values: usize, at: &mut [u8]) -> Dispatch {
    groups(params, values.div_ceil(THREADS), at)
}

/// One workgroup per item; kernels go on where the grid ends.
fn groups<P: Params>(params: P, items: usize, at: &mut [u8]) -> Dispatch {
    Dispatch {
        kernel: write(params, at),
        groups: [items.min(MAX_GROUPS) as u32, 1, 1],
    }
}

/// One workgroup per tile of a result of (rows, columns) in so many parts.
fn product<P: Params>(
    params: P,
    tile: Tile,
    [rows, columns, parts]: [usize; 3],
    at: &mut [u8],
) -> Dispatch {
    let kernel = Kernel {
        tile: Some(tile),
        ..write(params, at)
    };
    let tiles = |n: usize, threads: u32| n.div_ceil(4 * threads as usize) as u32;
    Dispatch {
        kernel,
        groups: [
            tiles(columns, tile.columns),
            tiles(rows, tile.rows),
            parts as u32,
        ],
    }
}
