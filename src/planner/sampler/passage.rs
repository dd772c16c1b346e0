//! The way from a node to its target as the automaton admits it: around the regions that it must not enter on this step,
//! and letter by letter, since a leg changes the letter once at most.

use std::sync::Arc;

use rustc_hash::FxHashMap;

use super::View;
use super::choices::Target;
use crate::alphabet::{Letter, LetterSet};
use crate::automaton::StateId;
use crate::system::{Leg, Spot};

/// Sets of letters that may be passed, by the step, the letter of the node and that of the target.
#[derive(Clone, Debug, Default)]
pub(super) struct Passages(FxHashMap<(Step, Letter, Option<Letter>), Arc<LetterSet>>);

/// A step of the automaton that is to be made: the state that it waits in, and the accepting state ahead.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Step {
    /// The state before the step (q_B^succ,1).
    pub(super) from: StateId,
    /// The accepting state (q_B^F,feas).
    pub(super) goal: StateId,
}

impl Passages {
    /// The letters on which the automaton can wait for the step without falling behind, those at the ends of the
    /// way among them.
    fn through(&mut self, view: &View<'_>, target: Target, here: Letter) -> Arc<LetterSet> {
        let key = (target.step, here, target.letter);
        let found = self.0.entry(key).or_insert_with(|| {
            let Step { from, goal } = target.step;
            let rho = &view.task.distances;
            let before = rho.to_go(from, goal);
            let nba = &view.task.nba;
            let mut through = view.system.alphabet().none();
            for letter in view.system.alphabet().letters() {
                let waits = nba
                    .successors(from, letter)
                    .any(|q| rho.to_go(q, goal) <= before);
                if waits || letter == here || Some(letter) == target.letter {
                    through.insert(letter);
                }
            }
            Arc::new(through)
        });
        Arc::clone(found)
    }
}

/// How the shortest way from a place to a target begins that enters no region in which the automaton could not wait; `None` if
/// there is none.
pub(super) fn first_leg(view: &View<'_>, spot: &Spot, target: Target) -> Option<Leg> {
    if !target.fixed || view.system.plane().is_none() {
        return view.system.first_leg(spot.at, target.at, target.fixed);
    }
    let through = {
        let mut leads = view.tree.leads().borrow_mut();
        leads.passages.through(view, target, spot.letter)
    };
    if through.is_all() {
        return view.system.first_leg(spot.at, target.at, true);
    }
    view.system.first_leg_through(spot.at, target.at, &through)
}

/// Whether the automaton can wait or go on to the target where the letter is that of a place on the way. A place in a region that it
/// must not enter can be moved to, and looks near to the target from there, but nothing follows.
pub(super) fn goes_on(view: &View<'_>, there: &Spot, target: Target) -> bool {
    if Some(there.letter) == target.letter {
        return true;
    }
    let Step { from, goal } = target.step;
    let rho = &view.task.distances;
    let before = rho.to_go(from, goal);
    let mut next = view.task.nba.successors(from, there.letter);
    next.any(|q| rho.to_go(q, goal) <= before)
}
