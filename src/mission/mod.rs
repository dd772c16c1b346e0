//! From a scenario to a verified plan: every stage of the house in one call.
//!
//! ```
//! use nngtl::mission::{self, Options};
//! use nngtl::render::Picture;
//! use nngtl::scenario::Scenario;
//!
//! let scenario = Scenario::load("scenarios/case-study.toml")?;
//! let planned = mission::plan(&scenario, &Options::default())?; // searched and verified
//! let svg = Picture::new(&scenario.workspace)
//!     .start(scenario.start)
//!     .path(&planned.path)
//!     .to_svg();
//! assert!(svg.contains("stays here"));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod explain;
mod fold;
mod guide;
mod think;
mod transfer;

/// The Rust of the README, as a test.
#[cfg(doctest)]
#[doc = include_str!("../../README.md")]
mod readme {}

use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::Point2;

use crate::automaton::{Limits, Nba, Task, TaskError};
use crate::exact::{Bounds, Halt, Infeasible};
use crate::guidance::Guidance;
use crate::nn::{DeviceChoice, LoadError, PredictError};
use crate::plan::{Bound, Cost, First, Path, PlanFile, PlanStats, StageSeconds};
use crate::planner::{self, GuidanceError, PlanError, Problem, Progress, Settings, Stats, Stop};
use crate::scenario::Scenario;
use crate::system::{Continuous, Grid, GridError, MapLayout, Spot, StartError, TransitionSystem};
use crate::verify::{self, Refusal, Verified};

pub use explain::{AtStart, LetterFact, NotOnThisMap, OutOfReach, Unreachable, Walls};
pub use guide::{Prediction, Question, predict, predict_many, predict_with};
pub use think::Thinking;
pub use transfer::{Change, build_library, replan_task, transfer_task};

/// Which strategy plans a mission.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SamplerChoice {
    /// Directed, and once a search has lasted so long that networks pay ([`Deferred::WORTH_IT`](crate::planner::Deferred::WORTH_IT)),
    /// guided, if they load and fit the mission.
    #[default]
    Auto,
    /// Uniform sampling.
    Uniform,
    /// Biased sampling.
    Biased,
    /// The rules of guided sampling without networks.
    Directed,
    /// Sampling guided by the networks, which run while the search goes on without them for a while
    /// ([`HeadStart::USUAL`](crate::planner::HeadStart::USUAL), [`Settings::networks_first`]).
    Guided,
    /// No sampling: the exact planner.
    Exact,
}

/// How a mission is planned.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// The strategy.
    pub sampler: SamplerChoice,
    /// What runs the networks, if they run.
    pub device: DeviceChoice,
    /// The folder of the networks' weights; the built-in ones if not given.
    pub model: Option<PathBuf>,
    /// Budget, seed and parameters of the search.
    pub settings: Settings,
    /// Whether a guided search that was over before it needed the networks waits for what they say, as for a picture of it.
    pub await_networks: bool,
}

/// A plan that has passed the checker, and what it took.
#[derive(Clone, Debug)]
pub struct Planned {
    /// The path.
    pub path: Path,
    /// What the checker found it to do.
    pub verified: Verified,
    /// The plan as a file holds it.
    pub file: PlanFile,
    /// What the networks predicted, if they ran.
    pub guidance: Option<Guidance>,
    /// The edges of the search trees, for pictures; none from the exact planner.
    pub edges: Vec<[Point2<f64>; 2]>,
    /// What a user should know: a device or a sampler was replaced, for example.
    pub notices: Vec<String>,
}

/// Why there is no plan.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum MissionError {
    /// The formula speaks of the next letter.
    #[error(
        "the task uses X (next), which has no meaning while a robot moves continuously: use U, F and G"
    )]
    Next,
    /// The formula has no automaton: no word satisfies it, or it is too large to translate.
    #[error(transparent)]
    Task(#[from] TaskError),
    /// The formula can be satisfied, but not over the letters of this map.
    #[error(transparent)]
    NotOnThisMap(#[from] NotOnThisMap),
    /// The mission needs places that cannot be reached.
    #[error(transparent)]
    Unreachable(#[from] Unreachable),
    /// The robot cannot be where it should start.
    #[error(transparent)]
    Start(#[from] StartError),
    /// The grid does not fit.
    #[error(transparent)]
    Grid(#[from] GridError),
    /// A heatmap that cannot guide.
    #[error(transparent)]
    Guidance(#[from] GuidanceError),
    /// The networks cannot be loaded.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// The networks do not fit the mission.
    #[error(transparent)]
    Predict(#[from] PredictError),
    /// The search could not begin, or found nothing.
    #[error(transparent)]
    Plan(#[from] PlanError),
    /// The exact planner found nothing.
    #[error(transparent)]
    Exact(#[from] Infeasible),
    /// A plan was found but did not pass the checker: a fault of this program.
    #[error("a plan was found but refused, please report this as a fault of nngtl: {0}")]
    Refused(#[from] Refusal),
}

/// Plans a mission: translates, predicts, searches, verifies.
///
/// # Errors
/// See [`MissionError`].
pub fn plan(scenario: &Scenario, options: &Options) -> Result<Planned, MissionError> {
    let began = Instant::now();
    let task = task(scenario)?;
    let translate = began.elapsed().as_secs_f64();
    let mut planned = plan_task(scenario, task, options, &Stop::new(), &mut |_| {})?;
    if let Some(stats) = &mut planned.file.stats {
        stats.seconds.translate = translate;
        stats.seconds.total = began.elapsed().as_secs_f64();
    }
    Ok(planned)
}

/// The scenario's mission as an automaton over the letters of its map.
///
/// # Errors
/// A formula with `X` off a grid, one that nothing satisfies, or one that is too large to translate.
pub fn task(scenario: &Scenario) -> Result<Task, MissionError> {
    task_within(scenario, &Limits::default())
}

/// As [`task`], within other limits of the translation than the default ones: to visit 15 places in any order takes an
/// automaton of 2¹⁵ states.
///
/// # Errors
/// See [`task`].
pub fn task_within(scenario: &Scenario, limits: &Limits) -> Result<Task, MissionError> {
    if scenario.formula.has_next() && scenario.grid.is_none() {
        return Err(MissionError::Next);
    }
    let letters = Arc::clone(scenario.workspace.alphabet());
    let places = MapLayout::new(Arc::clone(&scenario.workspace), scenario.start);
    match Task::on_map(&scenario.formula, Arc::clone(&letters), limits, &places) {
        Err(TaskError::NotWithTheseLetters { .. }) => {
            Err(NotOnThisMap::new(&scenario.formula, &letters).into())
        }
        // A mission too large to translate can be impossible for a reason that is seen at once.
        Err(TaskError::Translate(why)) => {
            match NotOnThisMap::in_parts(&scenario.formula, &letters) {
                Some(impossible) => Err(impossible.into()),
                None => Err(TaskError::Translate(why).into()),
            }
        }
        other => Ok(other?),
    }
}

/// As [`plan`], for a task that is translated already or was read from a file. Raising `stop` ends
/// the search with the best plan so far; `observe` is told how far it is.
///
/// # Errors
/// See [`MissionError`].
pub fn plan_task(
    scenario: &Scenario,
    task: Task,
    options: &Options,
    stop: &Stop,
    observe: &mut dyn FnMut(Progress),
) -> Result<Planned, MissionError> {
    let began = Instant::now();
    let task = Arc::new(task);
    if options.sampler == SamplerChoice::Exact {
        return exact(scenario, &task, options, stop).map_err(|e| explained(scenario, &task, e));
    }
    let problem = problem(scenario, Arc::clone(&task))?;
    check_reachable(scenario, &task, &*problem.system)?;
    let chosen = guide::choose(scenario, &problem, options)?;
    let searched = Instant::now();
    let found = planner::plan(&problem, &chosen.sampler, &options.settings, stop, observe);
    let solution = found.map_err(|e| chosen.failed(e))?;
    let answer = chosen.answer()?;
    let search = searched.elapsed().as_secs_f64() - answer.waited;

    let (path, verified) = accepted(scenario, &task, options, solution.path, &solution.cost)?;
    let mut file = file(scenario, &task, &path, verified.cost);
    file.sampler = Some(chosen.name(&answer).to_owned());
    file.seed = Some(options.settings.seed);
    file.first = solution.stats.first_plan.map(first);
    file.first_prefix = solution.stats.first_prefix.map(first);
    let mut stats = stats(&solution.stats);
    stats.seconds.search = search;
    let mut guidance = None;
    if let Some(prediction) = answer.prediction {
        file.device = Some(prediction.device);
        file.model_hash = Some(prediction.model_hash);
        stats.seconds.encode = prediction.encode;
        stats.seconds.infer = prediction.infer;
        guidance = Some(prediction.guidance);
    }
    stats.seconds.total = began.elapsed().as_secs_f64();
    file.stats = Some(stats);
    Ok(Planned {
        path,
        verified,
        file,
        guidance,
        edges: solution.edges,
        notices: answer.notices,
    })
}

/// The world that the scenario's robot moves in, and where it starts there.
///
/// # Errors
/// A start where the robot cannot be.
pub fn world(scenario: &Scenario) -> Result<(Arc<dyn TransitionSystem>, Spot), MissionError> {
    let map = Arc::clone(&scenario.workspace);
    Ok(match scenario.grid {
        None => {
            let system = Continuous::new(map, scenario.start)?;
            let start = system.start();
            (Arc::new(system), start)
        }
        Some(grid) => {
            let system = Grid::new(map, grid.cells, grid.cell, scenario.start)?;
            let start = system.start();
            (Arc::new(system), start)
        }
    })
}

/// The scenario's mission, ready for search.
///
/// # Errors
/// As [`world`].
pub fn problem(scenario: &Scenario, task: Arc<Task>) -> Result<Problem, MissionError> {
    let (system, start) = world(scenario)?;
    Ok(Problem {
        system,
        task,
        start,
        weight: scenario.weight,
    })
}

/// Ends at once where no search could succeed: with the letters of places that the robot cannot
/// reach taken away nothing is accepted, or nothing along any way that the automaton admits.
pub(crate) fn check_reachable(
    scenario: &Scenario,
    task: &Task,
    system: &dyn TransitionSystem,
) -> Result<(), MissionError> {
    Unreachable::find(scenario, task, system).map_or(Ok(()), |why| Err(why.into()))
}

/// The exact planner's failure, with the walls that cause it where there are any.
fn explained(scenario: &Scenario, task: &Task, e: MissionError) -> MissionError {
    let fruitless = matches!(
        e,
        MissionError::Exact(
            Infeasible::Unsatisfiable | Infeasible::NoPrefix | Infeasible::NoSuffix
        ) | MissionError::Plan(PlanError::Unreachable(_))
    );
    let world = fruitless.then(|| world(scenario).ok()).flatten();
    world
        .and_then(|(system, _)| Unreachable::find(scenario, task, &*system))
        .map_or(e, MissionError::Unreachable)
}

/// Lower bounds beside a plan's cost: on all plans, and on those of the product (on grids their least cost itself, `upper`, as their
/// product was searched exhaustively). `None` if the work was ended.
fn bound(
    scenario: &Scenario,
    task: &Task,
    total: f64,
    upper: f64,
    halt: Halt<'_>,
) -> Option<Bound> {
    let began = Instant::now();
    let (map, start, weight) = (&scenario.workspace, scenario.start, scenario.weight);
    let least = match scenario.grid {
        None => crate::exact::bounds_until(map, start, task, weight, upper, halt)?,
        Some(_) => Bounds {
            all: crate::exact::least_cost(map, start, task, weight, halt)?,
            product: upper,
        },
    };
    // Rounding must not lift a bound above the plan.
    let product = (total >= least.product * (1.0 - 1e-9)).then_some(least.product.min(total));
    let cost = least.all.min(total);
    let gap = match total > 0.0 {
        true => Some(total / cost - 1.0).filter(|gap| gap.is_finite()),
        false => Some(0.0),
    };
    // Nothing is learned from a bound of 0, but of a plan that costs as little.
    let is_told = gap.is_some() || product.is_some_and(|least| least > 0.0);
    is_told.then(|| Bound {
        cost,
        gap,
        product,
        seconds: began.elapsed().as_secs_f64(),
    })
}

/// Plans without sampling.
fn exact(
    scenario: &Scenario,
    task: &Task,
    options: &Options,
    stop: &Stop,
) -> Result<Planned, MissionError> {
    let began = Instant::now();
    let budget = options.settings.time_budget();
    let out_of_time = || budget.is_some_and(|b| began.elapsed() >= b);
    let is_due = || stop.is_raised() || out_of_time();
    let halt = Halt::when(&is_due);
    let (path, cost) = match scenario.grid {
        None => {
            let map = &scenario.workspace;
            let plan = crate::exact::plan_until(map, scenario.start, task, scenario.weight, halt)?;
            (plan.path, plan.cost)
        }
        Some(_) => {
            let problem = problem(scenario, Arc::new(task.clone()))?;
            crate::transfer::optimum(&problem).ok_or_else(|| {
                let why = "the product of grid and automaton was searched exhaustively";
                PlanError::Unreachable(why.to_owned())
            })?
        }
    };
    let mut notices: Vec<String> = guide::unused_by(options.device, "exact")
        .into_iter()
        .collect();
    if out_of_time() {
        let says = "the time limit ended the exact search: this is its best plan so far";
        notices.push(says.to_owned());
    }
    let search = began.elapsed().as_secs_f64();
    let (path, verified) = folded(scenario, task, path, &cost)?;
    let mut file = file(scenario, task, &path, verified.cost);
    file.sampler = Some("exact".to_owned());
    file.bound = bound(scenario, task, verified.cost.total, cost.total, halt);
    let seconds = StageSeconds {
        search,
        total: began.elapsed().as_secs_f64(),
        ..StageSeconds::default()
    };
    file.stats = Some(PlanStats {
        seconds,
        ..PlanStats::default()
    });
    Ok(Planned {
        path,
        verified,
        file,
        guidance: None,
        edges: Vec::new(),
        notices,
    })
}

/// The checker, by the formula where there is one, and by the rules of the world that the robot moves in.
fn check(
    scenario: &Scenario,
    task: &Task,
    path: &Path,
    cost: Option<&Cost>,
) -> Result<Verified, Refusal> {
    let automaton = match task.formula {
        Some(_) => None,
        None => Some(&task.nba),
    };
    verify(scenario, automaton, path, scenario.weight, cost)
}

/// As [`folded`], for a search whose plans are to be made shorter; others are left as they were found.
fn accepted(
    scenario: &Scenario,
    task: &Task,
    options: &Options,
    path: Path,
    cost: &Cost,
) -> Result<(Path, Verified), Refusal> {
    if options.settings.shortens() {
        return folded(scenario, task, path, cost);
    }
    let verified = check(scenario, task, &path, Some(cost))?;
    Ok((path, verified))
}

/// Checks a planner's result, and lets its loop begin as soon as the checker allows it.
fn folded(
    scenario: &Scenario,
    task: &Task,
    path: Path,
    cost: &Cost,
) -> Result<(Path, Verified), Refusal> {
    let verified = check(scenario, task, &path, Some(cost))?;
    let folded = fold::fold(scenario, task, &path, &verified);
    Ok(folded.unwrap_or((path, verified)))
}

/// Checks a plan of a scenario, against an automaton instead of the scenario's formula if one is
/// given, by the rules of the continuous workspace or of the scenario's grid.
///
/// # Errors
/// The first thing that is wrong.
pub fn verify(
    scenario: &Scenario,
    automaton: Option<&Nba>,
    path: &Path,
    weight: f64,
    stated: Option<&Cost>,
) -> Result<Verified, Refusal> {
    let (map, start, formula) = (&scenario.workspace, scenario.start, &scenario.formula);
    match (scenario.grid, automaton) {
        (None, None) => verify::verify(map, start, formula, path, weight, stated),
        (None, Some(nba)) => verify::verify_automaton(map, start, nba, path, weight, stated),
        (Some(grid), None) => {
            verify::verify_on_grid(map, grid, start, formula, path, weight, stated)
        }
        (Some(grid), Some(nba)) => {
            verify::verify_automaton_on_grid(map, grid, start, nba, path, weight, stated)
        }
    }
}

fn file(scenario: &Scenario, task: &Task, path: &Path, cost: Cost) -> PlanFile {
    PlanFile {
        scenario: Some(scenario.name.clone()),
        scenario_hash: Some(scenario.hash.clone()),
        task: task.formula.as_ref().map(|_| scenario.task.clone()),
        weight: Some(scenario.weight),
        cost: Some(cost),
        ..PlanFile::new(path)
    }
}

fn first(first: planner::First) -> First {
    First {
        iterations: first.iterations,
        nodes: first.nodes,
        seconds: first.seconds,
        cost: first.cost,
    }
}

fn stats(stats: &Stats) -> PlanStats {
    PlanStats {
        threads: stats.threads,
        iterations: stats.iterations,
        nodes: stats.nodes,
        sites: stats.sites,
        seconds: StageSeconds::default(),
    }
}
