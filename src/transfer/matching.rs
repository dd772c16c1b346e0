//! Matching the subtasks of a new formula with skills (`transfer-planning.md`, IV-A).
//!
//! Def. 3.2 (ii) is relaxed: a skill matches if its path satisfies the self-loop of the new terminal
//! state. Paths are sets of letters here and self-loops too, so that is one subset test; skills are
//! looked up by their endpoints, so no skill is looked at that does not fit.

use smallvec::SmallVec;

use super::library::{Shelf, Use};
use super::places::{PlaceId, Places};
use super::subtasks::{Endpoint, Position, Subtask, SubtaskGraph, loops};
use crate::alphabet::LetterSet;
use crate::automaton::{Nba, StateId};

/// The automaton states along a reused path.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Run {
    /// The same in every waypoint but the first.
    Constant(StateId),
    /// One for each waypoint but the first.
    States(SmallVec<[StateId; 12]>),
}

impl Run {
    /// The state at waypoint `i ≥ 1`.
    pub(crate) fn state(&self, i: usize) -> StateId {
        match self {
            Self::Constant(q) => *q,
            Self::States(states) => states[i - 1],
        }
    }
}

/// An element of 𝓛_reuse: a skill with the new formula's automaton states.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Reuse {
    pub(crate) used: Use,
    pub(crate) run: Run,
    /// Where it leads.
    pub(crate) to: PlaceId,
    next: u32,
}

/// The end of a list of reuses.
const END: u32 = u32::MAX;

/// What of a library can be reused for one formula.
#[derive(Clone, Debug)]
pub(crate) struct Matching {
    /// 𝓛_reuse.
    entries: Vec<Reuse>,
    /// By place and automaton state: the first entry that begins there (𝒦₂).
    heads: Vec<u32>,
    states: usize,
    /// Starting endpoints of subtasks without a skill (𝒮_r).
    pub(crate) unmatched: Vec<Endpoint>,
    /// Subtasks with a skill, or that need none.
    pub(crate) matched: usize,
}

impl Matching {
    /// Finds a skill for each subtask of the graph.
    pub(crate) fn new(nba: &Nba, places: &Places, graph: &SubtaskGraph, shelf: &Shelf<'_>) -> Self {
        let mut matching = Self {
            entries: Vec::with_capacity(graph.len()),
            heads: vec![END; places.len() * nba.len()],
            states: nba.len(),
            unmatched: Vec::new(),
            matched: 0,
        };
        let labels = loops(nba);
        for subtask in &graph.subtasks {
            if matching.find(nba, &labels, shelf, subtask) {
                matching.matched += 1;
            } else if !subtask.from.position.outside {
                matching.unmatched.push(subtask.from);
            }
        }
        matching.unmatched.sort_unstable();
        matching.unmatched.dedup();
        matching
    }

    /// The reusable skills that begin at a place in a state.
    pub(crate) fn starting(&self, place: PlaceId, state: StateId) -> impl Iterator<Item = &Reuse> {
        let mut next = self.heads[place.index() * self.states + state.index()];
        std::iter::from_fn(move || {
            let entry = self.entries.get(next as usize)?;
            next = entry.next;
            Some(entry)
        })
    }

    /// Whether any reusable skill begins there (whether it is in 𝒦₁).
    pub(crate) fn begins(&self, place: PlaceId, state: StateId) -> bool {
        self.heads[place.index() * self.states + state.index()] != END
    }

    fn push(&mut self, from: PlaceId, state: StateId, used: Use, run: Run, to: PlaceId) {
        let head = &mut self.heads[from.index() * self.states + state.index()];
        let next = std::mem::replace(head, self.entries.len() as u32);
        self.entries.push(Reuse {
            used,
            run,
            to,
            next,
        });
    }

    /// Whether the subtask is matched; what can be reused for it is kept.
    fn find(
        &mut self,
        nba: &Nba,
        labels: &[LetterSet],
        shelf: &Shelf<'_>,
        subtask: &Subtask,
    ) -> bool {
        let (from, to) = (subtask.from.position, subtask.to.position);
        let state = subtask.to.state;
        match (from.outside, to.outside) {
            _ if subtask.is_stay() => true,
            (false, false) => {
                let before = self.entries.len();
                for &used in shelf.between(from.place, to.place) {
                    if shelf
                        .skill(used)
                        .letters()
                        .is_subset(&labels[state.index()])
                    {
                        let run = Run::Constant(state);
                        self.push(from.place, subtask.from.state, used, run, to.place);
                    }
                }
                self.entries.len() > before
            }
            (false, true) => self.leave(nba, shelf, subtask),
            (true, _) => continues(labels, shelf, from, subtask),
        }
    }

    /// Subtasks that ask the robot to leave a place: the first leg of any skill does so, and the
    /// automaton reads the rest of the skill's path as it may.
    fn leave(&mut self, nba: &Nba, shelf: &Shelf<'_>, subtask: &Subtask) -> bool {
        let from = subtask.from.position.place;
        let mut found = false;
        for (to, used) in shelf.leaving(from) {
            let skill = shelf.skill(used);
            let points = skill.path().len();
            if points < 3 {
                continue;
            }
            let letters = (1..points - 1).map(|i| skill.spot(i, used.backward).letter);
            for run in runs(nba, subtask.to.state, letters) {
                self.push(from, subtask.from.state, used, Run::States(run), to);
                found = true;
            }
        }
        found
    }
}

/// Subtasks that begin outside of a place: the rest of a skill that led out of it.
fn continues(labels: &[LetterSet], shelf: &Shelf<'_>, from: Position, subtask: &Subtask) -> bool {
    let label = &labels[subtask.to.state.index()];
    let fits = |used: &Use| {
        let skill = shelf.skill(*used);
        let points = skill.path().len();
        points >= 3 && (2..points - 1).all(|i| label.contains(skill.spot(i, used.backward).letter))
    };
    let uses = shelf.between(from.place, subtask.to.position.place);
    uses.iter().any(fits)
}

/// The automaton's runs over a path that it enters in `first`: for each state in which it can be at
/// the end, the run that waits longest in what it has. `letters` are those of the waypoints
/// between the ends.
fn runs(
    nba: &Nba,
    first: StateId,
    letters: impl Iterator<Item = crate::alphabet::Letter>,
) -> Vec<SmallVec<[StateId; 12]>> {
    // Layers of (state, the number of its predecessor in the layer before).
    let mut layers: Vec<Vec<(StateId, usize)>> = vec![vec![(first, 0)]];
    for letter in letters {
        let before = &layers[layers.len() - 1];
        let mut layer: Vec<(StateId, usize)> = Vec::new();
        for (i, &(q, _)) in before.iter().enumerate() {
            for next in nba.successors(q, letter) {
                match layer.iter_mut().find(|(s, _)| *s == next) {
                    Some(entry) if next == q => entry.1 = i,
                    Some(_) => {}
                    None => layer.push((next, i)),
                }
            }
        }
        layers.push(layer);
    }
    let last = layers.len() - 1;
    let trace = |end: usize| {
        let mut run: SmallVec<[StateId; 12]> = SmallVec::new();
        let mut i = end;
        for layer in layers.iter().rev() {
            let (q, parent) = layer[i];
            run.push(q);
            i = parent;
        }
        run.reverse();
        run
    };
    (0..layers[last].len()).map(trace).collect()
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use super::*;
    use crate::alphabet::{Alphabet, Letter};
    use crate::automaton::Transition;

    #[test]
    fn runs_reach_every_state_that_the_letters_allow() {
        let alphabet = Arc::new(Alphabet::disjoint(vec!["a".to_owned()]).unwrap());
        let all = |target| Transition {
            target: StateId(target),
            guard: alphabet.all(),
        };
        // 0 → 1 → 1, 1 → 2: no waiting in 0.
        let nba = Nba {
            transitions: vec![vec![all(1)], vec![all(1), all(2)], vec![]],
            initial: vec![StateId(0)],
            accepting: vec![false, false, true],
            alphabet,
        };
        let free = Letter(0);
        let found = runs(&nba, StateId(0), [free, free].into_iter());
        let found: Vec<Vec<u32>> = found
            .iter()
            .map(|run| run.iter().map(|q| q.0).collect())
            .collect();
        assert_eq!(found, [vec![0, 1, 1], vec![0, 1, 2]]);
        assert!(runs(&nba, StateId(2), [free].into_iter()).is_empty());
    }
}
