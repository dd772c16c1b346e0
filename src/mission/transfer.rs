//! Missions planned with a library of skills, and plans repaired in changed environments.

use std::sync::Arc;
use std::time::Instant;

use super::{
    MissionError, Options, Planned, SamplerChoice, accepted, check_reachable, file, first, folded,
    guide, problem, stats,
};
use crate::automaton::Task;
use crate::plan::{Cost, Path, PlanStats, StageSeconds};
use crate::planner::{Problem, Progress, Sampler, Stop};
use crate::scenario::Scenario;
use crate::shorten::{SWEEPS, Shortener};
use crate::transfer::{
    self, BeyondRepair, BuildProgress, BuildSampler, BuildSettings, Built, Library, Repair,
    Replanned, Reused,
};

/// Builds a library from a scenario's mission. The sampler is `uniform` as in the paper, or `guided` by
/// the heatmap of that mission; `auto` is uniform. Told beside the library is what a user should know of the device.
///
/// # Errors
/// See [`MissionError`].
pub fn build_library(
    scenario: &Scenario,
    task: &Task,
    options: &Options,
    settings: &BuildSettings,
    stop: &Stop,
    observe: &mut dyn FnMut(BuildProgress),
) -> Result<(Built, Option<String>), MissionError> {
    let problem = problem(scenario, Arc::new(task.clone()))?;
    let (system, start) = (&*problem.system, problem.start);
    check_reachable(scenario, task, system)?;
    let (sampler, notice) = match options.sampler {
        SamplerChoice::Guided => {
            let mut networks = guide::load(options)?;
            let (_, prediction) = guide::ask(&mut networks, &scenario.workspace, &problem)?;
            let heatmap = prediction.guidance.heatmap;
            (BuildSampler::Guided(heatmap), prediction.notice)
        }
        _ => (
            BuildSampler::Uniform,
            guide::unused_by(options.device, Sampler::Uniform.name()),
        ),
    };
    let built = transfer::build(system, start, task, &sampler, settings, stop, observe)?;
    Ok((built, notice))
}

/// Plans a mission with a library that is bound to the scenario's map. The sampler `auto` is directed sampling: where skills
/// join to a plan no sample is needed for the first one, and where one is missing uniform samples (the paper's) seldom fill the gap.
///
/// # Errors
/// See [`MissionError`].
pub fn transfer_task(
    scenario: &Scenario,
    task: Task,
    library: &Library,
    options: &Options,
    stop: &Stop,
    observe: &mut dyn FnMut(Progress),
) -> Result<(Planned, Reused), MissionError> {
    let began = Instant::now();
    let task = Arc::new(task);
    let problem = problem(scenario, Arc::clone(&task))?;
    check_reachable(scenario, &task, &*problem.system)?;
    let chosen = match options.sampler {
        SamplerChoice::Auto => guide::Chosen::plain(Sampler::Directed, options.device),
        SamplerChoice::Guided => {
            let chosen = guide::guided_from_the_first(scenario, &problem, options);
            guide::unless_too_many(chosen)?
        }
        _ => guide::choose(scenario, &problem, options)?,
    };
    let searched = Instant::now();
    let found = transfer::transfer(
        &problem,
        library,
        &chosen.sampler,
        &options.settings,
        stop,
        observe,
    );
    let found = found.map_err(|e| chosen.failed(e))?;
    let mut solution = found.solution;
    if !options.settings.first {
        let cost = solution.cost;
        (solution.path, solution.cost) = shortened(&problem, options, solution.path, cost);
    }
    let search = searched.elapsed().as_secs_f64();
    let answer = chosen.answer()?;
    let (path, verified) = accepted(scenario, &task, options, solution.path, &solution.cost)?;
    let mut file = file(scenario, &task, &path, verified.cost);
    file.sampler = Some(format!("transfer-{}", chosen.sampler.name()));
    file.seed = Some(options.settings.seed);
    file.first = solution.stats.first_plan.map(first);
    file.first_prefix = solution.stats.first_prefix.map(first);
    let mut effort = stats(&solution.stats);
    effort.seconds.search = search;
    let mut guidance = None;
    if let Some(prediction) = answer.prediction {
        file.device = Some(prediction.device);
        file.model_hash = Some(prediction.model_hash);
        effort.seconds.encode = prediction.encode;
        effort.seconds.infer = prediction.infer;
        guidance = Some(prediction.guidance);
    }
    effort.seconds.total = began.elapsed().as_secs_f64();
    file.stats = Some(effort);
    let planned = Planned {
        path,
        verified,
        file,
        guidance,
        edges: solution.edges,
        notices: answer.notices,
    };
    Ok((planned, found.reused))
}

/// The plan pulled taut, if the settings want that and its places are not those of a grid.
fn shortened(problem: &Problem, options: &Options, path: Path, cost: Cost) -> (Path, Cost) {
    let map = problem.system.plane().filter(|_| options.settings.shorten);
    let shorter = map
        .and_then(|map| Shortener::new(map, &problem.task, problem.weight).shorten(&path, SWEEPS));
    match shorter {
        Some((path, shorter)) if shorter.total < cost.total => (path, shorter),
        _ => (path, cost),
    }
}

/// A repaired plan with what the change made pointless taken out: a loop may lead to a waypoint for the way that is closed now, and back. Its
/// entries, the sides on which it passes obstacles and the order of its visits are looked at, as a search does with its best plan.
fn looked_around(
    problem: &Problem,
    options: &Options,
    (path, cost): (Path, Cost),
    is_due: impl Fn() -> bool,
) -> (Path, Cost) {
    let best = shortened(problem, options, path, cost);
    let Some(map) = problem.system.plane().filter(|_| options.settings.shorten) else {
        return best;
    };
    let shortener = Shortener::new(map, &problem.task, problem.weight);
    let walk = |from, to| {
        let mut way = Vec::new();
        if !is_due() {
            problem.system.walk(from, to, &mut |at| way.push(at));
        }
        way
    };
    shortener.look_around(best, &walk, &is_due)
}

/// What was done to a plan in a changed environment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Change {
    /// Nothing: it still holds.
    None,
    /// So many segments were replaced, in so many seconds.
    Repaired {
        /// Segments.
        segments: usize,
        /// Seconds, without verification.
        seconds: f64,
    },
    /// No repair was possible, for this reason: the mission was planned anew.
    Anew(BeyondRepair),
}

/// Makes a plan fit a changed scenario: repairs it, or plans anew where that is not possible (with the
/// library if one is given, else as the options say). The whole plan is verified.
///
/// # Errors
/// See [`MissionError`].
pub fn replan_task(
    scenario: &Scenario,
    task: Task,
    plan: &Path,
    library: Option<&Library>,
    options: &Options,
    stop: &Stop,
    observe: &mut dyn FnMut(Progress),
) -> Result<(Planned, Change), MissionError> {
    let began = Instant::now();
    let shared = Arc::new(task);
    let mut problem = problem(scenario, Arc::clone(&shared))?;
    let (mut repair, change) = match transfer::replan(&problem, plan, &options.settings) {
        Replanned::Unchanged(repair) => (repair, Change::None),
        Replanned::Repaired(repair) => {
            let (segments, seconds) = (repair.segments, repair.seconds);
            (repair, Change::Repaired { segments, seconds })
        }
        Replanned::Hopeless(why) => {
            let task = Task::clone(&shared);
            let planned = match library {
                Some(library) => transfer_task(scenario, task, library, options, stop, observe)?.0,
                None => super::plan_task(scenario, task, options, stop, observe)?,
            };
            return Ok((planned, Change::Anew(why)));
        }
    };
    problem.task = Arc::clone(&repair.task);
    if change != Change::None {
        let budget = options.settings.time_budget();
        let is_due = || stop.is_raised() || budget.is_some_and(|b| began.elapsed() >= b);
        let repaired = (repair.path, repair.cost);
        (repair.path, repair.cost) = looked_around(&problem, options, repaired, is_due);
    }
    let Repair {
        path, cost, task, ..
    } = repair;
    let (path, verified) = folded(scenario, &task, path, &cost)?;
    let mut file = file(scenario, &task, &path, verified.cost);
    file.sampler = Some("replan".to_owned());
    file.seed = Some(options.settings.seed);
    file.stats = Some(PlanStats {
        iterations: repair.samples,
        seconds: StageSeconds {
            search: repair.seconds,
            total: began.elapsed().as_secs_f64(),
            ..StageSeconds::default()
        },
        ..PlanStats::default()
    });
    let planned = Planned {
        path,
        verified,
        file,
        guidance: None,
        edges: Vec::new(),
        notices: guide::unused_device(options.device, ", as repairs ask no networks")
            .into_iter()
            .collect(),
    };
    Ok((planned, change))
}
