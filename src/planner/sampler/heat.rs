//! The heatmap as a sampler uses it: cells of any rectangle, in proportion to their weight.

use super::choices::below;
use crate::guidance::{Heatmap, are_finite, nearest, steps_of};
use crate::random::Random;
use crate::simd::vectorised;
use crate::workspace::Bounds;
use nalgebra::Point2;

/// Why predictions cannot guide a search.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum GuidanceError {
    /// Not one probability per automaton state.
    #[error("the state prediction has {found} entries, the automaton {expected} states")]
    States {
        /// States of the automaton.
        expected: usize,
        /// Entries of the prediction.
        found: usize,
    },
    /// The heatmap is not a square of finite values in [0, 1].
    #[error("the heatmap is not a square of finite values: {0}")]
    Heatmap(String),
}

/// The square frame of the heatmap over the map: its lower-left corner is the map's.
pub(super) struct Frame {
    origin: Point2<f64>,
    cell: f64,
    side: usize,
}

impl Frame {
    pub(super) fn new(bounds: Bounds, side: usize) -> Self {
        Self {
            origin: bounds.min,
            cell: bounds.side() / side as f64,
            side,
        }
    }

    fn index(&self, along: f64) -> usize {
        // A float-to-integer cast saturates, so points outside land in the border cells.
        ((along / self.cell) as usize).min(self.side - 1)
    }

    /// The cells of the rectangle between two points: lowest, and highest (included).
    pub(super) fn rectangle(&self, a: Point2<f64>, b: Point2<f64>) -> ([usize; 2], [usize; 2]) {
        let (min, max) = (a.inf(&b) - self.origin, a.sup(&b) - self.origin);
        (
            [self.index(min.x), self.index(min.y)],
            [self.index(max.x), self.index(max.y)],
        )
    }

    pub(super) fn corner(&self, i: usize, j: usize) -> Point2<f64> {
        Point2::new(
            self.origin.x + i as f64 * self.cell,
            self.origin.y + j as f64 * self.cell,
        )
    }
}

/// Summed-area table of a heatmap: draws a cell of any rectangle in proportion to its weight, in
/// logarithmic time.
#[derive(Clone, Debug)]
pub struct HeatmapSums {
    side: usize,
    /// `(side + 1)²` sums; entry `(i, j)` is the weight of all cells below `i` and `j`.
    sums: Vec<u32>,
}

/// Cells per side at most.
const LARGEST: usize = 4096;

impl HeatmapSums {
    /// Sums a heatmap, quantised to 16 bits, or to fewer where there are more than 256 cells per side.
    ///
    /// # Errors
    /// A heatmap that is not square, of more than 4,096 cells per side, or with values that are not finite.
    pub fn new(heatmap: &Heatmap) -> Result<Self, GuidanceError> {
        let side = heatmap.side;
        if side == 0 || heatmap.values.len() != side * side {
            let found = heatmap.values.len();
            let text = format!("{found} values for {side} × {side} cells");
            return Err(GuidanceError::Heatmap(text));
        }
        if side > LARGEST {
            let text = format!("{side} cells per side, at most {LARGEST} can be summed");
            return Err(GuidanceError::Heatmap(text));
        }
        if !are_finite(&heatmap.values) {
            let mut values = heatmap.values.iter();
            let bad = values.position(|v| !v.is_finite()).unwrap_or(0);
            let (i, j, v) = (bad / side, bad % side, heatmap.values[bad]);
            return Err(GuidanceError::Heatmap(format!("cell ({i}, {j}) is {v}")));
        }
        // The sum of all cells must fit.
        let steps = (u32::MAX / (side * side) as u32).min(u32::from(u16::MAX));
        let share = steps as f32 / f32::from(u16::MAX);
        let row = side + 1;
        let mut sums = vec![0; row * row];
        vectorised!({
            for (i, values) in heatmap.values.chunks_exact(side).enumerate() {
                let (above, below) = sums[i * row..].split_at_mut(row);
                let below = &mut below[1..row];
                for (sum, &v) in below.iter_mut().zip(values) {
                    *sum = nearest(steps_of(v) * share);
                }
                let mut along = 0;
                for sum in below.iter_mut() {
                    along += *sum;
                    *sum = along;
                }
                for (sum, above) in below.iter_mut().zip(&above[1..]) {
                    *sum += above;
                }
            }
        });
        Ok(Self { side, sums })
    }

    /// Cells per side.
    pub(super) fn side(&self) -> usize {
        self.side
    }

    /// The weight of the cells from `low` to `high`, both included.
    #[must_use]
    pub fn weight(&self, low: [usize; 2], high: [usize; 2]) -> u64 {
        let at = |i: usize, j: usize| u64::from(self.sums[i * (self.side + 1) + j]);
        at(high[0] + 1, high[1] + 1) + at(low[0], low[1])
            - at(low[0], high[1] + 1)
            - at(high[0] + 1, low[1])
    }

    /// A cell between `low` and `high` (included), in proportion to its weight; uniform if all
    /// weights are 0.
    pub(super) fn draw(
        &self,
        random: &mut Random,
        low: [usize; 2],
        high: [usize; 2],
    ) -> (usize, usize) {
        let total = self.weight(low, high);
        if total == 0 {
            let pick = |random: &mut Random, k: usize| {
                low[k] + below(random, (high[k] - low[k] + 1) as u64) as usize
            };
            return (pick(random, 0), pick(random, 1));
        }
        let mut left = below(random, total);
        let column = |i: usize| self.weight(low, [i, high[1]]);
        let i = first_beyond(low[0], high[0], left, column);
        left -= if i > low[0] { column(i - 1) } else { 0 };
        let cell = |j: usize| self.weight([i, low[1]], [i, j]);
        (i, first_beyond(low[1], high[1], left, cell))
    }
}

/// The first index in `low..=high` whose running sum exceeds `goal`.
fn first_beyond(low: usize, high: usize, goal: u64, sum: impl Fn(usize) -> u64) -> usize {
    let (mut low, mut high) = (low, high);
    while low < high {
        let middle = low.midpoint(high);
        if sum(middle) > goal {
            high = middle;
        } else {
            low = middle + 1;
        }
    }
    low
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::generator;

    #[test]
    fn cells_are_drawn_in_proportion_to_their_weight() {
        let values: Vec<f32> = (0..16)
            .map(|k| if k % 5 == 0 { 0.2 } else { 0.0 })
            .collect();
        let mut values = values;
        values[6] = 0.6; // cell (1, 2)
        let sums = HeatmapSums::new(&Heatmap { side: 4, values }).unwrap();
        let mut random = generator(5, 0);
        let mut counts = [[0_u32; 4]; 4];
        for _ in 0..8_000 {
            let (i, j) = sums.draw(&mut random, [0, 0], [2, 3]);
            counts[i][j] += 1;
        }
        // (0,0), (1,1), (2,2) weigh 0.2 each, (1,2) 0.6, all else nothing.
        assert_eq!(counts.iter().flatten().sum::<u32>(), 8_000);
        let share = |i: usize, j: usize| f64::from(counts[i][j]) / 8_000.0;
        assert!((share(1, 2) - 0.5).abs() < 0.03, "{counts:?}");
        assert!((share(2, 2) - 1.0 / 6.0).abs() < 0.03, "{counts:?}");
        assert_eq!(counts[3], [0; 4]);
    }

    #[test]
    fn empty_rectangles_are_uniform() {
        let values = vec![0.0; 9];
        let sums = HeatmapSums::new(&Heatmap { side: 3, values }).unwrap();
        let mut random = generator(6, 0);
        let mut seen = [[false; 3]; 3];
        for _ in 0..500 {
            let (i, j) = sums.draw(&mut random, [1, 0], [2, 2]);
            seen[i][j] = true;
        }
        assert_eq!(seen, [[false; 3], [true; 3], [true; 3]]);
    }

    #[test]
    fn rectangles_are_at_least_one_cell() {
        let frame = Frame::new(Bounds::unit(), 200);
        let (low, high) = frame.rectangle(Point2::new(0.5001, 1.0), Point2::new(0.5002, 0.0));
        assert_eq!((low, high), ([100, 0], [100, 199]));
    }

    #[test]
    fn bad_heatmaps_are_refused() {
        let bad = |values: Vec<f32>| HeatmapSums::new(&Heatmap { side: 2, values }).is_err();
        assert!(bad(vec![0.0; 3]));
        assert!(bad(vec![0.0, f32::NAN, 0.0, 0.0]));
        let side = LARGEST + 1;
        let values = vec![0.0; side * side];
        assert!(HeatmapSums::new(&Heatmap { side, values }).is_err());
    }

    #[test]
    fn the_sum_of_a_large_heatmap_fits() {
        for side in [256, 257, 1_000] {
            let sums = HeatmapSums::new(&Heatmap::flat(side)).unwrap();
            let whole = sums.weight([0, 0], [side - 1, side - 1]);
            let one = sums.weight([side - 1, 0], [side - 1, 0]);
            assert_eq!(whole, one * (side * side) as u64);
            assert!(one >= 4_000);
        }
    }
}
