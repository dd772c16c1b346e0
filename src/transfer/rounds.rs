//! The order in which a plan makes its rounds, for the plan's repair.

use std::sync::Arc;

use super::replan::has_run;
use crate::alphabet::Props;
use crate::automaton::{Layout, Limits, Task};
use crate::plan::Path;
use crate::planner::Problem;

/// A task with a run along the plan, if `problem`'s has none: its patrols are waited for in the order of the plan's suffix.
///
/// What is shortest on a changed map is another tour than before, perhaps, and in its order the plan's round is none. `None` where
/// the task has a run already, or none can be found.
pub(super) fn task_along(problem: &Problem, plan: &Path) -> Option<Arc<Task>> {
    let formula = problem.task.formula.as_ref()?;
    if plan.suffix.len() < 2 || has_run(problem, plan) {
        return None;
    }
    let alphabet = problem.system.alphabet();
    let around = Around::new(problem, plan);
    let visited = around.stops.iter().fold(0, |all, (_, props)| all | props.0);
    // The plan does not tell which place its automaton's first round waited for.
    Props(visited).iter().find_map(|last| {
        let layout = Last(&around, last);
        let task = Task::on_map(formula, Arc::clone(alphabet), &Limits::default(), &layout).ok()?;
        let other = Problem {
            task: Arc::new(task),
            ..problem.clone()
        };
        has_run(&other, plan).then_some(other.task)
    })
}

/// The stops of a suffix: how far along it, and what holds there.
struct Around {
    stops: Vec<(f64, Props)>,
    length: f64,
}

impl Around {
    fn new(problem: &Problem, plan: &Path) -> Self {
        let alphabet = problem.system.alphabet();
        let mut length = 0.0;
        let mut stops = Vec::new();
        for leg in plan.suffix.windows(2) {
            if let Some(spot) = problem.system.settle(leg[0].at) {
                stops.push((length, alphabet.props(spot.letter)));
            }
            length += (leg[1].at - leg[0].at).norm();
        }
        Self { stops, length }
    }

    /// From a stop where `from` holds onwards to the next where `to` does.
    fn between(&self, from: usize, to: usize) -> f64 {
        let stops = |region| {
            let there = move |s: &&(f64, Props)| s.1.contains(region);
            self.stops.iter().filter(there).map(|s| s.0)
        };
        let onwards = |(a, b): (f64, f64)| if b >= a { b - a } else { b - a + self.length };
        let pairs = stops(from).flat_map(|a| stops(to).map(move |b| (a, b)));
        pairs.map(onwards).fold(f64::INFINITY, f64::min)
    }
}

/// A suffix as the map of a tour whose first round waits for one region.
struct Last<'a>(&'a Around, usize);

impl Layout for Last<'_> {
    fn length(&self, from: Option<usize>, to: usize) -> f64 {
        match from {
            Some(from) => self.0.between(from, to),
            None if to == self.1 => 0.0,
            None => self.0.length,
        }
    }
}
