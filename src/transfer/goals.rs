//! Goal states of Algorithm 4: accepting states above a node (`acc`), and the cycles that a node closes
//! onto its own path (`transfer-planning.md`, IV-B.1 and IV-B.2).
//!
//! The paper keeps for each node the set of accepting states on its path, and updates it from the
//! parent alone, which goes stale when a node further up is rewired and then loses goals. Here
//! a node has a link to the nearest accepting node on its path, itself included; following the
//! links gives the whole set. The tree reports every node whose path changed, parents before children,
//! so one pass over that report keeps all links right at constant cost for each changed node.

use crate::alphabet::Letter;
use crate::automaton::Task;
use crate::planner::{NodeId, Tree};
use crate::system::TransitionSystem;

/// No accepting node on the path.
const NONE: u32 = u32::MAX;

/// The accepting nodes on the paths of a tree, and what closes cycles there.
#[derive(Debug, Default)]
pub(crate) struct Goals {
    /// For each node, the nearest accepting node on its path from the root, itself included.
    acc: Vec<u32>,
    /// Accepting nodes, in the order they were found.
    accepting: Vec<NodeId>,
    known: Vec<bool>,
}

/// A triplet (q_P, q_P^mid, q_P^F) without its last part, which the cycle determines: `last` can move
/// to its ancestor `mid`, and an accepting node lies between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Closure {
    pub(crate) last: NodeId,
    pub(crate) mid: NodeId,
    pub(crate) length: f64,
}

impl Goals {
    /// Takes note of nodes whose paths changed, in the order the tree reports them.
    pub(crate) fn update(&mut self, task: &Task, tree: &Tree<'_>, touched: &[NodeId]) {
        self.acc.resize(tree.len(), NONE);
        self.known.resize(tree.len(), false);
        for &node in touched {
            let accepts = task.feasible.binary_search(&tree.state(node)).is_ok();
            if accepts && !std::mem::replace(&mut self.known[node.index()], true) {
                self.accepting.push(node);
            }
            let above = tree.parent(node).map_or(NONE, |p| self.acc[p.index()]);
            self.acc[node.index()] = if accepts { node.0 } else { above };
        }
    }

    /// All accepting nodes of the tree.
    pub(crate) fn accepting(&self) -> &[NodeId] {
        &self.accepting
    }

    /// FindGoal: the shortest cycle below `limit` that `node` closes by one move onto an ancestor, with
    /// an accepting node on it. Cycles of no length are left to [`crate::planner`]'s table of
    /// letters on which staying accepts.
    pub(crate) fn close(
        &self,
        system: &dyn TransitionSystem,
        task: &Task,
        tree: &Tree<'_>,
        node: NodeId,
        limit: f64,
    ) -> Option<Closure> {
        let acc = self.acc[node.index()];
        let spot = tree.spot(node);
        let cost = tree.cost(node);
        let mut next = (acc != NONE).then_some(NodeId(acc));
        let mut best: Option<Closure> = None;
        while let Some(mid) = next {
            let along = cost - tree.cost(mid);
            // Further up cycles only get longer.
            if along >= best.map_or(limit, |b| b.length) {
                break;
            }
            next = tree.parent(mid);
            let there = tree.spot(mid);
            let length = along + system.distance(spot.at, there.at);
            if length <= 0.0 || length >= best.map_or(limit, |b| b.length) {
                continue;
            }
            if steps(task, tree, node, spot.letter, mid) && system.step(&spot, &there) {
                best = Some(Closure {
                    last: node,
                    mid,
                    length,
                });
            }
        }
        best
    }
}

/// Whether the automaton can step from one node's state to the other's on a letter.
fn steps(task: &Task, tree: &Tree<'_>, from: NodeId, letter: Letter, to: NodeId) -> bool {
    let guard = task.nba.guard(tree.state(from), tree.state(to));
    guard.is_some_and(|g| g.contains(letter))
}
