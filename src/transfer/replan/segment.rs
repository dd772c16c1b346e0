//! The part of the automaton that a broken segment of a plan uses.

use std::sync::Arc;

use crate::automaton::{Distances, Nba, StateId, Task, Transition};
use crate::plan::Waypoint;
use crate::planner::{NodeId, Tree};

/// B': the states of a segment with the transitions between them; in two layers, before and after the
/// first accepting state, if the segment has to pass one.
pub(super) struct SubAutomaton {
    pub(super) task: Task,
    /// The full automaton's states, by this one's.
    states: Vec<StateId>,
    pub(super) first: StateId,
    pub(super) last: StateId,
}

impl SubAutomaton {
    pub(super) fn new(nba: &Nba, segment: &[Waypoint], accepting: bool) -> Self {
        let mut used: Vec<StateId> = segment.iter().map(|w| w.state).collect();
        used.sort_unstable();
        used.dedup();
        let count = used.len();
        let layers = if accepting { 2 } else { 1 };
        let number = |q: StateId| used.binary_search(&q).unwrap_or(0);
        // A state that accepts is in the second layer, and so is everything after it.
        let enter = |layer: usize, q: StateId| match accepting {
            true if layer == 1 || nba.is_accepting(q) => 1,
            _ => 0,
        };
        let mut transitions = Vec::with_capacity(layers * count);
        for layer in 0..layers {
            for &q in &used {
                let row = nba.outgoing(q).iter();
                let inner = row.filter(|t| used.binary_search(&t.target).is_ok());
                let mut row: Vec<Transition> = inner
                    .map(|t| Transition {
                        target: StateId((enter(layer, t.target) * count + number(t.target)) as u32),
                        guard: t.guard.clone(),
                    })
                    .collect();
                row.sort_by_key(|t| t.target);
                transitions.push(row);
            }
        }
        let (from, to) = (segment[0].state, segment[segment.len() - 1].state);
        let first = StateId((enter(0, from) * count + number(from)) as u32);
        let last = StateId(((layers - 1) * count + number(to)) as u32);
        let small = Nba {
            alphabet: Arc::clone(&nba.alphabet),
            initial: vec![first],
            accepting: (0..layers * count).map(|i| i == last.index()).collect(),
            transitions,
        };
        let mut states = used.clone();
        states.extend((1..layers).flat_map(|_| used.iter().copied()));
        Self {
            task: Task {
                distances: Distances::new(&small),
                feasible: vec![last],
                formula: None,
                nba: small,
            },
            states,
            first,
            last,
        }
    }

    /// The path to a node and on to the end of the segment, in the full automaton's states.
    pub(super) fn path(&self, tree: &Tree<'_>, node: NodeId, to: &Waypoint) -> Vec<Waypoint> {
        let mut path: Vec<Waypoint> = tree
            .path(node)
            .into_iter()
            .map(|w| Waypoint {
                state: self.states[w.state.index()],
                ..w
            })
            .collect();
        path.push(*to);
        path
    }
}
