//! What the paths of trees may cost, if a plan is to be cheaper than the best.

use super::Search;
use crate::planner::informed::Informed;

/// Paths of trees that cost more than the best plan by no more than this share are kept where they can be shortened: then they may be cheaper.
const SLACK: f64 = 0.05;

/// After so many iterations a prefix tree is large enough for it to pay to know what ways come to at least: finding out takes as
/// long as some dozens of iterations.
const INFORMED: u64 = 1_024;

/// And a suffix tree after so many of its own.
const INFORMED_SUFFIX: u64 = 256;

/// Larger relaxed products are too much for every suffix tree.
const STEPS: usize = 1 << 13;

impl Search<'_> {
    /// Whether a plan by a goal with a way of this length can be cheaper than the best. The way is part of the
    /// prefix as far as the suffix's entry, and of the suffix from there.
    pub(super) fn can_improve(&self, way: f64) -> bool {
        let bound = self.least_share() * way;
        self.best.as_ref().is_none_or(|b| bound < b.cost.total)
    }

    /// The least that a unit of length costs.
    pub(super) fn least_share(&self) -> f64 {
        self.problem.weight.min(1.0 - self.problem.weight)
    }

    /// The length that a part of weight `share` must stay below for a plan to beat the best, where
    /// `known` is the cost of the rest at least.
    pub(super) fn limit(&self, known: f64, share: f64) -> f64 {
        match &self.best {
            Some(best) if self.settings.informed && share > 1e-9 => {
                let slack = if self.settings.shortens() { SLACK } else { 0.0 };
                (best.cost.total * (1.0 + slack) - known) / share
            }
            _ => f64::INFINITY,
        }
    }

    /// The length that a suffix by a goal with a way of this length must stay below for its plan to beat the
    /// best: the way is part of the prefix, but for as much of it as the suffix may hold.
    pub(super) fn suffix_limit(&self, way: f64) -> f64 {
        let (before, after) = (self.problem.weight, 1.0 - self.problem.weight);
        let whole = self.limit(0.0, after);
        if !whole.is_finite() || whole >= way {
            return whole;
        }
        // Shorter than the way: so the prefix is what is left of it at least.
        if before < after {
            self.limit(before * way, after - before)
        } else {
            0.0
        }
    }

    /// The length that a way of the prefix tree must stay below. No suffix is shorter than the least cycle, and the way is part of the
    /// prefix, but for as much of it as the suffix may hold.
    pub(super) fn prefix_limit(&self) -> f64 {
        let share = self.least_share();
        let informed = self.prefix.is_informed(); // before, nothing is found out for it
        let relaxed = informed.then(|| self.ground.relaxed()).flatten();
        let cycle = relaxed.map_or(0.0, |relaxed| relaxed.least_cycle());
        self.limit((1.0 - self.problem.weight - share) * cycle, share)
    }

    /// Lets the prefix tree know what ways come to at least, once that is of use.
    pub(super) fn inform_prefix(&mut self) {
        let due = self.best.is_some() && self.stats.iterations >= INFORMED;
        if !due || !self.settings.informed || self.prefix.is_informed() {
            return;
        }
        if let Some(relaxed) = self.ground.relaxed() {
            let task = &self.problem.task;
            let roots = (Some(self.prefix.root().at), &*task.nba.initial);
            let informed = Informed::new(relaxed, &task.nba, roots, (None, &task.feasible));
            self.prefix.inform(informed);
        }
    }

    /// The same for a suffix tree.
    pub(super) fn inform_suffix(&mut self, i: usize) {
        let suffix = &mut self.suffixes[i];
        let due = self.best.is_some() && suffix.iterations >= INFORMED_SUFFIX;
        if due
            && self.settings.informed
            && let Some(relaxed) = self.ground.relaxed()
            && relaxed.steps() <= STEPS
        {
            suffix.inform(relaxed, &self.problem.task.nba);
        }
    }
}
