//! What planning asks of an automaton.

use std::sync::{Arc, OnceLock};

use super::scc::components;
use super::tour::Layout;
use super::translate::{is_satisfiable, translate, translate_on};
use super::{Limits, Nba, StateId, TranslateError};
use crate::alphabet::Alphabet;
use crate::ltl::Formula;

/// Shortest step counts between automaton states: ρ of the paper (`nngtl.md`, III-B).
///
/// Planning asks for the way to few states, the feasible accepting ones, while an automaton that visits places in
/// any order has as many states as there are sets of places: so the counts to a state are found when they are first
/// asked for, and kept.
#[derive(Clone, Debug)]
pub struct Distances {
    /// Where in `before` the states that step to a state begin; one more at the end.
    begins: Vec<u32>,
    before: Vec<u32>,
    /// For each state the steps to it from every state.
    columns: Vec<OnceLock<Box<[u32]>>>,
}

impl Distances {
    /// The value that stands for "cannot be reached".
    pub const INFINITE: u32 = u32::MAX;

    /// Prepares ρ for every pair. ρ(q, q) is the length of the shortest *cycle* through q (1 for a self-loop),
    /// since that is what feasibility of an accepting state asks for (S-1).
    #[must_use]
    pub fn new(nba: &Nba) -> Self {
        let size = nba.len();
        let mut begins = vec![0; size + 1];
        let edges = || (0..size).flat_map(|q| nba.transitions[q].iter().map(move |t| (q, t)));
        for (_, t) in edges() {
            begins[t.target.index() + 1] += 1;
        }
        for q in 0..size {
            begins[q + 1] += begins[q];
        }
        let mut ends = begins.clone();
        let mut before = vec![0; begins[size] as usize];
        for (from, t) in edges() {
            let end = &mut ends[t.target.index()];
            before[*end as usize] = from as u32;
            *end += 1;
        }
        Self {
            begins,
            before,
            columns: vec![OnceLock::new(); size],
        }
    }

    /// ρ(from, to); the shortest cycle when they are the same state; [`Self::INFINITE`] if none.
    #[must_use]
    pub fn get(&self, from: StateId, to: StateId) -> u32 {
        let column = self.columns[to.index()].get_or_init(|| {
            let mut steps = vec![Self::INFINITE; self.columns.len()];
            self.search(to.index(), &mut steps, &mut Vec::new());
            steps.into()
        });
        column[from.index()]
    }

    /// As [`Self::get`], but 0 from a state to itself: the distance still to go.
    #[must_use]
    pub fn to_go(&self, from: StateId, to: StateId) -> u32 {
        if from == to { 0 } else { self.get(from, to) }
    }

    /// The largest finite ρ between two different states, 0 if there is none. Nothing is kept.
    #[must_use]
    pub fn largest(&self) -> u32 {
        let mut steps = vec![Self::INFINITE; self.columns.len()];
        let mut queue = Vec::new();
        let mut largest = 0;
        for to in 0..self.columns.len() {
            self.search(to, &mut steps, &mut queue);
            // The last state of a breadth-first search is the furthest; the first ones may be the state itself.
            let others = queue.iter().rev().find(|&&q| q as usize != to);
            largest = largest.max(others.map_or(0, |&q| steps[q as usize]));
            queue
                .drain(..)
                .for_each(|q| steps[q as usize] = Self::INFINITE);
        }
        largest
    }

    /// Breadth-first search from every state to one: `steps` are infinite before, `queue` is empty before and
    /// holds the states from which there is a way afterwards, by ascending number of steps.
    fn search(&self, to: usize, steps: &mut [u32], queue: &mut Vec<u32>) {
        let before = |q: usize| &self.before[self.begins[q] as usize..self.begins[q + 1] as usize];
        let mut open = |q: u32, count: u32, queue: &mut Vec<u32>| {
            if steps[q as usize] == Self::INFINITE {
                steps[q as usize] = count;
                queue.push(q);
            }
            steps[q as usize]
        };
        before(to).iter().for_each(|&q| {
            open(q, 1, queue);
        });
        let mut next = 0;
        while let Some(&q) = queue.get(next) {
            let count = open(q, 0, queue) + 1;
            for &from in before(q as usize) {
                open(from, count, queue);
            }
            next += 1;
        }
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
    /// ρ between the states.
    pub distances: Distances,
    /// The feasible accepting states (S-1), ascending.
    pub feasible: Vec<StateId>,
}

impl Task {
    /// The accepting states that lie on a cycle, ascending.
    fn on_cycles(nba: &Nba) -> Vec<StateId> {
        let targets = |q: usize| nba.transitions[q].iter().map(|t| t.target.index());
        let component = components(nba.len(), targets);
        // Whatever steps to a state of its own component, itself or another, is on a cycle.
        let returns = |q: usize| targets(q).any(|to| component[to] == component[q]);
        nba.states()
            .filter(|&q| nba.is_accepting(q) && returns(q.index()))
            .collect()
    }

    /// Makes a task from an automaton that is already trimmed to its useful states.
    #[must_use]
    pub fn from_trimmed(nba: Nba, formula: Option<Formula>) -> Self {
        let distances = Distances::new(&nba);
        let feasible = Self::on_cycles(&nba);
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
        Self::of(translate(formula, alphabet, limits)?, formula, limits)
    }

    /// As [`Self::from_formula`], for a map whose places `layout` tells of: those of a patrol are waited for in the
    /// order of a short tour. The automaton accepts the same words; what changes is which cycle of places is one cycle of its
    /// states, and so the cheapest plan.
    ///
    /// # Errors
    /// As [`Self::from_formula`].
    pub fn on_map(
        formula: &Formula,
        alphabet: Arc<Alphabet>,
        limits: &Limits,
        layout: &dyn Layout,
    ) -> Result<Self, TaskError> {
        let nba = translate_on(formula, alphabet, limits, layout)?;
        Self::of(nba, formula, limits)
    }

    /// A formula's automaton, or why it is empty.
    fn of(nba: Nba, formula: &Formula, limits: &Limits) -> Result<Self, TaskError> {
        let letters = nba.alphabet.len();
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

#[cfg(test)]
mod tests {
    use super::*;

    /// ρ of all pairs by relaxing until nothing changes.
    fn relaxed(nba: &Nba) -> Vec<Vec<u32>> {
        let mut steps = vec![vec![Distances::INFINITE; nba.len()]; nba.len()];
        let mut changed = true;
        while changed {
            changed = false;
            for from in 0..nba.len() {
                for t in &nba.transitions[from] {
                    let mut beyond = steps[t.target.index()].clone();
                    beyond[t.target.index()] = 0;
                    for (known, rest) in steps[from].iter_mut().zip(beyond) {
                        if rest != Distances::INFINITE && rest + 1 < *known {
                            *known = rest + 1;
                            changed = true;
                        }
                    }
                }
            }
        }
        steps
    }

    #[test]
    fn distances_and_feasible_states_agree_with_relaxation() {
        let formulas = [
            "F a & F b & F c",
            "GF a & GF b",
            "F (a & F (b & F c)) & G !d",
            "(!a U b) & GF c",
            "FG a | F b",
        ];
        for text in formulas {
            let letters =
                Alphabet::disjoint(["a", "b", "c", "d"].map(str::to_owned).to_vec()).unwrap();
            let formula = text.parse().unwrap();
            let limits = Limits::default();
            let task = Task::from_formula(&formula, Arc::new(letters), &limits).unwrap();
            let expected = relaxed(&task.nba);
            let mut largest = 0;
            for from in task.nba.states() {
                for to in task.nba.states() {
                    let steps = expected[from.index()][to.index()];
                    assert_eq!(task.distances.get(from, to), steps, "{text}");
                    if from != to && steps != Distances::INFINITE {
                        largest = largest.max(steps);
                    }
                }
                let cycle = expected[from.index()][from.index()] != Distances::INFINITE;
                let feasible = task.feasible.contains(&from);
                assert_eq!(feasible, cycle && task.nba.is_accepting(from), "{text}");
            }
            assert_eq!(task.distances.largest(), largest, "{text}");
        }
    }
}
