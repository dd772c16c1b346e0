//! How near samplers come to the optimum: the gap to the exact planner's plan after so many iterations
//! and so much time.

mod curves;
mod text;

use std::time::Instant;

use serde::{Deserialize, Serialize};

use super::entrant::{Entrant, Networks};
use super::groups::{Group, groups};
use super::trials::stats;
use super::{BenchError, Case, Contender};
use crate::exact;
use crate::planner::{Improvement, Problem, Settings, Solution, Stop};
use crate::transfer;
use crate::verify::verify;

pub(super) use curves::{Along, curve};

/// A moment of a search at which its best plan is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mark {
    /// After so many iterations.
    Iterations(u64),
    /// After so many seconds.
    Seconds(f64),
}

impl Mark {
    /// The best cost at this moment.
    fn cost(self, improvements: &[Improvement]) -> Option<f64> {
        let before = |i: &&Improvement| match self {
            Self::Iterations(n) => i.iterations <= n,
            Self::Seconds(s) => i.seconds <= s,
        };
        improvements
            .iter()
            .take_while(before)
            .last()
            .map(|i| i.cost)
    }

    fn name(self) -> String {
        match self {
            Self::Iterations(n) => format!("{n} iterations"),
            Self::Seconds(s) => format!("{s} s"),
        }
    }
}

/// How costs are followed over time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct CostSettings {
    /// Settings of every search; its iterations and its time limit are the budget.
    pub settings: Settings,
    /// Searches of each contender on each mission; their seeds count up from the settings' seed.
    pub trials: u64,
    /// The moments of the tables.
    pub marks: Vec<Mark>,
    /// Whether certified lower bounds are computed, too, which takes seconds a mission.
    pub bounds: bool,
}

/// What the exact planner says about a mission.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Reference {
    /// The mission's name.
    pub case: String,
    /// The kind of its map, where that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub family: Option<String>,
    /// λ, the weight of the prefix.
    #[serde(default)]
    pub weight: f64,
    /// The cost of the exact planner's plan.
    pub upper: f64,
    /// What every plan costs at least, if that was asked for.
    pub lower: Option<f64>,
    /// Seconds that the plan took.
    pub seconds: f64,
    /// Seconds that the lower bound took.
    pub bound_seconds: f64,
    /// What every plan costs at least, as soon as that can be said.
    pub quick: f64,
    /// Seconds that took.
    pub quick_seconds: f64,
}

/// How near to the exact planner's plan counts as there.
const NEAR: [f64; 2] = [0.05, 0.01];

/// The costs of one search.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Descent {
    /// The mission's name.
    pub case: String,
    /// Who searched.
    #[serde(flatten)]
    pub contender: Contender,
    /// The seed.
    pub seed: u64,
    /// Each cheaper plan, in order; seconds are those of the search alone.
    pub improvements: Vec<Improvement>,
    /// Iterations of the whole search.
    pub iterations: u64,
    /// Seconds of the whole search.
    pub seconds: f64,
    /// Seconds of encoding and networks.
    pub network_seconds: f64,
    /// From which iteration on they count beside those of the search; `None` if they passed meanwhile and the search's seconds hold
    /// what it waited for them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub networks_after: Option<u64>,
    /// Whether the checker accepted the last plan; `None` without a plan, without a formula to
    /// check it by, and on grids.
    pub verified: Option<bool>,
}

impl Descent {
    /// Seconds with encoding and networks, for a moment of the search.
    fn whole(&self, iterations: u64, seconds: f64) -> f64 {
        match self.networks_after {
            Some(after) if iterations > after => seconds + self.network_seconds,
            _ => seconds,
        }
    }

    /// After how many iterations and seconds of search the best plan cost at most `share` more than `upper`.
    fn reached(&self, upper: f64, share: f64) -> Option<(u64, f64)> {
        let there = |i: &&Improvement| gap(i.cost, upper) <= share;
        let first = self.improvements.iter().find(there)?;
        Some((first.iterations, first.seconds))
    }
}

/// Costs over time of samplers, with bounds on the optimum.
#[derive(Clone, Debug, Serialize)]
pub struct Convergence {
    /// The report format's version.
    pub version: u32,
    /// The moments looked at.
    pub marks: Vec<Mark>,
    /// Who searched, in the order of the report.
    pub contenders: Vec<Contender>,
    /// Settings of every search, whose seeds count up.
    pub settings: Settings,
    /// Searches of each contender on each mission.
    pub trials: u64,
    /// Bounds by mission.
    pub references: Vec<Reference>,
    /// Every search.
    pub descents: Vec<Descent>,
}

/// Searches every mission that the exact planner solves with every contender until the last mark. Missions that were not
/// finished when `stop` was raised are left out.
///
/// # Errors
/// As [`compare`](super::compare).
pub fn converge(
    cases: &[Case],
    contenders: &[Contender],
    costs: &CostSettings,
    stop: &Stop,
    progress: &mut dyn FnMut(usize),
) -> Result<Convergence, BenchError> {
    let mut all = Convergence::new(contenders, costs);
    for (done, case) in cases.iter().enumerate() {
        let Some(found) = of_case(case, contenders, costs, stop)? else {
            break;
        };
        all.references.extend(found.reference);
        all.descents.extend(found.descents);
        progress(done + 1);
    }
    Ok(all)
}

/// What was found on one mission.
#[derive(Default)]
pub(super) struct Searched {
    /// What the exact planner says, if it solves the mission.
    pub(super) reference: Option<Reference>,
    /// The searches; none without a plan of the exact planner's.
    pub(super) descents: Vec<Descent>,
}

/// The searches of one mission; `None` if the stop was raised before they were done.
pub(super) fn of_case(
    case: &Case,
    contenders: &[Contender],
    costs: &CostSettings,
    stop: &Stop,
) -> Result<Option<Searched>, BenchError> {
    let reference = reference(case, costs.bounds);
    // Without a plan of the exact planner's there is nothing to compare with.
    let trials = match reference {
        Some(_) => costs.trials,
        None => 0,
    };
    let search = |contender: &Contender, entrant: &Entrant, settings: &Settings| {
        let descent = descend(case, contender, entrant, settings, stop)?;
        Ok((!stop.is_raised()).then_some(descent))
    };
    let descents = case.searches(contenders, &costs.settings, trials, search)?;
    let found = descents.map(|descents| Searched {
        reference,
        descents,
    });
    Ok(found.filter(|_| !stop.is_raised()))
}

fn reference(case: &Case, bounds: bool) -> Option<Reference> {
    let problem = &case.problem;
    let began = Instant::now();
    let Some(map) = problem.system.plane() else {
        // Where places are finitely many all of them are searched.
        let (_, cost) = transfer::optimum(problem)?;
        return Some(Reference {
            case: case.name.clone(),
            family: case.family.clone(),
            weight: problem.weight,
            upper: cost.total,
            lower: bounds.then_some(cost.total),
            seconds: began.elapsed().as_secs_f64(),
            bound_seconds: 0.0,
            quick: cost.total,
            quick_seconds: 0.0,
        });
    };
    let plan = exact::plan(map, problem.start.at, &problem.task, problem.weight).ok()?;
    let seconds = began.elapsed().as_secs_f64();
    let began = Instant::now();
    let upper = plan.cost.total;
    let (start, task, weight) = (problem.start.at, &problem.task, problem.weight);
    let lower = bounds.then(|| exact::lower_bound(map, start, task, weight, upper));
    let bound_seconds = began.elapsed().as_secs_f64();
    let began = Instant::now();
    let quick = exact::quick_bound(map, start, task, weight, upper);
    Some(Reference {
        case: case.name.clone(),
        family: case.family.clone(),
        weight: problem.weight,
        upper,
        lower,
        seconds,
        bound_seconds,
        quick,
        quick_seconds: began.elapsed().as_secs_f64(),
    })
}

fn descend(
    case: &Case,
    contender: &Contender,
    entrant: &Entrant,
    settings: &Settings,
    stop: &Stop,
) -> Result<Descent, BenchError> {
    let (found, networks) = entrant.search(case, settings, stop);
    let solution = found.as_ref().ok();
    let verified = solution.and_then(|solution| check(&case.problem, solution));
    let stats = stats(case, found)?;
    Ok(Descent {
        case: case.name.clone(),
        contender: contender.clone(),
        seed: settings.seed,
        improvements: stats.improvements,
        iterations: stats.iterations,
        seconds: stats.seconds,
        network_seconds: case.network_seconds(contender).iter().sum(),
        networks_after: match networks {
            Networks::After(samples) => Some(samples),
            Networks::Waited(..) => None,
        },
        verified,
    })
}

/// Whether the checker accepts a plan.
fn check(problem: &Problem, found: &Solution) -> Option<bool> {
    let (map, formula) = (problem.system.plane()?, problem.task.formula.as_ref()?);
    let (start, weight) = (problem.start.at, problem.weight);
    let judged = verify(map, start, formula, &found.path, weight, Some(&found.cost));
    Some(judged.is_ok())
}

/// How much of `base` a cost lies above it; both may be 0.
fn gap(cost: f64, base: f64) -> f64 {
    (cost - base) / base.abs().max(1e-6)
}

impl Convergence {
    /// Without any searches yet.
    pub(super) fn new(contenders: &[Contender], costs: &CostSettings) -> Self {
        Self {
            version: 3,
            marks: costs.marks.clone(),
            contenders: contenders.to_vec(),
            settings: costs.settings.clone(),
            trials: costs.trials,
            references: Vec::new(),
            descents: Vec::new(),
        }
    }

    /// What the exact planner says about a mission.
    fn reference(&self, case: &str) -> Option<&Reference> {
        self.references.iter().find(|r| r.case == case)
    }

    /// The gaps of a contender's plans to the exact planner's at a mark, and how many had no plan.
    #[must_use]
    pub fn gaps(&self, contender: &Contender, mark: usize) -> (Vec<f64>, usize) {
        let mine = self.descents.iter().filter(|d| d.contender == *contender);
        let mut missing = 0;
        let gaps = mine.filter_map(|d| {
            let cost = self.marks[mark].cost(&d.improvements);
            missing += usize::from(cost.is_none());
            Some(gap(cost?, self.reference(&d.case)?.upper))
        });
        let gaps = gaps.collect();
        (gaps, missing)
    }

    /// All missions, and families if there are several.
    fn groups(&self) -> Vec<Group> {
        let missions = self.references.iter();
        groups(
            missions.map(|r| (r.case.as_str(), r.family.as_deref())),
            None,
        )
    }
}
