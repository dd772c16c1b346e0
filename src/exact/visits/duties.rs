//! What the language of a task asks for, wherever its words are cut into prefix and suffix.

use crate::alphabet::{LetterSet, Props};
use crate::automaton::{Nba, Task};
use crate::shorten::used_regions;
use crate::workspace::Workspace;

/// So many places count at most: the work doubles with each.
const MOST_DUTIES: usize = 10;

/// A place that the language asks for: a region, or what two regions have in common.
#[derive(Debug, PartialEq)]
pub(super) struct Duty {
    pub(super) regions: Props,
    /// Whether every loop holds it.
    pub(super) recurring: bool,
    /// The duties that are never seen for the first time after this one, as bits.
    pub(super) before: u32,
}

/// What the language asks for.
pub(super) fn duties(workspace: &Workspace, task: &Task) -> Vec<Duty> {
    let nba = &task.nba;
    let alphabet = workspace.alphabet();
    let all = alphabet.all();
    let within = |place: Props| alphabet.filter(|props| place.0 & !props.0 == 0);
    let without = |place: Props| within(place).complement();
    let used: Vec<usize> = used_regions(workspace, task).iter().collect();
    let pairs = used.iter().enumerate().flat_map(|(k, &r)| {
        let others = used[k + 1..].iter();
        others.map(move |&s| Props::single(r).with(s))
    });
    let meeting = pairs.filter(|&pair| !within(pair).is_empty());
    let singles = used.iter().map(|&r| Props::single(r));
    let needed = meeting
        .chain(singles)
        .filter(|&place| !accepts(nba, &without(place), &without(place)))
        .map(|place| (!accepts(nba, &all, &without(place)), place));
    let mut needed: Vec<(bool, Props)> = needed.collect();
    // A pair says all that its regions do, unless these recur and it does not.
    let told = |&(recurring, place): &(bool, Props)| {
        let holds = |other: &(bool, Props)| place != other.1 && place.0 & !other.1.0 == 0;
        needed
            .iter()
            .any(|other| holds(other) && other.0 >= recurring)
    };
    let told: Vec<bool> = needed.iter().map(told).collect();
    let mut told = told.iter();
    needed.retain(|_| told.next() == Some(&false));
    // Where there are too many, those that cost the most.
    needed.sort_by_key(|&(recurring, place)| (!recurring, place.0));
    needed.truncate(MOST_DUTIES);
    let comes_first = |first: Props, then: Props| {
        let early = reached(nba, &without(first));
        let mut too_early = within(then);
        too_early.subtract(&within(first));
        let steps = nba.transitions.iter().zip(&early);
        let mut steps = steps.filter(|(_, early)| **early).flat_map(|(t, _)| t);
        first != then && steps.all(|t| t.guard.is_disjoint(&too_early))
    };
    let duty = |&(recurring, regions): &(bool, Props)| Duty {
        regions,
        recurring,
        before: (0..needed.len())
            .filter(|&i| comes_first(needed[i].1, regions))
            .fold(0, |set, i| set | 1 << i),
    };
    needed.iter().map(duty).collect()
}

/// The states that words over some letters lead to.
fn reached(nba: &Nba, letters: &LetterSet) -> Vec<bool> {
    let mut seen = vec![false; nba.len()];
    let mut open: Vec<usize> = nba.initial.iter().map(|q| q.index()).collect();
    while let Some(q) = open.pop() {
        if !std::mem::replace(&mut seen[q], true) {
            open.extend(steps(nba, q, letters));
        }
    }
    seen
}

fn steps<'n>(nba: &'n Nba, q: usize, letters: &'n LetterSet) -> impl Iterator<Item = usize> + 'n {
    let taken = nba.transitions[q].iter();
    taken
        .filter(|t| !t.guard.is_disjoint(letters))
        .map(|t| t.target.index())
}

/// Whether the automaton accepts a word that holds some letters alone, and from some moment on others alone.
fn accepts(nba: &Nba, ever: &LetterSet, at_last: &LetterSet) -> bool {
    let reached = reached(nba, ever);
    let accepting = nba.states().filter(|&q| nba.is_accepting(q));
    accepting
        .map(|q| q.index())
        .filter(|&q| reached[q])
        .any(|goal| {
            let mut seen = vec![false; nba.len()];
            let mut open: Vec<usize> = steps(nba, goal, at_last).collect();
            while let Some(q) = open.pop() {
                if q == goal {
                    return true;
                }
                if !std::mem::replace(&mut seen[q], true) {
                    open.extend(steps(nba, q, at_last));
                }
            }
            false
        })
}
