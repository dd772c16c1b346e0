//! Loops that begin as soon as the mission allows it (ours).
//!
//! Planners close a suffix where a place *and* an automaton state come back. Some walks can be told with less prefix: for
//! `GF(a & F b) & (!b U a)` the automaton makes the first round in states of its own, as `b` is forbidden before `a`, so all of
//! that round is prefix though it is walked like the others; and with `X` the first step often is. The checker evaluates the
//! formula on the word of a path and knows no states, so it tells where the loop may begin.

mod moves;
mod rounds;

use std::cell::LazyCell;

use nalgebra::Point2;

use super::check;
use crate::alphabet::Props;
use crate::automaton::Task;
use crate::ltl::semantics;
use crate::plan::{Cost, Path, Waypoint};
use crate::scenario::Scenario;
use crate::shorten::{SWEEPS, Shortener};
use crate::verify::Verified;
use rounds::Walks;

/// So many entries are tried at most, the cheapest first.
const ENTRIES: usize = 256;

/// An entry: the prefix up to a point of it, and from there straight to the loop.
struct Entry {
    total: f64,
    /// The number of the prefix's point.
    leave: usize,
    /// The number of the loop's leg that is met, or of its first point.
    leg: usize,
    at: Point2<f64>,
}

/// How often a plan that was made cheaper is looked at again.
const AGAIN: usize = 4;

/// A plan that enters the loop of `path` elsewhere, or goes a round that begins earlier, and passes the checker, if there is one that
/// costs less.
///
/// Its suffix has the automaton states of `path`'s, which the run reaches after a round or more, or those of the first round; where a bend
/// was straightened, points have the state of the bend that they took the place of.
pub(super) fn fold(
    scenario: &Scenario,
    task: &Task,
    path: &Path,
    known: &Verified,
) -> Option<(Path, Verified)> {
    if scenario.grid.is_some() {
        return moves::improve(scenario, task, path, known);
    }
    // Most plans are left as they are.
    let shortener = LazyCell::new(|| Shortener::new(&scenario.workspace, task, scenario.weight));
    let tight = |(path, known)| tightened(scenario, task, &shortener, path, known);
    let mut best = straightened(scenario, task, path, known).map(tight);
    // A prefix that costs nothing need not be shorter.
    if scenario.weight <= 0.0 {
        return best;
    }
    let mut walks = Walks::new(scenario);
    for _ in 0..AGAIN {
        let (path, known) = best.as_ref().map_or((path, known), |(p, v)| (p, v));
        let Some(cheaper) = fold_once(scenario, task, path, known, &mut walks) else {
            break;
        };
        let straight = straightened(scenario, task, &cheaper.0, &cheaper.1);
        best = straight.or(Some(cheaper)).map(tight);
    }
    best
}

/// A plan that was changed, made shorter as long as that helps.
fn tightened(
    scenario: &Scenario,
    task: &Task,
    shortener: &Shortener<'_>,
    mut path: Path,
    mut known: Verified,
) -> (Path, Verified) {
    for _ in 0..AGAIN {
        let shorter = shortener.shorten(&path, SWEEPS).map(|(path, _)| path);
        let Some(shorter) = shorter else { break };
        match check(scenario, task, &shorter, None) {
            Ok(verified) if is_less(verified.cost.total, known.cost.total) => {
                (path, known) = (shorter, verified);
            }
            _ => break,
        }
    }
    (path, known)
}

/// The plan without bends that it does not need, if it has any. The automaton may want a visit on a way of its own, there and back,
/// that for the formula a loop can pass on its way to elsewhere.
fn straightened(
    scenario: &Scenario,
    task: &Task,
    path: &Path,
    known: &Verified,
) -> Option<(Path, Verified)> {
    // A plan that stays somewhere is taut already.
    if path.suffix.len() < 3 {
        return None;
    }
    let mut best: Option<(Path, Verified)> = None;
    let parts: [fn(&mut Path) -> &mut Vec<Waypoint>; 2] = [|p| &mut p.prefix, |p| &mut p.suffix];
    let lengths = [path.prefix.len(), path.suffix.len()];
    for (part, length) in parts.into_iter().zip(lengths) {
        // From the end, so that those that are still to be tried keep their numbers.
        for i in (1..length - 1).rev() {
            let (old, verified) = best.as_ref().map_or((path, known), |(p, v)| (p, v));
            let mut shorter = old.clone();
            let points = part(&mut shorter);
            let [before, at, after] = [i - 1, i, i + 1].map(|i| points[i].at);
            let saved = (at - before).norm() + (after - at).norm() - (after - before).norm();
            if saved < 1e-9 * known.cost.total {
                continue;
            }
            let Ok(stretches) = scenario.workspace.trace(before, after) else {
                continue;
            };
            // What is seen changes at most once along a leg: between one change and the next there is a waypoint.
            let changes = stretches.windows(2).map(|s| s[1].start).collect::<Vec<_>>();
            let state = points[i].state;
            let between = changes.windows(2).map(|c| Waypoint {
                at: before + (after - before) * f64::midpoint(c[0], c[1]),
                state,
            });
            points.splice(i..=i, between);
            let checked = check(scenario, task, &shorter, None).ok();
            if let Some(found) = checked.filter(|v| v.cost.total < verified.cost.total) {
                best = Some((shorter, found));
            }
        }
    }
    best
}

/// The cheapest of the best other entry, the best wider round and the best earlier one.
fn fold_once(
    scenario: &Scenario,
    task: &Task,
    path: &Path,
    known: &Verified,
    walks: &mut Walks<'_>,
) -> Option<(Path, Verified)> {
    let seen = Seen::new(scenario, task, path);
    let entered = enter(scenario, task, path, known.cost, seen.as_ref());
    let known = entered.as_ref().map_or(known, |(_, verified)| verified);
    let begun = seen.and_then(|seen| {
        let wider = rounds::enter_wider(scenario, task, path, known, walks);
        let known = wider.as_ref().map_or(known, |(_, verified)| verified);
        rounds::begin_earlier(scenario, task, path, known, &seen, walks).or(wider)
    });
    begun.or(entered)
}

/// The cheapest plan that enters the loop elsewhere, if one costs less in all; the loop's length is that of the cost.
fn enter(
    scenario: &Scenario,
    task: &Task,
    path: &Path,
    cost: Cost,
    seen: Option<&Seen<'_>>,
) -> Option<(Path, Verified)> {
    if path.suffix.len() < 2 {
        return None;
    }
    let tried = entries(scenario, path, cost).into_iter().take(ENTRIES);
    let mut plausible = tried.filter(|e| seen.is_none_or(|s| s.allows(path, e)));
    plausible.find_map(|entry| {
        let folded = entry.path(path);
        let verified = check(scenario, task, &folded, None).ok()?;
        (verified.cost.total < cost.total).then_some((folded, verified))
    })
}

/// All entries that would make a plan cheaper, the cheapest first.
fn entries(scenario: &Scenario, path: &Path, cost: Cost) -> Vec<Entry> {
    let weight = scenario.weight;
    let mut entries = Vec::new();
    let walked = walked(&path.prefix, |a, b| (b - a).norm());
    for (leave, from) in path.prefix.iter().enumerate() {
        for (leg, ends) in path.suffix.windows(2).enumerate() {
            let points = [Some(ends[0].at), nearest(from.at, ends)];
            for at in points.into_iter().flatten() {
                let prefix = walked[leave] + (at - from.at).norm();
                let total = weight * prefix + (1.0 - weight) * cost.suffix;
                if is_less(total, cost.total) {
                    entries.push(Entry {
                        total,
                        leave,
                        leg,
                        at,
                    });
                }
            }
        }
    }
    entries.sort_by(|a, b| a.total.total_cmp(&b.total));
    entries
}

/// Whether a cost is less by more than rounding.
fn is_less(cost: f64, limit: f64) -> bool {
    cost < limit - 1e-9 * limit.max(1.0)
}

/// How far along the way each point is.
fn walked(points: &[Waypoint], apart: impl Fn(Point2<f64>, Point2<f64>) -> f64) -> Vec<f64> {
    let legs = points.windows(2).map(|w| apart(w[0].at, w[1].at));
    let sums = legs.scan(0.0, |all, leg| {
        *all += leg;
        Some(*all)
    });
    std::iter::once(0.0).chain(sums).collect()
}

/// What is seen along each leg of a plan, found once for all of its entries.
struct Seen<'a> {
    scenario: &'a Scenario,
    start: Props,
    prefix: Vec<Vec<Props>>,
    suffix: Vec<Vec<Props>>,
}

impl<'a> Seen<'a> {
    /// `None` where that is not what decides: for tasks without a formula.
    fn new(scenario: &'a Scenario, task: &Task, path: &Path) -> Option<Self> {
        task.formula.as_ref()?;
        let map = &scenario.workspace;
        let legs = |points: &[Waypoint]| -> Option<Vec<Vec<Props>>> {
            let legs = points.windows(2);
            legs.map(|w| along(scenario, w[0].at, w[1].at)).collect()
        };
        Some(Self {
            scenario,
            start: map.alphabet().props(map.letter_at(scenario.start)?),
            prefix: legs(&path.prefix)?,
            suffix: legs(&path.suffix)?,
        })
    }

    /// Whether the way to the loop is free and the word satisfies the formula.
    fn allows(&self, path: &Path, entry: &Entry) -> bool {
        let ends = &path.suffix[entry.leg..][..2];
        let leg = |from, to| along(self.scenario, from, to);
        let Some(way) = leg(path.prefix[entry.leave].at, entry.at) else {
            return false;
        };
        let (mut after, mut before) = (self.suffix[entry.leg].clone(), Vec::new());
        if entry.at != ends[0].at {
            let parts = leg(entry.at, ends[1].at).zip(leg(ends[0].at, entry.at));
            let Some(parts) = parts else { return false };
            (after, before) = parts;
        }
        let mut prefix = vec![self.start];
        prefix.extend(self.prefix[..entry.leave].iter().flatten().chain(&way));
        let (earlier, later) = self.suffix.split_at(entry.leg);
        let rest = later[1..].iter().chain(earlier).flatten();
        let suffix: Vec<Props> = after.iter().chain(rest).chain(&before).copied().collect();
        let alphabet = self.scenario.workspace.alphabet();
        semantics::holds(&self.scenario.formula, &prefix, &suffix, alphabet).unwrap_or(false)
    }
}

/// What is seen along a leg; `None` if it is blocked.
fn along(scenario: &Scenario, a: Point2<f64>, b: Point2<f64>) -> Option<Vec<Props>> {
    if a == b {
        return Some(Vec::new());
    }
    let map = &scenario.workspace;
    let stretches = map.trace(a, b).ok()?;
    let props = stretches.iter().map(|s| map.alphabet().props(s.letter));
    Some(props.collect())
}

/// The point of a leg that is nearest to `p`, unless that is one of its ends.
fn nearest(p: Point2<f64>, ends: &[Waypoint]) -> Option<Point2<f64>> {
    let (a, leg) = (ends[0].at, ends[1].at - ends[0].at);
    let share = (p - a).dot(&leg) / leg.norm_squared().max(f64::MIN_POSITIVE);
    let at = a + leg * share;
    (share > 0.0 && share < 1.0 && at != a && at != ends[1].at).then_some(at)
}

impl Entry {
    /// The plan that enters here.
    fn path(&self, old: &Path) -> Path {
        let open = &old.suffix[..old.suffix.len() - 1];
        let mut suffix: Vec<Waypoint> = Vec::with_capacity(open.len() + 2);
        suffix.push(Waypoint {
            at: self.at,
            ..open[self.leg]
        });
        suffix.extend(&open[self.leg + 1..]);
        suffix.extend(&open[..=self.leg]);
        suffix.push(suffix[0]);
        suffix.dedup_by(|b, a| a.at == b.at && a.state == b.state);
        let mut prefix = old.prefix[..=self.leave].to_vec();
        if prefix[self.leave].at == self.at {
            prefix[self.leave].state = suffix[0].state;
        } else {
            prefix.push(suffix[0]);
        }
        Path { prefix, suffix }
    }
}
