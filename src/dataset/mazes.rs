//! Mazes: one-lane corridors between thin walls, where most turns are wrong.

use nalgebra::Point2;
use rand::RngExt;

use super::maps::round;
use super::rooms::{Rooms, shuffled};
use crate::random::{Random, chance};
use crate::workspace::{Bounds, Polygon};

/// Cells along a side.
const SIDES: std::ops::RangeInclusive<usize> = 6..=12;

/// A maze on a square grid of cells.
pub(super) struct Maze {
    /// Walls, as rectangles that overlap where they cross.
    pub(super) walls: Vec<Polygon>,
    /// Cells along a side.
    side: usize,
    /// Half the free width of a corridor.
    pub(super) reach: f64,
}

impl Maze {
    /// Draws a maze: a random spanning tree of the cells (half of them by depth-first walks, which makes
    /// long corridors, half by joining cells in random order, which makes many short ones), and openings
    /// in up to a fifth of the remaining walls, so that most mazes have more than one way around.
    pub(super) fn draw(random: &mut Random) -> Self {
        let side = random.random_range(SIDES);
        let cell = 1.0 / side as f64;
        let thick = cell * random.random_range(0.12..0.3);
        let mut open = if chance(random, 0.5) {
            walked(side, random)
        } else {
            joined(side, random)
        };
        let loops = random.random_range(0.0..0.2);
        for wall in open.upright.iter_mut().chain(&mut open.level) {
            *wall |= chance(random, loops);
        }
        Self {
            walls: open.walls(thick),
            side,
            reach: (cell - thick) / 2.0,
        }
    }

    /// The middle of a random cell.
    pub(super) fn place(&self, random: &mut Random) -> Point2<f64> {
        let mut middle = || (random.random_range(0..self.side) as f64 + 0.5) / self.side as f64;
        Point2::new(middle(), middle())
    }
}

/// Which inner walls of a grid of cells are open.
struct Openings {
    side: usize,
    /// Between columns i and i + 1 in row j: number `i · side + j`.
    upright: Vec<bool>,
    /// Between rows j and j + 1 in column i: number `j · side + i`.
    level: Vec<bool>,
}

impl Openings {
    fn none(side: usize) -> Self {
        let closed = vec![false; (side - 1) * side];
        Self {
            side,
            upright: closed.clone(),
            level: closed,
        }
    }

    /// Opens the wall between two neighbouring cells, given as (column, row).
    fn open(&mut self, a: (usize, usize), b: (usize, usize)) {
        if a.1 == b.1 {
            self.upright[a.0.min(b.0) * self.side + a.1] = true;
        } else {
            self.level[a.1.min(b.1) * self.side + a.0] = true;
        }
    }

    /// The closed walls, those in one line as one rectangle.
    fn walls(&self, thick: f64) -> Vec<Polygon> {
        let line = |k: usize| k as f64 / self.side as f64;
        let corner = |x: f64, y: f64| round(Bounds::unit().clip(Point2::new(x, y)));
        let half = thick / 2.0;
        let mut walls = Vec::new();
        for k in 0..self.side - 1 {
            let across = line(k + 1);
            let row = |open: &[bool]| stretches(&open[k * self.side..][..self.side]);
            for (from, to) in row(&self.upright) {
                let low = corner(across - half, line(from) - half);
                let high = corner(across + half, line(to) + half);
                walls.extend(Polygon::rectangle(low, high));
            }
            for (from, to) in row(&self.level) {
                let low = corner(line(from) - half, across - half);
                let high = corner(line(to) + half, across + half);
                walls.extend(Polygon::rectangle(low, high));
            }
        }
        walls
    }
}

/// The runs of closed walls, as (first, one after the last).
fn stretches(open: &[bool]) -> Vec<(usize, usize)> {
    let mut found: Vec<(usize, usize)> = Vec::new();
    for (k, _) in open.iter().enumerate().filter(|(_, open)| !**open) {
        match found.last_mut() {
            Some(last) if last.1 == k => last.1 = k + 1,
            _ => found.push((k, k + 1)),
        }
    }
    found
}

/// A spanning tree by a depth-first walk that turns at random.
fn walked(side: usize, random: &mut Random) -> Openings {
    let mut open = Openings::none(side);
    let mut seen = vec![false; side * side];
    let mut way = vec![(random.random_range(0..side), random.random_range(0..side))];
    seen[way[0].0 * side + way[0].1] = true;
    while let Some(&(i, j)) = way.last() {
        let ahead: Vec<(usize, usize)> = [
            (i.wrapping_sub(1), j),
            (i + 1, j),
            (i, j.wrapping_sub(1)),
            (i, j + 1),
        ]
        .into_iter()
        .filter(|&(i, j)| i < side && j < side && !seen[i * side + j])
        .collect();
        if ahead.is_empty() {
            way.pop();
            continue;
        }
        let next = ahead[random.random_range(0..ahead.len())];
        open.open((i, j), next);
        seen[next.0 * side + next.1] = true;
        way.push(next);
    }
    open
}

/// A spanning tree by opening walls in random order wherever that joins something.
fn joined(side: usize, random: &mut Random) -> Openings {
    let mut open = Openings::none(side);
    let mut rooms = Rooms::new(side * side);
    for (upright, i, j) in shuffled(side, side, random) {
        let next = if upright { (i + 1, j) } else { (i, j + 1) };
        if rooms.join(j * side + i, next.1 * side + next.0) {
            open.open((i, j), next);
        }
    }
    open
}
