//! Shapes as on occupancy maps: caves that a cellular automaton grows, and rooms whose walls a
//! range finder saw, traced to polygons as map files are (`maps/outline.rs`).

use nalgebra::Point2;
use rand::RngExt;

use super::maps::round;
use super::rooms;
use crate::maps::DEFAULT_TOLERANCE;
use crate::maps::outline::Cells;
use crate::random::{Random, chance};
use crate::workspace::{Bounds, Polygon};

/// Cells along a side.
const SIDES: std::ops::RangeInclusive<usize> = 36..=64;

/// The share of the cells that the robot can reach, at least.
const LEAST_FREE: f64 = 0.4;

/// Draws obstacles; `None` if too little is free or the free part does not meet the edge.
pub(super) fn obstacles(random: &mut Random) -> Option<Vec<Polygon>> {
    let side = random.random_range(SIDES);
    let occupied = if chance(random, 0.6) {
        cave(side, random)
    } else {
        scanned_rooms(side, random)
    };
    let mut cells = Cells {
        width: side,
        height: side,
        occupied,
    };
    fill_all_but_the_largest(&mut cells)?;
    let mut found = Vec::new();
    for rings in cells.outlines(DEFAULT_TOLERANCE).ok()? {
        // A hole would be free space that cannot be reached; it was filled.
        let [ring] = rings.as_slice() else {
            return None;
        };
        let corner = |p: &Point2<f64>| round(Bounds::unit().clip(p / side as f64));
        let mut corners: Vec<Point2<f64>> = ring.iter().map(corner).collect();
        corners.dedup();
        found.push(Polygon::new(corners).ok()?);
    }
    Some(found)
}

/// Noise that a majority rule smooths: a cell is occupied afterwards if at least five of the nine cells
/// around it were.
fn cave(side: usize, random: &mut Random) -> Vec<bool> {
    let filled = random.random_range(0.38..0.48);
    let mut cells: Vec<bool> = (0..side * side).map(|_| chance(random, filled)).collect();
    for _ in 0..random.random_range(3..=6) {
        cells = smoothed(&cells, side);
    }
    cells
}

/// Walls of rooms, as cells that they meet, with some cells beside them and a little clutter.
fn scanned_rooms(side: usize, random: &mut Random) -> Vec<bool> {
    let mut cells = vec![false; side * side];
    let at = |c: f64| ((c * side as f64) as usize).min(side - 1);
    for wall in rooms::draw(random) {
        let (low, high) = (wall.min(), wall.max());
        for y in at(low.y)..=at(high.y) {
            for x in at(low.x)..=at(high.x) {
                cells[y * side + x] = true;
            }
        }
    }
    let (rough, clutter) = (
        random.random_range(0.05..0.2),
        random.random_range(0.0..0.02),
    );
    let walls = cells.clone();
    for (k, cell) in cells.iter_mut().enumerate() {
        let beside = around(&walls, side, k % side, k / side) > 0;
        *cell |= chance(random, if beside { rough } else { clutter });
    }
    cells
}

/// How many of the nine cells around this one are occupied; beyond the edge the edge goes on.
fn around(cells: &[bool], side: usize, x: usize, y: usize) -> usize {
    let three = |c: usize| [c.saturating_sub(1), c, (c + 1).min(side - 1)];
    let rows = three(y).into_iter();
    rows.flat_map(|y| three(x).map(|x| usize::from(cells[y * side + x])))
        .sum()
}

fn smoothed(cells: &[bool], side: usize) -> Vec<bool> {
    (0..side * side)
        .map(|k| around(cells, side, k % side, k / side) >= 5)
        .collect()
}

/// Fills every free part but the largest; `None` if that is small, or away from the edge: then an obstacle
/// would have a hole.
fn fill_all_but_the_largest(cells: &mut Cells) -> Option<()> {
    let (width, height) = (cells.width, cells.height);
    let mut part = vec![usize::MAX; cells.occupied.len()];
    let mut sizes = Vec::new();
    for start in 0..part.len() {
        if cells.occupied[start] || part[start] != usize::MAX {
            continue;
        }
        let name = sizes.len();
        let (mut open, mut size) = (vec![start], 0);
        part[start] = name;
        while let Some(cell) = open.pop() {
            size += 1;
            let (x, y) = (cell % width, cell / width);
            let beside = [
                (x > 0).then(|| cell - 1),
                (x + 1 < width).then(|| cell + 1),
                (y > 0).then(|| cell - width),
                (y + 1 < height).then(|| cell + width),
            ];
            for next in beside.into_iter().flatten() {
                if !cells.occupied[next] && part[next] == usize::MAX {
                    part[next] = name;
                    open.push(next);
                }
            }
        }
        sizes.push(size);
    }
    let largest = (0..sizes.len()).max_by_key(|&name| sizes[name])?;
    if (sizes[largest] as f64) < LEAST_FREE * part.len() as f64 {
        return None;
    }
    let edge = |k: usize| {
        let (x, y) = (k % width, k / width);
        x == 0 || y == 0 || x + 1 == width || y + 1 == height
    };
    let reaches_edge = (0..part.len()).any(|k| part[k] == largest && edge(k));
    for (cell, name) in cells.occupied.iter_mut().zip(&part) {
        *cell |= *name != largest;
    }
    reaches_edge.then_some(())
}
