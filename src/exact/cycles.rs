//! Shortest cycles through accepting product states, and where they are entered.
//!
//! A cycle through the accepting state f that is entered at e costs λ·d(s, e) + (1 − λ)·(d(f, e) + d(e, f))
//! together with the way from the start s to e. One search from f finds the best: it goes round in two
//! layers, before e (0) and after it (1), and changes from the first to the second at any state for what the
//! way there from the start costs. An e that is further from the start than f is not needed, since f itself
//! would be cheaper; so all these ways are known when f is met.
//!
//! The search is an A*. Back to f it is at least as far as in a straight line, and as in the product to *any*
//! state with f's automaton state, which one backward search gives for all f alike. In layer 0 the
//! way to the entry is still to be paid, and d(s, e) ≥ d(s, f) − d(e, f): if r is left to go, at least
//! λ·max(0, d(s, f) − r) + (1 − λ)·r is left to pay.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use super::mission::Mission;
use super::search::{Found, Labels};
use crate::queue::Entry;

/// Searches for suffixes, with what they share.
pub(super) struct Cycles<'m, 'a> {
    mission: &'m Mission<'a>,
    /// Of both layers, the second after the first.
    labels: Labels,
    /// The number of product states.
    size: u32,
    to_go: HashMap<u32, Vec<f64>>,
    searches_left: usize,
}

/// What one search is for.
struct Goal<'g> {
    /// The accepting product state.
    at: u32,
    /// The length of the way there.
    way: f64,
    /// λ and 1 − λ.
    shares: (f64, f64),
    home: nalgebra::Point2<f64>,
    to_go: &'g [f64],
}

impl Goal<'_> {
    /// What is left to pay at least in a layer at a product state.
    fn guess(&self, mission: &Mission<'_>, s: u32, joined: bool) -> f64 {
        let (before, after) = self.shares;
        let straight = (mission.at(mission.split(s).0) - self.home).norm();
        let left = straight.max(self.to_go[s as usize]);
        if joined {
            after * left
        } else if before < after {
            before * (self.way - left).max(0.0) + after * left
        } else {
            after * left.max(self.way)
        }
    }
}

impl<'m, 'a> Cycles<'m, 'a> {
    pub(super) fn new(mission: &'m Mission<'a>) -> Self {
        Self {
            mission,
            labels: Labels::new(2 * mission.product_size()),
            size: mission.product_size() as u32,
            to_go: HashMap::new(),
            searches_left: mission.roadmap.config.suffix_searches,
        }
    }

    /// The cheapest plan whose suffix moves and passes the accepting product state `at`, if it costs less
    /// than `limit`. `ways` are the ways from the start, to `at` and to all that is nearer.
    pub(super) fn close(&mut self, at: u32, ways: &Labels, limit: f64) -> Option<(f64, Found)> {
        if self.searches_left == 0 || self.mission.roadmap.halt.is_due() {
            return None;
        }
        self.searches_left -= 1;
        let m = self.mission;
        let (node, state) = m.split(at);
        let to_go = self
            .to_go
            .entry(state)
            .or_insert_with(|| m.lengths_to(state));
        let goal = Goal {
            at,
            way: ways.cost(at),
            shares: m.shares(),
            home: m.at(node),
            to_go,
        };
        let (total, last) = search(m, &goal, &mut self.labels, self.size, ways, limit)?;
        // Backwards: from the last state before f to the entry, and from there to f.
        let mut joined = Vec::new();
        let mut s = last;
        while s >= self.size {
            joined.push(s - self.size);
            s = self.labels.parent[s as usize];
            if s == u32::MAX {
                break;
            }
        }
        joined.reverse();
        let mut round = joined;
        let entry = round[0];
        round.push(at);
        if s != u32::MAX {
            round.extend(&self.labels.path_to(s)[1..]);
        }
        let prefix = m.nodes_of(&ways.path_to(entry));
        let mut suffix = m.nodes_of(&round);
        suffix.remove(0);
        while suffix.last() == prefix.last() && !suffix.is_empty() {
            suffix.pop();
        }
        let suffix = Some(suffix);
        Some((total, Found { prefix, suffix }))
    }
}

/// The A* search: the least cost, and the last state of the second layer before the goal.
fn search(
    m: &Mission<'_>,
    goal: &Goal<'_>,
    labels: &mut Labels,
    size: u32,
    ways: &Labels,
    limit: f64,
) -> Option<(f64, u32)> {
    let (before, after) = goal.shares;
    labels.clear();
    let mut queue = BinaryHeap::new();
    let mut closing: Option<(f64, u32)> = None;
    labels.improve(goal.at, 0.0, u32::MAX);
    labels.improve(size + goal.at, before * goal.way, u32::MAX);
    queue.push(Reverse(Entry(0.0, goal.at)));
    queue.push(Reverse(Entry(0.0, size + goal.at)));
    let mut popped = 0;
    while let Some(Reverse(Entry(whole, i))) = queue.pop() {
        popped += 1;
        if m.ends_after(popped) {
            return None;
        }
        let cut = closing.map_or(limit, |c| c.0);
        if whole >= cut {
            break;
        }
        let (s, joined) = (i % size, i >= size);
        let cost = labels.cost(i);
        if s != goal.at && whole > cost + goal.guess(m, s, joined) + 1e-12 {
            continue; // an older, longer label
        }
        if !joined && s != goal.at && ways.cost(s) <= goal.way {
            let entered = cost + before * ways.cost(s);
            let least = entered + goal.guess(m, s, true);
            if least < cut && labels.improve(size + s, entered, i) {
                queue.push(Reverse(Entry(least, size + s)));
            }
        }
        m.each_step(s, |next, length| {
            let through = cost + after * length;
            if next == goal.at {
                let cut = closing.map_or(limit, |c| c.0);
                if joined && through < cut {
                    closing = Some((through, i));
                }
                return;
            }
            let least = through + goal.guess(m, next, joined);
            let cut = closing.map_or(limit, |c| c.0);
            let next = if joined { size + next } else { next };
            if least < cut && labels.improve(next, through, i) {
                queue.push(Reverse(Entry(least, next)));
            }
        });
    }
    closing
}
