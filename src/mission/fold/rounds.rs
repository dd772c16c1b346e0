//! Loops that begin on the way there: what the prefix visits, every round visits, too.
//!
//! Where a unit of the prefix costs as much as one of the suffix or more, a longer round is cheap if it makes the prefix shorter, down to
//! a round that begins at the start. Often the way to a loop is such a round itself, or most of it. The shortener tries some with the
//! automaton ([`begin_earlier`](crate::shorten::Shortener::begin_earlier)); where the automaton is in states of its own on its first
//! round, only the formula can tell.

use std::sync::Arc;

use nalgebra::Point2;

use super::{Seen, along};
use crate::alphabet::Props;
use crate::automaton::Task;
use crate::ltl::semantics;
use crate::mission::check;
use crate::plan::{Path, Waypoint};
use crate::scenario::Scenario;
use crate::system::Continuous;
use crate::verify::Verified;

/// So many rounds are tried at most, the cheapest first.
const TRIES: usize = 256;

/// So many of them at most come back around obstacles: on maps of thousands of corners each such way takes milliseconds.
const WALKS: usize = 16;

/// A round from a point of the prefix along the path to a point of the loop, and back from there.
struct Round {
    /// Its plan's cost if nothing is in the way back.
    least: f64,
    /// The number of the prefix's point.
    begin: usize,
    /// The number of the loop's point.
    turn: usize,
}

/// The cheapest plan with a round that begins earlier and that passes the checker, if there is one that costs less. Its waypoints have
/// the automaton states of the first round; those of the way back that of the place where it begins.
pub(super) fn begin_earlier(
    scenario: &Scenario,
    task: &Task,
    path: &Path,
    known: &Verified,
    seen: &Seen<'_>,
) -> Option<(Path, Verified)> {
    let mut best: Option<(Path, Verified)> = None;
    // Made where the first straight way back is blocked.
    let mut system = None;
    let mut walks = 0;
    let mut around = |from, to| {
        walks += 1;
        if walks > WALKS {
            return None;
        }
        let map = || Continuous::new(Arc::clone(&scenario.workspace), scenario.start).ok();
        let system = system.get_or_insert_with(map).as_ref()?;
        Some(system.shortest_path(from, to)?[1..].to_vec())
    };
    for round in rounds(scenario, path, known.cost.total)
        .into_iter()
        .take(TRIES)
    {
        let limit = best.as_ref().map_or(known.cost.total, |b| b.1.cost.total);
        if !is_less(round.least, limit) {
            break;
        }
        let (from, to) = (path.suffix[round.turn].at, path.prefix[round.begin].at);
        let way = match along(scenario, from, to) {
            Some(_) => Some(vec![to]),
            None => around(from, to),
        };
        let Some(way) = way.filter(|way| seen.allows_round(path, &round, way)) else {
            continue;
        };
        let found = round.path(path, &way);
        let cheaper = |verified: &Verified| is_less(verified.cost.total, limit);
        if let Some(verified) = check(scenario, task, &found, None).ok().filter(cheaper) {
            best = Some((found, verified));
        }
    }
    best
}

/// Whether a cost is less by more than rounding.
fn is_less(cost: f64, limit: f64) -> bool {
    cost < limit - 1e-9 * limit.max(1.0)
}

/// All rounds that could make a plan cheaper, the cheapest first.
fn rounds(scenario: &Scenario, path: &Path, limit: f64) -> Vec<Round> {
    let weight = scenario.weight;
    let walked = |points: &[Waypoint]| -> Vec<f64> {
        let legs = points.windows(2).map(|w| (w[1].at - w[0].at).norm());
        let sum = |all: &mut f64, leg: f64| {
            *all += leg;
            Some(*all)
        };
        std::iter::once(0.0).chain(legs.scan(0.0, sum)).collect()
    };
    let (before, after) = (walked(&path.prefix), walked(&path.suffix));
    let whole = before[before.len() - 1];
    let last = path.prefix.len() - 1;
    let mut found = Vec::new();
    for (begin, point) in path.prefix.iter().enumerate() {
        for (turn, end) in path.suffix.iter().enumerate() {
            let back = (end.at - point.at).norm();
            let round = whole - before[begin] + after[turn] + back;
            let least = weight * before[begin] + (1.0 - weight) * round;
            let is_round = begin < last || turn > 0;
            if is_round && is_less(least, limit) {
                found.push(Round { least, begin, turn });
            }
        }
    }
    found.sort_by(|a, b| a.least.total_cmp(&b.least));
    found
}

impl Round {
    /// The plan that goes this round, back by `way`, whose last point is where the round begins.
    fn path(&self, old: &Path, way: &[Point2<f64>]) -> Path {
        let prefix = old.prefix[..=self.begin].to_vec();
        let mut suffix = old.prefix[self.begin..].to_vec();
        suffix.extend(&old.suffix[1..=self.turn]);
        let state = old.suffix[self.turn].state;
        suffix.extend(way.iter().map(|&at| Waypoint { at, state }));
        // It closes in the state that it began in.
        if let Some(end) = suffix.last_mut() {
            *end = prefix[self.begin];
        }
        suffix.dedup_by(|b, a| a.at == b.at && a.state == b.state);
        Path { prefix, suffix }
    }
}

impl Seen<'_> {
    /// Whether the way back is free and the word satisfies the formula.
    fn allows_round(&self, path: &Path, round: &Round, way: &[Point2<f64>]) -> bool {
        let mut at = path.suffix[round.turn].at;
        let mut back = Vec::new();
        for &next in way {
            let Some(leg) = along(self.scenario, at, next) else {
                return false;
            };
            back.extend(leg);
            at = next;
        }
        let (there, on) = self.prefix.split_at(round.begin);
        let prefix: Vec<Props> = std::iter::once(self.start)
            .chain(there.iter().flatten().copied())
            .collect();
        let legs = on.iter().chain(&self.suffix[..round.turn]).flatten();
        let suffix: Vec<Props> = legs.copied().chain(back).collect();
        if suffix.is_empty() {
            return false;
        }
        let alphabet = self.scenario.workspace.alphabet();
        semantics::holds(&self.scenario.formula, &prefix, &suffix, alphabet).unwrap_or(false)
    }
}
