//! The product of gates and automaton, in which shortest paths are lower bounds.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, HashMap};

use super::{Gates, Halt, Relations};
use crate::alphabet::Letter;
use crate::automaton::Task;
use crate::queue::Entry;

/// Nodes between two looks at whether to end.
const CHECKED: usize = 1024;

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
    /// Whether it is a leg of any path, or only one on which a suffix is entered.
    pub(super) walk: bool,
    /// Whether a suffix can be entered on it, and then in which [class](Product::classes).
    pub(super) entry: Option<u32>,
}

/// The product of gates and automaton.
pub(super) struct Product<'t> {
    pub(super) task: &'t Task,
    pub(super) weight: f64,
    pub(super) letters: Vec<Letter>,
    pub(super) relations: Relations,
    pub(super) nodes: Vec<Node>,
    pub(super) legs: Vec<Leg>,
    /// By letter and state, as bits (number modulo 64): the states after reading the letter any number of
    /// times.
    pub(super) reads: Vec<Vec<u64>>,
    /// The letters of legs with the states in which a suffix can be entered on them.
    pub(super) classes: Vec<(usize, u64)>,
    /// For each node the numbers of the legs from it, and to it.
    pub(super) out: Vec<Vec<u32>>,
    pub(super) into: Vec<Vec<u32>>,
    /// When to end; costs that are found after that are too high.
    pub(super) halt: Halt<'t>,
}

impl<'t> Product<'t> {
    /// Where it is time to end it is of no use.
    pub(super) fn new(gates: &Gates, task: &'t Task, weight: f64, halt: Halt<'t>) -> Self {
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
            if halt.is_due() {
                break;
            }
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
        let (reads, leads) = readings(&relations, &letters, states);
        let mut classes: Vec<(usize, u64)> = Vec::new();
        let mut class_of = HashMap::new();
        let mut legs = Vec::new();
        for (i, node) in nodes.iter().enumerate() {
            if i % CHECKED == 0 && halt.is_due() {
                break;
            }
            for &(gate, to) in &ends[node.letter] {
                let goes_on = gates.goes_on(node, gate);
                let length = gates.straight(node.gate, gate);
                for &state in relations.often(letters[node.letter], node.state) {
                    let class = (
                        node.letter,
                        reads[node.letter][node.state as usize]
                            & leads[node.letter][state as usize],
                    );
                    let class = *class_of.entry(class).or_insert_with(|| {
                        classes.push(class);
                        classes.len() as u32 - 1
                    });
                    let mut add = |crossed, walk, entry| {
                        legs.push(Leg {
                            from: i as u32,
                            to: numbers[&(gate, to, state, crossed)] as u32,
                            length,
                            walk,
                            entry,
                        });
                    };
                    // Where a suffix is entered, no way back of a convex region is cut short.
                    if goes_on != Some(false) {
                        add(false, false, Some(class));
                    }
                    if let Some(crossed) = goes_on {
                        add(crossed, true, (!crossed).then_some(class));
                    }
                }
            }
        }
        let mut product = Self {
            task,
            weight,
            letters,
            reads,
            classes,
            relations,
            nodes,
            legs,
            out: Vec::new(),
            into: Vec::new(),
            halt,
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

    /// What the cheapest ways from (or to) the seeds cost, as far as that is below `limit`, at so much for a
    /// unit of length.
    pub(super) fn distances(
        &self,
        seeds: impl Iterator<Item = (usize, f64)>,
        share: f64,
        back: bool,
        limit: f64,
    ) -> Vec<f64> {
        let mut found = vec![f64::INFINITY; self.nodes.len()];
        let mut queue = BinaryHeap::new();
        if self.halt.is_due() {
            return found;
        }
        for (n, cost) in seeds {
            if cost < found[n] && cost < limit {
                found[n] = cost;
                queue.push(Reverse(Entry(cost, n as u32)));
            }
        }
        let mut popped = 0;
        while let Some(Reverse(Entry(cost, n))) = queue.pop() {
            popped += 1;
            if popped % CHECKED == 0 && self.halt.is_due() {
                break;
            }
            if cost > found[n as usize] {
                continue;
            }
            let legs = if back { &self.into } else { &self.out };
            for &k in &legs[n as usize] {
                let leg = self.legs[k as usize];
                let next = if back { leg.from } else { leg.to };
                let through = cost + share * leg.length;
                if leg.walk && through < found[next as usize] && through < limit {
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
            n.gate != 0
                && !n.crossed
                && gates.crosses(n.gate, letter, n.letter)
                && reads.contains(&n.state)
        };
        let all = self.nodes.iter().enumerate();
        all.filter(|(_, n)| leaves(n)).map(|(i, _)| i).collect()
    }

    /// Drops all other legs.
    pub(super) fn keep_legs(&mut self, keep: &[bool]) {
        let mut keep = keep.iter();
        self.legs.retain(|_| keep.next().copied().unwrap_or(true));
        self.index();
    }

    /// Replaces the lengths of legs by better bounds.
    pub(super) fn lengthen(&mut self, gates: &mut Gates) {
        for leg in &mut self.legs {
            let (from, to) = (self.nodes[leg.from as usize], self.nodes[leg.to as usize]);
            if from.gate != to.gate && !self.halt.is_due() {
                leg.length = leg
                    .length
                    .max(gates.around(from.letter, from.gate, to.gate));
            }
        }
        self.legs.retain(|leg| leg.length.is_finite());
        self.index();
    }

    /// Drops the nodes that are not to be kept and halves the gates of some. What is known of a leg holds
    /// for the legs between the halves of its gates.
    pub(super) fn halve(&mut self, gates: &mut Gates, keep: &[bool], split: &[bool]) {
        let of_gates = |nodes: &[bool]| {
            let mut all = vec![false; gates.gates.len()];
            for (node, yes) in self.nodes.iter().zip(nodes) {
                all[node.gate] |= yes;
            }
            all
        };
        let halves = gates.halve(&of_gates(keep), &of_gates(split));
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
            let letters = [leg.from, leg.to].map(|n| self.nodes[n as usize].letter);
            for &from in &numbers[leg.from as usize] {
                for &to in &numbers[leg.to as usize] {
                    // Fewer borders may run along a half than along the whole.
                    if !gates.crosses(nodes[to as usize].gate, letters[0], letters[1]) {
                        continue;
                    }
                    let (g, h) = (nodes[from as usize].gate, nodes[to as usize].gate);
                    let length = leg.length.max(gates.straight(g, h));
                    legs.push(Leg {
                        from,
                        to,
                        length,
                        ..*leg
                    });
                }
            }
        }
        (self.nodes, self.legs) = (nodes, legs);
        self.index();
    }
}

/// By letter and state, as bits: the states after reading the letter any number of times, and those from
/// which the state follows when it is read once or more.
fn readings(
    relations: &Relations,
    letters: &[Letter],
    states: u32,
) -> (Vec<Vec<u64>>, Vec<Vec<u64>>) {
    let (mut reads, mut leads) = (Vec::new(), Vec::new());
    for &letter in letters {
        let mut after: Vec<u64> = (0..states).map(|q| 1 << (q % 64)).collect();
        let mut before = vec![0_u64; states as usize];
        for q in 0..states {
            for &next in relations.often(letter, q) {
                after[q as usize] |= 1 << (next % 64);
                before[next as usize] |= 1 << (q % 64);
            }
        }
        reads.push(after);
        leads.push(before);
    }
    (reads, leads)
}
