//! How far the automaton is from closing a cycle, where the place of the root matters: in an accepting state that it cannot wait in
//! it has to arrive together with the robot, on a letter that one leg leads from to the root.

use crate::alphabet::{Alphabet, Letter, LetterSet};
use crate::automaton::{Distances, Nba, StateId};

/// Steps to the root's state, the last of them beside the root.
#[derive(Debug)]
pub(super) struct Closing {
    /// The letters of places from which a leg may lead to the root.
    letters: LetterSet,
    /// By state, the steps that are left; from the root's own state those of a whole cycle.
    steps: Vec<u32>,
}

impl Closing {
    /// For a root with this state and letter; `None` if the automaton can wait there, or if nothing could be closed, so that
    /// ρ has to do.
    pub(super) fn new(nba: &Nba, alphabet: &Alphabet, root: StateId, here: Letter) -> Option<Self> {
        if nba.guard(root, root).is_some() {
            return None;
        }
        let at_root = alphabet.props(here);
        // Across a border one region is entered or left: one of the letters has all regions of the other.
        let letters = alphabet.filter(|props| {
            let both = props.0 & at_root.0;
            both == props.0 || both == at_root.0
        });
        let mut steps = vec![Distances::INFINITE; nba.states().count()];
        let mut wave: Vec<StateId> = nba
            .states()
            .filter(|&q| nba.guard(q, root).is_some_and(|g| !g.is_disjoint(&letters)))
            .collect();
        let mut depth = 0;
        while !wave.is_empty() {
            depth += 1;
            for q in &wave {
                steps[q.index()] = depth;
            }
            let before = |q: &StateId| {
                let leads = |t: StateId| steps[t.index()] == depth;
                steps[q.index()] == Distances::INFINITE
                    && nba.outgoing(*q).iter().any(|t| leads(t.target))
            };
            wave = nba.states().filter(before).collect();
        }
        let closable = steps[root.index()] != Distances::INFINITE;
        closable.then_some(Self { letters, steps })
    }

    /// The steps from a state to the root, those of a whole cycle from the root's own.
    pub(super) fn steps(&self, from: StateId) -> u32 {
        self.steps[from.index()]
    }

    /// The letters of places from which a leg may lead to the root.
    pub(super) fn letters(&self) -> &LetterSet {
        &self.letters
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::automaton::{Limits, Task};
    use std::sync::Arc;

    #[test]
    fn a_cycle_closes_beside_its_root() {
        let names = ["a", "b"].map(str::to_owned).to_vec();
        let alphabet = Arc::new(Alphabet::disjoint(names).unwrap());
        let formula = "G F a && G F b".parse().unwrap();
        let task = Task::from_formula(&formula, Arc::clone(&alphabet), &Limits::default()).unwrap();
        let nba = &task.nba;
        let a = alphabet.letters_with(0).iter().next().unwrap();
        let mut seen = 0;
        for root in nba.states().filter(|&q| nba.guard(q, q).is_none()) {
            let Some(closing) = Closing::new(nba, &alphabet, root, a) else {
                continue;
            };
            seen += 1;
            let b = alphabet.letters_with(1);
            assert!(closing.letters().is_disjoint(&b), "no leg leads from b into a");
            for q in nba.states() {
                // Never nearer than the automaton alone has it.
                assert!(closing.steps(q) >= task.distances.get(q, root));
                let last = nba.guard(q, root).is_some_and(|g| !g.is_subset(&b));
                assert_eq!(closing.steps(q) == 1, last);
            }
        }
        assert!(seen > 0);
    }
}
