//! Shortest ways on a grid, to as many places as there is time and memory for.

use std::collections::HashSet;

use nalgebra::Point2;

use crate::alphabet::Letter;
use crate::plan::Waypoint;
use crate::system::{Grid, TransitionSystem};

/// So many cells are looked at for ways, in all, and as many numbers kept: on the largest grids the ways to one place take a million.
const CELLS: usize = 8_000_000;

/// The length of a way in which nothing stands.
pub(super) fn apart(a: Point2<f64>, b: Point2<f64>) -> f64 {
    (b.x - a.x).abs() + (b.y - a.y).abs()
}

/// Shortest ways on the grid, to as many places as the budget goes to.
pub(super) struct Ways {
    grid: Grid,
    /// The places to which ways are known, by the bits of their coordinates.
    known: HashSet<[u64; 2]>,
    /// To so many more places they may be looked for.
    left: usize,
}

impl Ways {
    pub(super) fn new(grid: Grid) -> Self {
        let [columns, rows] = grid.cells();
        Self {
            left: CELLS / (columns * rows).max(1),
            known: HashSet::new(),
            grid,
        }
    }

    /// Whether the ways to a place are known, or may be looked for.
    pub(super) fn knows(&mut self, to: Point2<f64>) -> bool {
        let place = [to.x.to_bits(), to.y.to_bits()];
        if self.left > 0 && self.known.insert(place) {
            self.left -= 1;
            return true;
        }
        self.known.contains(&place)
    }

    /// The length of the way from one place to another; where it is not known, of one in which nothing stands.
    pub(super) fn length(&mut self, from: Point2<f64>, to: Point2<f64>) -> f64 {
        // Ways have the same length in both directions but where a region bars one of them.
        let ends = match (self.knows(to), self.knows(from)) {
            (true, _) => (from, to),
            (false, true) => (to, from),
            (false, false) => return apart(from, to),
        };
        self.grid
            .way_length(ends.0, ends.1)
            .unwrap_or(f64::INFINITY)
    }

    /// Whether there is a region.
    pub(super) fn sees(&self, at: Point2<f64>) -> bool {
        let props = |letter| self.grid.alphabet().props(letter);
        self.letter(at)
            .is_some_and(|letter| !props(letter).is_empty())
    }

    /// What is seen at a place.
    pub(super) fn letter(&self, at: Point2<f64>) -> Option<Letter> {
        self.grid.settle(at).map(|spot| spot.letter)
    }

    /// Goes on from the last of `points` to a place: adds the moves that lead there, if there are any. Points on the way have its state.
    pub(super) fn go(&mut self, points: &mut Vec<Waypoint>, to: Waypoint) -> Option<()> {
        let mut at = points.last()?.at;
        if let Some(end) = points.last_mut()
            && at == to.at
        {
            end.state = to.state;
            return Some(());
        }
        let spot = |at| self.grid.settle(at);
        if !self.grid.step(&spot(at)?, &spot(to.at)?) {
            if !self.knows(to.at) {
                return None;
            }
            while at != to.at {
                let leg = self.grid.first_leg(at, to.at, true)?;
                at = leg.to;
                points.push(Waypoint { at, ..to });
            }
            return Some(());
        }
        points.push(to);
        Some(())
    }
}
