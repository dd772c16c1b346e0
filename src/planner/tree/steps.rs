//! What an automaton does on each letter, as lists of numbers.

use crate::alphabet::Letter;
use crate::automaton::{Nba, StateId};

/// For every letter and state the states that can follow, all in one array.
#[derive(Clone, Debug)]
pub(super) struct Steps {
    states: usize,
    /// For letter `l` and state `q`, at `l · states + q`, where its list begins; one more at the end.
    begins: Vec<u32>,
    targets: Vec<StateId>,
}

impl Steps {
    pub(super) fn new(nba: &Nba) -> Self {
        let states = nba.len();
        let mut begins = Vec::with_capacity(nba.alphabet.len() * states + 1);
        let mut targets = Vec::new();
        for letter in nba.alphabet.letters() {
            for state in nba.states() {
                begins.push(targets.len() as u32);
                targets.extend(nba.successors(state, letter));
            }
        }
        begins.push(targets.len() as u32);
        Self {
            states,
            begins,
            targets,
        }
    }

    /// The number of a letter and a state together.
    #[inline]
    pub(super) fn row(&self, letter: Letter, state: StateId) -> u32 {
        (letter.index() * self.states + state.index()) as u32
    }

    /// Whether a row's state is followed by itself at most.
    pub(super) fn stays(&self, row: u32) -> bool {
        let state = StateId(row % self.states as u32);
        self.range_of(row).all(|k| self.target(k) == state)
    }

    /// Whether no state can follow `state` where the letter is `letter`.
    #[inline]
    pub(super) fn is_end(&self, letter: Letter, state: StateId) -> bool {
        self.range(letter, state).is_empty()
    }

    /// The letter of a row.
    pub(super) fn letter(&self, row: u32) -> Letter {
        Letter(row / self.states as u32)
    }

    /// The numbers of the entries that follow `state` when it reads `letter`, by ascending state.
    #[inline]
    pub(super) fn range(&self, letter: Letter, state: StateId) -> std::ops::Range<usize> {
        self.range_of(self.row(letter, state))
    }

    /// As [`Self::range`], by row.
    #[inline]
    pub(super) fn range_of(&self, row: u32) -> std::ops::Range<usize> {
        let i = row as usize;
        self.begins[i] as usize..self.begins[i + 1] as usize
    }

    /// The state of an entry.
    #[inline]
    pub(super) fn target(&self, entry: usize) -> StateId {
        self.targets[entry]
    }
}
