//! The automaton itself.

use std::sync::Arc;

use super::scc;
use crate::alphabet::{Alphabet, Letter, LetterSet};

/// The number of a state of an [`Nba`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct StateId(pub u32);

impl StateId {
    /// The state's number as an index into arrays.
    #[must_use]
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// A transition: where it leads, and on which letters.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Transition {
    /// The state it leads to.
    pub target: StateId,
    /// The letters on which it can be taken; never empty.
    pub guard: LetterSet,
}

/// A nondeterministic Büchi automaton with state acceptance (`nngtl.md`, II-B).
///
/// Between two states there is at most one [`Transition`]: its guard holds every letter of every
/// disjunct, so none is lost. A run reads the letter of the point it *leaves*: from `(x, q)` the
/// automaton steps to `q'` with `L(x)` in the guard (III-A, step 4).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Nba {
    /// The letters that guards speak of.
    pub alphabet: Arc<Alphabet>,
    /// The initial states, ascending, without repetition. Empty: the automaton accepts nothing.
    pub initial: Vec<StateId>,
    /// For each state, whether it is accepting.
    pub accepting: Vec<bool>,
    /// For each state, its outgoing transitions by ascending target.
    pub transitions: Vec<Vec<Transition>>,
}

impl Nba {
    /// How many states there are.
    #[must_use]
    pub fn len(&self) -> usize {
        self.accepting.len()
    }

    /// Whether there is no state at all.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.accepting.is_empty()
    }

    /// All states, ascending.
    pub fn states(&self) -> impl Iterator<Item = StateId> + use<> {
        (0..self.accepting.len() as u32).map(StateId)
    }

    /// Whether `state` is accepting.
    #[must_use]
    pub fn is_accepting(&self, state: StateId) -> bool {
        self.accepting[state.index()]
    }

    /// The transitions that leave `state`, by ascending target.
    #[must_use]
    pub fn outgoing(&self, state: StateId) -> &[Transition] {
        &self.transitions[state.index()]
    }

    /// The states that can follow `state` when it reads `letter`, ascending.
    pub fn successors(&self, state: StateId, letter: Letter) -> impl Iterator<Item = StateId> + '_ {
        self.outgoing(state)
            .iter()
            .filter(move |t| t.guard.contains(letter))
            .map(|t| t.target)
    }

    /// The letters on which `from` can step to `to`, if any.
    #[must_use]
    pub fn guard(&self, from: StateId, to: StateId) -> Option<&LetterSet> {
        let row = self.outgoing(from);
        row.binary_search_by_key(&to, |t| t.target)
            .ok()
            .map(|i| &row[i].guard)
    }

    /// How many transitions (pairs of states) there are.
    #[must_use]
    pub fn edge_count(&self) -> usize {
        self.transitions.iter().map(Vec::len).sum()
    }

    /// The same language without useless states: those that cannot be reached or from which no word
    /// is accepted, and transitions without letters. States keep their order; acceptance of a state
    /// on no cycle is kept as it is. Without states if no word is accepted.
    #[must_use]
    pub fn trimmed(&self) -> Self {
        let n = self.len();
        let targets = |q: usize| {
            let real = self.transitions[q].iter().filter(|t| !t.guard.is_empty());
            real.map(|t| t.target.index())
        };
        let of = scc::components(n, targets);
        let mut useful = vec![false; n];
        for q in 0..n {
            useful[q] = self.accepting[q] && targets(q).any(|t| of[t] == of[q]);
        }
        // Backwards from feasible accepting states, forwards from initial ones.
        let mut before: Vec<Vec<usize>> = vec![Vec::new(); n];
        (0..n).for_each(|q| targets(q).for_each(|t| before[t].push(q)));
        close(&mut useful, |q| before[q].clone());
        let mut reached = vec![false; n];
        for q in &self.initial {
            reached[q.index()] = true;
        }
        close(&mut reached, |q| targets(q).collect());
        let kept: Vec<usize> = (0..n).filter(|&q| useful[q] && reached[q]).collect();
        let number = |q: StateId| {
            kept.binary_search(&q.index())
                .ok()
                .map(|i| StateId(i as u32))
        };
        let row = |q: &usize| {
            let renumbered = self.transitions[*q].iter().filter_map(|t| {
                Some(Transition {
                    target: number(t.target)?,
                    guard: t.guard.clone(),
                })
            });
            renumbered.filter(|t| !t.guard.is_empty()).collect()
        };
        Self {
            alphabet: self.alphabet.clone(),
            initial: self.initial.iter().filter_map(|&q| number(q)).collect(),
            accepting: kept.iter().map(|&q| self.accepting[q]).collect(),
            transitions: kept.iter().map(row).collect(),
        }
    }
}

/// Adds to a set all that `next` leads to, again and again.
fn close(set: &mut [bool], next: impl Fn(usize) -> Vec<usize>) {
    let mut todo: Vec<usize> = (0..set.len()).filter(|&q| set[q]).collect();
    while let Some(q) = todo.pop() {
        for t in next(q) {
            if !std::mem::replace(&mut set[t], true) {
                todo.push(t);
            }
        }
    }
}
