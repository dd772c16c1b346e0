//! The product of gates and automaton, in which shortest paths are lower bounds.

use std::cell::RefCell;
use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use super::{Gates, Relations};
use crate::alphabet::Letter;
use crate::automaton::Task;

/// A node of the product: a gate, the letter that it leads into, and the automaton's state there.
#[derive(Clone, Copy, Debug)]
pub(super) struct Node {
    pub(super) gate: usize,
    pub(super) letter: usize,
    pub(super) state: u32,
    /// Whether a convex region was just crossed from another gate.
    pub(super) crossed: bool,
}

/// A leg of the product between two nodes, by their numbers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Leg {
    pub(super) from: u32,
    pub(super) to: u32,
    pub(super) length: f64,
}

/// The product of gates and automaton.
pub(super) struct Product<'t> {
    pub(super) task: &'t Task,
    pub(super) weight: f64,
    pub(super) letters: Vec<Letter>,
    pub(super) relations: Relations,
    pub(super) nodes: Vec<Node>,
    pub(super) legs: Vec<Leg>,
    /// For each node the numbers of the legs from it, and to it.
    pub(super) out: Vec<Vec<u32>>,
    pub(super) into: Vec<Vec<u32>>,
}

/// Distances in a product.
pub(super) struct Solved {
    pub(super) from_start: Vec<f64>,
    /// To where the robot can stay for ever.
    pub(super) to_rest: Vec<f64>,
    pub(super) rounds: Vec<Round>,
}

/// Suffixes that begin with a letter, in an accepting state.
pub(super) struct Round {
    pub(super) letter: usize,
    pub(super) state: u32,
    /// The least length of a prefix to there.
    pub(super) prefix: f64,
    /// From where the suffix first leaves the letter, and to where it comes back into it.
    pub(super) from: Vec<f64>,
    pub(super) to: Vec<f64>,
    /// The least length of a suffix, without its leg within the letter.
    pub(super) least: f64,
}

impl<'t> Product<'t> {
    pub(super) fn new(gates: &Gates, task: &'t Task, weight: f64) -> Self {
        let relations = Relations::new(&task.nba);
        let letters: Vec<Letter> = gates.letters.iter().map(|l| l.1).collect();
        let states = task.nba.len() as u32;
        let mut nodes = Vec::new();
        let mut numbers = HashMap::new();
        // For each letter the gates at which a leg in it can end, and what they lead into.
        let mut ends: Vec<Vec<(usize, usize)>> = vec![Vec::new(); letters.len()];
        for q in &task.nba.initial {
            nodes.push(Node {
                gate: 0,
                letter: gates.start_letter,
                state: q.0,
                crossed: false,
            });
        }
        for gate in 1..gates.gates.len() {
            for (from, to) in gates.crossings(gate) {
                ends[from].push((gate, to));
                for (state, crossed) in (0..states).flat_map(|q| [(q, false), (q, true)]) {
                    numbers
                        .entry((gate, to, state, crossed))
                        .or_insert_with(|| {
                            nodes.push(Node {
                                gate,
                                letter: to,
                                state,
                                crossed,
                            });
                            nodes.len() - 1
                        });
                }
            }
        }
        let mut legs = Vec::new();
        for (i, node) in nodes.iter().enumerate() {
            for &(gate, to) in &ends[node.letter] {
                let Some(crossed) = gates.goes_on(node, gate) else {
                    continue;
                };
                let length = gates.straight(node.gate, gate);
                for &state in relations.often(letters[node.letter], node.state) {
                    legs.push(Leg {
                        from: i as u32,
                        to: numbers[&(gate, to, state, crossed)] as u32,
                        length,
                    });
                }
            }
        }
        let mut product = Self {
            task,
            weight,
            letters,
            relations,
            nodes,
            legs,
            out: Vec::new(),
            into: Vec::new(),
        };
        product.index();
        product
    }

    pub(super) fn index(&mut self) {
        self.out = vec![Vec::new(); self.nodes.len()];
        self.into = vec![Vec::new(); self.nodes.len()];
        for (k, leg) in self.legs.iter().enumerate() {
            self.out[leg.from as usize].push(k as u32);
            self.into[leg.to as usize].push(k as u32);
        }
    }

    /// Shortest distances from (or to) a set of nodes, as far as they are below `limit`.
    pub(super) fn distances(
        &self,
        from: impl Iterator<Item = usize>,
        back: bool,
        limit: f64,
    ) -> Vec<f64> {
        let mut found = vec![f64::INFINITY; self.nodes.len()];
        let mut queue = BinaryHeap::new();
        for n in from {
            found[n] = 0.0;
            queue.push(Reverse(Entry(0.0, n as u32)));
        }
        while let Some(Reverse(Entry(length, n))) = queue.pop() {
            if length > found[n as usize] {
                continue;
            }
            let legs = if back { &self.into } else { &self.out };
            for &k in &legs[n as usize] {
                let leg = self.legs[k as usize];
                let next = if back { leg.from } else { leg.to };
                let through = length + leg.length;
                if through < found[next as usize] && through < limit {
                    found[next as usize] = through;
                    queue.push(Reverse(Entry(through, next)));
                }
            }
        }
        found
    }

    /// The nodes from which `state` can be read to within their letter, if that is `letter`.
    pub(super) fn arrivals(&self, letter: usize, state: u32) -> impl Iterator<Item = usize> + '_ {
        let all = self.nodes.iter().enumerate();
        let here = all.filter(move |(_, n)| {
            let reads = || self.relations.often(self.letters[letter], n.state);
            n.letter == letter && (n.state == state || reads().contains(&state))
        });
        here.map(|(i, _)| i)
    }

    /// The nodes at which a suffix can first leave `letter`, begun in `state`.
    pub(super) fn departures(&self, gates: &Gates, letter: usize, state: u32) -> Vec<usize> {
        let reads = self.relations.often(self.letters[letter], state);
        let leaves = |n: &Node| {
            let region = gates.gates[n.gate].region;
            n.gate != 0
                && !n.crossed
                && gates.crosses(region, letter, n.letter)
                && reads.contains(&n.state)
        };
        let all = self.nodes.iter().enumerate();
        all.filter(|(_, n)| leaves(n)).map(|(i, _)| i).collect()
    }

    pub(super) fn solve(&self, gates: &Gates, cut: f64) -> Solved {
        let part = |share: f64| {
            if share > 1e-9 {
                cut / share
            } else {
                f64::INFINITY
            }
        };
        let (prefix_limit, suffix_limit) = (part(self.weight), part(1.0 - self.weight));
        let starts = self.task.nba.initial.len();
        let from_start = self.distances(0..starts, false, prefix_limit);
        let mut resting: Vec<usize> = Vec::new();
        let mut rounds = Vec::new();
        for letter in 0..self.letters.len() {
            for f in &self.task.feasible {
                let arrivals: Vec<usize> = self.arrivals(letter, f.0).collect();
                let reached = arrivals.iter().map(|&n| from_start[n]);
                let prefix = reached.fold(f64::INFINITY, f64::min);
                if self
                    .relations
                    .often(self.letters[letter], f.0)
                    .contains(&f.0)
                {
                    // Staying costs nothing, so nothing else can be cheaper.
                    resting.extend(arrivals);
                    continue;
                }
                if !prefix.is_finite() {
                    continue;
                }
                let departures = self.departures(gates, letter, f.0);
                let from = self.distances(departures.into_iter(), false, suffix_limit);
                let to = self.distances(arrivals.iter().copied(), true, f64::INFINITY);
                let least = arrivals.iter().map(|&n| from[n]);
                let least = least.fold(f64::INFINITY, f64::min);
                rounds.push(Round {
                    letter,
                    state: f.0,
                    prefix,
                    from,
                    to,
                    least,
                });
            }
        }
        let to_rest = self.distances(resting.into_iter(), true, prefix_limit);
        Solved {
            from_start,
            to_rest,
            rounds,
        }
    }

    pub(super) fn total(&self, prefix: f64, suffix: f64) -> f64 {
        // A share of nothing costs nothing, even of an infinite length that was cut off.
        let part = |share: f64, length: f64| if share > 0.0 { share * length } else { 0.0 };
        part(self.weight, prefix) + part(1.0 - self.weight, suffix)
    }

    /// What a plan costs at least that goes `length` from one node to another, whatever its part.
    pub(super) fn through(&self, solved: &Solved, from: usize, length: f64, to: usize) -> f64 {
        let prefix = solved.from_start[from] + length;
        let mut least = self.total(prefix + solved.to_rest[to], 0.0);
        for round in &solved.rounds {
            let on_prefix = self.total(prefix + round.to[to], round.least);
            let on_suffix = self.total(round.prefix, round.from[from] + length + round.to[to]);
            least = least.min(on_prefix).min(on_suffix);
        }
        least
    }

    /// Drops the legs that no plan below `cut` can take.
    pub(super) fn prune(&mut self, solved: &Solved, cut: f64) {
        let mut legs = std::mem::take(&mut self.legs);
        legs.retain(|leg| {
            self.through(solved, leg.from as usize, leg.length, leg.to as usize) < cut
        });
        self.legs = legs;
        self.index();
    }

    /// Replaces the lengths of legs by better bounds.
    pub(super) fn lengthen(&mut self, gates: &mut Gates) {
        for leg in &mut self.legs {
            let (from, to) = (self.nodes[leg.from as usize], self.nodes[leg.to as usize]);
            if from.gate != to.gate {
                leg.length = leg
                    .length
                    .max(gates.around(from.letter, from.gate, to.gate));
            }
        }
        self.legs.retain(|leg| leg.length.is_finite());
        self.index();
    }

    /// What any plan costs at least; `cut` if it is that or more.
    pub(super) fn bound(&self, gates: &Gates, solved: &Solved, cut: f64) -> f64 {
        let resting = (0..self.nodes.len()).filter(|&n| solved.to_rest[n] == 0.0);
        let rest = resting.map(|n| solved.from_start[n]);
        let mut best = self.total(rest.fold(f64::INFINITY, f64::min), 0.0).min(cut);
        for round in &solved.rounds {
            if self.total(round.prefix, round.least) >= best {
                continue;
            }
            let arrivals: Vec<usize> = self.arrivals(round.letter, round.state).collect();
            let entry = Entries::new(gates, self, solved, round.letter, &arrivals);
            // One search for each gate by which the suffix leaves, to close it with the leg from there.
            let mut departures = self.departures(gates, round.letter, round.state);
            departures.sort_by_key(|&n| self.nodes[n].gate);
            for group in departures.chunk_by(|&a, &b| self.nodes[a].gate == self.nodes[b].gate) {
                let gate = self.nodes[group[0]].gate;
                let least = group.iter().map(|&n| round.to[n]);
                let least = least.fold(f64::INFINITY, f64::min);
                if self.total(round.prefix, least) >= best {
                    continue;
                }
                let limit = (best - self.weight * round.prefix) / (1.0 - self.weight).max(1e-12);
                let from = self.distances(group.iter().copied(), false, limit);
                for &n in &arrivals {
                    let last = self.nodes[n].gate;
                    if self.total(round.prefix, from[n]) >= best {
                        continue;
                    }
                    let closing = gates.known(round.letter, last, gate);
                    if !closing.is_finite() || self.total(round.prefix, from[n] + closing) >= best {
                        continue;
                    }
                    let joined = (entry.to(gate) + entry.to(last) - closing) / 2.0;
                    let prefix = if self.weight <= 0.6 {
                        round.prefix.max(joined)
                    } else {
                        round.prefix
                    };
                    best = best.min(self.total(prefix, from[n] + closing));
                }
            }
        }
        best
    }

    /// Which nodes a plan below `cut` can pass.
    pub(super) fn useful_nodes(&self, solved: &Solved, cut: f64) -> Vec<bool> {
        let through = |n| self.through(solved, n, 0.0, n) < cut;
        (0..self.nodes.len()).map(through).collect()
    }

    /// Halves gates. What is known of a leg holds for the legs between the halves of its gates.
    pub(super) fn halve(&mut self, gates: &mut Gates, keep: &[bool]) {
        let mut kept = vec![false; gates.gates.len()];
        for (node, keep) in self.nodes.iter().zip(keep) {
            kept[node.gate] |= keep;
        }
        let halves = gates.halve(&kept);
        let mut nodes = Vec::new();
        let mut numbers: Vec<Vec<u32>> = Vec::with_capacity(self.nodes.len());
        for (i, (node, &keep)) in self.nodes.iter().zip(keep).enumerate() {
            let mut mine = Vec::new();
            // The first nodes are the starts, by number.
            if keep || i < self.task.nba.initial.len() {
                for &gate in &halves[node.gate] {
                    mine.push(nodes.len() as u32);
                    nodes.push(Node { gate, ..*node });
                }
            }
            numbers.push(mine);
        }
        let mut legs = Vec::with_capacity(4 * self.legs.len());
        for leg in &self.legs {
            for &from in &numbers[leg.from as usize] {
                for &to in &numbers[leg.to as usize] {
                    let (g, h) = (nodes[from as usize].gate, nodes[to as usize].gate);
                    let length = leg.length.max(gates.straight(g, h));
                    legs.push(Leg { from, to, length });
                }
            }
        }
        (self.nodes, self.legs) = (nodes, legs);
        self.index();
    }
}

/// The least lengths of prefixes that come into a letter with an accepting state in sight, and go on in
/// it to a gate.
pub(super) struct Entries<'g> {
    pub(super) gates: &'g Gates,
    pub(super) letter: usize,
    /// Gates of arrival with the length until there, the shortest first.
    pub(super) arrivals: Vec<(f64, usize)>,
    pub(super) known: RefCell<HashMap<usize, f64>>,
}

impl<'g> Entries<'g> {
    pub(super) fn new(
        gates: &'g Gates,
        product: &Product<'_>,
        solved: &Solved,
        letter: usize,
        nodes: &[usize],
    ) -> Self {
        let all = nodes
            .iter()
            .map(|&n| (solved.from_start[n], product.nodes[n].gate));
        let mut arrivals: Vec<(f64, usize)> = all.filter(|a| a.0.is_finite()).collect();
        arrivals.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        Self {
            gates,
            letter,
            arrivals,
            known: RefCell::default(),
        }
    }

    pub(super) fn to(&self, gate: usize) -> f64 {
        *self.known.borrow_mut().entry(gate).or_insert_with(|| {
            let mut least = f64::INFINITY;
            for &(length, from) in &self.arrivals {
                if length >= least {
                    break;
                }
                least = least.min(length + self.gates.known(self.letter, from, gate));
            }
            least
        })
    }
}

/// An entry of a queue: ordered by length, then by number.
#[derive(PartialEq)]
pub(super) struct Entry(f64, u32);

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
