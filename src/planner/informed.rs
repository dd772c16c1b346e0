//! What ways come to at least: the informed part of a search.
//!
//! Once a plan is known, a product state can be on a cheaper one only if the way to it and what is left from there are short enough together
//! (the idea of J. D. Gammell, S. S. Srinivasa, T. D. Barfoot, "Informed RRT*: optimal sampling-based path planning focused via direct sampling of
//! an admissible ellipsoidal heuristic", IROS 2014; in the product of map and automaton by a relaxation of ours).
//!
//! # The relaxation
//! The automaton reads a letter where the robot sees it. So who is to read letter l goes to where l is, at least as far as each of its regions is
//! in a straight line; and from where one letter is to where another is, at least as far as their regions are apart. The empty letter may be read
//! anywhere, and where a letter is the robot moves at no cost. What is left by these rules is a shortest path over pairs of letter and
//! state, found once; from a point comes the distance to the letter that is next. Obstacles and regions that must not be
//! entered only make ways longer.

mod outlook;

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::sync::Arc;

use nalgebra::Point2;

use crate::alphabet::{Letter, Props};
use crate::automaton::{Nba, StateId};
use crate::queue::Entry;
use crate::workspace::{Polygon, Workspace};
pub(super) use outlook::Outlook;

/// No relaxed product has more pairs of letter and state: from each point all of them are looked at.
const PAIRS: usize = 1 << 12;

/// So many steps between pairs are looked at for the least cycle, at most.
const STEPS: usize = 1 << 18;

/// The product of automaton and places of letters.
#[derive(Debug)]
pub(crate) struct Relaxed {
    regions: Vec<Polygon>,
    /// The letters but the empty one, each with the numbers of its regions.
    letters: Vec<(Letter, Vec<usize>)>,
    empty: Option<Letter>,
    states: usize,
    /// At `i · letters + k` how far apart letters number `i` and `k` are at least.
    apart: Vec<f64>,
    /// For each pair, at `letter · states + state`, the states that follow on its letter or the empty one.
    after: Vec<Vec<u32>>,
    /// And those that it follows.
    before: Vec<Vec<u32>>,
    /// No cycle through an accepting state is shorter.
    least_cycle: f64,
}

/// Lengths of shortest ways between one end and every pair.
#[derive(Debug)]
struct Table {
    /// At `letter · states + state`.
    lengths: Vec<f64>,
    /// For each state whether empty letters alone lie between it and the end.
    free: Vec<bool>,
    /// Where the end is, if not anywhere.
    at: Option<Point2<f64>>,
}

/// What the ways of one tree come to at least.
#[derive(Debug)]
pub(crate) struct Informed {
    relaxed: Arc<Relaxed>,
    coming: Table,
    going: Table,
}

/// Ends of ways: automaton states, at a place or anywhere.
pub(super) type Ends<'a> = (Option<Point2<f64>>, &'a [StateId]);

/// Which way the automaton is followed.
#[derive(Clone, Copy, PartialEq)]
enum Along {
    Forwards,
    Backwards,
}

impl Relaxed {
    /// Of a map and an automaton over its letters, the cycles of whose plans pass one of the states `accepting`; `None` if it is too large to
    /// be of use.
    pub(super) fn of(map: &Workspace, nba: &Nba, accepting: &[StateId]) -> Option<Self> {
        let alphabet = map.alphabet();
        let named = alphabet
            .letters()
            .filter(|&l| !alphabet.props(l).is_empty());
        let letters = named.map(|l| (l, alphabet.props(l).iter().collect()));
        let letters: Vec<(Letter, Vec<usize>)> = letters.collect();
        let (count, states) = (letters.len(), nba.len());
        if count * states > PAIRS {
            return None;
        }
        let regions: Vec<Polygon> = map.regions().iter().map(|r| r.polygon.clone()).collect();
        let empty = alphabet.letter(Props::EMPTY);
        let mut relaxed = Self {
            apart: distances(&regions, &letters),
            regions,
            letters,
            empty,
            states,
            after: vec![Vec::new(); count * states],
            before: vec![Vec::new(); count * states],
            least_cycle: 0.0,
        };
        for i in 0..count {
            let letter = relaxed.letters[i].0;
            for from in nba.states() {
                for t in nba.outgoing(from) {
                    if t.guard.contains(letter) || empty.is_some_and(|e| t.guard.contains(e)) {
                        relaxed.after[i * states + from.index()].push(t.target.0);
                        relaxed.before[i * states + t.target.index()].push(from.0);
                    }
                }
            }
        }
        if relaxed.steps() * count * accepting.len() <= STEPS {
            relaxed.least_cycle = relaxed.cycle(accepting);
        }
        Some(relaxed)
    }

    /// No suffix is shorter.
    pub(super) fn least_cycle(&self) -> f64 {
        self.least_cycle
    }

    /// How many steps there are between pairs: about what a table costs.
    pub(super) fn steps(&self) -> usize {
        let reads: usize = self.after.iter().map(Vec::len).sum();
        reads + self.after.len() * self.letters.len()
    }

    /// How far each letter is from a point.
    fn far(&self, p: Point2<f64>, into: &mut Vec<f64>) {
        let far = |&i: &usize| self.regions[i].least_distance(p);
        let letters = self.letters.iter();
        into.clear();
        into.extend(letters.map(|(_, regions)| regions.iter().map(far).fold(0.0, f64::max)));
    }

    /// The lengths of shortest ways between `ends` and every pair.
    fn table(&self, nba: &Nba, (at, states): Ends<'_>, along: Along) -> Table {
        let mut far = vec![0.0; self.letters.len()];
        if let Some(at) = at {
            self.far(at, &mut far);
        }
        let number = |i: usize, q: &StateId| i * self.states + q.index();
        let letters = far.iter().enumerate();
        let ends = letters.flat_map(|(i, &far)| states.iter().map(move |q| (number(i, q), far)));
        Table {
            lengths: self.lengths(ends, along),
            free: self.free(nba, states, along),
            at,
        }
    }

    /// The lengths of shortest ways between the pairs `ends`, to which something is added, and every pair.
    fn lengths(&self, ends: impl Iterator<Item = (usize, f64)>, along: Along) -> Vec<f64> {
        let next = match along {
            Along::Forwards => &self.after,
            Along::Backwards => &self.before,
        };
        let mut lengths = vec![f64::INFINITY; next.len()];
        let mut open: BinaryHeap<_> = ends.map(|(pair, l)| Reverse(Entry(l, pair))).collect();
        while let Some(Reverse(Entry(length, pair))) = open.pop() {
            if length >= lengths[pair] {
                continue;
            }
            lengths[pair] = length;
            let (letter, state) = (pair / self.states, pair % self.states);
            let reads = next[pair]
                .iter()
                .map(|&q| (letter * self.states + q as usize, 0.0));
            let count = self.letters.len();
            let moves =
                (0..count).map(|k| (k * self.states + state, self.apart[letter * count + k]));
            for (there, more) in reads.chain(moves) {
                if length + more < lengths[there] {
                    open.push(Reverse(Entry(length + more, there)));
                }
            }
        }
        lengths
    }

    /// The states between which and `ends` the automaton need read nothing but empty letters.
    fn free(&self, nba: &Nba, ends: &[StateId], along: Along) -> Vec<bool> {
        let mut next = vec![Vec::new(); self.states];
        for q in nba.states() {
            for target in self.empty.iter().flat_map(|&e| nba.successors(q, e)) {
                let (from, to) = match along {
                    Along::Forwards => (q, target),
                    Along::Backwards => (target, q),
                };
                next[from.index()].push(to);
            }
        }
        let mut free = vec![false; self.states];
        let mut open = ends.to_vec();
        while let Some(q) = open.pop() {
            if !std::mem::replace(&mut free[q.index()], true) {
                open.extend_from_slice(&next[q.index()]);
            }
        }
        free
    }

    /// The length of the shortest cycle through one of the given states: where it reads in that state the robot sees some letter, or none and
    /// then goes on to some letter.
    fn cycle(&self, states: &[StateId]) -> f64 {
        let mut least = f64::INFINITY;
        for i in 0..self.letters.len() {
            for q in states {
                let pair = i * self.states + q.index();
                let lengths = self.lengths(std::iter::once((pair, 0.0)), Along::Backwards);
                let after = self.after[pair].iter();
                let back = after.map(|&q| lengths[i * self.states + q as usize]);
                least = back.fold(least, f64::min);
            }
        }
        if least.is_finite() { least } else { 0.0 }
    }
}

/// How far apart the letters are at least: as their regions that are furthest from each other.
fn distances(regions: &[Polygon], letters: &[(Letter, Vec<usize>)]) -> Vec<f64> {
    let mut between = vec![0.0; regions.len() * regions.len()];
    for (i, a) in regions.iter().enumerate() {
        for (k, b) in regions.iter().enumerate().take(i) {
            let apart = a.least_distance_to(b);
            between[i * regions.len() + k] = apart;
            between[k * regions.len() + i] = apart;
        }
    }
    let apart = |from: &[usize], to: &[usize]| {
        let pairs = from.iter().flat_map(|&i| to.iter().map(move |&k| (i, k)));
        let lengths = pairs.map(|(i, k)| between[i * regions.len() + k]);
        lengths.fold(0.0, f64::max)
    };
    let from = letters.iter();
    from.flat_map(|(_, from)| letters.iter().map(|(_, to)| apart(from, to)))
        .collect()
}

impl Table {
    /// What lies between the end and a point that is `far` from the letters: for each state at least so much.
    fn from(&self, p: Point2<f64>, far: &[f64], into: &mut [f64]) {
        let straight = self.straight(p);
        for (length, &free) in into.iter_mut().zip(&self.free) {
            *length = if free { straight } else { f64::INFINITY };
        }
        for (lengths, far) in self.lengths.chunks_exact(into.len()).zip(far) {
            for (length, more) in into.iter_mut().zip(lengths) {
                *length = length.min(far + more);
            }
        }
    }

    /// The same for one state.
    fn of_state(&self, state: StateId, p: Point2<f64>, far: &[f64]) -> f64 {
        let rows = self.lengths.chunks_exact(self.free.len()).zip(far);
        let least = if self.free[state.index()] {
            self.straight(p)
        } else {
            f64::INFINITY
        };
        rows.map(|(lengths, far)| far + lengths[state.index()])
            .fold(least, f64::min)
    }

    fn straight(&self, p: Point2<f64>) -> f64 {
        self.at.map_or(0.0, |at| (at - p).norm())
    }
}

impl Informed {
    /// Of a tree that begins at `roots` and is to reach one of `ends`.
    pub(super) fn new(relaxed: &Arc<Relaxed>, nba: &Nba, roots: Ends<'_>, ends: Ends<'_>) -> Self {
        Self {
            relaxed: Arc::clone(relaxed),
            coming: relaxed.table(nba, roots, Along::Forwards),
            going: relaxed.table(nba, ends, Along::Backwards),
        }
    }
}

#[cfg(test)]
mod tests;
