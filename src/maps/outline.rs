//! From cells to polygons: the outlines of occupied cells, exact or simplified.
//!
//! Occupied cells that touch at a corner belong together: a robot never passes between them. So that
//! this is plain from the polygons, the corner is closed by a triangle of [`CHAMFER`] cells in each
//! of the two free cells.
//!
//! # What simplification guarantees
//! With a tolerance τ below half a cell, an outline runs within τ of where it ran, and so that on its
//! way between an occupied and a free cell it passes the straight line between their centres at least
//! ½ − τ cells away from both. Between two such lines it stays in the square of four centres around
//! a corner of the grid. No two stretches of outline share such a square (except at the closed corners
//! above, which stay as they are), so outlines never meet, every occupied centre stays occupied, every
//! free centre free, and two free cells are connected by moves across their sides before if and only
//! if they are afterwards. Along the edge of the picture nothing moves at all.

use nalgebra::{Point2, Vector2};

use super::MapErrorKind;

/// How much of the sides of the free cells is cut off where occupied cells touch at a corner.
pub const CHAMFER: f64 = 0.25;

/// Outlines with more corners than this are refused.
pub(super) const MAX_CORNERS: usize = 1_000_000;

/// Cells, row by row, the lowest row first.
#[derive(Clone, Debug)]
pub struct Cells {
    /// How many along x.
    pub width: usize,
    /// How many along y.
    pub height: usize,
    /// Which are occupied: cell (x, y) has number `y·width + x`.
    pub occupied: Vec<bool>,
}

/// A connected group of occupied cells as rings of corners, in cells: first its outer border,
/// counter-clockwise, then its holes, clockwise.
pub type Rings = Vec<Vec<Point2<f64>>>;

/// East, north, west, south.
const STEPS: [(i64, i64); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

impl Cells {
    /// Whether a cell is occupied; cells beyond the edge are not.
    #[must_use]
    pub fn is_occupied(&self, x: i64, y: i64) -> bool {
        let inside = x >= 0 && y >= 0 && (x as usize) < self.width && (y as usize) < self.height;
        inside && self.occupied[y as usize * self.width + x as usize]
    }

    /// The outlines of the occupied cells, one entry for each group of cells that touch at sides or
    /// corners, simplified with `tolerance` in `[0, 0.5)` cells; 0 keeps every corner.
    ///
    /// # Errors
    /// If there are too many corners.
    pub fn outlines(&self, tolerance: f64) -> Result<Vec<Rings>, MapErrorKind> {
        let groups = self.groups();
        let mut rings: Vec<Rings> = Vec::new();
        let mut traced = vec![false; self.occupied.len()];
        let mut corners = 0;
        for y in 0..self.height {
            for x in 0..self.width {
                let (cell, at) = (y * self.width + x, (x as i64, y as i64));
                let below_free = !self.is_occupied(at.0, at.1 - 1);
                if !self.occupied[cell] || traced[cell] || !below_free {
                    continue;
                }
                let path = self.trace(at, &mut traced);
                let ring = path.simplify(tolerance);
                corners += ring.len();
                if corners > MAX_CORNERS {
                    let limit = MAX_CORNERS;
                    return Err(MapErrorKind::TooManyCorners { limit });
                }
                // Row by row, the first border of a group that is met is the outer one.
                let group = groups[cell] as usize;
                if rings.len() <= group {
                    rings.resize(group + 1, Vec::new());
                }
                rings[group].push(ring);
            }
        }
        Ok(rings)
    }

    /// Numbers the groups of occupied cells that touch, in the order of their first cells.
    fn groups(&self) -> Vec<u32> {
        let mut group = vec![u32::MAX; self.occupied.len()];
        let mut next = 0;
        let mut open = Vec::new();
        for start in 0..self.occupied.len() {
            if !self.occupied[start] || group[start] != u32::MAX {
                continue;
            }
            group[start] = next;
            open.push(start);
            while let Some(cell) = open.pop() {
                let (x, y) = ((cell % self.width) as i64, (cell / self.width) as i64);
                for (i, j) in (-1..=1).flat_map(|i| (-1..=1).map(move |j| (x + i, y + j))) {
                    if !self.is_occupied(i, j) {
                        continue;
                    }
                    let other = j as usize * self.width + i as usize;
                    if group[other] == u32::MAX {
                        group[other] = next;
                        open.push(other);
                    }
                }
            }
            next += 1;
        }
        group
    }

    /// Walks along a border with the occupied cells on the left, beginning below a cell.
    fn trace(&self, start: (i64, i64), traced: &mut [bool]) -> Path {
        let mut path = Path {
            size: [self.width as i64, self.height as i64],
            corners: Vec::new(),
            steps: Vec::new(),
            closed: Vec::new(),
        };
        let (mut at, mut heading, mut closed) = (start, 0_usize, false);
        let mut first_closed = false;
        loop {
            if heading == 0 {
                traced[at.1 as usize * self.width + at.0 as usize] = true;
            }
            path.corners.push(Point2::new(at.0 as f64, at.1 as f64));
            path.steps.push(heading);
            path.closed.push(closed);
            at = (at.0 + STEPS[heading].0, at.1 + STEPS[heading].1);
            let [left, right] = self.ahead(at, heading);
            closed = right && !left;
            heading = match (left, right) {
                (_, true) => (heading + 3) % 4,
                (true, false) => heading,
                (false, false) => (heading + 1) % 4,
            };
            if at == start && heading == 0 {
                first_closed |= closed;
                path.closed[0] = first_closed;
                return path;
            }
        }
    }

    /// Whether the cells ahead of a corner of the grid are occupied, to the left and to the right.
    fn ahead(&self, (x, y): (i64, i64), heading: usize) -> [bool; 2] {
        // The cells around the corner, from the one to the north-east on.
        let around = [(0, 0), (-1, 0), (-1, -1), (0, -1)].map(|(i, j)| (x + i, y + j));
        [around[heading], around[(heading + 3) % 4]].map(|(x, y)| self.is_occupied(x, y))
    }
}

/// A closed walk along sides of cells; it begins at a corner.
struct Path {
    size: [i64; 2],
    /// Where each step begins.
    corners: Vec<Point2<f64>>,
    /// The heading of each step.
    steps: Vec<usize>,
    /// Whether occupied cells touch where the step begins, with a free cell on either side.
    closed: Vec<bool>,
}

/// A place where a simplified outline may bend: a corner, or the middle of a straight stretch.
#[derive(Clone, Copy, Debug)]
struct Stop {
    /// The next step's number where a line arrives, and where one leaves. They differ in the
    /// middle of a cell's side.
    steps: [usize; 2],
    arrive: Point2<f64>,
    /// Where the outline goes on: elsewhere only at closed corners.
    leave: Point2<f64>,
    is_corner: bool,
    /// Whether the outline must bend here.
    pinned: bool,
}

impl Path {
    fn simplify(&self, tolerance: f64) -> Vec<Point2<f64>> {
        let stops = self.stops();
        let mut kept = Vec::new();
        if tolerance > 0.0 {
            let first = first_stop(&stops);
            let (mut at, end) = (first, first + stops.len());
            while at < end {
                kept.push(stops[at % stops.len()]);
                at = self.next_stop(&stops, at, end, tolerance);
            }
        }
        if kept.len() < 3 {
            kept = stops.into_iter().filter(|s| s.is_corner).collect();
        }
        let bends = kept.iter().flat_map(|s| [s.arrive, s.leave]);
        let mut ring: Vec<Point2<f64>> = bends.collect();
        ring.dedup();
        ring
    }

    /// The furthest stop, up to `end`, that a straight line from stop `from` may lead to.
    fn next_stop(&self, stops: &[Stop], from: usize, end: usize, tolerance: f64) -> usize {
        let n = stops.len();
        let eye = stops[from % n].leave;
        let mut wedge: Option<[Vector2<f64>; 2]> = None;
        let mut passed: Vec<Point2<f64>> = Vec::new();
        let mut step = stops[from % n].steps[1] % self.steps.len();
        let mut best = from + 1;
        for to in from + 1..=end {
            let stop = stops[to % n];
            while step != stop.steps[0] % self.steps.len() {
                if !self.narrow(&mut wedge, eye, step, tolerance) {
                    return best;
                }
                step = (step + 1) % self.steps.len();
            }
            let d = stop.arrive - eye;
            let ahead = wedge.is_none_or(|[low, high]| low.perp(&d) > 0.0 && d.perp(&high) > 0.0);
            let near = |p: &Point2<f64>| {
                let t = ((p - eye).dot(&d) / d.norm_squared()).clamp(0.0, 1.0);
                (eye + d * t - p).norm() <= tolerance
            };
            if ahead && d.norm_squared() > 0.0 && passed.iter().all(near) {
                best = to;
            }
            // Longer lines than this are not looked for: each looks at all corners it passes.
            if stop.pinned || passed.len() >= 128 {
                return best;
            }
            if stop.is_corner {
                passed.push(stop.arrive);
            }
        }
        best
    }

    /// Narrows the directions from `eye` to those that pass the middle of a step's side of a cell
    /// within the tolerance; `false` if none are left.
    fn narrow(
        &self,
        wedge: &mut Option<[Vector2<f64>; 2]>,
        eye: Point2<f64>,
        step: usize,
        tolerance: f64,
    ) -> bool {
        let heading = direction(self.steps[step]);
        let middle = self.corners[step] + heading * 0.5;
        let aside = Vector2::new(-heading.y, heading.x) * tolerance;
        let (right, left) = (middle - aside - eye, middle + aside - eye);
        if right.perp(&left) <= 0.0 {
            return false;
        }
        let [low, high] = wedge.unwrap_or([right, left]);
        let low = if low.perp(&right) > 0.0 { right } else { low };
        let high = if left.perp(&high) > 0.0 { left } else { high };
        *wedge = Some([low, high]);
        low.perp(&high) > 0.0
    }

    /// Corners and the middles of straight stretches, in order, the start first.
    fn stops(&self) -> Vec<Stop> {
        let n = self.steps.len();
        let turns: Vec<usize> = (0..n)
            .filter(|&i| self.steps[i] != self.steps[(i + n - 1) % n])
            .collect();
        let mut stops = Vec::with_capacity(2 * turns.len());
        for (k, &i) in turns.iter().enumerate() {
            let end = turns.get(k + 1).copied().unwrap_or(turns[0] + n);
            stops.push(self.corner_stop(i));
            let length = end - i;
            let at = self.corners[i] + direction(self.steps[i]) * (length as f64 / 2.0);
            stops.push(Stop {
                steps: [i + length / 2, i + length.div_ceil(2)],
                arrive: at,
                leave: at,
                is_corner: false,
                pinned: false,
            });
        }
        stops
    }

    fn corner_stop(&self, i: usize) -> Stop {
        let at = self.corners[i];
        let [width, height] = self.size.map(|s| s as f64);
        let on_edge = at.x == 0.0 || at.y == 0.0 || at.x == width || at.y == height;
        let before = self.steps[(i + self.steps.len() - 1) % self.steps.len()];
        let (mut arrive, mut leave) = (at, at);
        if self.closed[i] {
            arrive -= direction(before) * CHAMFER;
            leave += direction(self.steps[i]) * CHAMFER;
        }
        Stop {
            steps: [i, i],
            arrive,
            leave,
            is_corner: true,
            pinned: on_edge || self.closed[i],
        }
    }
}

fn direction(heading: usize) -> Vector2<f64> {
    let (x, y) = STEPS[heading];
    Vector2::new(x as f64, y as f64)
}

/// Where to begin: where the outline must bend, else behind its longest straight stretch.
fn first_stop(stops: &[Stop]) -> usize {
    if let Some(first) = stops.iter().position(|s| s.pinned) {
        return first;
    }
    // Corners and middles take turns.
    let n = stops.len();
    let length = |i: usize| (stops[i].arrive - stops[(i + n - 2) % n].arrive).norm();
    let corners = (0..n).step_by(2);
    corners
        .max_by(|&i, &j| length(i).total_cmp(&length(j)))
        .unwrap_or(0)
}
