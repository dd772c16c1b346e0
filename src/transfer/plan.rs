//! TransferPlanning: planning a mission with a library of skills, and what was reused of it
//! (`transfer-planning.md`, IV). The algorithm itself is in [`super::search`].

use std::collections::HashSet;
use std::time::Instant;

use serde::Serialize;

use super::library::Library;
use super::reuse::Layout;
use super::search::Search;
use crate::plan::Waypoint;
use crate::planner::{PlanError, Problem, Progress, Sampler, Settings, Solution, Stop};

/// What reuse did for a plan.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Reused {
    /// The new formula's subtasks.
    pub counts: SubtaskCounts,
    /// Seconds to build the graph of subtasks and to match it with the library (t_Ω of Table I).
    pub graph_seconds: f64,
    /// Seconds to lay the library out for this start: once for each map and start, whatever the
    /// mission.
    pub layout_seconds: f64,
    /// For each leg of prefix and suffix, whether it is part of a skill.
    pub prefix_legs: Vec<bool>,
    /// As `prefix_legs`, for the suffix.
    pub suffix_legs: Vec<bool>,
}

/// A plan that was made with a library.
#[derive(Clone, Debug)]
pub struct Transferred {
    /// The plan, and what the search did. `seconds` of its stats leave out the graph of subtasks.
    pub solution: Solution,
    /// What was reused.
    pub reused: Reused,
}

/// How many subtasks a mission has, and how many of them a library serves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct SubtaskCounts {
    /// Subtasks (#T of Table I).
    pub subtasks: usize,
    /// Those with a reusable path, or that need none.
    pub matched: usize,
}

impl SubtaskCounts {
    /// The share of subtasks that have a reusable path (%T of Table I), in `[0, 100]`.
    #[must_use]
    pub fn percent(&self) -> f64 {
        100.0 * self.matched as f64 / self.subtasks.max(1) as f64
    }
}

/// Counts a mission's subtasks, without planning it.
#[must_use]
pub fn count_subtasks(problem: &Problem, library: &Library) -> SubtaskCounts {
    let layout = Layout::new(library, &*problem.system, problem.start);
    let kit = layout.fit(problem);
    SubtaskCounts {
        subtasks: kit.subtasks,
        matched: kit.matching.matched,
    }
}

/// Plans a mission with a library of skills (Alg. 4).
///
/// # Errors
/// Settings out of range, a task for another map, or no plan within the budget.
pub fn transfer(
    problem: &Problem,
    library: &Library,
    sampler: &Sampler,
    settings: &Settings,
    stop: &Stop,
    observe: &mut dyn FnMut(Progress),
) -> Result<Transferred, PlanError> {
    settings.validate()?;
    if !(0.0..=1.0).contains(&problem.weight) {
        return Err(PlanError::Weight(problem.weight));
    }
    if *problem.task.nba.alphabet != **problem.system.alphabet() {
        return Err(PlanError::Alphabet);
    }
    let began = Instant::now();
    let layout = Layout::new(library, &*problem.system, problem.start);
    let laid_out = Instant::now();
    let kit = layout.fit(problem);
    let mut reused = Reused {
        counts: SubtaskCounts {
            subtasks: kit.subtasks,
            matched: kit.matching.matched,
        },
        graph_seconds: laid_out.elapsed().as_secs_f64(),
        layout_seconds: (laid_out - began).as_secs_f64(),
        ..Reused::default()
    };
    let mut search = Search::new(problem, &kit, sampler, settings, stop);
    let reason = search.run(observe);
    let solution = search.finish(reason)?;
    let legs = SkillLegs::new(library);
    reused.prefix_legs = legs.mark(&solution.path.prefix);
    reused.suffix_legs = legs.mark(&solution.path.suffix);
    Ok(Transferred { solution, reused })
}

/// The legs of all skills, to tell which legs of a plan were reused.
struct SkillLegs(HashSet<[[u64; 2]; 2]>);

impl SkillLegs {
    fn new(library: &Library) -> Self {
        let legs = library
            .skills()
            .iter()
            .flat_map(|s| s.path().windows(2).map(|w| Self::key(w[0].at, w[1].at)));
        Self(legs.collect())
    }

    /// A leg, the same in both directions.
    fn key(a: nalgebra::Point2<f64>, b: nalgebra::Point2<f64>) -> [[u64; 2]; 2] {
        let bits = |p: nalgebra::Point2<f64>| [p.x.to_bits(), p.y.to_bits()];
        let (a, b) = (bits(a), bits(b));
        [a.min(b), a.max(b)]
    }

    fn mark(&self, points: &[Waypoint]) -> Vec<bool> {
        points
            .windows(2)
            .map(|w| self.0.contains(&Self::key(w[0].at, w[1].at)))
            .collect()
    }
}
