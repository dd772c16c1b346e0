//! Suffix trees: ways from a goal back to itself (`nngtl.md`, III-A, 2), and where the prefix enters them.

use super::tree::{Near, NodeId, Tree};
use crate::automaton::{Nba, StateId};
use crate::plan::{Path, Waypoint};
use crate::system::TransitionSystem;

/// A tree grown from one goal of the prefix tree, and the cheapest way back found so far.
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
    /// The length of the way back that was last made a plan of, and what that plan cost.
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
            entered: None,
            touched: Vec::new(),
        }
    }

    /// Whether any way back is known.
    pub(crate) fn is_closed(&self) -> bool {
        self.best.is_some()
    }

    /// The length of the cheapest way back.
    pub(crate) fn length(&self) -> Option<f64> {
        let (length, node) = self.best?;
        let coming = self.tree.cost(node) - self.tree.length_to(node);
        Some(length - coming)
    }

    /// The nodes that were new or cheaper when it was last tried to close the cycle.
    pub(crate) fn touched(&self) -> &[NodeId] {
        &self.touched
    }

    /// Whether anything changed that closes the cycle more cheaply. The closing leg obeys the
    /// segment rule like every other and reads the letter of the place that it leaves.
    pub(crate) fn close(&mut self, system: &dyn TransitionSystem, nba: &Nba) -> bool {
        let root = self.tree.root();
        let mut touched = std::mem::take(&mut self.touched);
        self.tree.take_touched(&mut touched);
        let mut improved = false;
        for &node in &touched {
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

    /// The cheapest way back, from the goal to the goal.
    pub(crate) fn path(&self) -> Option<Vec<Waypoint>> {
        let mut path = Vec::new();
        self.path_into(&mut path).then_some(path)
    }

    /// As [`Self::path`], written over what `path` holds; `false` if no way back is known.
    pub(super) fn path_into(&self, path: &mut Vec<Waypoint>) -> bool {
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
