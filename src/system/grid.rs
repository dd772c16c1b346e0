//! The grid of the transfer paper as a transition system: axis-parallel moves between cell centres.
//!
//! A move leads from a cell centre to any centre in the same row or column whose segment meets no
//! obstacle and no region but those of its ends (`transfer-planning.md`, VI; the published planner's
//! rule). Lengths are Manhattan, staying costs nothing, and a plan's word has one letter for each
//! waypoint, so formulas with next make sense here.

use std::collections::{HashMap, VecDeque};
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::{Point2, Vector2};

use super::{Landmark, Leg, Spot, TransitionSystem};
use crate::alphabet::{Alphabet, Letter, LetterSet, Props};
use crate::number::Brief;
use crate::random::{Random, choose};
use crate::workspace::{Bounds, Place, Workspace};

/// The largest number of cells of a grid.
pub const MAX_CELLS: usize = 1_000_000;

/// How far, relative to a cell, the grid's extent may be from the map's, and the start from a centre.
const FIT: f64 = 1e-6;

/// The four directions of moves; opposite ones are two apart.
const DIRECTIONS: [(isize, isize); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

/// Why a grid could not be laid over a map.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum GridError {
    /// No cell, or too many.
    #[error("a grid of {columns} × {rows} cells: expected at least one and at most {MAX_CELLS}")]
    Cells {
        /// Cells along x.
        columns: u32,
        /// Cells along y.
        rows: u32,
    },
    /// A cell has no side.
    #[error("a grid whose cells have a side of {}: expected a length above 0", Brief(*cell))]
    Side {
        /// What was given.
        cell: f64,
    },
    /// The cells do not cover the map.
    #[error(
        "{columns} × {rows} cells of side {} do not cover the map of {} × {}: expected columns · side = width and rows · side = height", Brief(*cell), Brief(*width), Brief(*height)
    )]
    Extent {
        /// Cells along x.
        columns: u32,
        /// Cells along y.
        rows: u32,
        /// A cell's side.
        cell: f64,
        /// The map's width.
        width: f64,
        /// The map's height.
        height: f64,
    },
    /// The start is no cell's centre.
    #[error("the start ({}, {}) is no cell centre: the nearest is ({}, {})", Brief(*x), Brief(*y), Brief(*near_x), Brief(*near_y))]
    OffCentre {
        /// The start's x.
        x: f64,
        /// The start's y.
        y: f64,
        /// The nearest centre's x.
        near_x: f64,
        /// The nearest centre's y.
        near_y: f64,
    },
    /// The start's cell cannot be entered.
    #[error("the start ({x}, {y}) lies in an obstacle: move it to a free cell")]
    Blocked {
        /// The start's x.
        x: f64,
        /// The start's y.
        y: f64,
    },
}

/// What lies between the centres of two neighbouring cells: the regions met, or `None` if an
/// obstacle is in the way.
type Gap = Option<Props>;

/// A grid over a map, with a start.
#[derive(Debug)]
pub struct Grid {
    map: Arc<Workspace>,
    columns: usize,
    rows: usize,
    cell: f64,
    start: Spot,
    /// By cell, `i * rows + j`; `None` where the robot cannot be.
    spots: Vec<Option<Spot>>,
    /// From each cell one step right, and one step up.
    gaps: [Vec<Gap>; 2],
    free: Vec<Point2<f64>>,
    by_letter: Vec<Vec<Point2<f64>>>,
    landmarks: Vec<Vec<Landmark>>,
    /// By cell: which landmark of its letter stands for its part; `u32::MAX` if none does.
    parts: Vec<u32>,
    reachable: LetterSet,
    /// Steps to targets that were asked for more than once, by target cell.
    fields: Mutex<HashMap<usize, Arc<Vec<u32>>>>,
}

impl Grid {
    /// Lays `columns × rows` square cells of side `cell` over a map, lower-left corner on lower-left
    /// corner.
    ///
    /// # Errors
    /// Cells that do not cover the map, or a start that is no free cell's centre.
    ///
    /// ```
    /// use std::sync::Arc;
    /// use nalgebra::Point2;
    /// use nngtl::system::{Grid, TransitionSystem};
    /// use nngtl::workspace::{Bounds, Workspace};
    /// let map = Arc::new(Workspace::new(Bounds::unit(), vec![], vec![])?);
    /// let grid = Grid::new(map, [10, 10], 0.1, Point2::new(0.05, 0.05))?;
    /// let far = grid.settle(Point2::new(0.97, 0.04)).unwrap();
    /// assert!(grid.step(&grid.start(), &far)); // one row: one move
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn new(
        map: Arc<Workspace>,
        cells: [u32; 2],
        cell: f64,
        start: Point2<f64>,
    ) -> Result<Self, GridError> {
        let [columns, rows] = cells;
        check_extent(&map, columns, rows, cell)?;
        let (nx, ny) = (columns as usize, rows as usize);
        let centre = |k: usize| centre_of(&map, cell, k / ny, k % ny);
        let spots: Vec<Option<Spot>> = (0..nx * ny)
            .map(|k| match map.locate(centre(k)) {
                Place::Free { letter, .. } => Some(Spot {
                    at: centre(k),
                    letter,
                }),
                Place::Outside | Place::Obstacle(_) => None,
            })
            .collect();
        let gaps = [
            gaps(&map, &spots, |k| (k / ny + 1 < nx).then_some(k + ny)),
            gaps(&map, &spots, |k| (k % ny + 1 < ny).then_some(k + 1)),
        ];
        let mut grid = Self {
            start: Spot {
                at: start,
                letter: Letter(0),
            },
            columns: nx,
            rows: ny,
            cell,
            free: spots.iter().flatten().map(|s| s.at).collect(),
            by_letter: vec![Vec::new(); map.alphabet().len()],
            landmarks: vec![Vec::new(); map.alphabet().len()],
            parts: vec![u32::MAX; nx * ny],
            reachable: map.alphabet().none(),
            fields: Mutex::default(),
            spots,
            gaps,
            map,
        };
        grid.start = grid.starting_at(start)?;
        for spot in grid.spots.iter().flatten() {
            grid.by_letter[spot.letter.index()].push(spot.at);
        }
        grid.find_parts();
        Ok(grid)
    }

    /// The map.
    #[must_use]
    pub fn map(&self) -> &Arc<Workspace> {
        &self.map
    }

    /// Cells along x and along y.
    #[must_use]
    pub fn cells(&self) -> [usize; 2] {
        [self.columns, self.rows]
    }

    /// The side of a cell, in map units.
    #[must_use]
    pub fn cell(&self) -> f64 {
        self.cell
    }

    /// Where the robot starts.
    #[must_use]
    pub fn start(&self) -> Spot {
        self.start
    }

    /// All cells where the robot can be, in order.
    pub fn free_spots(&self) -> impl Iterator<Item = Spot> + '_ {
        self.spots.iter().flatten().copied()
    }

    fn starting_at(&self, p: Point2<f64>) -> Result<Spot, GridError> {
        let k = self.nearest_cell(p);
        let near = centre_of(&self.map, self.cell, k / self.rows, k % self.rows);
        let off = (near - p).norm();
        if off.is_nan() || off > FIT * self.cell {
            return Err(GridError::OffCentre {
                x: p.x,
                y: p.y,
                near_x: near.x,
                near_y: near.y,
            });
        }
        self.spots[k].ok_or(GridError::Blocked { x: p.x, y: p.y })
    }

    /// The cell whose centre is nearest, within the grid.
    fn nearest_cell(&self, p: Point2<f64>) -> usize {
        let offset = (p - self.map.bounds().min) / self.cell;
        // A float-to-integer cast saturates, so points outside land in the border cells.
        let i = (offset.x.floor() as usize).min(self.columns - 1);
        let j = (offset.y.floor() as usize).min(self.rows - 1);
        i * self.rows + j
    }

    /// The cell next to `k`, and what lies between.
    fn next(&self, k: usize, direction: usize) -> Option<(usize, Props)> {
        let (dx, dy) = DIRECTIONS[direction];
        let i = (k / self.rows).checked_add_signed(dx)?;
        let j = (k % self.rows).checked_add_signed(dy)?;
        if i >= self.columns || j >= self.rows {
            return None;
        }
        let to = i * self.rows + j;
        let gap = self.gaps[direction % 2][k.min(to)]?;
        Some((to, gap))
    }

    /// Calls `visit` with each cell that a straight move from `k` leads to, nearest first in each
    /// direction.
    fn for_each_move(&self, k: usize, mut visit: impl FnMut(usize, Spot)) {
        let Some(from) = self.spots[k] else { return };
        let own = self.map.alphabet().props(from.letter).0;
        for direction in 0..4 {
            let (mut at, mut met) = (k, 0);
            while let Some((to, gap)) = self.next(at, direction) {
                met |= gap.0;
                let Some(spot) = self.spots[to] else { break };
                let here = self.map.alphabet().props(spot.letter).0;
                if met & !(own | here) == 0 {
                    visit(to, spot);
                }
                (at, met) = (to, met | here);
            }
        }
    }

    /// Finds the connected parts of each letter that can be reached, and a cell that stands for each.
    fn find_parts(&mut self) {
        let start = self.nearest_cell(self.start.at);
        let mut reached = vec![false; self.spots.len()];
        let mut open = vec![start];
        reached[start] = true;
        while let Some(k) = open.pop() {
            self.for_each_move(k, |to, _| {
                if !std::mem::replace(&mut reached[to], true) {
                    open.push(to);
                }
            });
        }
        for (k, reached) in reached.into_iter().enumerate() {
            if reached && self.parts[k] == u32::MAX {
                self.mark_part(k);
            }
        }
    }

    /// Marks the cells connected to `k` that carry its letter as one part.
    fn mark_part(&mut self, k: usize) {
        let Some(seed) = self.spots[k] else { return };
        let letter = seed.letter;
        let own = self.map.alphabet().props(letter).0;
        let number = self.landmarks[letter.index()].len() as u32;
        let mut members = vec![k];
        self.parts[k] = number;
        let mut done = 0;
        while let Some(&cell) = members.get(done) {
            done += 1;
            for direction in 0..4 {
                let Some((to, gap)) = self.next(cell, direction) else {
                    continue;
                };
                let same = self.spots[to].is_some_and(|s| s.letter == letter);
                if same && gap.0 & !own == 0 && self.parts[to] == u32::MAX {
                    self.parts[to] = number;
                    members.push(to);
                }
            }
        }
        let at = |k: &usize| centre_of(&self.map, self.cell, k / self.rows, k % self.rows);
        let sum = members
            .iter()
            .map(|k| at(k).coords)
            .fold(Vector2::zeros(), |a, b| a + b);
        let middle = Point2::from(sum / members.len() as f64);
        let away = |k: &&usize| (at(k) - middle).norm_squared();
        let central = members
            .iter()
            .min_by(|a, b| away(a).total_cmp(&away(b)).then(a.cmp(b)));
        self.reachable.insert(letter);
        self.landmarks[letter.index()].push(Landmark {
            at: central.map_or(seed.at, at),
            area: members.len() as f64 * self.cell * self.cell,
        });
    }

    /// Steps of one cell from everywhere to `target`, over cells outside regions and cells that carry
    /// the target's letter; over all cells if `through`.
    fn field(&self, target: usize, through: bool) -> Vec<u32> {
        let alphabet = self.map.alphabet();
        let letter = self.spots[target].map(|s| s.letter);
        let mut steps = vec![u32::MAX; self.spots.len()];
        steps[target] = 0;
        let mut open = VecDeque::from([target]);
        while let Some(k) = open.pop_front() {
            let passable = self.spots[k].is_some_and(|s| {
                through || Some(s.letter) == letter || alphabet.props(s.letter).is_empty()
            });
            if !passable {
                continue;
            }
            for direction in 0..4 {
                if let Some((to, _)) = self.next(k, direction)
                    && self.spots[to].is_some()
                    && steps[to] == u32::MAX
                {
                    steps[to] = steps[k] + 1;
                    open.push_back(to);
                }
            }
        }
        steps
    }

    fn field_to(&self, target: usize, keep: bool) -> Arc<Vec<u32>> {
        if !keep {
            return Arc::new(self.field(target, false));
        }
        let mut known = self.fields.lock().unwrap_or_else(PoisonError::into_inner);
        let field = known
            .entry(target)
            .or_insert_with(|| Arc::new(self.field(target, false)));
        Arc::clone(field)
    }

    /// The length of the way that [`first_leg`](TransitionSystem::first_leg) takes step by step; `None` if there is none.
    pub(crate) fn way_length(&self, from: Point2<f64>, to: Point2<f64>) -> Option<f64> {
        let (k, target) = (self.nearest_cell(from), self.nearest_cell(to));
        match self.field_to(target, true)[k] {
            u32::MAX => self.first_leg(from, to, true).map(|leg| leg.length),
            steps => Some(f64::from(steps) * self.cell),
        }
    }

    /// The longest straight run from `k` along which the steps to go fall by one each cell.
    fn descend(&self, k: usize, steps: &[u32]) -> Option<usize> {
        let run = |direction| {
            let (mut at, mut length) = (k, 0_u32);
            while let Some((to, _)) = self.next(at, direction)
                && steps[at] > 0
                && steps[to] == steps[at] - 1
            {
                (at, length) = (to, length + 1);
            }
            (length, at)
        };
        let runs = (0..4).map(run);
        // The first of the longest, so that ties do not depend on anything else.
        runs.reduce(|best, r| if r.0 > best.0 { r } else { best })
            .filter(|&(length, _)| length > 0)
            .map(|(_, at)| at)
    }
}

impl TransitionSystem for Grid {
    fn alphabet(&self) -> &Arc<Alphabet> {
        self.map.alphabet()
    }

    fn bounds(&self) -> Bounds {
        self.map.bounds()
    }

    fn settle(&self, p: Point2<f64>) -> Option<Spot> {
        if !self.map.bounds().contains(p) {
            return None;
        }
        self.spots[self.nearest_cell(p)]
    }

    fn distance(&self, a: Point2<f64>, b: Point2<f64>) -> f64 {
        (b.x - a.x).abs() + (b.y - a.y).abs()
    }

    fn step(&self, a: &Spot, b: &Spot) -> bool {
        let (from, to) = (self.nearest_cell(a.at), self.nearest_cell(b.at));
        let n = self.rows;
        let direction = match ((to / n).cmp(&(from / n)), (to % n).cmp(&(from % n))) {
            (std::cmp::Ordering::Equal, std::cmp::Ordering::Equal) => return true,
            (std::cmp::Ordering::Greater, std::cmp::Ordering::Equal) => 0,
            (std::cmp::Ordering::Equal, std::cmp::Ordering::Greater) => 1,
            (std::cmp::Ordering::Less, std::cmp::Ordering::Equal) => 2,
            (std::cmp::Ordering::Equal, std::cmp::Ordering::Less) => 3,
            _ => return false,
        };
        let props = |letter| self.map.alphabet().props(letter).0;
        let allowed = props(a.letter) | props(b.letter);
        let mut at = from;
        while at != to {
            match self.next(at, direction) {
                Some((next, gap)) if gap.0 & !allowed == 0 => at = next,
                _ => return false,
            }
            if self.spots[at].is_none_or(|s| props(s.letter) & !allowed != 0) {
                return false;
            }
        }
        true
    }

    fn sample_free(&self, random: &mut Random) -> Point2<f64> {
        choose(random, &self.free).copied().unwrap_or(self.start.at)
    }

    fn sample_letter(&self, letter: Letter, random: &mut Random) -> Point2<f64> {
        choose(random, &self.by_letter[letter.index()])
            .copied()
            .unwrap_or(self.start.at)
    }

    fn reachable(&self) -> &LetterSet {
        &self.reachable
    }

    fn landmarks(&self, letter: Letter) -> &[Landmark] {
        &self.landmarks[letter.index()]
    }

    fn first_leg(&self, from: Point2<f64>, to: Point2<f64>, keep: bool) -> Option<Leg> {
        let (k, target) = (self.nearest_cell(from), self.nearest_cell(to));
        if k == target {
            return Some(Leg { to, length: 0.0 });
        }
        let steps = self.field_to(target, keep);
        let (next, left) = match self.descend(k, &steps) {
            Some(next) => (next, steps[k]),
            // Regions bar the way: go through them.
            None => {
                let through = self.field(target, true);
                (self.descend(k, &through)?, through[k])
            }
        };
        self.spots[next].map(|s| Leg {
            to: s.at,
            length: f64::from(left) * self.cell,
        })
    }

    fn neighbours(&self, from: &Spot, into: &mut Vec<Spot>) -> bool {
        into.clear();
        self.for_each_move(self.nearest_cell(from.at), |_, spot| into.push(spot));
        true
    }

    fn part(&self, spot: &Spot) -> Option<u32> {
        let part = self.parts[self.nearest_cell(spot.at)];
        (part != u32::MAX).then_some(part)
    }

    fn reads_waypoints(&self) -> bool {
        true
    }

    fn fingerprint(&self) -> String {
        let grid = [self.columns as f64, self.rows as f64, self.cell];
        super::fingerprint(&self.map, &grid)
    }
}

fn check_extent(map: &Workspace, columns: u32, rows: u32, cell: f64) -> Result<(), GridError> {
    let count = (columns as usize).saturating_mul(rows as usize);
    if count == 0 || count > MAX_CELLS {
        return Err(GridError::Cells { columns, rows });
    }
    if cell.is_nan() || cell <= 0.0 {
        return Err(GridError::Side { cell });
    }
    let (width, height) = (map.bounds().width(), map.bounds().height());
    let fits = |n: u32, extent: f64| (f64::from(n) * cell - extent).abs() <= FIT * cell;
    if fits(columns, width) && fits(rows, height) {
        return Ok(());
    }
    Err(GridError::Extent {
        columns,
        rows,
        cell,
        width,
        height,
    })
}

fn centre_of(map: &Workspace, cell: f64, i: usize, j: usize) -> Point2<f64> {
    let min = map.bounds().min;
    Point2::new(
        min.x + (i as f64 + 0.5) * cell,
        min.y + (j as f64 + 0.5) * cell,
    )
}

fn gaps(
    map: &Workspace,
    spots: &[Option<Spot>],
    next: impl Fn(usize) -> Option<usize>,
) -> Vec<Gap> {
    let between = |k: usize| -> Gap {
        let (a, b) = (spots[k]?, spots[next(k)?]?);
        let stretches = map.trace(a.at, b.at).ok()?;
        let met = stretches
            .iter()
            .fold(0, |met, s| met | map.alphabet().props(s.letter).0);
        Some(Props(met))
    };
    (0..spots.len()).map(between).collect()
}

#[cfg(test)]
mod tests;
