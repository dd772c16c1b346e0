//! The automaton itself.

use std::sync::Arc;

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
}
