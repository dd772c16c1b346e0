//! The problem as a search sees it.

use std::borrow::Cow;
use std::sync::{Arc, OnceLock};

use crate::automaton::{Copies, StateId, Task};
use crate::plan::Path;
use crate::planner::Problem;
use crate::planner::advice::advice;
use crate::planner::informed::Relaxed;
use crate::planner::sampler::Sampler;

/// A problem, with an automaton whose accepting states are those that a run comes back to ([`Copies`]).
#[derive(Debug)]
pub(crate) struct Ground<'a> {
    problem: Cow<'a, Problem>,
    /// For each state of the automaton the one of the problem's that it stands for, if that is another automaton.
    origin: Option<Vec<StateId>>,
    /// The task as the map allows it, if that is another one.
    advised: Option<Task>,
    relaxed: OnceLock<Option<Arc<Relaxed>>>,
}

impl<'a> Ground<'a> {
    pub(crate) fn of(problem: &'a Problem) -> Self {
        let Some(Copies { nba, origin }) = Copies::of(&problem.task.nba) else {
            return Self {
                advised: advice(problem),
                problem: Cow::Borrowed(problem),
                origin: None,
                relaxed: OnceLock::new(),
            };
        };
        let task = Task::from_trimmed(nba, problem.task.formula.clone());
        let problem = Problem {
            task: Arc::new(task),
            ..problem.clone()
        };
        Self {
            advised: advice(&problem),
            problem: Cow::Owned(problem),
            origin: Some(origin),
            relaxed: OnceLock::new(),
        }
    }

    /// What ways come to at least is found with this; `None` where that is unknown. Made when it is first asked for.
    pub(super) fn relaxed(&self) -> Option<&Arc<Relaxed>> {
        let make = || {
            let Task { nba, feasible, .. } = &*self.problem.task;
            let map = self.problem.system.plane()?;
            Relaxed::of(map, nba, feasible).map(Arc::new)
        };
        self.relaxed.get_or_init(make).as_ref()
    }

    /// The task without what the map rules out: what trees grow by and samplers count on.
    pub(super) fn advised(&self) -> &Task {
        self.advised.as_ref().unwrap_or(&self.problem.task)
    }

    pub(crate) fn problem(&self) -> &Problem {
        &self.problem
    }

    /// A sampler for the problem's own automaton as one for this.
    pub(crate) fn sampler(&self, sampler: &Sampler) -> Sampler {
        match &self.origin {
            Some(origin) => sampler.for_states(origin),
            None => sampler.clone(),
        }
    }

    /// The state of the problem's own automaton that a state stands for.
    pub(crate) fn own(&self, state: StateId) -> StateId {
        self.origin.as_ref().map_or(state, |o| o[state.index()])
    }

    /// Gives a path the states of the problem's own automaton. Where a copy waited for its state, nothing is left to do.
    pub(crate) fn restore(&self, path: &mut Path) {
        for waypoint in path.prefix.iter_mut().chain(&mut path.suffix) {
            waypoint.state = self.own(waypoint.state);
        }
        if self.origin.is_some() {
            path.prefix.dedup();
        }
    }
}
