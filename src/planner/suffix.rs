//! Suffix trees: ways from a goal back to itself (`nngtl.md`, III-A, 2).

use super::tree::{NodeId, Tree};
use crate::automaton::{Nba, StateId};
use crate::plan::Waypoint;
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
        let (_, node) = self.best?;
        let mut path = self.tree.path(node);
        path.push(Waypoint {
            at: self.tree.root().at,
            state: self.state,
        });
        Some(path)
    }
}
