//! What planning asks of an automaton.

use std::sync::Arc;

use super::translate::is_satisfiable;
use super::{Limits, Nba, StateId, TranslateError, translate};
use crate::alphabet::Alphabet;
use crate::ltl::Formula;

/// Shortest step counts between automaton states: ρ of the paper (`nngtl.md`, III-B).
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Distances {
    size: usize,
    steps: Vec<u32>,
}

impl Distances {
    /// The value that stands for "cannot be reached".
    pub const INFINITE: u32 = u32::MAX;

    /// Computes ρ for every pair by breadth-first search. ρ(q, q) is the length of the shortest
    /// *cycle* through q (1 for a self-loop), since that is what feasibility of an accepting
    /// state asks for (S-1).
    #[must_use]
    pub fn new(nba: &Nba) -> Self {
        let size = nba.len();
        let mut steps = vec![Self::INFINITE; size * size];
        for from in 0..size {
            let row = &mut steps[from * size..(from + 1) * size];
            let mut frontier = vec![from];
            let mut depth = 0;
            while !frontier.is_empty() {
                depth += 1;
                let mut next = Vec::new();
                for q in frontier {
                    for t in &nba.transitions[q] {
                        let to = t.target.index();
                        if row[to] == Self::INFINITE {
                            row[to] = depth;
                            next.push(to);
                        }
                    }
                }
                frontier = next;
            }
        }
        Self { size, steps }
    }

    /// ρ(from, to); the shortest cycle when they are the same state; [`Self::INFINITE`] if none.
    #[must_use]
    pub fn get(&self, from: StateId, to: StateId) -> u32 {
        self.steps[from.index() * self.size + to.index()]
    }

    /// As [`Self::get`], but 0 from a state to itself: the distance still to go.
    #[must_use]
    pub fn to_go(&self, from: StateId, to: StateId) -> u32 {
        if from == to { 0 } else { self.get(from, to) }
    }
}

/// A mission ready for planning: an automaton over the map's letters with what samplers ask of it.
#[derive(Clone, Debug)]
pub struct Task {
    /// The automaton: every state can be reached from an initial state and can reach a feasible
    /// accepting state.
    pub nba: Nba,
    /// The formula it was made from; `None` if the automaton was given.
    pub formula: Option<Formula>,
    /// ρ between all pairs of states.
    pub distances: Distances,
    /// The feasible accepting states (S-1), ascending.
    pub feasible: Vec<StateId>,
}

impl Task {
    /// Makes a task from an automaton that is already trimmed to its useful states.
    #[must_use]
    pub fn from_trimmed(nba: Nba, formula: Option<Formula>) -> Self {
        let distances = Distances::new(&nba);
        let feasible = nba
            .states()
            .filter(|&q| nba.is_accepting(q) && distances.get(q, q) != Distances::INFINITE)
            .collect();
        Self {
            nba,
            formula,
            distances,
            feasible,
        }
    }
}

/// Why no [`Task`] could be made. The outcomes are distinct: the first two are facts about the
/// mission, the others are not.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TaskError {
    /// No word at all satisfies the formula.
    #[error("the formula is unsatisfiable: no sequence of letters whatever satisfies it")]
    Unsatisfiable,
    /// Some words satisfy the formula, but none over the letters that occur.
    #[error(
        "the formula is satisfiable, but not with the letters of this map: it needs regions to hold together, or apart, as they never do here (there are {letters} letters)"
    )]
    NotWithTheseLetters {
        /// How many letters occur.
        letters: usize,
    },
    /// No word over the letters that occur satisfies the formula; it has too many propositions to
    /// tell whether words over other letters do.
    #[error("no word over the {letters} letters of this map satisfies the formula")]
    NoWord {
        /// How many letters occur.
        letters: usize,
    },
    /// The automaton that was given accepts no word over the letters that occur.
    #[error("the automaton accepts no word over the {letters} letters of this map")]
    EmptyAutomaton {
        /// How many letters occur.
        letters: usize,
    },
    /// The formula could not be translated.
    #[error(transparent)]
    Translate(#[from] TranslateError),
}

impl Task {
    /// Translates a formula and prepares it for planning.
    ///
    /// # Errors
    /// [`TaskError::Unsatisfiable`] or [`TaskError::NotWithTheseLetters`] if no word over the letters
    /// satisfies the formula, else what [`translate`] says.
    pub fn from_formula(
        formula: &Formula,
        alphabet: Arc<Alphabet>,
        limits: &Limits,
    ) -> Result<Self, TaskError> {
        let letters = alphabet.len();
        let nba = translate(formula, alphabet, limits)?;
        if !nba.is_empty() {
            return Ok(Self::from_trimmed(nba, Some(formula.clone())));
        }
        match is_satisfiable(formula, limits)? {
            Some(true) => Err(TaskError::NotWithTheseLetters { letters }),
            Some(false) => Err(TaskError::Unsatisfiable),
            None => Err(TaskError::NoWord { letters }),
        }
    }

    /// Prepares an automaton that was not made from a formula, after removing its useless states.
    ///
    /// # Errors
    /// [`TaskError::EmptyAutomaton`] if it accepts no word.
    pub fn from_nba(nba: Nba) -> Result<Self, TaskError> {
        let letters = nba.alphabet.len();
        let nba = nba.trimmed();
        if nba.is_empty() {
            return Err(TaskError::EmptyAutomaton { letters });
        }
        Ok(Self::from_trimmed(nba, None))
    }
}
