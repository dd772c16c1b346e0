//! The cheapest ways into the automaton states of a place that is connected.

use super::{NONE, NodeId};
use crate::automaton::StateId;

/// A way into an automaton state: its cost when it was found, the node that it comes from, and the
/// length of the move from there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Way {
    pub(super) cost: f64,
    pub(super) from: NodeId,
    pub(super) length: f64,
}

/// For each automaton state the cheapest way into it so far.
#[derive(Clone, Debug)]
pub(super) struct Ways {
    pub(super) into: Vec<Way>,
    /// The states that some way leads to; in the end sorted by cost, then by number.
    pub(super) found: Vec<StateId>,
}

impl Ways {
    pub(super) fn new(states: usize) -> Self {
        Self {
            into: vec![
                Way {
                    cost: f64::INFINITY,
                    from: NodeId(NONE),
                    length: 0.0,
                };
                states
            ],
            found: Vec::with_capacity(states),
        }
    }

    pub(super) fn clear(&mut self) {
        for q in self.found.drain(..) {
            self.into[q.index()].cost = f64::INFINITY;
        }
    }

    pub(super) fn cost(&self, state: StateId) -> f64 {
        self.into[state.index()].cost
    }

    pub(super) fn set(&mut self, state: StateId, cost: f64, from: NodeId, length: f64) {
        if self.cost(state) == f64::INFINITY {
            self.found.push(state);
        }
        self.into[state.index()] = Way { cost, from, length };
    }

    pub(super) fn sort(&mut self) {
        let into = &self.into;
        let cost = |q: &StateId| into[q.index()].cost;
        self.found
            .sort_unstable_by(|a, b| cost(a).total_cmp(&cost(b)).then(a.cmp(b)));
    }
}
