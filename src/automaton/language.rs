//! Questions about the words that automata accept.

use std::collections::HashMap;

use super::bits::Bits;
use super::graph::{Edge, Graph, Marks};
use super::{Nba, scc};
use crate::alphabet::{Letter, LetterSet};

impl Nba {
    /// Whether the word `prefix cycle cycle cycle …` is accepted. An empty cycle makes no infinite
    /// word, and none is accepted.
    #[must_use]
    pub fn accepts(&self, prefix: &[Letter], cycle: &[Letter]) -> bool {
        let length = prefix.len() + cycle.len();
        let letter = |i: usize| *prefix.get(i).unwrap_or_else(|| &cycle[i - prefix.len()]);
        let next = |i: usize| if i + 1 == length { prefix.len() } else { i + 1 };
        let mut seen = vec![false; self.len() * length];
        let mut todo: Vec<(usize, usize)> = Vec::new();
        if cycle.is_empty() {
            return false;
        }
        let mut rows: Vec<Vec<usize>> = vec![Vec::new(); seen.len()];
        for q in &self.initial {
            seen[q.index() * length] = true;
            todo.push((q.index(), 0));
        }
        while let Some((q, i)) = todo.pop() {
            for t in &self.transitions[q] {
                if !t.guard.contains(letter(i)) {
                    continue;
                }
                let (to, j) = (t.target.index(), next(i));
                rows[q * length + i].push(to * length + j);
                if !std::mem::replace(&mut seen[to * length + j], true) {
                    todo.push((to, j));
                }
            }
        }
        let of = scc::components(rows.len(), |n| rows[n].iter().copied());
        (0..rows.len())
            .any(|n| self.accepting[n / length] && rows[n].iter().any(|&m| of[m] == of[n]))
    }

    /// Whether no word is accepted.
    #[must_use]
    pub fn is_language_empty(&self) -> bool {
        accepts_nothing(&self.to_graph())
    }

    /// Whether no word is accepted by both automata, which must be over the same alphabet.
    ///
    /// With the automata of a formula and of its negation this shows that neither accepts a wrong
    /// word.
    #[must_use]
    pub fn is_disjoint_from(&self, other: &Self) -> bool {
        product(&self.to_graph(), &other.to_graph()).is_empty()
    }

    pub(super) fn to_graph(&self) -> Graph {
        let convert = |t: &super::Transition, marks: Marks| Edge {
            target: t.target.0,
            marks,
            guard: to_bits(&t.guard, self.alphabet.len()),
        };
        // Several initial states are joined by one that has all their edges.
        let single = self.with_one_initial();
        if single.initial.len() != 1 || single.is_empty() {
            return Graph::empty();
        }
        let edges = single.transitions.iter().zip(&single.accepting);
        Graph {
            marks: 1,
            edges: edges
                .map(|(row, &acc)| row.iter().map(|t| convert(t, Marks::from(acc))).collect())
                .collect(),
        }
    }
}

/// A guard as a set of letter numbers.
pub(super) fn to_bits(guard: &LetterSet, letters: usize) -> Bits {
    let mut bits = Bits::none(letters);
    guard.iter().for_each(|l| bits.insert(l.index()));
    bits
}

/// Whether no run of `graph` accepts.
fn accepts_nothing(graph: &Graph) -> bool {
    !graph.components().accepting.contains(&true)
}

/// The part of the product of two automata that is reachable from their initial states.
pub(super) fn product(a: &Graph, b: &Graph) -> Product {
    let start = (a.len() > 0 && b.len() > 0).then_some((0, 0));
    product_from(a, b, start)
}

/// As [`product`], from several pairs of states.
pub(super) fn product_from(
    a: &Graph,
    b: &Graph,
    starts: impl IntoIterator<Item = (u32, u32)>,
) -> Product {
    let mut graph = Graph {
        marks: a.marks + b.marks,
        edges: Vec::new(),
    };
    let mut queue: Vec<(u32, u32)> = starts.into_iter().collect();
    let mut number: HashMap<(u32, u32), u32> = queue
        .iter()
        .enumerate()
        .map(|(i, &pair)| (pair, i as u32))
        .collect();
    while graph.len() < queue.len() {
        let (p, q) = queue[graph.len()];
        let mut row = Vec::new();
        for e in &a.edges[p as usize] {
            for f in &b.edges[q as usize] {
                if e.guard.is_disjoint(&f.guard) {
                    continue;
                }
                let pair = (e.target, f.target);
                let target = *number.entry(pair).or_insert_with(|| {
                    queue.push(pair);
                    queue.len() as u32 - 1
                });
                row.push(Edge {
                    target,
                    marks: e.marks | f.marks << a.marks,
                    // Which letters they are is of no interest any more.
                    guard: Bits::One(1),
                });
            }
        }
        graph.edges.push(row);
    }
    Product(graph)
}

/// What two automata accept together.
pub(super) struct Product(Graph);

impl Product {
    /// Whether that is nothing.
    pub(super) fn is_empty(&self) -> bool {
        accepts_nothing(&self.0)
    }
}
