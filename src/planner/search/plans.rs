//! What counts as a plan, and which is the best.

use nalgebra::Point2;

use super::{Best, Deadline, ENTRY_PERIOD, Search};
use crate::alphabet::LetterSet;
use crate::plan::{Cost, Path, Waypoint};
use crate::planner::Improvement;
use crate::planner::polish::{Kind, PROMISING, Polish};
use crate::planner::suffix::Entry;
use crate::planner::tree::NodeId;
use crate::shorten::{SLACK, Shortener};
use crate::system::TransitionSystem;

/// Where to enter a way back is looked for anew once it has got shorter by so much.
const NOTABLE: f64 = 0.01;

/// So often at most the last plan is made better, as long as it gets cheaper by this share.
const WORTHWHILE: f64 = 1e-3;
const LAST: usize = 8;

impl Search<'_> {
    /// Takes note of goals that are new or cheaper.
    pub(super) fn look_at_prefix(&mut self) {
        let mut touched = std::mem::take(&mut self.touched);
        self.prefix.take_touched(&mut touched);
        self.known.resize(self.prefix.len(), false);
        for &node in &touched {
            let state = self.prefix.state(node);
            if !self.accepting[state.index()] {
                continue;
            }
            let letter = self.prefix.spot(node).letter;
            let stays = self.staying[letter.index()][state.index()];
            if !std::mem::replace(&mut self.known[node.index()], true) {
                self.stats.goals += 1;
                if !stays {
                    self.open_goals.push(node);
                }
                if self.stats.first_prefix.is_none() {
                    self.stats.first_prefix = Some(self.first(self.prefix.cost(node)));
                }
            }
            if stays {
                let at = self.prefix.spot(node).at;
                self.consider_staying(node, Waypoint { at, state });
            } else if let Some(&i) = self.suffix_of.get(&node) {
                self.consider_suffix(i);
            }
        }
        self.touched = touched;
    }

    /// The plan that stays at a goal.
    fn consider_staying(&mut self, goal: NodeId, here: Waypoint) {
        let cost = Cost::new(self.prefix.length_to(goal), 0.0, self.problem.weight);
        self.offer(goal, None, cost);
        if self.is_better(cost) {
            let mut path = self.outdated();
            self.prefix.path_into(goal, &mut path.prefix);
            path.suffix.clear();
            path.suffix.push(here);
            self.keep(goal, path, cost);
        }
    }

    /// Whether a way back that has got shorter may make a plan that is better than the best, or worth shortening: where to enter
    /// it has to be found anew, and most often that is where it was.
    pub(super) fn is_worth_entering(&self, i: usize) -> bool {
        let suffix = &self.suffixes[i];
        let known = suffix.entered.zip(suffix.worth(self.problem.weight));
        known.is_none_or(|((worth, total), now)| {
            now <= worth * (1.0 - NOTABLE) || self.is_better_total(total - (worth - now))
        })
    }

    /// The plan whose suffix is the shortest way back that a suffix tree knows, entered where that is
    /// cheapest.
    pub(super) fn consider_suffix(&mut self, i: usize) {
        let mut cycle = std::mem::take(&mut self.cycle);
        let suffix = &self.suffixes[i];
        if let Some(length) = suffix.length()
            && suffix.path_into(&mut cycle)
        {
            let goal = suffix.goal;
            self.consider_cycle(i, goal, &cycle, length);
        }
        self.cycle = cycle;
    }

    fn consider_cycle(&mut self, i: usize, goal: NodeId, cycle: &[Waypoint], length: f64) {
        let Some((entry, cost)) = self.enter(cycle, length) else {
            return;
        };
        let worth = self.suffixes[i].worth(self.problem.weight);
        self.suffixes[i].entered = worth.map(|worth| (worth, cost.total));
        self.offer(goal, Some(i), cost);
        if self.is_better(cost) {
            let mut path = self.outdated();
            entry.path_into(&self.prefix, cycle, &mut path);
            self.keep(goal, path, cost);
        }
    }

    /// The path of the best plan so far, to write a better one over.
    fn outdated(&mut self) -> Path {
        let none = || Path {
            prefix: Vec::new(),
            suffix: Vec::new(),
        };
        self.best.take().map_or_else(none, |best| best.path)
    }

    /// Where a cycle is entered most cheaply, and what that costs.
    fn enter(&mut self, cycle: &[Waypoint], length: f64) -> Option<(Entry, Cost)> {
        let system = &*self.problem.system;
        let side = system.bounds().side();
        let near = self.settings.near(self.prefix.site_count(), side);
        let order = &mut self.order;
        let entry = Entry::cheapest(&mut self.prefix, system, cycle, near, order)?;
        Some((entry, Cost::new(entry.length, length, self.problem.weight)))
    }

    /// Looks for better entries to the best plan's suffix and, in turn, to those of other goals, and for other ways and orders
    /// of the best plan.
    pub(super) fn enter_again(&mut self, deadline: &Deadline<'_>) {
        let Some(best) = &mut self.best else { return };
        if best.path.suffix.len() > 1 {
            let (goal, length) = (best.goal, best.cost.suffix);
            let cycle = std::mem::take(&mut best.path.suffix);
            let found = self.enter(&cycle, length);
            match found {
                Some((entry, cost)) if self.is_better(cost) => {
                    let mut path = self.outdated();
                    entry.path_into(&self.prefix, &cycle, &mut path);
                    self.keep(goal, path, cost);
                }
                _ => {
                    if let Some(best) = &mut self.best {
                        best.path.suffix = cycle;
                    }
                }
            }
        }
        self.look_around(deadline, 1.0);
        if !self.suffixes.is_empty() {
            let turn = self.stats.iterations / ENTRY_PERIOD;
            self.consider_suffix((turn % self.suffixes.len() as u64) as usize);
        }
    }

    /// Gives the best plan's legs other ways around obstacles, enters its suffix along one, and visits in another order, if that is
    /// cheaper. Once for each best plan, and on large maps, where a way takes long to find, no more often than growing leaves time for.
    fn look_around(&mut self, deadline: &Deadline<'_>, slack: f64) {
        let (Some(polish), Some(best)) = (&mut self.polish, &self.best) else {
            return;
        };
        if polish.looked_around == best.cost.total || !polish.may_walk(self.stats.iterations) {
            return;
        }
        polish.looked_around = best.cost.total;
        let system = &*self.problem.system;
        let passable = polish.shortener.passable();
        let (polish, iterations) = (&*polish, self.stats.iterations);
        let walk = |from, to| {
            if deadline.has_come() || !polish.may_walk(iterations) {
                return Vec::new();
            }
            let way = way(system, from, to, passable);
            if way.as_ref().is_none_or(|way| way.len() > 1) {
                polish.has_walked();
            }
            way.unwrap_or_default()
        };
        let goal = best.goal;
        let others: Vec<_> = polish.shortener.others(&best.path, &walk, slack).collect();
        for (path, cost) in others {
            if self.is_better(cost) {
                self.keep_with_beacons(goal, path, cost);
            }
        }
    }

    /// Keeps a better plan that the tree does not hold, and hands its points to it.
    fn keep_with_beacons(&mut self, goal: NodeId, path: Path, cost: Cost) {
        let points = path.prefix.iter().skip(1).map(|w| w.at);
        if let Some(polish) = &mut self.polish {
            polish.beacons.clear();
            polish.beacons.extend(points);
        }
        self.keep(goal, path, cost);
    }

    /// Takes note of a plan as one that could be shortened.
    fn offer(&mut self, goal: NodeId, suffix: Option<usize>, cost: Cost) {
        // Not before there is something to shorten: a first plan should not wait for it.
        if self.polish.is_none() && self.settings.shortens() {
            let map = self.problem.system.plane();
            let shortener = |map| Shortener::new(map, &self.problem.task, self.problem.weight);
            self.polish = map.map(|map| Polish::new(shortener(map)));
        }
        let hopeless = |best: &Best| cost.total > PROMISING * best.cost.total;
        if self.best.as_ref().is_some_and(hopeless) {
            return;
        }
        if let Some(polish) = &mut self.polish {
            let word = self.prefix.word_to(goal);
            polish.offer(Kind { suffix, word }, goal, cost.total);
        }
    }

    fn is_better(&self, cost: Cost) -> bool {
        self.is_better_total(cost.total)
    }

    fn is_better_total(&self, total: f64) -> bool {
        self.best.as_ref().is_none_or(|b| total < b.cost.total)
    }

    fn keep(&mut self, goal: NodeId, path: Path, cost: Cost) {
        let pivot = self.pivot(goal, &path.suffix);
        self.best = Some(Best {
            goal,
            pivot,
            path,
            cost,
        });
        if self.stats.first_plan.is_none() {
            self.stats.first_plan = Some(self.first(cost.total));
        }
        self.stats.improvements.push(Improvement {
            iterations: self.stats.iterations,
            seconds: self.began.elapsed().as_secs_f64(),
            cost: cost.total,
        });
    }

    /// The point of a suffix that stands for the goal it was found at: of those in its state the nearest.
    fn pivot(&self, goal: NodeId, suffix: &[Waypoint]) -> usize {
        let (at, state) = (self.prefix.spot(goal).at, self.prefix.state(goal));
        let distance = |i: &usize| self.problem.system.distance(suffix[*i].at, at);
        let count = suffix.len().saturating_sub(1).max(1);
        (0..count)
            .filter(|&i| suffix[i].state == state)
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .unwrap_or(0)
    }

    /// Shortens a candidate, if one is due.
    pub(super) fn shorten(&mut self) {
        let (Some(polish), Some(best)) = (&mut self.polish, &self.best) else {
            return;
        };
        let Some(next) = polish.next(self.stats.iterations, best.cost.total) else {
            return;
        };
        let path = match next.kind.suffix {
            None => {
                let prefix = self.prefix.path(next.goal);
                let suffix = prefix.last().map(|&end| vec![end]);
                suffix.map(|suffix| Path { prefix, suffix })
            }
            Some(i) => self.suffixes[i].path().and_then(|cycle| {
                let (entry, _) = self.enter(&cycle, 0.0)?;
                Some(entry.path(&self.prefix, &cycle))
            }),
        };
        let shorten = |path| self.polish.as_ref().and_then(|p| p.shorten(&path));
        let Some((path, cost)) = path.and_then(shorten) else {
            return;
        };
        if self.is_better(cost) {
            self.keep_with_beacons(next.goal, path, cost);
        }
    }

    /// Shortens the best plan, and looks for other ways, orders and entries, as long as that helps: it may be a tree's that was not due, and
    /// no other comes after it.
    pub(super) fn improve_last(&mut self, deadline: &Deadline<'_>) {
        if let Some(polish) = &mut self.polish {
            polish.looked_around = f64::INFINITY;
        }
        for _ in 0..LAST {
            let (Some(polish), Some(best)) = (&self.polish, &self.best) else {
                return;
            };
            let (goal, before) = (best.goal, best.cost.total);
            if let Some((path, cost)) = polish.shorten(&best.path)
                && self.is_better(cost)
            {
                self.keep(goal, path, cost);
            }
            let limit = before * (1.0 - WORTHWHILE);
            if !self.best.as_ref().is_some_and(|b| b.cost.total < limit) {
                self.look_around(deadline, SLACK);
            }
            if !self.best.as_ref().is_some_and(|b| b.cost.total < limit) {
                return;
            }
        }
    }
}

/// The bends and the end of the shortest way that keeps to letters, if there is one.
fn way(
    system: &dyn TransitionSystem,
    from: Point2<f64>,
    to: Point2<f64>,
    through: &LetterSet,
) -> Option<Vec<Point2<f64>>> {
    let mut way = Vec::new();
    let (mut at, mut left) = (from, f64::INFINITY);
    loop {
        let leg = system.first_leg_through(at, to, through)?;
        // Of corners that lie on one another none leads to the next for ever.
        if leg.length >= left {
            return None;
        }
        (at, left) = (leg.to, leg.length);
        way.push(at);
        if at == to {
            return Some(way);
        }
    }
}
