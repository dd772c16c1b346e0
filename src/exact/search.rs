//! Shortest prefixes and suffixes in the product of roadmap and automaton.
//!
//! Dijkstra's algorithm meets accepting product states in the order of their prefix cost. Each
//! is closed to a suffix at once: where the robot may stay there, at no cost; otherwise by an A*
//! search for the shortest cycle, cut off at what would not beat the best plan so far. The A*
//! search is guided by the distance back in a straight line and by the distance in the product to
//! *any* accepting state of the same number, which one backward search gives for all of them.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use super::Infeasible;
use super::mission::Mission;

/// The best plan on the roadmap, as nodes.
pub(super) struct Found {
    /// From the start to where the suffix begins.
    pub(super) prefix: Vec<u32>,
    /// The nodes after that one, without coming back to it; `None` if the robot stays.
    pub(super) suffix: Option<Vec<u32>>,
}

/// An entry of a queue: ordered by priority, then by number.
#[derive(PartialEq)]
struct Entry(f64, u32);

impl Eq for Entry {}

impl Ord for Entry {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0).then(self.1.cmp(&other.1))
    }
}

impl PartialOrd for Entry {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

/// Costs and parents of a search over product states, emptied in constant time.
struct Labels {
    cost: Vec<f64>,
    parent: Vec<u32>,
    stamp: Vec<u32>,
    now: u32,
}

impl Labels {
    fn new(size: usize) -> Self {
        Self {
            cost: vec![f64::INFINITY; size],
            parent: vec![u32::MAX; size],
            stamp: vec![0; size],
            now: 1,
        }
    }

    fn clear(&mut self) {
        self.now += 1;
    }

    fn cost(&self, s: u32) -> f64 {
        if self.stamp[s as usize] == self.now {
            self.cost[s as usize]
        } else {
            f64::INFINITY
        }
    }

    /// Takes the label if it is better than the one there.
    fn improve(&mut self, s: u32, cost: f64, parent: u32) -> bool {
        let better = cost < self.cost(s);
        if better {
            self.stamp[s as usize] = self.now;
            self.cost[s as usize] = cost;
            self.parent[s as usize] = parent;
        }
        better
    }

    /// The states from a root (its own or no parent) to `s`, both included.
    fn path_to(&self, mut s: u32, root: u32) -> Vec<u32> {
        let mut path = vec![s];
        while s != root && self.parent[s as usize] != u32::MAX {
            s = self.parent[s as usize];
            path.push(s);
        }
        path.reverse();
        path
    }
}

impl Mission<'_> {
    fn states(&self) -> u32 {
        self.task.nba.len() as u32
    }

    fn product_size(&self) -> usize {
        (self.start_node() as usize + 1) * self.task.nba.len()
    }

    fn split(&self, s: u32) -> (u32, u32) {
        (s / self.states(), s % self.states())
    }

    /// Calls `visit(next, length)` for every step that leaves product state `s`: waiting, which
    /// reads the letter once more, and driving along a segment.
    fn each_step(&self, s: u32, mut visit: impl FnMut(u32, f64)) {
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

    /// The best plan on the roadmap.
    pub(super) fn search(&self) -> Result<Found, Infeasible> {
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
        let mut cycles = Cycles::new(self);
        let mut best: Option<(f64, Found)> = None;
        let mut goals = 0;
        while let Some(Reverse(Entry(cost, s))) = queue.pop() {
            if cost > labels.cost(s) {
                continue;
            }
            let bound = best.as_ref().map_or(f64::INFINITY, |b| b.0);
            if self.weight * cost >= bound {
                break;
            }
            if accepting[self.split(s).1 as usize] {
                goals += 1;
                if let Some((length, suffix)) = cycles.close(s, self.weight * cost, bound) {
                    let total = self.weight * cost + (1.0 - self.weight) * length;
                    if total < bound {
                        let prefix = self.nodes_of(&labels.path_to(s, u32::MAX));
                        best = Some((total, Found { prefix, suffix }));
                    }
                }
            }
            self.each_step(s, |next, length| {
                if labels.improve(next, cost + length, s) {
                    queue.push(Reverse(Entry(cost + length, next)));
                }
            });
        }
        match best {
            Some((_, found)) => Ok(found),
            None if goals == 0 => Err(Infeasible::NoPrefix),
            None => Err(Infeasible::NoSuffix),
        }
    }

    /// The nodes that product states stand on, without waiting.
    fn nodes_of(&self, states: &[u32]) -> Vec<u32> {
        let mut nodes: Vec<u32> = states.iter().map(|&s| self.split(s).0).collect();
        nodes.dedup();
        nodes
    }

    /// For every product state, the length of the shortest way to some product state with
    /// automaton state `goal`.
    fn lengths_to(&self, goal: u32) -> Vec<f64> {
        let mut labels = Labels::new(self.product_size());
        let mut queue = BinaryHeap::new();
        let backward: Vec<Vec<Vec<u32>>> = self
            .task
            .nba
            .alphabet
            .letters()
            .map(|l| self.relations.backward_once(l))
            .collect();
        for node in (0..self.start_node()).filter(|&n| self.is_active(n)) {
            let s = node * self.states() + goal;
            labels.improve(s, 0.0, u32::MAX);
            queue.push(Reverse(Entry(0.0, s)));
        }
        while let Some(Reverse(Entry(cost, s))) = queue.pop() {
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

/// Searches for suffixes, with what they share.
struct Cycles<'m, 'a> {
    mission: &'m Mission<'a>,
    labels: Labels,
    to_go: HashMap<u32, Vec<f64>>,
    searches_left: usize,
}

impl<'m, 'a> Cycles<'m, 'a> {
    fn new(mission: &'m Mission<'a>) -> Self {
        Self {
            mission,
            labels: Labels::new(mission.product_size()),
            to_go: HashMap::new(),
            searches_left: mission.roadmap.config.suffix_searches,
        }
    }

    /// The shortest suffix from product state `goal` whose plan, with `prefix` the weighted cost
    /// so far, costs less than `bound`: its length and its nodes.
    fn close(&mut self, goal: u32, prefix: f64, bound: f64) -> Option<(f64, Option<Vec<u32>>)> {
        let m = self.mission;
        let (node, state) = m.split(goal);
        if m.relations.often(m.letter(node), state).contains(&state) {
            return Some((0.0, None));
        }
        if self.searches_left == 0 || node == m.start_node() {
            return None;
        }
        let share = 1.0 - m.weight;
        let limit = if share > 1e-9 {
            (bound - prefix) / share
        } else {
            f64::INFINITY
        };
        let to_go = self
            .to_go
            .entry(state)
            .or_insert_with(|| m.lengths_to(state));
        let home = m.at(node);
        let guess = |s: u32| (m.at(m.split(s).0) - home).norm().max(to_go[s as usize]);
        self.labels.clear();
        self.searches_left -= 1;
        let mut queue = BinaryHeap::new();
        let mut closing: Option<(f64, u32)> = None;
        let mut expand = |labels: &mut Labels, queue: &mut BinaryHeap<_>, s: u32, cost: f64| {
            m.each_step(s, |next, length| {
                let through = cost + length;
                if next == goal {
                    if closing.is_none_or(|c| through < c.0) && through < limit {
                        closing = Some((through, s));
                    }
                } else {
                    let whole = through + guess(next);
                    let cut = closing.map_or(limit, |c| c.0.min(limit));
                    if whole < cut && labels.improve(next, through, s) {
                        queue.push(Reverse(Entry(whole, next)));
                    }
                }
            });
            closing.map_or(limit, |c| c.0)
        };
        let mut cut = expand(&mut self.labels, &mut queue, goal, 0.0);
        while let Some(Reverse(Entry(whole, s))) = queue.pop() {
            if whole >= cut {
                break;
            }
            let cost = self.labels.cost(s);
            if whole > cost + guess(s) + 1e-12 {
                continue; // an older, longer label
            }
            cut = expand(&mut self.labels, &mut queue, s, cost);
        }
        let (length, last) = closing?;
        let mut nodes = m.nodes_of(&self.labels.path_to(last, goal));
        nodes.remove(0);
        while nodes.last() == Some(&node) {
            nodes.pop();
        }
        Some((length, Some(nodes)))
    }
}
