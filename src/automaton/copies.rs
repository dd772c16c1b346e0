//! Accepting states that a run comes back to, told from those that it only passes.

use super::scc::components;
use super::{Nba, StateId, Transition};

/// The same language with fewer places at which a cycle may be looked for.
///
/// A run that is accepted comes back to one of its accepting states for ever, by steps within the state's strongly connected
/// component. A state that the run begins in, or enters from another component, it need not come back to from *there*: `l5` may
/// lead to the state in which `l4` is due again and again, and wherever the robot is then, no cycle leads back unless `l4` is in
/// sight. So such entries lead to a copy of the state that is not accepting, and the state itself is entered by steps of its own
/// component alone (ours).
#[derive(Clone, Debug)]
pub(crate) struct Copies {
    pub(crate) nba: Nba,
    /// For each state the one that it stands for; the copies come last.
    pub(crate) origin: Vec<StateId>,
}

impl Copies {
    /// `None` if there is nothing to copy. Where an accepting state can be kept by waiting whatever letter is read, any place will
    /// do, and no copy is made.
    pub(crate) fn of(nba: &Nba) -> Option<Self> {
        let targets = |q: usize| nba.transitions[q].iter().map(|t| t.target.index());
        let component = components(nba.len(), targets);
        let within = |from: StateId, to: StateId| component[from.index()] == component[to.index()];
        let mut entered = vec![false; nba.len()];
        for q in &nba.initial {
            entered[q.index()] = true;
        }
        for q in nba.states() {
            for t in nba.outgoing(q).iter().filter(|t| !within(q, t.target)) {
                entered[t.target.index()] = true;
            }
        }
        let mut origin: Vec<StateId> = nba.states().collect();
        let mut copy: Vec<Option<StateId>> = vec![None; nba.len()];
        for q in nba.states() {
            let returns = nba.outgoing(q).iter().any(|t| within(q, t.target));
            if nba.is_accepting(q) && entered[q.index()] && returns && !lasts(nba, q) {
                copy[q.index()] = Some(StateId(origin.len() as u32));
                origin.push(q);
            }
        }
        if origin.len() == nba.len() {
            return None;
        }
        let entry = |q: StateId| copy[q.index()].unwrap_or(q);
        let row = |q: &StateId| {
            let led = nba.outgoing(*q).iter().map(|t| Transition {
                target: if within(*q, t.target) {
                    t.target
                } else {
                    entry(t.target)
                },
                guard: t.guard.clone(),
            });
            let mut row: Vec<Transition> = led.collect();
            row.sort_unstable_by_key(|t| t.target);
            row
        };
        let mut initial: Vec<StateId> = nba.initial.iter().map(|&q| entry(q)).collect();
        initial.sort_unstable();
        let mut accepting = nba.accepting.clone();
        accepting.resize(origin.len(), false);
        let nba = Nba {
            alphabet: nba.alphabet.clone(),
            initial,
            accepting,
            transitions: origin.iter().map(row).collect(),
        };
        Some(Self { nba, origin })
    }
}

/// Whether waiting in `q` is a step on every letter that any step from there is on.
fn lasts(nba: &Nba, q: StateId) -> bool {
    let waiting = nba.guard(q, q);
    let mut steps = nba.outgoing(q).iter();
    waiting.is_some_and(|w| steps.all(|t| t.guard.is_subset(w)))
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use rand::RngExt;

    use super::*;
    use crate::alphabet::{Alphabet, Letter};
    use crate::random::{Random, generator};

    /// An automaton of up to five states, each transition there or not.
    fn random_nba(random: &mut Random) -> Nba {
        let names = ["a", "b"].map(str::to_owned).to_vec();
        let alphabet = Arc::new(Alphabet::disjoint(names).unwrap());
        let states = random.random_range(1..=5);
        let row = |random: &mut Random| -> Vec<Transition> {
            let to = (0..states).filter_map(|target| {
                let letters = alphabet.letters().filter(|_| random.random_bool(0.3));
                let mut guard = alphabet.none();
                letters.for_each(|l| guard.insert(l));
                let target = StateId(target);
                (!guard.is_empty()).then_some(Transition { target, guard })
            });
            to.collect()
        };
        let transitions = (0..states).map(|_| row(random)).collect();
        let accepting = (0..states).map(|_| random.random_bool(0.4)).collect();
        Nba {
            alphabet: Arc::clone(&alphabet),
            initial: vec![StateId(0)],
            accepting,
            transitions,
        }
    }

    #[test]
    fn copies_change_no_language_and_stand_on_no_cycle() {
        let mut random = generator(1, 0);
        let mut made = 0;
        for _ in 0..3_000 {
            let nba = random_nba(&mut random);
            let Some(Copies { nba: with, origin }) = Copies::of(&nba) else {
                continue;
            };
            made += 1;
            let letters = nba.alphabet.len() as u32;
            for _ in 0..20 {
                let [prefix, cycle] = [0, 1].map(|least| -> Vec<Letter> {
                    let len = random.random_range(least..=least + 4);
                    (0..len)
                        .map(|_| Letter(random.random_range(0..letters)))
                        .collect()
                });
                let (one, other) = (nba.accepts(&prefix, &cycle), with.accepts(&prefix, &cycle));
                assert_eq!(one, other, "{prefix:?} ({cycle:?}):\n{nba}\n{with}");
            }
            let targets = |q: usize| with.transitions[q].iter().map(|t| t.target.index());
            let component = components(with.len(), targets);
            for q in with.states() {
                for t in with.outgoing(q) {
                    // What is a step here is one of the states that they stand for.
                    let own = nba.guard(origin[q.index()], origin[t.target.index()]);
                    assert_eq!(own, Some(&t.guard));
                    let copied = t.target.index() >= nba.len();
                    assert!(!copied || component[q.index()] != component[t.target.index()]);
                }
                assert!(!with.is_accepting(q) || q.index() < nba.len());
            }
        }
        assert!(made > 300, "{made}");
    }

    #[test]
    fn where_the_state_lasts_nothing_is_copied() {
        let names = ["a"].map(str::to_owned).to_vec();
        let alphabet = Arc::new(Alphabet::disjoint(names).unwrap());
        let a = alphabet.letters_with(0);
        let to = |target, guard| Transition {
            target: StateId(target),
            guard,
        };
        // Once a, then anything.
        let mut visit = Nba {
            initial: vec![StateId(0)],
            accepting: vec![false, true],
            transitions: vec![
                vec![to(0, a.complement()), to(1, a.clone())],
                vec![to(1, alphabet.all())],
            ],
            alphabet,
        };
        assert!(Copies::of(&visit).is_none());
        // Once a, then for ever again: after the first one the robot may be far from the next.
        visit.transitions[1] = vec![to(1, a.clone()), to(2, a.complement())];
        visit
            .transitions
            .push(vec![to(1, a.clone()), to(2, a.complement())]);
        visit.accepting.push(false);
        let copies = Copies::of(&visit).unwrap();
        assert_eq!(copies.origin, [0, 1, 2, 1].map(StateId));
        assert_eq!(copies.nba.guard(StateId(0), StateId(3)), Some(&a));
        assert_eq!(copies.nba.guard(StateId(0), StateId(1)), None);
    }
}
