//! Runs until the first plan.

use serde::{Deserialize, Serialize};

use super::entrant::{Entrant, Networks};
use super::groups::COMPLEX_FROM;
use super::{BenchError, Case, Contender, Report};
use crate::planner::{First, PlanError, Settings, Stats, Stop};

/// Where a run's time went, in seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Times {
    /// From the formula to the task.
    pub translate: f64,
    /// From map and automaton to tensors; where that was done while the search went on, what the search waited for it.
    pub encode: f64,
    /// The networks, likewise.
    pub infer: f64,
    /// The search.
    pub search: f64,
}

impl Times {
    /// Encoding and networks.
    #[must_use]
    pub fn networks(&self) -> f64 {
        self.encode + self.infer
    }
}

/// One run of one contender on one mission.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Trial {
    /// The mission's name.
    pub case: String,
    /// The kind of its map, where that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub family: Option<String>,
    /// Who ran.
    #[serde(flatten)]
    pub contender: Contender,
    /// The seed.
    pub seed: u64,
    /// The first prefix, if there was one: its iterations, product states, seconds of search and length.
    pub prefix: Option<First>,
    /// The first plan, if there was one; its cost is the total cost.
    pub plan: Option<First>,
    /// Iterations that the run counts with where nothing was found: the cap.
    pub cap: u64,
    /// Product states when the search ended.
    pub nodes: u64,
    /// Where the time went.
    pub times: Times,
    /// From which iteration on the seconds of encoding and networks count beside those of the search.
    pub networks_after: u64,
}

impl Trial {
    /// Whether a plan was found.
    #[must_use]
    pub fn solved(&self) -> bool {
        self.plan.is_some()
    }

    /// Iterations until this was found; the cap if it was not.
    pub(super) fn iterations_until(&self, found: Option<First>) -> f64 {
        found.map_or(self.cap, |f| f.iterations) as f64
    }

    /// Product states when this was found; all of them if it was not.
    pub(super) fn nodes_until(&self, found: Option<First>) -> f64 {
        found.map_or(self.nodes, |f| f.nodes) as f64
    }

    /// Seconds of search until this was found; all of them if it was not.
    pub(super) fn search_until(&self, found: Option<First>) -> f64 {
        found.map_or(self.times.search, |f| f.seconds)
    }

    /// The same with encoding and networks, if they were asked by then.
    pub(super) fn seconds_until(&self, found: Option<First>) -> f64 {
        let iterations = found.map_or(self.cap, |f| f.iterations);
        let networks = match iterations > self.networks_after {
            true => self.times.networks(),
            false => 0.0,
        };
        networks + self.search_until(found)
    }
}

/// What to compare.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Comparison {
    /// Who runs, in the order of the report.
    pub contenders: Vec<Contender>,
    /// Runs per mission and contender, none where costs alone are followed; their seeds count up from the settings' seed.
    pub trials: u64,
    /// Settings of every search; its `first` is set, its iterations are the cap.
    pub settings: Settings,
}

/// Runs a comparison; `progress` is called after each mission with the number done.
///
/// Missions without predictions are left out of the guided strategy, and those that were not finished when
/// `stop` was raised are left out altogether.
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
        let Some(more) = of_case(case, comparison, stop)? else {
            break;
        };
        trials.extend(more);
        progress(done + 1);
    }
    Ok(Report::new(comparison.clone(), COMPLEX_FROM, trials))
}

/// All runs on one mission; `None` if the stop was raised before they were done.
pub(super) fn of_case(
    case: &Case,
    comparison: &Comparison,
    stop: &Stop,
) -> Result<Option<Vec<Trial>>, BenchError> {
    let settings = Settings {
        first: true,
        ..comparison.settings.clone()
    };
    let run = |contender: &Contender, entrant: &Entrant, settings: &Settings| {
        let (found, networks) = entrant.search(case, settings, stop);
        // A search that was cut short says nothing about its sampler.
        if stop.is_raised() {
            return Ok(None);
        }
        let stats = stats(case, found)?;
        Ok(Some(trial(case, contender, settings, &stats, &networks)))
    };
    case.searches(&comparison.contenders, &settings, comparison.trials, run)
}

/// What a search did, whether or not it found a plan.
pub(super) fn stats(
    case: &Case,
    found: Result<crate::planner::Solution, PlanError>,
) -> Result<Stats, BenchError> {
    match found {
        Ok(solution) => Ok(solution.stats),
        Err(PlanError::NotFound(why)) => Ok(why.stats),
        Err(source) => Err(BenchError::Plan {
            case: case.name.clone(),
            source: Box::new(source),
        }),
    }
}

fn trial(
    case: &Case,
    contender: &Contender,
    settings: &Settings,
    stats: &Stats,
    networks: &Networks,
) -> Trial {
    let [encode, infer] = case.network_seconds(contender);
    let (networks_after, share) = match networks {
        Networks::After(samples) => (*samples, f64::from(u8::from(stats.iterations > *samples))),
        Networks::Waited(head_start, waited) => {
            let both = (encode + infer).max(f64::MIN_POSITIVE);
            (head_start.states, waited.iter().sum::<f64>() / both)
        }
    };
    let of_search = |first: First| First {
        seconds: networks.without(first.iterations, first.seconds),
        ..first
    };
    Trial {
        case: case.name.clone(),
        family: case.family.clone(),
        contender: contender.clone(),
        seed: settings.seed,
        prefix: stats.first_prefix.map(of_search),
        plan: stats.first_plan.map(of_search),
        cap: settings.iterations,
        nodes: stats.nodes,
        times: Times {
            translate: case.translate_seconds,
            encode: share * encode,
            infer: share * infer,
            search: networks.without(u64::MAX, stats.seconds),
        },
        networks_after,
    }
}
