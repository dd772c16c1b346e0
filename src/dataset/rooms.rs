//! Walls of rooms: a grid of them, joined by doors so that every room can be reached.

use std::ops::RangeInclusive;

use nalgebra::Point2;
use rand::RngExt;

use super::maps::round;
use crate::random::{Random, chance};
use crate::workspace::{Bounds, Polygon};

/// The cuts of one axis: 0, the positions of the walls, 1.
type Cuts = Vec<f64>;

/// How the wall between two neighbouring rooms looks.
#[derive(Clone, Copy, PartialEq)]
enum Wall {
    Closed,
    Door,
    Open,
}

/// Draws the walls of 2 × 2 to 5 × 5 rooms.
pub(super) fn draw(random: &mut Random) -> Vec<Polygon> {
    let (xs, ys) = (cuts(2..=5, random), cuts(2..=5, random));
    let thick = random.random_range(0.012..0.03);
    between(&xs, &ys, thick, random)
}

/// Draws the walls of so many rooms along each side, so thick.
pub(super) fn walls(
    counts: RangeInclusive<usize>,
    thick: f64,
    random: &mut Random,
) -> Vec<Polygon> {
    let (xs, ys) = (cuts(counts.clone(), random), cuts(counts, random));
    between(&xs, &ys, thick, random)
}

/// The walls of rooms between these cuts. A random spanning tree of the rooms has doors; some more walls have a door too or are
/// left out.
fn between(xs: &Cuts, ys: &Cuts, thick: f64, random: &mut Random) -> Vec<Polygon> {
    let (columns, rows) = (xs.len() - 1, ys.len() - 1);
    let (extra, open) = (
        random.random_range(0.0..0.35),
        random.random_range(0.0..0.5),
    );
    let mut rooms = Rooms::new(columns * rows);
    let mut walls = Vec::new();
    for k in shuffled(columns, rows, random) {
        let (upright, i, j) = k;
        let (a, b) = if upright {
            (j * columns + i, j * columns + i + 1)
        } else {
            (j * columns + i, (j + 1) * columns + i)
        };
        let wall = if rooms.join(a, b) || chance(random, extra) {
            if chance(random, open) {
                Wall::Open
            } else {
                Wall::Door
            }
        } else {
            Wall::Closed
        };
        let along = if upright {
            (ys[j], ys[j + 1])
        } else {
            (xs[i], xs[i + 1])
        };
        let across = if upright { xs[i + 1] } else { ys[j + 1] };
        for (from, to) in solid(wall, along, thick, random) {
            let (near, far) = ((from, across - thick / 2.0), (to, across + thick / 2.0));
            let corner = |(u, v): (f64, f64)| {
                let p = if upright {
                    Point2::new(v, u)
                } else {
                    Point2::new(u, v)
                };
                round(Bounds::unit().clip(p))
            };
            walls.extend(Polygon::rectangle(corner(near), corner(far)));
        }
    }
    walls
}

/// So many rooms of uneven size along an axis, none narrower than two fifths of an even share.
fn cuts(counts: RangeInclusive<usize>, random: &mut Random) -> Cuts {
    let count = random.random_range(counts);
    let widths: Vec<f64> = (0..count).map(|_| random.random_range(0.6..1.4)).collect();
    let total: f64 = widths.iter().sum();
    let mut at = 0.0;
    let inner = widths[..count - 1].iter().map(|w| {
        at += w / total;
        at
    });
    std::iter::once(0.0).chain(inner).chain([1.0]).collect()
}

/// The inner walls, as (upright, column, row), in random order.
pub(super) fn shuffled(
    columns: usize,
    rows: usize,
    random: &mut Random,
) -> Vec<(bool, usize, usize)> {
    let upright = (0..columns - 1).flat_map(|i| (0..rows).map(move |j| (true, i, j)));
    let level = (0..columns).flat_map(|i| (0..rows - 1).map(move |j| (false, i, j)));
    let mut all: Vec<_> = upright.chain(level).collect();
    for k in (1..all.len()).rev() {
        all.swap(k, random.random_range(0..=k));
    }
    all
}

/// The solid pieces of a wall from `a` to `b`; they reach into the crossing walls by half their
/// thickness, so that no corner is left open.
fn solid(wall: Wall, (a, b): (f64, f64), thick: f64, random: &mut Random) -> Vec<(f64, f64)> {
    let (from, to) = (a - thick / 2.0, b + thick / 2.0);
    match wall {
        Wall::Open => Vec::new(),
        Wall::Closed => vec![(from, to)],
        Wall::Door => {
            let room = b - a - 2.0 * thick;
            let gap = random.random_range(0.05_f64..0.11).min(0.7 * room);
            let slack = room - gap;
            let door = a + thick + random.random_range(0.1..0.9) * slack;
            vec![(from, door), (door + gap, to)]
        }
    }
}

/// Which rooms are joined already (union-find).
pub(super) struct Rooms(Vec<usize>);

impl Rooms {
    pub(super) fn new(count: usize) -> Self {
        Self((0..count).collect())
    }

    fn root(&self, mut room: usize) -> usize {
        while self.0[room] != room {
            room = self.0[room];
        }
        room
    }

    /// Joins two rooms; whether they were apart.
    pub(super) fn join(&mut self, a: usize, b: usize) -> bool {
        let (a, b) = (self.root(a), self.root(b));
        self.0[a] = b;
        a != b
    }
}
