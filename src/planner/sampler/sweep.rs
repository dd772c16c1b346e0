//! Uniform points in an order that a large tree is fast in.
//!
//! What an iteration reads of a tree lies around the drawn point. As long as the tree fits into the processor's caches the order of
//! the points does not matter; beyond that each iteration waits for memory. So points of a large tree are drawn many at a time and
//! handed out along a space-filling curve: neighbours in time are neighbours in space, and what one iteration has fetched the next
//! one finds. The idea of cache-aware sampling is that of J. Ichnowski, J. Prins, R. Alterovitz, "Cache-Aware Asymptotically-Optimal
//! Sampling-Based Motion Planning" (ICRA 2014); batches along a curve instead of a subdivision of the map are ours.
//!
//! The points are independent and uniform as before, whatever their order, so a batch leaves the tree as dense as it would be, and
//! every part of the map keeps getting points for ever.

use nalgebra::Point2;

use super::View;
use crate::random::Random;

/// Trees of fewer places than this fit into the caches.
const LARGE: usize = 8_192;

/// A batch is this part of the tree: the more points, the nearer they are to each other, while the map as a whole is still visited
/// again and again as the tree grows.
const PART: usize = 4;

/// Bits of a coordinate that count: a cell of the curve and what surrounds it fit into the caches.
const BITS: u32 = 6;

/// Cells of a side.
const SIDE: u32 = 1 << BITS;

/// The points of a batch that are left, the next one last.
#[derive(Clone, Debug, Default)]
pub(super) struct Sweep {
    points: Vec<Point2<f64>>,
    // Buffers that are kept between batches: the points as they were drawn, with their places on the curve, and where the points of
    // each place begin.
    drawn: Vec<(u16, Point2<f64>)>,
    begins: Vec<usize>,
    /// For each cell its place on the curve.
    curve: Vec<u16>,
}

impl Sweep {
    /// The next uniform point of the free space.
    pub(super) fn next(&mut self, view: &View<'_>, random: &mut Random) -> Point2<f64> {
        if let Some(at) = self.points.pop() {
            return at;
        }
        let sites = view.tree.site_count();
        if sites < LARGE {
            return view.system.sample_free(random);
        }
        self.draw(view, sites / PART, random);
        self.points.pop().expect("a large tree has a quarter")
    }

    /// Draws so many points and puts them in order.
    fn draw(&mut self, view: &View<'_>, count: usize, random: &mut Random) {
        let bounds = view.system.bounds();
        let cells = f64::from(SIDE) / bounds.side();
        if self.curve.is_empty() {
            self.curve = curve();
        }
        self.begins.clear();
        self.begins.resize(self.curve.len() + 1, 0);
        self.drawn.clear();
        for _ in 0..count {
            let at = view.system.sample_free(random);
            let from = (at - bounds.min) * cells;
            let [x, y] = [from.x, from.y].map(|c| (c as u32).min(SIDE - 1));
            let place = self.curve[(x * SIDE + y) as usize];
            self.begins[place as usize + 1] += 1;
            self.drawn.push((place, at));
        }
        for place in 1..self.begins.len() {
            self.begins[place] += self.begins[place - 1];
        }
        self.points.resize(count, Point2::origin());
        for &(place, at) in &self.drawn {
            let next = &mut self.begins[place as usize];
            self.points[*next] = at;
            *next += 1;
        }
    }
}

/// Hilbert's curve through a square of [`SIDE`] cells a side: for each cell (x, y), at `x · SIDE + y`, where the curve meets it.
fn curve() -> Vec<u16> {
    let cells = (0..SIDE).flat_map(|x| (0..SIDE).map(move |y| (x, y)));
    cells.map(|(x, y)| along_curve(x, y) as u16).collect()
}

fn along_curve(mut x: u32, mut y: u32) -> u32 {
    let mut place = 0;
    for bit in (0..BITS).rev() {
        let (right, up) = (x >> bit & 1, y >> bit & 1);
        place = place << 2 | (3 * right) ^ up;
        // The curve enters and leaves each quarter as its place in the whole wants it.
        if up == 0 {
            if right == 1 {
                (x, y) = (SIDE - 1 - x, SIDE - 1 - y);
            }
            (x, y) = (y, x);
        }
    }
    place
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_curve_visits_every_cell_once_and_steps_to_a_neighbour() {
        let mut cells = vec![None; (SIDE * SIDE) as usize];
        for (cell, place) in (0..).zip(curve()) {
            let known = cells[usize::from(place)].replace((cell / SIDE, cell % SIDE));
            assert_eq!(known, None);
        }
        let cells: Vec<(u32, u32)> = cells.into_iter().map(Option::unwrap).collect();
        for pair in cells.windows(2) {
            let ((x0, y0), (x1, y1)) = (pair[0], pair[1]);
            assert_eq!(x0.abs_diff(x1) + y0.abs_diff(y1), 1);
        }
    }
}
