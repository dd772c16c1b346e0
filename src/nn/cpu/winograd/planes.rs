//! What products meet of the input: differences and sums of neighbouring cells, by tiles.

use super::super::interleave::take_apart;
use super::super::product::LANES;
use super::super::views::{Planes, at_least};

/// A value of a tile of one axis: input `first`, plus or minus input `second` of the tile.
#[derive(Clone, Copy, Debug)]
enum Value {
    Input(usize),
    Difference(usize, usize),
    Sum(usize, usize),
}

use crate::simd::vectorised;
use Value::{Difference, Input, Sum};

/// How two outputs along an axis are computed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Form {
    /// The taps of the kernel.
    pub(super) taps: usize,
    /// What is kept of each tile of the input.
    values: &'static [Value],
}

impl Form {
    /// Two taps.
    pub(super) const TWO: Self = Self {
        taps: 2,
        values: &[Difference(0, 1), Input(1), Difference(1, 2)],
    };
    /// Two taps whose first input is the first or the second of a tile.
    pub(super) const TWO_EITHER: Self = Self {
        taps: 2,
        values: &[Difference(0, 1), Input(0), Input(1), Difference(1, 2)],
    };
    /// Three taps.
    pub(super) const THREE: Self = Self {
        taps: 3,
        values: &[
            Difference(0, 2),
            Sum(1, 2),
            Difference(2, 1),
            Difference(1, 3),
        ],
    };

    /// Products for two outputs.
    pub(super) fn points(&self) -> usize {
        self.taps + 1
    }

    /// Which value the product of a point meets, and how many tiles on, if the first input is `begin` cells from that of a tile.
    pub(super) fn point(&self, point: usize, begin: usize) -> (usize, usize) {
        let (tiles, odd) = (begin / 2, begin % 2 == 1);
        if self.values.len() == self.points() {
            debug_assert!(!odd, "only TWO_EITHER begins anywhere");
            return (point, tiles);
        }
        match (odd, point) {
            (false, 0) => (0, tiles),
            (false, point) => (point + 1, tiles),
            (true, 0) => (3, tiles),
            (true, point) => (2 - point, tiles + 1),
        }
    }

    /// By how many tiles products look ahead at most, if none begins beyond `begin`.
    pub(super) fn shift(&self, begin: usize) -> usize {
        begin.div_ceil(2)
    }

    /// From products to outputs: `products` has for each pair of points a part of `part` values of which `used` are there
    /// (behind the columns of a row some may be anything, and are not looked at afterwards); `cells` gets parts for the four cells of a tile.
    pub(super) fn outputs(&self, products: &[f32], used: usize, part: usize, cells: &mut [f32]) {
        vectorised!(match self.taps {
            2 => outputs::<3>(products, used, part, cells),
            _ => outputs::<4>(products, used, part, cells),
        });
    }
}

/// Sixteen values at a time.
type Lanes = [f32; LANES];

#[inline(always)]
fn plus(a: Lanes, b: Lanes) -> Lanes {
    std::array::from_fn(|i| a[i] + b[i])
}

#[inline(always)]
fn minus(a: Lanes, b: Lanes) -> Lanes {
    std::array::from_fn(|i| a[i] - b[i])
}

/// The two outputs of an axis.
#[inline(always)]
fn pair<const POINTS: usize>(m: [Lanes; POINTS]) -> [Lanes; 2] {
    if POINTS == 3 {
        return [plus(m[0], m[1]), minus(m[1], m[2])];
    }
    [plus(m[0], plus(m[1], m[2])), minus(minus(m[1], m[2]), m[3])]
}

#[inline(always)]
fn outputs<const POINTS: usize>(products: &[f32], used: usize, part: usize, cells: &mut [f32]) {
    let mut parts = products.chunks_exact(part);
    let products: [[&[Lanes]; POINTS]; POINTS] = std::array::from_fn(|_| {
        std::array::from_fn(|_| {
            &parts.next().expect("as many as points").as_chunks().0[..used / LANES]
        })
    });
    let mut parts = cells.chunks_exact_mut(part);
    let cells: [&mut [Lanes]; 4] =
        std::array::from_fn(|_| &mut parts.next().expect("four").as_chunks_mut().0[..used / LANES]);
    for n in 0..used / LANES {
        // Across a row of tiles first, then down.
        let rows: [[Lanes; 2]; POINTS] = std::array::from_fn(|a| {
            pair(std::array::from_fn::<_, POINTS, _>(|b| products[a][b][n]))
        });
        for second in 0..2 {
            let [upper, lower] = pair(std::array::from_fn::<_, POINTS, _>(|a| rows[a][second]));
            cells[second][n] = upper;
            cells[2 + second][n] = lower;
        }
    }
}

/// A strip of the input by tiles: for each pair of a form's values, each channel, and each residue of the stride of a cell's row
/// and column a plane of `height · width` tiles. What one product meets stands together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Tiled {
    pub(super) form: Form,
    pub(super) stride: usize,
    pub(super) padding: usize,
    pub(super) channels: usize,
    /// Rows and columns of a plane: those of a strip, and those ahead that products meet.
    pub(super) height: usize,
    pub(super) width: usize,
}

impl Tiled {
    fn size(&self) -> usize {
        self.height * self.width
    }

    /// Values of all planes of a pair of values.
    fn of_pair(&self) -> usize {
        self.inputs() * self.size()
    }

    /// Input planes: channels by residues.
    fn inputs(&self) -> usize {
        self.channels * self.stride * self.stride
    }

    /// Values of all planes, and the room that products need beyond them.
    pub(super) fn len(&self) -> usize {
        self.form.values.len().pow(2) * self.of_pair() + LANES
    }

    /// Where the planes begin that a product meets, from that of the first channel on.
    pub(super) fn offsets(&self, offsets: &mut Vec<u32>) {
        offsets.clear();
        offsets.extend((0..self.inputs()).map(|input| (input * self.size()) as u32));
    }

    /// Where the values are from there: `down` and `right` are [`Form::point`]s.
    pub(super) fn place(&self, down: (usize, usize), right: (usize, usize)) -> usize {
        let plane = down.0 * self.form.values.len() + right.0;
        plane * self.of_pair() + down.1 * self.width + right.1
    }

    /// Lays out the input from row `first` of tiles on; `lines` is memory to work in.
    pub(super) fn fill(
        &self,
        x: Planes<'_>,
        first: usize,
        lines: &mut Vec<f32>,
        planes: &mut [f32],
    ) {
        // Cells of a row by their residue of two tiles' distance. The last tile's last inputs are two on.
        let room = (self.width + 2).max((self.padding + x.width).div_ceil(2 * self.stride));
        let cells = 2 * self.stride * room;
        let lines = at_least(lines, x.width + 2 * cells);
        lines.fill(0.0);
        let (outside, lines) = lines.split_at_mut(x.width);
        let (line, parts) = lines.split_at_mut(cells);
        vectorised!(match self.stride {
            1 => self.lay::<2>(x, first, outside, line, parts, planes),
            _ => self.lay::<4>(x, first, outside, line, parts, planes),
        });
    }

    /// As [`Self::fill`]. `SPLIT` is twice the stride; rows beyond the input are `outside`. A row of a value is put together
    /// in `line` and taken apart into `parts`, so that each value of all tiles of a row is a run.
    #[inline(always)]
    fn lay<const SPLIT: usize>(
        &self,
        x: Planes<'_>,
        first: usize,
        outside: &[f32],
        line: &mut [f32],
        parts: &mut [f32],
        planes: &mut [f32],
    ) {
        let room = parts.len() / SPLIT;
        let (values, of_pair) = (self.form.values, self.of_pair());
        for channel in 0..self.channels {
            let plane = x.channel(channel);
            for row_residue in 0..self.stride {
                for (down, &value) in values.iter().enumerate() {
                    for tile in 0..self.height {
                        let row = |input: usize| {
                            let row = self.stride * (2 * (first + tile) + input) + row_residue;
                            match row.checked_sub(self.padding) {
                                Some(row) if row < x.height => &plane[row * x.width..][..x.width],
                                _ => outside,
                            }
                        };
                        value.write(row, &mut line[self.padding..][..x.width]);
                        take_apart::<SPLIT>(line, parts, room);
                        for column_residue in 0..self.stride {
                            let run = |input: usize| {
                                let column = self.stride * input + column_residue;
                                &parts[column % SPLIT * room + column / SPLIT..][..self.width]
                            };
                            let input = (channel * self.stride + row_residue) * self.stride
                                + column_residue;
                            let begin = down * values.len() * of_pair
                                + input * self.size()
                                + tile * self.width;
                            for (right, &value) in values.iter().enumerate() {
                                value.write(
                                    run,
                                    &mut planes[begin + right * of_pair..][..self.width],
                                );
                            }
                        }
                    }
                }
            }
        }
    }
}

impl Value {
    /// Writes the value of each tile, from runs of the tiles' inputs.
    #[inline(always)]
    fn write<'a>(self, run: impl Fn(usize) -> &'a [f32], to: &mut [f32]) {
        match self {
            Input(a) => by_lanes(run(a), run(a), to, |a, _| a),
            Difference(a, b) => by_lanes(run(a), run(b), to, |a, b| a - b),
            Sum(a, b) => by_lanes(run(a), run(b), to, |a, b| a + b),
        }
    }
}

/// `to = f(a, b)`, value by value. The last vector overlaps the one before: rows are short, and
/// single values would take most of the time.
#[inline(always)]
fn by_lanes(a: &[f32], b: &[f32], to: &mut [f32], f: impl Fn(f32, f32) -> f32) {
    let Some(last) = to.len().checked_sub(LANES) else {
        let pairs = a.iter().zip(b);
        to.iter_mut()
            .zip(pairs)
            .for_each(|(to, (&a, &b))| *to = f(a, b));
        return;
    };
    for begin in (0..to.len()).step_by(LANES) {
        let at = begin.min(last);
        let [a, b] = [a, b].map(|values| &values[at..][..LANES]);
        for (i, to) in to[at..][..LANES].iter_mut().enumerate() {
            *to = f(a[i], b[i]);
        }
    }
}
