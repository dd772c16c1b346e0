//! The choices that biased and guided sampling share: S-1 to S-4 of `nngtl.md`, III-B.
//!
//! Guided sampling makes the same choices, except that with probability α each is drawn in
//! proportion to the predicted state probabilities (C-1), among the candidates that keep S-3's
//! order.

use nalgebra::Point2;
use rand::RngExt;
use smallvec::SmallVec;

use super::closing::Closing;
use super::passage::Step;
use super::{Aim, View};
use crate::alphabet::{Letter, LetterSet};
use crate::automaton::{Distances, StateId};
use crate::planner::tree::NodeId;
use crate::random::{Random, chance, choose, unit, weighted};

/// Share of steps, once a plan is known, that need not bring the automaton closer to its goal.
const ELSEWHERE: f64 = 0.2;

/// How a choice among automaton states is made.
#[derive(Clone, Copy, Default)]
pub(super) struct Preference<'a> {
    /// Predicted probabilities per automaton state.
    pub(super) predicted: Option<&'a [f64]>,
    /// With which probability a choice follows them.
    pub(super) alpha: f64,
    /// What a probability counts as at least.
    pub(super) least: f64,
}

impl<'a> Preference<'a> {
    /// What this choice follows, if it is one that follows the prediction.
    fn drawn(&self, random: &mut Random) -> Option<impl Fn(StateId) -> f64 + use<'a>> {
        let (p, least) = (self.predicted?, self.least);
        chance(random, self.alpha).then_some(move |q: StateId| p[q.index()].max(least))
    }

    /// Draws one of `states`: by prediction with probability α, otherwise uniformly.
    fn pick(&self, random: &mut Random, states: &[StateId]) -> Option<StateId> {
        if let Some(p) = self.drawn(random) {
            let weights = states.iter().map(|&q| p(q));
            return weighted(random, weights).map(|i| states[i]);
        }
        choose(random, states).copied()
    }
}

/// Where to go, and from which node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Destination {
    /// The node to extend from (q_P^closest).
    pub(super) closest: NodeId,
    /// The point to head for (x^ℒ); `None` if the next step has no destination.
    pub(super) target: Option<Target>,
}

/// A point to head for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Target {
    pub(super) at: Point2<f64>,
    /// Whether it is one of few fixed points, so that paths to it are worth keeping.
    pub(super) fixed: bool,
    /// The letter that it stands for, where any other place with that letter would do.
    pub(super) letter: Option<Letter>,
    /// Whether the next move from there is to close the cycle.
    pub(super) closes: bool,
    /// What the automaton is to do there.
    pub(super) step: Step,
}

/// S-1 to S-4. `None`: the chosen node cannot make progress, a failed sample.
pub(super) fn destination(
    view: &View<'_>,
    preference: Preference<'_>,
    random: &mut Random,
) -> Option<Destination> {
    let goal = accepting_state(view, preference, random)?;
    let closest = closest_node(view, goal, preference, random)?;
    let spot = view.tree.spot(closest);
    let state = view.tree.state(closest);
    let at_root = view.tree.is_at_root(closest);
    // Where the path has to end, unless any place will do.
    let end = match view.aim {
        Aim::Prefix { .. } => None,
        Aim::Suffix { .. } => Some(view.tree.root().at),
        Aim::Reach { at, .. } => Some(at),
    };
    let end = end.map(|at| Target {
        at,
        fixed: true,
        letter: None,
        closes: false,
        step: Step { from: goal, goal },
    });
    let around = matches!(view.aim, Aim::Suffix { .. }) && at_root;
    let waits = view.task.nba.guard(goal, goal);
    let waits = waits.is_some_and(|g| g.contains(spot.letter));
    if end.is_some() && state == goal && waits && !around {
        // The automaton's part is done: what is left is the way to the end.
        let target = end;
        return Some(Destination { closest, target });
    }
    // Where it cannot wait at the goal, the automaton's part is done there by a move to the end of the way alone.
    let there = || end.and_then(|end| view.system.settle(end.at));
    let at_end = || there().is_some_and(|there| view.system.step(&spot, &there));
    let done = view.waits(goal) || at_end();
    let first = first_successor(view, (state, spot.letter), (goal, done), preference, random)?;
    if first == goal && done {
        // Any move from here completes the automaton's part.
        let target = end;
        return Some(Destination { closest, target });
    }
    let second = second_successor(view, first, goal, preference, random)?;
    let target = target_of_edge(view, (first, second), goal, spot.letter, random);
    Some(Destination { closest, target })
}

/// S-1: a feasible accepting state. In a suffix it is the root's.
fn accepting_state(
    view: &View<'_>,
    preference: Preference<'_>,
    random: &mut Random,
) -> Option<StateId> {
    match view.aim {
        Aim::Suffix { state, .. } | Aim::Reach { state, .. } => Some(state),
        Aim::Prefix { .. } => preference.pick(random, &view.task.feasible),
    }
}

/// S-2: a node of the tree; with probability `p_closest` one of those that ρ puts closest to the
/// goal (D_min), otherwise one of the others.
///
/// Goals are left out: a prefix has nothing to gain beyond them. Once a plan is known, the level
/// that is taken for "closest" is drawn uniformly among those in the tree, so that the search for
/// cheaper ways does not stay at the last step (ours; the papers stop there).
fn closest_node(
    view: &View<'_>,
    goal: StateId,
    preference: Preference<'_>,
    random: &mut Random,
) -> Option<NodeId> {
    let mut kept = view.tree.leads().borrow_mut();
    let (mut levels, mut candidates) = (
        std::mem::take(&mut kept.levels),
        std::mem::take(&mut kept.candidates),
    );
    drop(kept);
    levels.clear();
    for state in view.task.nba.states() {
        let Some(&sample) = view.tree.in_state(state).last() else {
            continue;
        };
        let distance = view.to_go(sample, goal);
        let prefix_goal = distance == 0 && matches!(view.aim, Aim::Prefix { .. });
        if distance != Distances::INFINITE && !prefix_goal {
            levels.push((distance, state));
        }
    }
    let node = choose_level(view, &levels, random).and_then(|level| {
        let mut take = |closest: bool| {
            let wanted = levels.iter().filter(|l| (l.0 == level) == closest);
            candidates.clear();
            candidates.extend(wanted.map(|l| l.1));
            !candidates.is_empty()
        };
        let _ = take(chance(random, view.share(view.settings.p_closest))) || take(true);
        draw_node(view, &candidates, preference, random)
    });
    let mut kept = view.tree.leads().borrow_mut();
    (kept.levels, kept.candidates) = (levels, candidates);
    node
}

/// The distance from the goal that counts as closest.
fn choose_level(view: &View<'_>, levels: &[(u32, StateId)], random: &mut Random) -> Option<u32> {
    if view.is_improving() {
        Some(choose(random, levels)?.0)
    } else {
        levels.iter().map(|l| l.0).min()
    }
}

/// A node in one of `states`: uniform over nodes, or weighted by the prediction of their state.
fn draw_node(
    view: &View<'_>,
    states: &[StateId],
    preference: Preference<'_>,
    random: &mut Random,
) -> Option<NodeId> {
    let count = |q: &StateId| view.tree.in_state(*q).len();
    let state = match preference.drawn(random) {
        Some(p) => {
            let weights = states.iter().map(|q| p(*q) * count(q) as f64);
            states[weighted(random, weights)?]
        }
        None => states[weighted(random, states.iter().map(|q| count(q) as f64))?],
    };
    choose(random, view.tree.in_state(state)).copied()
}

/// S-3, first half: a state that reading the letter of the closest node leads to, no further from
/// the goal than it was; among those the nearest.
fn first_successor(
    view: &View<'_>,
    (state, letter): (StateId, Letter),
    (goal, done): (StateId, bool),
    preference: Preference<'_>,
    random: &mut Random,
) -> Option<StateId> {
    // In the goal state, but not at the end of the way, the whole cycle is to go; staying there is no progress.
    let leaving = !matches!(view.aim, Aim::Prefix { .. }) && state == goal;
    let to_go = |q: StateId| match q == goal && done && !leaving {
        true => 0,
        false if leaving => view.around(q, goal),
        false => view.left(q, goal),
    };
    let before = to_go(state);
    let allowed: SmallVec<[StateId; 64]> = view
        .task
        .nba
        .successors(state, letter)
        .filter(|&q| to_go(q) <= before)
        .collect();
    if let Some(p) = preference.drawn(random) {
        let weights = allowed.iter().map(|&q| p(q));
        return weighted(random, weights).map(|i| allowed[i]);
    }
    let least = allowed.iter().map(|&q| to_go(q)).min()?;
    let nearest: SmallVec<[StateId; 64]> =
        allowed.into_iter().filter(|&q| to_go(q) == least).collect();
    choose(random, &nearest).copied()
}

/// S-3, second half: a state after `first`, strictly closer to the goal. Once a plan is known, now and then any from which
/// the goal can be reached (ours): more steps of the automaton may be a shorter way.
fn second_successor(
    view: &View<'_>,
    first: StateId,
    goal: StateId,
    preference: Preference<'_>,
    random: &mut Random,
) -> Option<StateId> {
    let before = view.around(first, goal);
    let closing = view.closing();
    // The goal's own steps are those of a cycle, unless this step closes it.
    let to_go = |q: StateId, guard: &LetterSet| {
        let closes = |c: &Closing| !c.letters().is_disjoint(guard);
        match closing.as_deref() {
            Some(closing) if q == goal && closes(closing) => 0,
            Some(closing) => closing.steps(q),
            None => view.task.distances.to_go(q, goal),
        }
    };
    let steps = view.task.nba.outgoing(first).iter();
    let to = |least: u32| -> SmallVec<[StateId; 64]> {
        let steps = steps.clone();
        let closer = steps.filter(|t| to_go(t.target, &t.guard) < least);
        closer.map(|t| t.target).filter(|&q| q != first).collect()
    };
    if view.is_improving() && chance(random, ELSEWHERE) {
        return preference.pick(random, &to(Distances::INFINITE));
    }
    preference.pick(random, &to(before))
}

/// S-4: a point whose letter lets the automaton step from `first` to `second`. One letter is
/// drawn among those that the guard admits and the closest node does not have; one without
/// region means anywhere outside regions. `None`: the step has no destination.
fn target_of_edge(
    view: &View<'_>,
    (first, second): (StateId, StateId),
    goal: StateId,
    here: Letter,
    random: &mut Random,
) -> Option<Target> {
    let step = Step { from: first, goal };
    let guard = view.task.nba.guard(first, second)?;
    let free = |letter: Letter| view.system.alphabet().props(letter).is_empty();
    let letters: SmallVec<[Letter; 64]> = guard
        .iter()
        .filter(|&l| l != here && !view.system.landmarks(l).is_empty())
        .collect();
    if guard.contains(here) {
        return None;
    }
    let closing = view.closing().filter(|_| second == goal);
    let closes = |l: &Letter| closing.as_ref().is_none_or(|c| c.letters().contains(*l));
    let letters: SmallVec<[Letter; 64]> = match letters.iter().any(closes) {
        true => letters.into_iter().filter(closes).collect(),
        false => letters,
    };
    let &letter = choose(random, &letters)?;
    if free(letter) {
        return Some(Target {
            at: view.system.sample_letter(letter, random),
            fixed: false,
            letter: None,
            closes: false,
            step,
        });
    }
    let root = view.tree.root();
    let closes = closing.is_some_and(|c| c.letters().contains(letter));
    if closes && root.letter == letter && view.settings.lead > 0.0 {
        // From where the straight way to the root enters the region it is in sight (ours; not by the paper's rule).
        return Some(Target {
            at: root.at,
            fixed: true,
            letter: Some(letter),
            closes: true,
            step,
        });
    }
    let landmarks = view.system.landmarks(letter);
    let pick = weighted(random, landmarks.iter().map(|l| l.area))?;
    Some(Target {
        at: landmarks[pick].at,
        fixed: true,
        letter: Some(letter),
        closes,
        step,
    })
}

/// Draws points until one is not in an obstacle. Redraws do not count as iterations; after too
/// many the sample has failed.
pub(super) fn settle(
    view: &View<'_>,
    random: &mut Random,
    mut propose: impl FnMut(&mut Random) -> Point2<f64>,
) -> Option<Point2<f64>> {
    for _ in 0..64 {
        let at = view.system.bounds().clip(propose(random));
        if let Some(spot) = view.system.settle(at) {
            return Some(spot.at);
        }
    }
    None
}

/// A uniform index below `n`, by the crate's generator.
pub(super) fn below(random: &mut Random, n: u64) -> u64 {
    random.random_range(0..n)
}

/// A point uniform over the cell between two corners.
pub(super) fn in_box(random: &mut Random, min: Point2<f64>, max: Point2<f64>) -> Point2<f64> {
    Point2::new(
        min.x + unit(random) * (max.x - min.x),
        min.y + unit(random) * (max.y - min.y),
    )
}
