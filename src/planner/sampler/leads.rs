//! Which node of an automaton state to go on from towards a target: the one with the least way left (once a plan is known, the
//! least way by it as a whole), until it has disappointed so often that another one's turn comes.
//!
//! Nodes are looked at once for each target that is asked for, a bounded number at a time, so that a sample costs no more
//! in a large tree than in a small one.

use std::cmp::Ordering;
use std::collections::binary_heap::{BinaryHeap, PeekMut};
use std::sync::Arc;

use rustc_hash::FxHashMap;

use super::View;
use super::choices::Target;
use super::closing::Closing;
use super::passage::{Passages, Step, first_leg};
use super::sweep::Sweep;
use crate::automaton::StateId;
use crate::planner::tree::NodeId;

/// Nodes that are looked at for one sample, at most.
const AT_ONCE: usize = 64;

/// How nodes are compared.
struct Weights {
    /// Whether the way to the node counts.
    whole: bool,
    /// What a node counts as further away, relative to the map's side, when no single leg leads from it to the target: other letters
    /// are in between, which cost a site or more.
    detour: f64,
    /// What a node counts as further away, relative to the map's side, each time that it was chosen. Where the shortest way leads
    /// through what the automaton forbids, others get their turn.
    weariness: f64,
}

/// A first plan should take few samples.
const FIRST: Weights = Weights {
    whole: false,
    detour: 0.3,
    weariness: 0.03,
};

/// A better one takes other ways than the one that was tried.
const BETTER: Weights = Weights {
    whole: true,
    detour: 0.02,
    weariness: 0.1,
};

impl Weights {
    fn of(view: &View<'_>) -> Self {
        if view.is_improving() { BETTER } else { FIRST }
    }

    /// The way to a node, as far as it counts.
    fn spent(&self, view: &View<'_>, node: NodeId) -> f64 {
        if self.whole {
            view.tree.cost(node)
        } else {
            0.0
        }
    }
}

/// An automaton state, a step, a target's place, and whether the way to the node counts.
type Key = (StateId, Step, [u64; 2], bool);

/// What samplers remember of a tree.
#[derive(Clone, Debug, Default)]
pub(crate) struct Leads {
    /// How many samples were drawn by the rules, the present one counted.
    samples: u64,
    /// The nodes that were looked at.
    queues: FxHashMap<Key, Queue>,
    pub(super) passages: Passages,
    pub(super) sweep: Sweep,
    /// Once it was asked for.
    closing: Option<Option<Arc<Closing>>>,
    /// Buffers that are kept between samples, so that these allocate nothing: the states with nodes and how far
    /// they are from the goal, and those of them that are chosen from.
    pub(super) levels: Vec<(u32, StateId)>,
    pub(super) candidates: Vec<StateId>,
}

/// The first samples of a tree follow the rules alone. Most first plans take fewer; where the rules fail, the original
/// strategies get their shares from then on, so that the search is as complete as before.
const ALONE: u64 = 32;

impl Leads {
    /// Counts a sample that the rules draw.
    pub(super) fn count(&mut self) {
        self.samples += 1;
    }

    /// Whether the present sample is drawn by the rules alone.
    pub(super) fn is_alone(&self) -> bool {
        (1..=ALONE).contains(&self.samples)
    }

    /// What closes a cycle through the root of this tree.
    pub(super) fn closing(&mut self, view: &View<'_>, root: StateId) -> Option<Arc<Closing>> {
        let found = self.closing.get_or_insert_with(|| {
            let (nba, letter) = (&view.task.nba, view.tree.root().letter);
            Closing::new(nba, view.system.alphabet(), root, letter).map(Arc::new)
        });
        found.clone()
    }
}

#[derive(Clone, Debug, Default)]
struct Queue {
    /// How many of the state's nodes have been looked at.
    seen: usize,
    /// Those from which a path leads to the target, the next to be chosen on top.
    nodes: BinaryHeap<Lead>,
}

/// A node with the way left from it, grown by what it counts as further away.
#[derive(Clone, Copy, Debug)]
pub(super) struct Lead {
    pub(super) left: f64,
    pub(super) node: NodeId,
    /// Whether `left` is more than the least that it can be: ways are looked up for those nodes only whose turn could be next.
    known: bool,
}

impl Ord for Lead {
    fn cmp(&self, other: &Self) -> Ordering {
        // Reversed: a heap has its greatest element on top.
        other
            .left
            .total_cmp(&self.left)
            .then(other.node.cmp(&self.node))
            .then(other.known.cmp(&self.known))
    }
}

impl PartialOrd for Lead {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Lead {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Lead {}

/// The node to go on from to a fixed target, among those in `state`; `None` if no path leads there from any that was
/// looked at, or none so that less than `limit` is left. Ways are not looked up where the crow could not fly within it.
pub(super) fn best(view: &View<'_>, state: StateId, target: Target, limit: f64) -> Option<Lead> {
    let weights = Weights::of(view);
    let key = key(view, state, target);
    let known = view.tree.leads().borrow_mut().queues.remove(&key);
    let mut queue = known.unwrap_or_default();
    let nodes = view.tree.in_state(state);
    for &node in nodes.iter().skip(queue.seen).take(AT_ONCE) {
        queue.seen += 1;
        let straight = view.system.distance(view.tree.spot(node).at, target.at);
        queue.nodes.push(Lead {
            left: weights.spent(view, node) + straight,
            node,
            known: false,
        });
    }
    let mut best = None;
    while let Some(mut lead) = queue.nodes.peek_mut() {
        if lead.left >= limit {
            break;
        }
        if lead.known {
            best = Some(*lead);
            break;
        }
        match left(view, &weights, lead.node, target) {
            Some(left) => {
                lead.left = weights.spent(view, lead.node) + left;
                lead.known = true;
            }
            None => {
                PeekMut::pop(lead);
            }
        }
    }
    view.tree.leads().borrow_mut().queues.insert(key, queue);
    best
}

/// A node that is gone on from counts as further away from now on.
pub(super) fn tire(view: &View<'_>, chosen: Lead, target: Target) {
    let key = key(view, view.tree.state(chosen.node), target);
    let mut leads = view.tree.leads().borrow_mut();
    let queue = leads.queues.get_mut(&key);
    if let Some(mut lead) = queue.and_then(|queue| queue.nodes.peek_mut()) {
        lead.left += Weights::of(view).weariness * view.system.bounds().side();
    }
}

fn key(view: &View<'_>, state: StateId, target: Target) -> Key {
    let at = [target.at.x.to_bits(), target.at.y.to_bits()];
    (state, target.step, at, view.is_improving())
}

/// The way left from a node to another place, with a surcharge if it takes more than one leg.
fn left(view: &View<'_>, weights: &Weights, node: NodeId, target: Target) -> Option<f64> {
    let spot = view.tree.spot(node);
    let state = view.tree.state(node);
    let mut steps = view.task.nba.successors(state, spot.letter);
    if spot.at == target.at || !steps.any(|q| q == target.step.from) {
        return None; // it is there, or its letter leads the automaton elsewhere
    }
    let leg = first_leg(view, &spot, target)?;
    let there = view.system.settle(target.at)?;
    let open = leg.to == target.at && view.system.step(&spot, &there);
    let surcharge = if open { 0.0 } else { weights.detour };
    Some(leg.length + surcharge * view.system.bounds().side())
}
