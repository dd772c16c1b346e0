//! The run of an automaton along a plan.

use crate::alphabet::{LetterSet, Props};
use crate::automaton::{StateId, Task};
use crate::plan::{Path, Waypoint};
use crate::planner::Problem;

/// So many rounds are looked at for states that come back.
const ROUNDS: usize = 16;

/// Whether the mission's automaton has an accepting run along a plan, one round for each of the plan's.
pub(in crate::transfer) fn has_run(problem: &Problem, plan: &Path) -> bool {
    with_states(problem, plan).is_some()
}

/// The plan with automaton states that are an accepting run: those it has if they are, else others, if
/// there are any. Letters are those that the changed map shows at free points; points under new
/// obstacles had no region.
pub(super) fn with_states(problem: &Problem, plan: &Path) -> Option<Path> {
    if plan.prefix.is_empty() || plan.suffix.is_empty() {
        return None;
    }
    let run = Run::new(problem, plan)?;
    if run.is_accepting_run(plan) {
        return Some(plan.clone());
    }
    run.find(plan).or_else(|| after_rounds(problem, plan))
}

/// The same walk with so many rounds told as prefix that the states of the run come back with each of those that follow: a loop may
/// begin sooner than they do.
fn after_rounds(problem: &Problem, plan: &Path) -> Option<Path> {
    let mut later = plan.clone();
    (0..problem.task.nba.len().min(ROUNDS)).find_map(|_| {
        later.prefix.extend(plan.suffix.iter().skip(1));
        Run::new(problem, &later)?.find(&later)
    })
}

/// The word of a plan, and the automaton that reads it.
struct Run<'a> {
    task: &'a Task,
    prefix: Vec<LetterSet>,
    suffix: Vec<LetterSet>,
    initial: &'a [StateId],
}

impl<'a> Run<'a> {
    fn new(problem: &'a Problem, plan: &Path) -> Option<Self> {
        let alphabet = problem.system.alphabet();
        let outside = alphabet.filter(Props::is_empty);
        let read = |w: &Waypoint| match problem.system.settle(w.at) {
            Some(spot) => {
                let mut only = alphabet.none();
                only.insert(spot.letter);
                only
            }
            None => outside.clone(),
        };
        let legs = |points: &[Waypoint]| -> Vec<_> {
            points[..points.len() - 1].iter().map(read).collect()
        };
        let mut suffix = legs(&plan.suffix);
        if suffix.is_empty() {
            suffix.push(read(&plan.suffix[0]));
        }
        Some(Self {
            task: &problem.task,
            prefix: legs(&plan.prefix),
            suffix,
            initial: &problem.task.nba.initial,
        })
    }

    fn steps(&self, from: StateId, letters: &LetterSet, to: StateId) -> bool {
        let known = from.index() < self.task.nba.len() && to.index() < self.task.nba.len();
        let guard = known.then(|| self.task.nba.guard(from, to)).flatten();
        guard.is_some_and(|g| letters.is_subset(g))
    }

    fn is_accepting_run(&self, plan: &Path) -> bool {
        // A plan of another mission, or of another program, may name states that this automaton lacks.
        let states = self.task.nba.len();
        let mut points = plan.prefix.iter().chain(&plan.suffix);
        if points.any(|w| w.state.index() >= states) {
            return false;
        }
        let follows = |points: &[Waypoint], letters: &[LetterSet]| {
            let mut legs = points.windows(2).zip(letters);
            legs.all(|(w, l)| self.steps(w[0].state, l, w[1].state))
        };
        let (first, end) = (
            plan.prefix[0].state,
            plan.prefix[plan.prefix.len() - 1].state,
        );
        let closes = match plan.suffix.as_slice() {
            [w] => w.state == end && self.stays(w.state),
            points => points[0].state == end && points[points.len() - 1].state == end,
        };
        let accepts = |w: &Waypoint| self.task.feasible.binary_search(&w.state).is_ok();
        self.initial.contains(&first)
            && closes
            && follows(&plan.prefix, &self.prefix)
            && (plan.suffix.len() == 1 || follows(&plan.suffix, &self.suffix))
            && plan.suffix.iter().any(accepts)
    }

    /// Whether the automaton can go on accepting from a state on the suffix's single letter.
    fn stays(&self, state: StateId) -> bool {
        self.reach(&[state], &self.suffix)
            .last()
            .is_some_and(|layer| layer.iter().any(|&(q, _)| q == state))
    }

    /// For each letter read, the states that can follow, each with its predecessor's number.
    fn reach(&self, from: &[StateId], letters: &[LetterSet]) -> Vec<Vec<(StateId, usize)>> {
        let mut layers = vec![from.iter().map(|&q| (q, 0)).collect::<Vec<_>>()];
        for set in letters {
            let before = &layers[layers.len() - 1];
            let mut layer: Vec<(StateId, usize)> = Vec::new();
            for (i, &(q, _)) in before.iter().enumerate() {
                for t in self.task.nba.outgoing(q) {
                    if set.is_subset(&t.guard) && layer.iter().all(|&(s, _)| s != t.target) {
                        layer.push((t.target, i));
                    }
                }
            }
            layers.push(layer);
        }
        layers
    }

    /// An accepting run with one round of the suffix for each round of the automaton.
    fn find(&self, plan: &Path) -> Option<Path> {
        let forward = self.reach(self.initial, &self.prefix);
        let ends = forward.last()?;
        let accepting = |q: &StateId| self.task.feasible.binary_search(q).is_ok();
        for (i, &(q, _)) in ends.iter().enumerate() {
            let prefix = assign(&plan.prefix, &forward, i);
            if plan.suffix.len() == 1 {
                if accepting(&q) && self.stays(q) {
                    let suffix = vec![prefix[prefix.len() - 1]];
                    return Some(Path { prefix, suffix });
                }
                continue;
            }
            let around = self.reach(&[q], &self.suffix);
            let back = around.last()?.iter().position(|&(s, _)| s == q);
            let Some(back) = back else { continue };
            let suffix = assign(&plan.suffix, &around, back);
            if suffix.iter().any(|w| accepting(&w.state)) {
                return Some(Path { prefix, suffix });
            }
        }
        None
    }
}

/// The points with the states of the run that ends in entry `end` of the last layer.
fn assign(points: &[Waypoint], layers: &[Vec<(StateId, usize)>], end: usize) -> Vec<Waypoint> {
    let mut states = Vec::with_capacity(layers.len());
    let mut i = end;
    for layer in layers.iter().rev() {
        let (q, parent) = layer[i];
        states.push(q);
        i = parent;
    }
    let with = |(w, &state): (&Waypoint, &StateId)| Waypoint { at: w.at, state };
    points.iter().zip(states.iter().rev()).map(with).collect()
}
