//! Plans on a grid that are made cheaper move by move.
//!
//! Trees on a grid keep the detours that they were drawn with, and close a suffix where the automaton does: what shortening and
//! [`rounds`](super::rounds) do for motion in the plane is done here for moves between cells. Four changes are tried, always the one
//! with the least cost in sight first, and the checker decides: a part of the way is cut short, visits change their order, the loop is
//! entered elsewhere, and the way there becomes part of the loop.

use std::sync::Arc;

use nalgebra::Point2;

use super::{is_less, walked};
use crate::automaton::Task;
use crate::mission::check;
use crate::plan::{Cost, Path, Waypoint};
use crate::scenario::Scenario;
use crate::shorten::orders;
use crate::system::{Grid, Spot, TransitionSystem};
use crate::verify::Verified;

/// So many changes are tried at most before one is found that helps, the most promising first.
const TRIES: usize = 512;

/// So many changes are made at most.
const CHANGES: usize = 64;

/// So many cells are looked at for ways, in all: on the largest grids a way takes a million.
const CELLS: usize = 20_000_000;

/// Parts with more visits keep their order: how many others there are grows with the square of their number.
const VISITS: usize = 16;

/// A part of a plan.
#[derive(Clone, Copy)]
enum Part {
    Prefix,
    Suffix,
}

/// A change of a plan.
enum Change {
    /// A part goes through these of its points alone, by the shortest ways.
    Through(Part, Vec<usize>),
    /// A part takes the shortest way from one of its points to another.
    Cut(Part, [usize; 2]),
    /// The loop is entered at its point `at`, from the point `leave` of the prefix.
    Enter { leave: usize, at: usize },
    /// The loop begins at the point `begin` of the prefix and comes back there from its point `turn`.
    Round { begin: usize, turn: usize },
}

/// The plan after all changes that made it cheaper, if there was one.
pub(super) fn improve(
    scenario: &Scenario,
    task: &Task,
    path: &Path,
    known: &Verified,
) -> Option<(Path, Verified)> {
    let spec = scenario.grid?;
    let map = Arc::clone(&scenario.workspace);
    let grid = Grid::new(map, spec.cells, spec.cell, scenario.start).ok()?;
    let mut ways = Ways { grid, left: CELLS };
    let mut best: Option<(Path, Verified)> = None;
    for _ in 0..CHANGES {
        let (path, known) = best.as_ref().map_or((path, known), |(p, v)| (p, v));
        let Some(cheaper) = change(scenario, task, path, known, &mut ways) else {
            break;
        };
        best = Some(cheaper);
    }
    best
}

/// The plan after the most promising change that makes it cheaper.
fn change(
    scenario: &Scenario,
    task: &Task,
    path: &Path,
    known: &Verified,
    ways: &mut Ways,
) -> Option<(Path, Verified)> {
    let changes = changes(path, known.cost, scenario.weight, ways);
    let mut tried = changes.into_iter().take(TRIES);
    tried.find_map(|(_, change)| {
        let changed = change.apply(path, ways)?;
        let cheaper = |v: &Verified| is_less(v.cost.total, known.cost.total);
        let verified = check(scenario, task, &changed, None).ok().filter(cheaper)?;
        Some((changed, verified))
    })
}

/// The length of a way in which nothing stands.
fn apart(a: Point2<f64>, b: Point2<f64>) -> f64 {
    (b.x - a.x).abs() + (b.y - a.y).abs()
}

/// All changes that would make the plan cheaper if nothing stood in the way, the cheapest first, with that cost.
fn changes(path: &Path, cost: Cost, weight: f64, ways: &Ways) -> Vec<(f64, Change)> {
    let (prefix, suffix) = (&path.prefix, &path.suffix);
    let (before, after) = (walked(prefix, apart), walked(suffix, apart));
    let (whole, round) = (before[before.len() - 1], after[after.len() - 1]);
    let total = |prefix: f64, suffix: f64| Cost::new(prefix, suffix, weight).total;
    let mut found = Vec::new();
    let mut add = |least: f64, change: Change| {
        if is_less(least, cost.total) {
            found.push((least, change));
        }
    };
    for (part, points, walked) in [
        (Part::Prefix, prefix, &before),
        (Part::Suffix, suffix, &after),
    ] {
        // What the plan costs at least with a part of another length.
        let with = |length: f64| match part {
            Part::Prefix => total(length, round),
            Part::Suffix => total(whole, length),
        };
        let last = points.len() - 1;
        for to in 1..=last {
            for from in 0..to {
                let saved = walked[to] - walked[from] - apart(points[from].at, points[to].at);
                add(with(walked[last] - saved), Change::Cut(part, [from, to]));
            }
        }
        for order in other_orders(points, ways) {
            let legs = order.windows(2);
            let length = legs.map(|w| apart(points[w[0]].at, points[w[1]].at)).sum();
            add(with(length), Change::Through(part, order));
        }
    }
    for (i, leave) in prefix.iter().enumerate() {
        for (k, point) in suffix.iter().enumerate() {
            let way = apart(leave.at, point.at);
            // Its last point is its first.
            if k + 1 < suffix.len().max(2) {
                let change = Change::Enter { leave: i, at: k };
                add(total(before[i] + way, round), change);
            }
            let longer = whole - before[i] + after[k] + way;
            if longer > 0.0 {
                let change = Change::Round { begin: i, turn: k };
                add(total(before[i], longer), change);
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
}

/// Other orders of the visits of a part, between its first point and its last one.
fn other_orders(points: &[Waypoint], ways: &Ways) -> Vec<Vec<usize>> {
    let last = points.len() - 1;
    let is_kept = |&i: &usize| i == 0 || i == last || ways.sees(points[i].at);
    let visits: Vec<usize> = (0..=last).filter(is_kept).collect();
    if !(4..=VISITS).contains(&visits.len()) {
        return Vec::new();
    }
    let orders = orders(visits.len(), true).into_iter();
    orders
        .map(|order| order.into_iter().map(|i| visits[i]).collect())
        .collect()
}

impl Change {
    /// The plan after the change; `None` if there is no way.
    fn apply(&self, old: &Path, ways: &mut Ways) -> Option<Path> {
        let Path { prefix, suffix } = old;
        let with = |part: Part, points: Vec<Waypoint>| match part {
            Part::Prefix => Path {
                prefix: points,
                suffix: suffix.clone(),
            },
            Part::Suffix => Path {
                prefix: prefix.clone(),
                suffix: points,
            },
        };
        let points = |part: Part| match part {
            Part::Prefix => prefix,
            Part::Suffix => suffix,
        };
        Some(match *self {
            Self::Through(part, ref order) => {
                let points = points(part);
                let mut through = vec![points[order[0]]];
                for &i in &order[1..] {
                    ways.go(&mut through, points[i])?;
                }
                with(part, through)
            }
            Self::Cut(part, [from, to]) => {
                let points = points(part);
                let mut cut = points[..=from].to_vec();
                ways.go(&mut cut, points[to])?;
                cut.extend(&points[to + 1..]);
                with(part, cut)
            }
            Self::Enter { leave, at } => {
                let mut way = prefix[..=leave].to_vec();
                ways.go(&mut way, suffix[at])?;
                let mut turned = suffix[at..].to_vec();
                turned.extend(&suffix[1..=at]);
                if let Some(end) = turned.last_mut() {
                    end.state = suffix[at].state;
                }
                Path {
                    prefix: way,
                    suffix: turned,
                }
            }
            Self::Round { begin, turn } => {
                let mut round = prefix[begin..].to_vec();
                round.extend(&suffix[1..=turn]);
                ways.go(&mut round, prefix[begin])?;
                Path {
                    prefix: prefix[..=begin].to_vec(),
                    suffix: round,
                }
            }
        })
    }
}

/// Shortest ways on the grid, as far as the budget goes.
struct Ways {
    grid: Grid,
    /// So many cells may still be looked at.
    left: usize,
}

impl Ways {
    /// Whether there is a region.
    fn sees(&self, at: Point2<f64>) -> bool {
        let props = |spot: Spot| self.grid.alphabet().props(spot.letter);
        self.grid
            .settle(at)
            .is_some_and(|spot| !props(spot).is_empty())
    }

    /// Goes on from the last of `points` to a place: adds the moves that lead there, if there are any. Points on the way have its state.
    fn go(&mut self, points: &mut Vec<Waypoint>, to: Waypoint) -> Option<()> {
        let mut at = points.last()?.at;
        if let Some(end) = points.last_mut()
            && at == to.at
        {
            end.state = to.state;
            return Some(());
        }
        let spot = |at| self.grid.settle(at);
        if !self.grid.step(&spot(at)?, &spot(to.at)?) {
            let [columns, rows] = self.grid.cells();
            self.left = self.left.checked_sub(columns * rows)?;
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
