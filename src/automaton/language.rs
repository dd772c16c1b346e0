//! Questions about the words that automata accept.

use super::bits::Bits;
use super::emptiness::share_a_word;
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
        !share_a_word(&self.to_graph(), &other.to_graph())
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
