//! Loops that begin on the way there: what the prefix visits, every round visits, too.
//!
//! Where a unit of the prefix costs as much as one of the suffix or more, a longer round is cheap if it makes the prefix shorter, down to
//! a round that begins at the start. Often the way to a loop is such a round itself, or most of it. The shortener tries some with the
//! automaton ([`begin_earlier`](crate::shorten::Shortener::begin_earlier)); where the automaton is in states of its own on its first
//! round, only the formula can tell.

use std::sync::Arc;

use nalgebra::Point2;

use super::{Seen, along, is_less, walked};
use crate::alphabet::Props;
use crate::automaton::Task;
use crate::ltl::semantics;
use crate::mission::check;
use crate::plan::{Cost, Path, Waypoint, length};
use crate::scenario::Scenario;
use crate::system::Continuous;
use crate::verify::Verified;

/// So many rounds are tried at most, the cheapest first.
const TRIES: usize = 256;

/// So many of them at most come back around obstacles: on maps of thousands of corners each such way takes milliseconds.
const WALKS: usize = 16;

/// So many visits of the prefix at most are where a round begins that is entered elsewhere, the last ones.
const WIDER: usize = 16;

/// The cheapest plan whose loop does what the prefix did from some visit on, entered elsewhere. To visit in every round what the prefix
/// visited last may cost next to nothing, and let the loop be entered where it passes the start.
pub(super) fn enter_wider(
    scenario: &Scenario,
    task: &Task,
    path: &Path,
    known: &Verified,
    walks: &mut Walks<'_>,
) -> Option<(Path, Verified)> {
    let last = path.prefix.len() - 1;
    if path.suffix.len() < 2 {
        return None;
    }
    let mut best: Option<(Path, Verified)> = None;
    walks.renew();
    let turn = path.suffix.len() - 1;
    let map = &scenario.workspace;
    let sees = |&i: &usize| {
        let letter = map.letter_at(path.prefix[i].at);
        letter.is_some_and(|l| !map.alphabet().props(l).is_empty())
    };
    for begin in (0..last).rev().filter(sees).take(WIDER) {
        let total = best.as_ref().map_or(known.cost.total, |b| b.1.cost.total);
        let to = path.prefix[begin].at;
        let round = Round {
            least: 0.0,
            begin,
            turn,
        };
        // Rounds that begin earlier are longer.
        let is_short = |length: f64| is_less((1.0 - scenario.weight) * length, total);
        if !is_short(length(&round.path(path, &[to]).suffix)) {
            break;
        }
        let Some(way) = walks.way(path.suffix[turn].at, to) else {
            continue;
        };
        let wider = round.path(path, &way);
        let length = length(&wider.suffix);
        if !is_short(length) {
            continue;
        }
        let cost = Cost {
            suffix: length,
            total,
            ..known.cost
        };
        let seen = Seen::new(scenario, task, &wider);
        best = super::enter(scenario, task, &wider, cost, seen.as_ref()).or(best);
    }
    best
}

/// Ways back to where a round begins.
pub(super) struct Walks<'a> {
    scenario: &'a Scenario,
    /// Made where the first straight way is blocked.
    system: Option<Option<Continuous>>,
    left: usize,
}

impl<'a> Walks<'a> {
    pub(super) fn new(scenario: &'a Scenario) -> Self {
        Self {
            scenario,
            system: None,
            left: WALKS,
        }
    }

    /// Allows as many ways around obstacles as at first.
    fn renew(&mut self) {
        self.left = WALKS;
    }

    /// The bends of a way and its end: straight, or around obstacles.
    fn way(&mut self, from: Point2<f64>, to: Point2<f64>) -> Option<Vec<Point2<f64>>> {
        let scenario = self.scenario;
        if along(scenario, from, to).is_some() {
            return Some(vec![to]);
        }
        self.left = self.left.checked_sub(1)?;
        let map = || Continuous::new(Arc::clone(&scenario.workspace), scenario.start).ok();
        let system = self.system.get_or_insert_with(map).as_ref()?;
        Some(system.shortest_path(from, to)?[1..].to_vec())
    }
}

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
    walks: &mut Walks<'_>,
) -> Option<(Path, Verified)> {
    let mut best: Option<(Path, Verified)> = None;
    walks.renew();
    for round in rounds(scenario, path, known.cost.total)
        .into_iter()
        .take(TRIES)
    {
        let limit = best.as_ref().map_or(known.cost.total, |b| b.1.cost.total);
        if !is_less(round.least, limit) {
            break;
        }
        let (from, to) = (path.suffix[round.turn].at, path.prefix[round.begin].at);
        let way = walks.way(from, to);
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

/// All rounds that could make a plan cheaper, the cheapest first.
fn rounds(scenario: &Scenario, path: &Path, limit: f64) -> Vec<Round> {
    let weight = scenario.weight;
    let straight = |a: Point2<f64>, b: Point2<f64>| (b - a).norm();
    let (before, after) = (
        walked(&path.prefix, straight),
        walked(&path.suffix, straight),
    );
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
