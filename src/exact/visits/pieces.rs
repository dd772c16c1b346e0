//! The borders of places in pieces, and what legs between these are at least.

use std::cell::OnceCell;
use std::sync::Arc;

use nalgebra::Point2;

use super::duties::Duty;
use crate::automaton::Task;
use crate::exact::Halt;
use crate::workspace::visibility::{PathsTo, VisibilityGraph};
use crate::workspace::{Polygon, Segment, Side, Workspace, segment_distance};

/// Into about so many pieces borders are cut.
const PIECES: f64 = 72.0;

/// A piece of the border of a place that is asked for, free of obstacles.
pub(super) struct Piece {
    ends: Segment,
    /// The number of the duty.
    pub(super) duty: usize,
}

/// Pieces of borders, and what legs between them are at least.
pub(super) struct Pieces {
    pub(super) all: Vec<Piece>,
    /// What legs from one to another are at least, row by row.
    pub(super) between: Vec<f64>,
    pub(super) from_start: Vec<f64>,
    /// The duties that the start fulfils, as bits.
    pub(super) at_start: u32,
    /// For each duty, whether its place is apart from all others.
    pub(super) apart: Vec<bool>,
}

impl Pieces {
    /// The pieces of a task's places; `None` if the work was ended.
    pub(super) fn new(
        map: &Workspace,
        start: Point2<f64>,
        duties: &[Duty],
        task: &Task,
        halt: Halt<'_>,
    ) -> Option<Self> {
        let here = map.letter_at(start).map(|l| map.alphabet().props(l));
        let is_here = |d: &Duty| here.is_some_and(|props| d.regions.0 & !props.0 == 0);
        let bit = |(i, _): (usize, &Duty)| 1_u32 << i;
        let fulfilled = duties.iter().enumerate().filter(|(_, d)| is_here(d));
        let at_start = fulfilled.map(bit).fold(0, |set, bit| set | bit);
        let is_apart = |d: &Duty| {
            let mut others = duties.iter().filter(|other| *other != d);
            others.all(|other| are_duties_apart(map, d, other))
        };
        let mut pieces = Self {
            all: cut(map, duties),
            between: Vec::new(),
            from_start: Vec::new(),
            at_start,
            apart: duties.iter().map(is_apart).collect(),
        };
        let space = space(map, start, task);
        let count = pieces.all.len();
        pieces.between = vec![0.0; count * count];
        for i in 0..count {
            if halt.is_due() {
                return None;
            }
            let legs = Legs::new(space.as_ref(), pieces.all[i].ends);
            for j in 0..i {
                let least = legs.from(pieces.all[j].ends);
                (pieces.between[i * count + j], pieces.between[j * count + i]) = (least, least);
            }
            pieces.from_start.push(legs.from((start, start)));
        }
        Some(pieces)
    }
}

/// The map with the regions that no accepted word holds as obstacles, as far as they are apart from all else.
fn space(map: &Workspace, start: Point2<f64>, task: &Task) -> Option<VisibilityGraph> {
    let passable = {
        let mut all = map.alphabet().none();
        let guards = task.nba.transitions.iter().flatten();
        guards.for_each(|t| all.union_with(&t.guard));
        all
    };
    let margin = 16.0 * map.tolerance();
    let is_forbidden = |r: usize| passable.is_disjoint(&map.alphabet().letters_with(r));
    let is_apart = |r: usize| {
        let mine = &map.regions()[r].polygon;
        let others = map.regions().iter().enumerate().filter(|(i, _)| *i != r);
        let mut others = others
            .map(|(_, region)| &region.polygon)
            .chain(map.obstacles());
        others.all(|other| mine.is_apart_from(other, margin))
    };
    let forbidden = (0..map.regions().len()).filter(|&r| is_forbidden(r) && is_apart(r));
    let mut obstacles = map.obstacles().to_vec();
    obstacles.extend(forbidden.map(|r| map.regions()[r].polygon.clone()));
    let space = Workspace::new(map.bounds(), obstacles, Vec::new()).ok()?;
    space.letter_at(start)?;
    Some(VisibilityGraph::new(Arc::new(space)))
}

/// Whether no place can fulfil two duties, or touch two such places.
fn are_duties_apart(map: &Workspace, first: &Duty, second: &Duty) -> bool {
    let margin = 16.0 * map.tolerance();
    let polygon = |r: usize| &map.regions()[r].polygon;
    let mut pairs = first
        .regions
        .iter()
        .flat_map(|r| second.regions.iter().map(move |s| (r, s)));
    pairs.any(|(r, s)| r != s && polygon(r).is_apart_from(polygon(s), margin))
}

/// The borders of the duties' places in pieces that no obstacle covers part of.
fn cut(map: &Workspace, duties: &[Duty]) -> Vec<Piece> {
    let margin = 4.0 * map.tolerance();
    let polygon = |r: usize| &map.regions()[r].polygon;
    let free = |p: Point2<f64>| map.letter_at(p).is_some();
    let mut whole: Vec<Piece> = Vec::new();
    for (duty, Duty { regions, .. }) in duties.iter().enumerate() {
        for r in regions.iter() {
            let other = regions.iter().find(|&s| s != r).map(polygon);
            let inside = |p| other.is_none_or(|o| o.side_of(p, margin) != Side::Outside);
            for (a, b) in polygon(r).edges() {
                let at = |t: f64| a + (b - a) * t;
                let turns = crossings(map, (a, b), other);
                let parts = turns.windows(2).map(|t| (at(t[0]), at(t[1])));
                let open = parts.filter(|&part| free(middle(part)) && inside(middle(part)));
                whole.extend(open.map(|ends| Piece { ends, duty }));
            }
        }
    }
    let length = |p: &Piece| (p.ends.1 - p.ends.0).norm();
    let sum: f64 = whole.iter().map(length).sum();
    let pieces = |p: &Piece| {
        let count = (PIECES * length(p) / sum).ceil().max(1.0);
        let (a, b) = p.ends;
        let at = move |k: f64| a + (b - a) * (k / count);
        let duty = p.duty;
        (0..count as usize).map(move |k| Piece {
            ends: (at(k as f64), at((k + 1) as f64)),
            duty,
        })
    };
    whole.iter().flat_map(pieces).collect()
}

/// Where an edge meets the borders of obstacles, of the bounds, and of another polygon: ascending, from 0 to 1.
fn crossings(map: &Workspace, (a, b): Segment, other: Option<&Polygon>) -> Vec<f64> {
    let (min, max) = (a.inf(&b), a.sup(&b));
    let meets = |p: &&Polygon| {
        p.min().x <= max.x && p.min().y <= max.y && p.max().x >= min.x && p.max().y >= min.y
    };
    let bounds = map.bounds();
    let frame = Polygon::rectangle(bounds.min, bounds.max).ok();
    let near = map
        .obstacles()
        .iter()
        .chain(other)
        .chain(&frame)
        .filter(meets);
    let along = b - a;
    let square = along.norm_squared();
    let mut found = vec![0.0, 1.0];
    for (c, d) in near.flat_map(Polygon::edges) {
        let across = d - c;
        let turn = along.perp(&across);
        if turn != 0.0 {
            let (t, u) = ((c - a).perp(&across) / turn, (c - a).perp(&along) / turn);
            if (-1e-9..=1.0 + 1e-9).contains(&u) {
                found.push(t);
            }
        } else {
            // Borders that run along each other begin and end somewhere.
            found.extend([c, d].map(|p| along.dot(&(p - a)) / square));
        }
    }
    found.retain(|t| (0.0..=1.0).contains(t));
    found.sort_by(f64::total_cmp);
    found.dedup_by(|b, a| *b - *a < 1e-9);
    found
}

fn middle((a, b): Segment) -> Point2<f64> {
    nalgebra::center(&a, &b)
}

/// What legs to a piece are at least.
struct Legs<'l> {
    /// `None` where straight lines are all that is known.
    space: Option<&'l VisibilityGraph>,
    piece: Segment,
    /// Ways around obstacles, made where they are asked for first.
    ways: OnceCell<PathsTo>,
}

impl<'l> Legs<'l> {
    fn new(space: Option<&'l VisibilityGraph>, piece: Segment) -> Self {
        Self {
            space,
            piece,
            ways: OnceCell::new(),
        }
    }

    fn from(&self, other: Segment) -> f64 {
        let straight = segment_distance(self.piece, other);
        let Some(space) = self.space else {
            return straight;
        };
        let (here, there) = (middle(self.piece), middle(other));
        if space.map().is_free_between(there, here) {
            return straight;
        }
        let ways = self.ways.get_or_init(|| space.paths_to(here));
        let around = ways
            .first_leg(space, there)
            .map_or(0.0, |(length, _)| length);
        let halves = ((self.piece.1 - self.piece.0).norm() + (other.1 - other.0).norm()) / 2.0;
        straight.max(around - halves)
    }
}
