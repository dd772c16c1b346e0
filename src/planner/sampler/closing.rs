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
    use crate::automaton::Transition;
    use std::sync::Arc;

    /// From the root by any letter to 1, which waits, and back on b, or on b to 2, which waits, and back on a.
    fn two_ways_around() -> (Nba, Arc<Alphabet>) {
        let names = ["a", "b"].map(str::to_owned).to_vec();
        let alphabet = Arc::new(Alphabet::disjoint(names).unwrap());
        let (any, a, b) = (
            alphabet.all(),
            alphabet.letters_with(0),
            alphabet.letters_with(1),
        );
        let to = |target, guard: &LetterSet| Transition {
            target: StateId(target),
            guard: guard.clone(),
        };
        let nba = Nba {
            initial: vec![StateId(0)],
            accepting: vec![true, false, false],
            transitions: vec![
                vec![to(1, &any)],
                vec![to(0, &b), to(1, &any), to(2, &b)],
                vec![to(0, &a), to(2, &any)],
            ],
            alphabet: Arc::clone(&alphabet),
        };
        (nba, alphabet)
    }

    #[test]
    fn a_cycle_closes_beside_its_root() {
        let (nba, alphabet) = two_ways_around();
        let (a, b) = (alphabet.letters_with(0), alphabet.letters_with(1));
        let at = |set: &LetterSet| set.iter().next().unwrap();
        let steps = |here| {
            let closing = Closing::new(&nba, &alphabet, StateId(0), here).unwrap();
            [0, 1, 2].map(|q| closing.steps(StateId(q)))
        };
        // No leg leads from b into a, so that with the root in a the way back on b is none.
        assert_eq!(steps(at(&a)), [3, 2, 1]);
        assert_eq!(steps(at(&b)), [2, 1, 3]);
        let beside = Closing::new(&nba, &alphabet, StateId(0), at(&a)).unwrap();
        assert!(beside.letters().is_disjoint(&b) && !beside.letters().is_disjoint(&a));
    }

    #[test]
    fn where_the_automaton_waits_any_place_will_do() {
        let (nba, alphabet) = two_ways_around();
        let free = alphabet.letters_with(0).complement();
        let free = free.iter().next().unwrap();
        assert!(Closing::new(&nba, &alphabet, StateId(1), free).is_none());
    }
}
