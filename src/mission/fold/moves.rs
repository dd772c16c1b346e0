//! Plans on a grid that are made cheaper move by move.
//!
//! Trees on a grid keep the detours that they were drawn with, and close a suffix where the automaton does: what shortening and
//! [`rounds`](super::rounds) do for motion in the plane is done here for moves between cells. Four changes are tried, always the one
//! that would cost least first, and the checker decides: a part of the way is cut short, visits change their order, the loop is
//! entered elsewhere, and the way there becomes part of the loop. When none helps, a round is begun although it does not, in case the
//! others then do.

mod ways;

use std::collections::HashSet;
use std::sync::Arc;

use nalgebra::Point2;

use super::{AGAIN, is_less, walked};
use crate::alphabet::Letter;
use crate::automaton::Task;
use crate::ltl::Formula;
use crate::mission::check;
use crate::plan::{Cost, Path, Waypoint};
use crate::scenario::Scenario;
use crate::shorten::orders;
use crate::system::Grid;
use crate::verify::{Refusal, Verified};
use ways::{Ways, apart};

/// The checker is asked for so many changes at most before one is found that helps, the most promising first.
const TRIES: usize = 512;

/// So many changes are made at most, one after the other.
const CHANGES: usize = 64;

/// At so many visits of the prefix, the first ones, a round begins although it is not cheaper by itself.
const BEGINS: usize = 4;

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
    let mut search = Search {
        scenario,
        task,
        ways: Ways::new(grid),
        refused: HashSet::new(),
    };
    let mut best = search.descend(path, known);
    // A prefix that costs nothing need not be shorter.
    let again = if scenario.weight > 0.0 { AGAIN } else { 0 };
    for _ in 0..again {
        let (path, known) = best.as_ref().map_or((path, known), |(p, v)| (p, v));
        let begins = stops(&path.prefix, &search.ways);
        let mut cheapest: Option<(Path, Verified)> = None;
        for begin in begins.into_iter().take(BEGINS) {
            let Some(round) = search.begin(path, known, begin) else {
                continue;
            };
            let found = search.descend(&round.0, &round.1).unwrap_or(round);
            let limit = cheapest.as_ref().map_or(known, |(_, v)| v).cost.total;
            if is_less(found.1.cost.total, limit) {
                cheapest = Some(found);
            }
        }
        if cheapest.is_none() {
            break;
        }
        best = cheapest;
    }
    best
}

/// What is known while a plan is changed.
struct Search<'a> {
    scenario: &'a Scenario,
    task: &'a Task,
    ways: Ways,
    /// Words that the task refuses, without stuttering: many changes lead to the same one.
    refused: HashSet<[Vec<Letter>; 2]>,
}

/// What the checker says of a change.
enum Verdict {
    /// The plan costs less than it has to.
    Cheaper(Verified),
    /// The task refuses what it sees.
    Word,
    /// It costs too much, or a leg is not free.
    Else,
}

impl Search<'_> {
    /// The plan after all changes that make it cheaper, always the most promising one first; `None` if there is none.
    fn descend(&mut self, path: &Path, known: &Verified) -> Option<(Path, Verified)> {
        let mut best: Option<(Path, Verified)> = None;
        for _ in 0..CHANGES {
            let (path, known) = best.as_ref().map_or((path, known), |(p, v)| (p, v));
            let weight = self.scenario.weight;
            let changes = changes(path, known.cost, weight, &mut self.ways);
            let Some(cheaper) = self.first(path, changes, known.cost.total) else {
                break;
            };
            best = Some(cheaper);
        }
        best
    }

    /// The plan with the cheapest round that begins at a point of the prefix, dearer or not: with other orders and entries it may be
    /// worth while.
    fn begin(&mut self, path: &Path, known: &Verified, begin: usize) -> Option<(Path, Verified)> {
        let walked = walked(&path.suffix, apart);
        let to = path.prefix[begin].at;
        // A round goes somewhere.
        let first = usize::from(begin + 1 == path.prefix.len());
        let turns = first..path.suffix.len();
        let mut rounds: Vec<(f64, Change)> = turns
            .map(|turn| {
                let length = walked[turn] + self.ways.length(path.suffix[turn].at, to);
                (length, Change::Round { begin, turn })
            })
            .collect();
        rounds.sort_by(|a, b| a.0.total_cmp(&b.0));
        self.first(path, rounds, 2.0 * known.cost.total)
    }

    /// The plan after the first of some changes that the task allows and with which it costs less than `limit`.
    fn first(
        &mut self,
        path: &Path,
        changes: Vec<(f64, Change)>,
        limit: f64,
    ) -> Option<(Path, Verified)> {
        let mut tries = TRIES;
        let mut put_off = Vec::new();
        for (_, change) in changes {
            let Some(changed) = change.apply(path, &mut self.ways) else {
                continue;
            };
            let word = self.word(&changed);
            if self.refused.contains(&word) {
                put_off.push(change);
                continue;
            }
            tries = tries.checked_sub(1)?;
            match self.judge(&changed, limit) {
                Verdict::Cheaper(verified) => return Some((changed, verified)),
                Verdict::Word => _ = self.refused.insert(word),
                Verdict::Else => {}
            }
        }
        // Only with X, or for an automaton, does it matter how long a letter stays.
        let stutters = self.task.formula.as_ref().is_none_or(Formula::has_next);
        for change in put_off.into_iter().filter(|_| stutters).take(tries) {
            if let Some(changed) = change.apply(path, &mut self.ways)
                && let Verdict::Cheaper(verified) = self.judge(&changed, limit)
            {
                return Some((changed, verified));
            }
        }
        None
    }

    /// What the checker says of a plan that is to cost less than `limit`.
    fn judge(&self, path: &Path, limit: f64) -> Verdict {
        match check(self.scenario, self.task, path, None) {
            Ok(verified) if is_less(verified.cost.total, limit) => Verdict::Cheaper(verified),
            Err(Refusal::Formula { .. } | Refusal::NotAccepted { .. }) => Verdict::Word,
            _ => Verdict::Else,
        }
    }

    /// What a plan's waypoints see, once and then for ever, without stuttering.
    fn word(&self, path: &Path) -> [Vec<Letter>; 2] {
        let letters = |points: &[Waypoint]| {
            let letters = points.iter().filter_map(|p| self.ways.letter(p.at));
            let mut letters: Vec<Letter> = letters.collect();
            letters.dedup();
            letters
        };
        [letters(&path.prefix), letters(&path.suffix)]
    }
}

/// All changes that make the plan cheaper if the task allows them, the cheapest first, with that cost; it is one if nothing stood in the
/// way where the way is not known.
fn changes(path: &Path, cost: Cost, weight: f64, ways: &mut Ways) -> Vec<(f64, Change)> {
    let (prefix, suffix) = (&path.prefix, &path.suffix);
    let (before, after) = (walked(prefix, apart), walked(suffix, apart));
    for points in [prefix, suffix] {
        for i in stops(points, ways) {
            ways.knows(points[i].at);
        }
    }
    let (whole, round) = (before[before.len() - 1], after[after.len() - 1]);
    let total = |prefix: f64, suffix: f64| Cost::new(prefix, suffix, weight).total;
    let mut found = Vec::new();
    // Ways are looked up only where the change helps if nothing stands in them.
    let mut add = |ways: &mut Ways, cost_of: &dyn Fn(&mut Length<'_>) -> f64, change: Change| {
        if is_less(cost_of(&mut apart), cost.total) {
            let least = cost_of(&mut |a, b| ways.length(a, b));
            if is_less(least, cost.total) {
                found.push((least, change));
            }
        }
    };
    for (part, points, walked) in [
        (Part::Prefix, prefix, &before),
        (Part::Suffix, suffix, &after),
    ] {
        // What the plan costs with a part of another length.
        let with = |length: f64| match part {
            Part::Prefix => total(length, round),
            Part::Suffix => total(whole, length),
        };
        let last = points.len() - 1;
        for to in 1..=last {
            for from in 0..to {
                let others = walked[last] - walked[to] + walked[from];
                let cut =
                    |length: &mut Length<'_>| with(others + length(points[from].at, points[to].at));
                add(ways, &cut, Change::Cut(part, [from, to]));
            }
        }
        for order in other_orders(points, ways) {
            let through = |length: &mut Length<'_>| {
                let legs = order.windows(2);
                with(legs.map(|w| length(points[w[0]].at, points[w[1]].at)).sum())
            };
            add(ways, &through, Change::Through(part, order.clone()));
        }
    }
    for (i, leave) in prefix.iter().enumerate() {
        for (k, point) in suffix.iter().enumerate() {
            // Its last point is its first.
            if k + 1 < suffix.len().max(2) {
                let enter =
                    |length: &mut Length<'_>| total(before[i] + length(leave.at, point.at), round);
                add(ways, &enter, Change::Enter { leave: i, at: k });
            }
            let there = whole - before[i] + after[k];
            if there > 0.0 {
                let longer =
                    |length: &mut Length<'_>| total(before[i], there + length(point.at, leave.at));
                add(ways, &longer, Change::Round { begin: i, turn: k });
            }
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
}

/// The length of a way.
type Length<'a> = dyn FnMut(Point2<f64>, Point2<f64>) -> f64 + 'a;

/// The points of a part that it needs: its ends and its visits.
fn stops(points: &[Waypoint], ways: &Ways) -> Vec<usize> {
    let last = points.len() - 1;
    let is_kept = |&i: &usize| i == 0 || i == last || ways.sees(points[i].at);
    (0..=last).filter(is_kept).collect()
}

/// Other orders of the visits of a part, between its first point and its last one.
fn other_orders(points: &[Waypoint], ways: &Ways) -> Vec<Vec<usize>> {
    let visits = stops(points, ways);
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
