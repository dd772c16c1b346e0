//! Samplers side by side on the same missions: what guidance costs and what it saves.
//!
//! Every mission is searched by every strategy with the same seeds, until its first plan. One
//! iteration is one drawn sample; runs that spend their budget count at the cap and are told.

mod convergence;
pub mod inference;
mod report;
mod stats;
pub mod transfer;

use std::sync::Arc;

use serde::Serialize;

use crate::guidance::Guidance;
use crate::planner::{
    GuidanceError, Guide, PlanError, Problem, Sampler, Settings, Stats, Stop, plan,
};

pub use convergence::{Convergence, Descent, Mark, Reference, converge};
pub use report::Report;
pub use stats::{Ratio, Summary, mean};

/// A strategy of a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Strategy {
    /// Uniform sampling.
    Uniform,
    /// Biased sampling.
    Biased,
    /// The rules of guided sampling without predictions.
    Directed,
    /// The guided rule with a flat heatmap and flat state probabilities: what the rule gains
    /// without any network. What a network adds is what lies below it.
    Flat,
    /// Guided by the networks.
    Guided,
    /// The guided rule with the labels of the data set in place of the networks: what perfect networks
    /// would gain. A control that reads the answer, not a planner.
    Oracle,
}

impl Strategy {
    /// Its name, as on the command line and in reports.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Uniform => "uniform",
            Self::Biased => "biased",
            Self::Directed => "directed",
            Self::Flat => "flat",
            Self::Guided => "guided",
            Self::Oracle => "oracle",
        }
    }
}

/// One mission of a comparison.
#[derive(Clone, Debug)]
pub struct Case {
    /// The mission's name, unique in the comparison.
    pub name: String,
    /// The mission.
    pub problem: Problem,
    /// The networks' predictions, if they fit the mission.
    pub guidance: Option<Guidance>,
    /// What perfect networks would predict, if the mission came with labels.
    pub labels: Option<Guidance>,
    /// What encoding and inference took, in seconds.
    pub inference_seconds: f64,
}

/// One run of one strategy on one mission.
#[derive(Clone, Debug, Serialize)]
pub struct Trial {
    /// The mission's name.
    pub case: String,
    /// The strategy.
    pub strategy: Strategy,
    /// The seed.
    pub seed: u64,
    /// Whether a plan was found.
    pub solved: bool,
    /// Iterations to the first prefix; the cap if none was found.
    pub prefix_iterations: u64,
    /// Iterations to the first plan; the cap if none was found.
    pub plan_iterations: u64,
    /// Product states when the search ended.
    pub nodes: u64,
    /// Length of the first prefix.
    pub prefix_length: Option<f64>,
    /// Total cost of the first plan.
    pub cost: Option<f64>,
    /// Seconds of search, without inference.
    pub search_seconds: f64,
    /// Seconds of encoding and inference, for the guided strategy.
    pub inference_seconds: f64,
}

/// What to compare.
#[derive(Clone, Debug, Serialize)]
pub struct Comparison {
    /// The strategies, in the order of the report.
    pub strategies: Vec<Strategy>,
    /// Runs per mission and strategy; their seeds count up from the settings' seed.
    pub trials: u64,
    /// Settings of every search; its `first` is set, its iterations are the cap.
    pub settings: Settings,
}

/// Why a comparison could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum BenchError {
    /// Predictions that do not fit their mission.
    #[error("mission `{case}`: {source}")]
    Guidance {
        /// The mission.
        case: String,
        /// What is wrong with them.
        source: GuidanceError,
    },
    /// A search that could not begin.
    #[error("mission `{case}`: {source}")]
    Plan {
        /// The mission.
        case: String,
        /// Why not.
        source: Box<PlanError>,
    },
}

/// Runs a comparison; `progress` is called after each mission with the number done.
///
/// Missions without predictions are left out of the guided strategy, and the report says so.
///
/// # Errors
/// Predictions that do not fit, or settings that no search accepts.
pub fn compare(
    cases: &[Case],
    comparison: &Comparison,
    stop: &Stop,
    progress: &mut dyn FnMut(usize),
) -> Result<Report, BenchError> {
    let mut trials = Vec::new();
    for (done, case) in cases.iter().enumerate() {
        for &strategy in &comparison.strategies {
            let Some(sampler) = sampler(case, strategy)? else {
                continue;
            };
            for k in 0..comparison.trials {
                if stop.is_raised() {
                    return Ok(Report::new(comparison.clone(), done, trials));
                }
                let settings = Settings {
                    seed: comparison.settings.seed + k,
                    first: true,
                    ..comparison.settings.clone()
                };
                trials.push(run(case, strategy, &sampler, &settings)?);
            }
        }
        progress(done + 1);
    }
    Ok(Report::new(comparison.clone(), cases.len(), trials))
}

fn sampler(case: &Case, strategy: Strategy) -> Result<Option<Sampler>, BenchError> {
    let states = case.problem.task.nba.len();
    let guided = |guidance: &Guidance| {
        let guide = Guide::new(guidance, states).map_err(|source| BenchError::Guidance {
            case: case.name.clone(),
            source,
        })?;
        Ok(Sampler::Guided(Arc::new(guide)))
    };
    Ok(match strategy {
        Strategy::Uniform => Some(Sampler::Uniform),
        Strategy::Biased => Some(Sampler::Biased),
        Strategy::Directed => Some(Sampler::Directed),
        Strategy::Flat => Some(guided(&Guidance::flat(states))?),
        Strategy::Guided => case.guidance.as_ref().map(guided).transpose()?,
        Strategy::Oracle => case.labels.as_ref().map(guided).transpose()?,
    })
}

fn run(
    case: &Case,
    strategy: Strategy,
    sampler: &Sampler,
    settings: &Settings,
) -> Result<Trial, BenchError> {
    let (stats, solved) = match plan(&case.problem, sampler, settings, &Stop::new(), &mut |_| {}) {
        Ok(solution) => (solution.stats, true),
        Err(PlanError::NotFound(why)) => (why.stats, false),
        Err(source) => {
            return Err(BenchError::Plan {
                case: case.name.clone(),
                source: Box::new(source),
            });
        }
    };
    Ok(trial(case, strategy, settings, &stats, solved))
}

fn trial(
    case: &Case,
    strategy: Strategy,
    settings: &Settings,
    stats: &Stats,
    solved: bool,
) -> Trial {
    let cap = settings.iterations;
    Trial {
        case: case.name.clone(),
        strategy,
        seed: settings.seed,
        solved,
        prefix_iterations: stats.first_prefix.map_or(cap, |f| f.iterations),
        plan_iterations: stats.first_plan.map_or(cap, |f| f.iterations),
        nodes: stats.nodes,
        prefix_length: stats.first_prefix.map(|f| f.cost),
        cost: stats.first_plan.map(|f| f.cost),
        search_seconds: stats.seconds,
        inference_seconds: match strategy {
            Strategy::Guided => case.inference_seconds,
            _ => 0.0,
        },
    }
}
