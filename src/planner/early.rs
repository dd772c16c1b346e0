//! Suffixes that begin on the way to their goal (ours; the papers close cycles at goals alone).
//!
//! Where a unit of the prefix costs more than one of the suffix, what the way to a goal does is better done in every round:
//! down to a suffix that begins at the start. So a suffix tree may close its cycle at any product state of the prefix that
//! led to its root, too, and the cycle then goes on along that prefix to the root.

use super::sampler::Aim;
use super::tree::{NodeId, Tree};
use crate::automaton::Nba;
use crate::plan::Waypoint;
use crate::random::{Random, chance, choose};
use crate::system::{Spot, TransitionSystem};

/// The prefix is followed anew once it has got shorter by so much.
const NOTABLE: f64 = 0.01;

/// Share of the samples towards the way that go to its start.
const TO_START: f64 = 0.5;

/// The way to a suffix tree's root, and the cheapest cycle that begins on it.
#[derive(Debug)]
pub(super) struct Early {
    /// What a unit of prefix and of suffix cost.
    shares: [f64; 2],
    /// The product states on the way, the root left out, each with the length up to it.
    way: Vec<(Spot, Waypoint, f64)>,
    /// The length up to the root.
    whole: f64,
    best: Option<Cycle>,
}

/// A cycle that begins on the way.
#[derive(Clone, Copy, Debug)]
struct Cycle {
    /// What the plan costs.
    cost: f64,
    length: f64,
    /// The number of the way's point where it begins.
    from: usize,
    /// The node of the suffix tree from which it closes.
    node: NodeId,
}

impl Early {
    /// For a goal of `prefix`, where the prefix's share of the cost is `weight`; `None` if nothing could be gained.
    pub(super) fn of(prefix: &Tree<'_>, goal: NodeId, weight: f64) -> Option<Self> {
        let mut early = Self {
            shares: [weight, 1.0 - weight],
            way: Vec::new(),
            whole: 0.0,
            best: None,
        };
        early.follow(prefix, goal);
        (weight > 0.5 && !early.way.is_empty()).then_some(early)
    }

    fn follow(&mut self, prefix: &Tree<'_>, goal: NodeId) {
        self.way.clear();
        let mut node = goal;
        while let Some(before) = prefix.parent(node) {
            node = before;
            let spot = prefix.spot(node);
            let state = prefix.state(node);
            self.way.push((
                spot,
                Waypoint { at: spot.at, state },
                prefix.length_to(node),
            ));
        }
        self.way.reverse();
        self.whole = prefix.length_to(goal);
    }

    /// Follows the prefix anew if it has got notably shorter; then everything is to be looked at again.
    pub(super) fn renew(&mut self, prefix: &Tree<'_>, goal: NodeId) -> bool {
        if prefix.length_to(goal) >= self.whole * (1.0 - NOTABLE) {
            return false;
        }
        self.follow(prefix, goal);
        self.best = None;
        true
    }

    /// What a plan costs whose suffix begins at the root and has this length.
    pub(super) fn cost_at_root(&self, length: f64) -> f64 {
        let [before, after] = self.shares;
        before * self.whole + after * length
    }

    /// What the plan with the best cycle that begins on the way costs, and the cycle's length.
    pub(super) fn best(&self) -> Option<(f64, f64)> {
        self.best.map(|b| (b.cost, b.length))
    }

    /// Looks whether a node closes a cycle that makes a plan cheaper than `limit`.
    pub(super) fn close(
        &mut self,
        (system, nba): (&dyn TransitionSystem, &Nba),
        tree: &Tree<'_>,
        node: NodeId,
        limit: f64,
    ) -> bool {
        let [before, after] = self.shares;
        let (spot, state, cost) = (tree.spot(node), tree.state(node), tree.cost(node));
        let mut improved = false;
        for (from, &(begin, Waypoint { at, state: to }, walked)) in self.way.iter().enumerate() {
            let length = self.whole - walked + cost + system.distance(spot.at, at);
            let plan = before * walked + after * length;
            let least = self.best.map_or(limit, |b| b.cost.min(limit));
            if plan >= least || length <= 0.0 {
                continue;
            }
            let guard = nba.guard(state, to);
            if guard.is_some_and(|g| g.contains(spot.letter)) && system.step(&spot, &begin) {
                self.best = Some(Cycle {
                    cost: plan,
                    length,
                    from,
                    node,
                });
                improved = true;
            }
        }
        improved
    }

    /// Writes the best cycle over what `path` holds; `false` if none is known.
    pub(super) fn path_into(&self, tree: &Tree<'_>, path: &mut Vec<Waypoint>) -> bool {
        let Some(Cycle { from, node, .. }) = self.best else {
            return false;
        };
        tree.path_into(node, path);
        let way = self.way[from..].iter().map(|&(_, waypoint, _)| waypoint);
        path.splice(0..0, way);
        path.push(self.way[from].1);
        true
    }

    /// A product state of the way to grow towards.
    pub(super) fn aim(&self, random: &mut Random) -> Option<Aim> {
        let at = if chance(random, TO_START) {
            self.way.first()
        } else {
            choose(random, &self.way)
        };
        let &(_, Waypoint { at, state }, _) = at?;
        Some(Aim::Reach { at, state })
    }
}
