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
