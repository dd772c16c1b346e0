//! Shortest prefixes and suffixes in the product of roadmap and automaton.
//!
//! Dijkstra's algorithm from the start meets accepting product states in the order of the way there. Each
//! is closed to a cycle at once ([`Cycles`]): where the robot may stay there, at no cost; otherwise by a
//! search for the cycle through it that costs least together with the way to its cheapest entry. The way
//! to the accepting state consists of a way to the entry and a part of the cycle, which ends the search.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use super::Infeasible;
use super::cycles::Cycles;
use super::mission::Mission;
use crate::queue::Entry;

/// Neither prefix nor suffix counts as less than this share: among plans of equal cost the shorter ones
/// are wanted, and they end the search.
const MIN_SHARE: f64 = 1e-3;

/// Plans that cost no more than this share above the best are refined, too: where a suffix is best entered in
/// the middle of a leg, the roadmap does not know of it.
const SLACK: f64 = 0.03;

/// So many plans at most.
const CANDIDATES: usize = 4;

/// A plan on the roadmap, as nodes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Found {
    /// From the start to where the suffix is entered.
    pub(super) prefix: Vec<u32>,
    /// The nodes after that one, without coming back to it; `None` if the robot stays.
    pub(super) suffix: Option<Vec<u32>>,
}

impl Found {
    /// Whether another plan has the same suffix, wherever it is entered.
    fn has_suffix_of(&self, other: &Self) -> bool {
        let (Some(mine), Some(theirs)) = (&self.suffix, &other.suffix) else {
            return false;
        };
        let round = |f: &Self, rest: &[u32]| -> Vec<u32> {
            f.prefix.last().into_iter().chain(rest).copied().collect()
        };
        let (mine, theirs) = (round(self, mine), round(other, theirs));
        let n = mine.len();
        n == theirs.len() && (0..n).any(|k| (0..n).all(|i| mine[i] == theirs[(i + k) % n]))
    }
}

/// The cheapest plans so far.
#[derive(Default)]
struct Best {
    /// With their costs, ascending.
    plans: Vec<(f64, Found)>,
}

impl Best {
    /// What costs as much is not wanted any more.
    fn limit(&self) -> f64 {
        match &self.plans[..] {
            [] => f64::INFINITY,
            // Of two plans in which the robot stays the refined one is shorter that was before.
            [(best, found), ..] if found.suffix.is_none() => *best,
            [(best, _), ..] => best * (1.0 + SLACK),
        }
    }

    fn add(&mut self, total: f64, found: Found) {
        if total >= self.limit() {
            return;
        }
        let twin = |p: &&mut (f64, Found)| p.1.has_suffix_of(&found);
        match self.plans.iter_mut().find(twin) {
            Some(twin) if twin.0 <= total => return,
            Some(twin) => *twin = (total, found),
            None => self.plans.push((total, found)),
        }
        self.plans.sort_by(|a, b| a.0.total_cmp(&b.0));
        let limit = self.limit();
        self.plans.retain(|p| p.0 <= limit);
        self.plans.truncate(CANDIDATES);
    }
}

/// Costs and parents of a search over product states, emptied in constant time.
pub(super) struct Labels {
    cost: Vec<f64>,
    pub(super) parent: Vec<u32>,
    stamp: Vec<u32>,
    now: u32,
}

impl Labels {
    pub(super) fn new(size: usize) -> Self {
        Self {
            cost: vec![f64::INFINITY; size],
            parent: vec![u32::MAX; size],
            stamp: vec![0; size],
            now: 1,
        }
    }

    pub(super) fn clear(&mut self) {
        self.now += 1;
    }

    pub(super) fn cost(&self, s: u32) -> f64 {
        if self.stamp[s as usize] == self.now {
            self.cost[s as usize]
        } else {
            f64::INFINITY
        }
    }

    /// Takes the label if it is better than the one there.
    pub(super) fn improve(&mut self, s: u32, cost: f64, parent: u32) -> bool {
        let better = cost < self.cost(s);
        if better {
            self.stamp[s as usize] = self.now;
            self.cost[s as usize] = cost;
            self.parent[s as usize] = parent;
        }
        better
    }

    /// The states from where the search began to `s`, both included.
    pub(super) fn path_to(&self, mut s: u32) -> Vec<u32> {
        let mut path = vec![s];
        while self.parent[s as usize] != u32::MAX {
            s = self.parent[s as usize];
            path.push(s);
        }
        path.reverse();
        path
    }
}

impl Mission<'_> {
    pub(super) fn states(&self) -> u32 {
        self.task.nba.len() as u32
    }

    pub(super) fn product_size(&self) -> usize {
        (self.start_node() as usize + 1) * self.task.nba.len()
    }

    pub(super) fn split(&self, s: u32) -> (u32, u32) {
        (s / self.states(), s % self.states())
    }

    /// Calls `visit(next, length)` for every step that leaves product state `s`: waiting, which
    /// reads the letter once more, and driving along a segment.
    pub(super) fn each_step(&self, s: u32, mut visit: impl FnMut(u32, f64)) {
        let (node, state) = self.split(s);
        for &q in self.relations.once(self.letter(node), state) {
            visit(node * self.states() + q, 0.0);
        }
        for edge in self.edges(node) {
            if let Some(steps) = self.relations.steps(edge.word) {
                for &q in &steps.forward[state as usize] {
                    visit(edge.to * self.states() + q, edge.length);
                }
            }
        }
    }

    /// What a unit of prefix and of suffix cost in the search.
    pub(super) fn shares(&self) -> (f64, f64) {
        (
            self.weight.max(MIN_SHARE),
            (1.0 - self.weight).max(MIN_SHARE),
        )
    }

    /// The best plans on the roadmap, the cheapest first.
    pub(super) fn search(&self) -> Result<Vec<Found>, Infeasible> {
        let mut accepting = vec![false; self.task.nba.len()];
        for q in &self.task.feasible {
            accepting[q.index()] = true;
        }
        let mut labels = Labels::new(self.product_size());
        let mut queue = BinaryHeap::new();
        for q in &self.task.nba.initial {
            let s = self.start_node() * self.states() + q.0;
            labels.improve(s, 0.0, u32::MAX);
            queue.push(Reverse(Entry(0.0, s)));
        }
        let (before, after) = self.shares();
        let mut cycles = Cycles::new(self);
        let mut best = Best::default();
        let (mut goals, mut popped) = (0, 0_u32);
        while let Some(Reverse(Entry(cost, s))) = queue.pop() {
            popped += 1;
            if self.ends_after(popped) {
                break;
            }
            if cost > labels.cost(s) {
                continue;
            }
            if before.min(after) * cost >= best.limit() {
                break;
            }
            if accepting[self.split(s).1 as usize] {
                goals += 1;
                if self.stays(s) {
                    let prefix = self.nodes_of(&labels.path_to(s));
                    let suffix = None;
                    best.add(before * cost, Found { prefix, suffix });
                } else if let Some((total, found)) = cycles.close(s, &labels, best.limit()) {
                    best.add(total, found);
                }
            }
            self.each_step(s, |next, length| {
                if labels.improve(next, cost + length, s) {
                    queue.push(Reverse(Entry(cost + length, next)));
                }
            });
        }
        let halted = best.plans.is_empty() && self.roadmap.halt.is_due();
        if halted {
            return Err(Infeasible::Halted);
        }
        if goals == 0 {
            return Err(Infeasible::NoPrefix);
        }
        let found: Vec<Found> = best.plans.into_iter().map(|(_, f)| f).collect();
        match found.is_empty() {
            true => Err(Infeasible::NoSuffix),
            false => Ok(found),
        }
    }

    /// Whether a search that has looked at so many states should end.
    pub(super) fn ends_after(&self, popped: u32) -> bool {
        popped.is_multiple_of(256) && self.roadmap.halt.is_due()
    }

    /// Whether the robot can stay at an accepting product state for ever.
    fn stays(&self, s: u32) -> bool {
        let (node, state) = self.split(s);
        let reads = self.relations.often(self.letter(node), state);
        reads.contains(&state)
    }

    /// The nodes that product states stand on, without waiting.
    pub(super) fn nodes_of(&self, states: &[u32]) -> Vec<u32> {
        let mut nodes: Vec<u32> = states.iter().map(|&s| self.split(s).0).collect();
        nodes.dedup();
        nodes
    }

    /// For every product state, the length of the shortest way to some product state with
    /// automaton state `goal`.
    pub(super) fn lengths_to(&self, goal: u32) -> Vec<f64> {
        let mut labels = Labels::new(self.product_size());
        let mut queue = BinaryHeap::new();
        let backward: Vec<Vec<Vec<u32>>> = self
            .task
            .nba
            .alphabet
            .letters()
            .map(|l| self.relations.backward_once(l))
            .collect();
        for node in (0..=self.start_node()).filter(|&n| self.is_active(n)) {
            let s = node * self.states() + goal;
            labels.improve(s, 0.0, u32::MAX);
            queue.push(Reverse(Entry(0.0, s)));
        }
        let mut popped = 0;
        while let Some(Reverse(Entry(cost, s))) = queue.pop() {
            popped += 1;
            if self.ends_after(popped) {
                break;
            }
            if cost > labels.cost(s) {
                continue;
            }
            let (node, state) = self.split(s);
            let mut reach = |before: u32, length: f64| {
                if labels.improve(before, cost + length, s) {
                    queue.push(Reverse(Entry(cost + length, before)));
                }
            };
            for &q in &backward[self.letter(node).index()][state as usize] {
                reach(node * self.states() + q, 0.0);
            }
            for edge in self.edges(node) {
                if let Some(steps) = self.relations.steps(edge.back) {
                    for &q in &steps.backward[state as usize] {
                        reach(edge.to * self.states() + q, edge.length);
                    }
                }
            }
        }
        (0..labels.cost.len() as u32)
            .map(|s| labels.cost(s))
            .collect()
    }
}
