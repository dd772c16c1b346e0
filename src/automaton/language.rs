//! Questions about the words that automata accept.

use std::collections::HashMap;

use super::bits::Bits;
use super::graph::{Edge, Graph, Marks};
use super::{Nba, scc};
use crate::alphabet::Letter;

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
        intersect(&self.to_graph(), &all(self.alphabet.len())).is_empty()
    }

    /// Whether no word is accepted by both automata, which must be over the same alphabet.
    ///
    /// With the automata of a formula and of its negation this shows that neither accepts a wrong
    /// word.
    #[must_use]
    pub fn is_disjoint_from(&self, other: &Self) -> bool {
        intersect(&self.to_graph(), &other.to_graph()).is_empty()
    }

    pub(super) fn to_graph(&self) -> Graph {
        let convert = |t: &super::Transition, marks: Marks| {
            let mut guard = Bits::none(self.alphabet.len());
            t.guard.iter().for_each(|l| guard.insert(l.index()));
            Edge {
                target: t.target.0,
                marks,
                guard,
            }
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

/// The automaton of all words.
fn all(letters: usize) -> Graph {
    Graph {
        marks: 0,
        edges: vec![vec![Edge {
            target: 0,
            marks: 0,
            guard: Bits::all(letters),
        }]],
    }
}

/// What both automata accept.
pub(super) struct Intersection(Graph);

impl Intersection {
    /// Whether that is nothing.
    pub(super) fn is_empty(&self) -> bool {
        let components = self.0.components();
        !components.accepting.contains(&true)
    }
}

/// The product of two automata; only what is reachable.
pub(super) fn intersect(a: &Graph, b: &Graph) -> Intersection {
    let mut product = Graph {
        marks: a.marks + b.marks,
        edges: Vec::new(),
    };
    if a.len() == 0 || b.len() == 0 {
        return Intersection(product);
    }
    let mut number: HashMap<(u32, u32), u32> = HashMap::from([((0, 0), 0)]);
    let mut queue = vec![(0u32, 0u32)];
    while product.len() < queue.len() {
        let (p, q) = queue[product.len()];
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
                    guard: Bits::One(1),
                });
            }
        }
        product.edges.push(row);
    }
    Intersection(product)
}
