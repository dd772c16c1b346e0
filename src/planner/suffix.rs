//! Suffix trees: ways from a goal back to itself (`nngtl.md`, III-A, 2), and where the prefix enters them.

use std::sync::Arc;

use super::early::Early;
use super::informed::{Informed, Relaxed};
use super::sampler::Aim;
use super::tree::{Near, NodeId, Tree};
use crate::automaton::{Nba, StateId};
use crate::plan::{Path, Waypoint};
use crate::random::Random;
use crate::system::TransitionSystem;

/// A tree grown from one goal of the prefix tree, and the best cycle found so far.
#[derive(Debug)]
pub(crate) struct SuffixTree<'a> {
    /// The goal, as a node of the prefix tree.
    pub(crate) goal: NodeId,
    /// The goal's automaton state.
    pub(crate) state: StateId,
    pub(crate) tree: Tree<'a>,
    /// Iterations spent on it.
    pub(crate) iterations: u64,
    /// The length of the cheapest way back, and the node from which it closes.
    best: Option<(f64, NodeId)>,
    /// Cycles that begin on the way to the goal, where that can be cheaper.
    early: Option<Early>,
    /// The worth of the cycle that was last made a plan of, and what that plan cost.
    pub(crate) entered: Option<(f64, f64)>,
    touched: Vec<NodeId>,
}

impl<'a> SuffixTree<'a> {
    /// A suffix tree for a goal of `prefix`.
    pub(crate) fn of(prefix: &Tree<'a>, goal: NodeId) -> Self {
        let state = prefix.state(goal);
        Self {
            goal,
            state,
            tree: prefix.beside(prefix.spot(goal), &[state]),
            iterations: 0,
            best: None,
            early: None,
            entered: None,
            touched: Vec::new(),
        }
    }

    /// The same, for plans in which the prefix's share of the cost is `weight`.
    pub(super) fn weighted(prefix: &Tree<'a>, goal: NodeId, weight: f64) -> Self {
        Self {
            early: Early::of(prefix, goal, weight),
            ..Self::of(prefix, goal)
        }
    }

    /// Takes note of a shorter way to the goal.
    pub(super) fn renew(&mut self, prefix: &Tree<'_>) {
        if let Some(early) = &mut self.early
            && early.renew(prefix, self.goal)
        {
            self.tree.touch_all();
        }
    }

    /// Lets the tree know what cycles come to at least, unless they may begin elsewhere, too.
    pub(super) fn inform(&mut self, relaxed: &Arc<Relaxed>, nba: &Nba) {
        if self.early.is_some() || self.tree.is_informed() {
            return;
        }
        let (at, states) = (Some(self.tree.root().at), [self.state]);
        let informed = Informed::new(relaxed, nba, (at, &states), (at, &states));
        self.tree.inform(informed);
    }

    /// What the tree is to grow towards.
    pub(super) fn aim(&self, random: &mut Random) -> Aim {
        let early = self.early.as_ref().filter(|_| self.iterations % 2 == 1);
        let aim = early.and_then(|early| early.aim(random));
        aim.unwrap_or(Aim::Suffix {
            state: self.state,
            closed: self.best.is_some(),
        })
    }

    /// The length of the cheapest way back to the goal.
    fn length_back(&self) -> Option<f64> {
        let (length, node) = self.best?;
        let coming = self.tree.cost(node) - self.tree.length_to(node);
        Some(length - coming)
    }

    /// The cycles that begin on the way to the goal, if the best of them makes the cheaper plan.
    fn earlier(&self) -> Option<&Early> {
        let early = self.early.as_ref()?;
        let (cost, _) = early.best()?;
        let back = self.length_back();
        let at_root = back.map(|length| early.cost_at_root(length));
        at_root.is_none_or(|c| cost < c).then_some(early)
    }

    /// The length of the best cycle.
    pub(crate) fn length(&self) -> Option<f64> {
        let earlier = self.earlier().and_then(Early::best);
        earlier.map(|b| b.1).or_else(|| self.length_back())
    }

    /// What a plan with the best cycle costs at most, but for a prefix that is the same for all cycles of this tree.
    pub(super) fn worth(&self, weight: f64) -> Option<f64> {
        match (self.earlier(), &self.early) {
            (Some(early), _) => early.best().map(|b| b.0),
            (None, Some(early)) => Some(early.cost_at_root(self.length_back()?)),
            (None, None) => Some((1.0 - weight) * self.length_back()?),
        }
    }

    /// The nodes that were new or cheaper when it was last tried to close the cycle.
    pub(crate) fn touched(&self) -> &[NodeId] {
        &self.touched
    }

    /// Whether anything changed that closes a cycle more cheaply. The closing leg obeys the
    /// segment rule like every other and reads the letter of the place that it leaves.
    pub(crate) fn close(&mut self, system: &dyn TransitionSystem, nba: &Nba) -> bool {
        let root = self.tree.root();
        let mut touched = std::mem::take(&mut self.touched);
        self.tree.take_touched(&mut touched);
        let mut improved = false;
        for &node in &touched {
            if let Some(early) = &mut self.early {
                let back = self.best.map(|b| early.cost_at_root(b.0));
                let limit = back.unwrap_or(f64::INFINITY);
                improved |= early.close((system, nba), &self.tree, node, limit);
            }
            let spot = self.tree.spot(node);
            let length = self.tree.cost(node) + system.distance(spot.at, root.at);
            // The root itself, before any move, is no cycle: staying is judged elsewhere.
            if length <= 0.0 || self.best.is_some_and(|(best, _)| best <= length) {
                continue;
            }
            let guard = nba.guard(self.tree.state(node), self.state);
            if guard.is_some_and(|g| g.contains(spot.letter)) && system.step(&spot, &root) {
                self.best = Some((length, node));
                improved = true;
            }
        }
        self.touched = touched;
        improved
    }

    /// The best cycle: from the goal back to the goal, or from a point on the way to the goal by the goal.
    pub(crate) fn path(&self) -> Option<Vec<Waypoint>> {
        let mut path = Vec::new();
        self.path_into(&mut path).then_some(path)
    }

    /// As [`Self::path`], written over what `path` holds; `false` if no cycle is known.
    pub(super) fn path_into(&self, path: &mut Vec<Waypoint>) -> bool {
        if let Some(early) = self.earlier() {
            return early.path_into(&self.tree, path);
        }
        let Some((_, node)) = self.best else {
            return false;
        };
        self.tree.path_into(node, path);
        path.push(Waypoint {
            at: self.tree.root().at,
            state: self.state,
        });
        true
    }
}

/// Where a prefix enters a cycle.
#[derive(Clone, Copy, Debug)]
pub(super) struct Entry {
    /// The number of the cycle's point.
    at: usize,
    /// The node of the prefix tree that is there, or one move away.
    node: NodeId,
    /// The length of the prefix.
    pub(super) length: f64,
}

impl Entry {
    /// The cheapest way of a prefix tree to any product state of a cycle. The
    /// last point of a cycle is its first. `order` is a buffer.
    pub(super) fn cheapest(
        prefix: &mut Tree<'_>,
        system: &dyn TransitionSystem,
        cycle: &[Waypoint],
        near: Near,
        order: &mut Vec<(f64, usize)>,
    ) -> Option<Self> {
        let root = prefix.root().at;
        let least = |w: &Waypoint| system.distance(root, w.at);
        let count = cycle.len().saturating_sub(1).max(1);
        order.clear();
        order.extend(
            cycle[..count]
                .iter()
                .enumerate()
                .map(|(i, w)| (least(w), i)),
        );
        order.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut best: Option<Self> = None;
        for &(least, at) in order.iter() {
            let limit = best.map_or(f64::INFINITY, |b| b.length);
            if least >= limit {
                break;
            }
            let Some(spot) = system.settle(cycle[at].at) else {
                continue;
            };
            if spot.at != cycle[at].at {
                continue;
            }
            if let Some((node, length)) = prefix.way_into(spot, cycle[at].state, near, limit) {
                best = Some(Self { at, node, length });
            }
        }
        // What has not come down to the node yet is saved all the same.
        best.map(|b| Self {
            length: b.length - prefix.cost(b.node) + prefix.length_to(b.node),
            ..b
        })
    }

    /// The plan that enters the cycle here.
    pub(super) fn path(self, prefix: &Tree<'_>, cycle: &[Waypoint]) -> Path {
        let mut path = Path {
            prefix: Vec::new(),
            suffix: Vec::new(),
        };
        self.path_into(prefix, cycle, &mut path);
        path
    }

    /// As [`Self::path`], written over what `path` holds.
    pub(super) fn path_into(self, prefix: &Tree<'_>, cycle: &[Waypoint], path: &mut Path) {
        let here = cycle[self.at];
        prefix.path_into(self.node, &mut path.prefix);
        if prefix.spot(self.node).at != here.at || prefix.state(self.node) != here.state {
            path.prefix.push(here);
        }
        let count = cycle.len().saturating_sub(1).max(1);
        let suffix = (self.at..=self.at + count).map(|i| cycle[i % count]);
        path.suffix.clear();
        path.suffix.extend(suffix);
    }
}
