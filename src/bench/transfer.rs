//! The transfer paper's tables on its own workspace, and the same in the continuous workspace:
//! planning with a library beside our own biased planner, everything in one binary
//! (`transfer-planning.md`, VI).

mod changed;
mod continuous;
mod text;

use std::sync::Arc;
use std::time::Instant;

use serde::Serialize;

use super::stats::Summary;
use crate::automaton::Task;
use crate::ltl::Formula;
use crate::mission::{self, MissionError};
use crate::plan::{Cost, Path};
use crate::planner::{PlanError, Problem, Sampler, Settings, Stop, plan};
use crate::scenario::{Scenario, ScenarioError, ScenarioSpec};
use crate::transfer::{
    BuildSampler, BuildSettings, Library, SubtaskCounts, build, count_subtasks, optimum, transfer,
};

pub use changed::{ChangedRow, ChangedTable, changed_environments};
pub use continuous::{ContinuousRow, ContinuousTable, continuous_workspace};

/// The paper's workspace, as shipped.
const GRID: &str = include_str!("../../scenarios/transfer-grid.toml");

/// A formula of the paper with its figures.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PaperRow {
    /// Its name.
    pub name: &'static str,
    /// The formula, as printed.
    pub formula: &'static str,
    /// t_Ω in seconds.
    pub graph_seconds: f64,
    /// #T.
    pub subtasks: u32,
    /// %T.
    pub percent: f64,
    /// t in seconds.
    pub seconds: f64,
    /// t of the biased planner, in seconds.
    pub biased_seconds: f64,
    /// J.
    pub cost: f64,
    /// J of the biased planner.
    pub biased_cost: f64,
    /// Table II: t of repair and of planning anew for m = 1, 2, 3 new obstacles, in seconds.
    pub changed: [(f64, f64); 3],
    /// Seconds of the published biased planner's code, measured on a machine of today.
    pub published_biased_seconds: f64,
    /// The optimum of the product with ltl2ba's automaton.
    pub known_optimum: f64,
}

/// The formulas and figures of Tables I and II (`transfer-planning.md`, VI), with what the published
/// code gives and the optima of the product with ltl2ba's automata.
pub const PAPER: [PaperRow; 6] = [
    PaperRow {
        name: "phi1",
        formula: "[](<>r1 && <>r2)",
        graph_seconds: 0.00,
        subtasks: 6,
        percent: 83.3,
        seconds: 0.02,
        biased_seconds: 0.22,
        cost: 1.85,
        biased_cost: 1.86,
        changed: [(0.31, 0.33), (0.35, 0.31), (0.40, 0.31)],
        published_biased_seconds: 0.036,
        known_optimum: 1.85,
    },
    PaperRow {
        name: "phi2",
        formula: "[](<>r1 && <>r4) && [](r1 -> X(!r1 U r4))",
        graph_seconds: 0.03,
        subtasks: 17,
        percent: 94.1,
        seconds: 0.01,
        biased_seconds: 0.20,
        cost: 1.60,
        biased_cost: 1.47,
        changed: [(0.30, 0.22), (0.34, 0.18), (0.35, 0.22)],
        published_biased_seconds: 0.023,
        known_optimum: 1.40,
    },
    PaperRow {
        name: "phi3",
        formula: "[](<>r1 && <>r2 && <>r3 && <>r4 && <>r5 && <>r6)",
        graph_seconds: 0.02,
        subtasks: 10,
        percent: 90.0,
        seconds: 0.01,
        biased_seconds: 0.70,
        cost: 3.40,
        biased_cost: 3.45,
        changed: [(0.35, 0.76), (0.39, 0.89), (0.43, 0.84)],
        published_biased_seconds: 0.092,
        known_optimum: 3.40,
    },
    PaperRow {
        name: "phi4",
        formula: "[]<>(r1 && <>r2) && []<>(r3 && <>r4) && (!r1 U r3)",
        graph_seconds: 0.06,
        subtasks: 57,
        percent: 91.2,
        seconds: 0.07,
        biased_seconds: 1.16,
        cost: 3.25,
        biased_cost: 3.15,
        changed: [(0.38, 1.10), (0.34, 1.18), (0.42, 0.98)],
        published_biased_seconds: 0.17,
        known_optimum: 2.85,
    },
    PaperRow {
        name: "phi5",
        formula: "[](<>r1 && <>r2) && [](<>r3 && <>r4) && <>r5 && <>r6 && [](r1 -> X(!r1 U r2)) && [](r3 -> X(!r3 U r4))",
        graph_seconds: 2.04,
        subtasks: 383,
        percent: 94.3,
        seconds: 0.20,
        biased_seconds: 3.40,
        cost: 5.10,
        biased_cost: 2.83,
        changed: [(0.31, 3.32), (0.37, 4.17), (0.41, 3.77)],
        published_biased_seconds: 0.51,
        known_optimum: 2.70,
    },
    PaperRow {
        name: "phi6",
        formula: "[](<>r1 && <>r2) && [](<>r3 && <>r4) && [](<>r5 && <>r6) && [](r1 -> X(!r1 U r2)) && [](r3 -> X(!r3 U r4)) && [](r5 -> X(!r5 U r6))",
        graph_seconds: 9.10,
        subtasks: 1018,
        percent: 90.5,
        seconds: 0.98,
        biased_seconds: 9.85,
        cost: 4.50,
        biased_cost: 3.67,
        changed: [(0.34, 9.49), (0.38, 10.17), (0.44, 13.38)],
        published_biased_seconds: 2.5,
        known_optimum: 3.40,
    },
];

/// How the tables are made.
#[derive(Clone, Debug, Serialize)]
pub struct TransferBench {
    /// Runs of each formula, and of each changed environment.
    pub trials: u64,
    /// Changed environments for each formula and number of obstacles.
    pub environments: u64,
    /// The first seed.
    pub seed: u64,
    /// Seconds of the anytime phase, at most.
    pub anytime_seconds: f64,
    /// Iterations of the biased planner, at most.
    pub biased_iterations: u64,
}

impl Default for TransferBench {
    fn default() -> Self {
        Self {
            trials: 10,
            environments: 10,
            seed: 0,
            anytime_seconds: 1.0,
            biased_iterations: 1_000_000,
        }
    }
}

/// Why a table could not be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TransferBenchError {
    /// The shipped workspace is not sound: a fault of this program.
    #[error("the shipped workspace: {0}")]
    Scenario(#[from] ScenarioError),
    /// A formula could not be prepared, or a plan did not verify.
    #[error("{formula}: {source}")]
    Mission {
        /// The formula's name.
        formula: String,
        /// Why.
        source: Box<MissionError>,
    },
    /// A search found nothing.
    #[error("{formula}: {planner} found no plan: {source}")]
    NotFound {
        /// The formula's name.
        formula: String,
        /// Which planner.
        planner: &'static str,
        /// Why.
        source: Box<PlanError>,
    },
}

/// One formula of Table I.
#[derive(Clone, Debug, Serialize)]
pub struct TableRow {
    /// The paper's figures.
    pub paper: PaperRow,
    /// States of our automaton.
    pub states: usize,
    /// Seconds to translate the formula (both planners need it).
    pub translate_seconds: f64,
    /// #T and the share of them with a reusable path, on our automaton.
    pub counts: SubtaskCounts,
    /// The same on another automaton of the formula, if one was given.
    pub other_counts: Option<SubtaskCounts>,
    /// States of the other automaton.
    pub other_states: Option<usize>,
    /// t_Ω in seconds.
    pub graph: Summary,
    /// t to the first plan, in seconds, without t_Ω.
    pub first: Summary,
    /// t_Ω + t.
    pub total: Summary,
    /// J of the first plan.
    pub cost: Summary,
    /// J when the anytime phase ended.
    pub anytime_cost: Summary,
    /// Seconds until the optimum was reached, of the runs that reached it.
    pub optimal_after: Option<Summary>,
    /// Runs whose anytime phase reached the optimum.
    pub optimal_runs: usize,
    /// The optimum of the product with our automaton, by exhaustive search.
    pub optimum: f64,
    /// Seconds of that search.
    pub optimum_seconds: f64,
    /// t of our biased planner to its first plan, in seconds.
    pub biased: Summary,
    /// J of its first plans.
    pub biased_cost: Summary,
}

/// Table I, measured.
#[derive(Clone, Debug, Serialize)]
pub struct Table {
    /// The format's version.
    pub version: u32,
    /// How it was made.
    pub settings: TransferBench,
    /// Pairs of endpoints that the library joins.
    pub pairs: usize,
    /// Skills in the library.
    pub skills: usize,
    /// Seconds to build the library.
    pub build_seconds: f64,
    /// Seconds to lay the library out for the start: once for map and start.
    pub layout: Summary,
    /// One row for each formula.
    pub rows: Vec<TableRow>,
}

/// A library on the paper's workspace, and what it took.
#[derive(Clone, Debug)]
pub struct GridLibrary {
    /// The library.
    pub library: Library,
    /// Seconds to build it.
    pub seconds: f64,
}

/// The paper's workspace with one of its missions.
///
/// # Errors
/// A formula that does not belong to it.
pub fn grid_scenario(formula: Option<&str>) -> Result<Scenario, ScenarioError> {
    let mut spec: ScenarioSpec = toml::from_str(GRID).map_err(|e| {
        ScenarioError::from(crate::scenario::ScenarioErrorKind::Syntax(e.to_string()))
    })?;
    if let Some(formula) = formula {
        spec.task = Some(formula.to_owned());
    }
    Scenario::from_spec(&spec)
}

/// Builds the paper's library: from the mission that visits all six regions.
///
/// # Errors
/// A fault of the shipped workspace.
pub fn grid_library(seed: u64) -> Result<GridLibrary, TransferBenchError> {
    let scenario = grid_scenario(None)?;
    library_of(&scenario, seed)
}

fn library_of(scenario: &Scenario, seed: u64) -> Result<GridLibrary, TransferBenchError> {
    let problem = problem_of("library", scenario)?;
    let began = Instant::now();
    let settings = BuildSettings {
        seed,
        ..BuildSettings::default()
    };
    let built = build(
        &*problem.system,
        problem.start,
        &problem.task,
        &BuildSampler::Uniform,
        &settings,
        &Stop::new(),
        &mut |_| {},
    );
    let built = built.unwrap_or_else(|_| unreachable!("uniform sampling has no heatmap"));
    Ok(GridLibrary {
        library: built.library,
        seconds: began.elapsed().as_secs_f64(),
    })
}

fn problem_of(name: &str, scenario: &Scenario) -> Result<Problem, TransferBenchError> {
    let fail = |source: MissionError| TransferBenchError::Mission {
        formula: name.to_owned(),
        source: Box::new(source),
    };
    let task = mission::task(scenario).map_err(fail)?;
    mission::problem(scenario, Arc::new(task)).map_err(fail)
}

/// Every plan that is counted has passed the checker.
fn verified(
    name: &str,
    scenario: &Scenario,
    path: &Path,
    cost: &Cost,
) -> Result<(), TransferBenchError> {
    mission::verify(scenario, None, path, scenario.weight, Some(cost))
        .map(|_| ())
        .map_err(|refusal| TransferBenchError::Mission {
            formula: name.to_owned(),
            source: Box::new(refusal.into()),
        })
}

fn not_found(name: &str, planner: &'static str, source: PlanError) -> TransferBenchError {
    TransferBenchError::NotFound {
        formula: name.to_owned(),
        planner,
        source: Box::new(source),
    }
}

/// Measures Table I. `others` holds another automaton for some formulas (by name), whose subtasks are
/// counted too; `progress` is called with the number of rows done.
///
/// # Errors
/// A formula without a plan, or a plan that does not verify.
pub fn table(
    library: &GridLibrary,
    settings: &TransferBench,
    others: &[(String, Task)],
    progress: &mut dyn FnMut(usize),
) -> Result<Table, TransferBenchError> {
    let mut rows = Vec::new();
    let mut layouts = Vec::new();
    for (done, paper) in PAPER.into_iter().enumerate() {
        let other = others.iter().find(|(name, _)| name == paper.name);
        rows.push(row(
            paper,
            &library.library,
            settings,
            other.map(|(_, task)| task),
            &mut layouts,
        )?);
        progress(done + 1);
    }
    Ok(Table {
        version: 1,
        settings: settings.clone(),
        pairs: library.library.pairs(),
        skills: library.library.skills().len(),
        build_seconds: library.seconds,
        layout: summary(&layouts),
        rows,
    })
}

fn summary(values: &[f64]) -> Summary {
    Summary::of(values).unwrap_or_else(|| unreachable!("at least one trial"))
}

fn row(
    paper: PaperRow,
    library: &Library,
    settings: &TransferBench,
    other: Option<&Task>,
    layouts: &mut Vec<f64>,
) -> Result<TableRow, TransferBenchError> {
    let scenario = grid_scenario(Some(paper.formula))?;
    let translated = Instant::now();
    let problem = problem_of(paper.name, &scenario)?;
    let translate_seconds = translated.elapsed().as_secs_f64();
    let searched = Instant::now();
    let best = optimum(&problem);
    let optimum_seconds = searched.elapsed().as_secs_f64();
    let (path, best) = best.ok_or_else(|| {
        let why = PlanError::Unreachable("exhaustive search".to_owned());
        not_found(paper.name, "exhaustive search", why)
    })?;
    verified(paper.name, &scenario, &path, &best)?;
    let mut runs = Runs::default();
    for k in 0..settings.trials.max(1) {
        runs.transfer(&paper, &scenario, &problem, library, settings, k, layouts)?;
        runs.anytime(
            &paper, &scenario, &problem, library, settings, k, best.total,
        )?;
        runs.biased(&paper, &scenario, &problem, settings, k)?;
    }
    Ok(TableRow {
        paper,
        states: problem.task.nba.len(),
        translate_seconds,
        counts: count_subtasks(&problem, library),
        other_counts: other.map(|task| {
            let problem = Problem {
                task: Arc::new(task.clone()),
                ..problem.clone()
            };
            count_subtasks(&problem, library)
        }),
        other_states: other.map(|task| task.nba.len()),
        graph: summary(&runs.graph),
        first: summary(&runs.first),
        total: summary(&runs.total),
        cost: summary(&runs.cost),
        anytime_cost: summary(&runs.anytime_cost),
        optimal_after: Summary::of(&runs.optimal_after),
        optimal_runs: runs.optimal_after.len(),
        optimum: best.total,
        optimum_seconds,
        biased: summary(&runs.biased),
        biased_cost: summary(&runs.biased_cost),
    })
}

/// The runs of one formula.
#[derive(Default)]
struct Runs {
    graph: Vec<f64>,
    first: Vec<f64>,
    total: Vec<f64>,
    cost: Vec<f64>,
    anytime_cost: Vec<f64>,
    optimal_after: Vec<f64>,
    biased: Vec<f64>,
    biased_cost: Vec<f64>,
}

impl Runs {
    #[allow(clippy::too_many_arguments)] // what a trial is made of
    fn transfer(
        &mut self,
        paper: &PaperRow,
        scenario: &Scenario,
        problem: &Problem,
        library: &Library,
        bench: &TransferBench,
        k: u64,
        layouts: &mut Vec<f64>,
    ) -> Result<(), TransferBenchError> {
        let settings = Settings {
            seed: bench.seed + k,
            first: true,
            iterations: bench.biased_iterations,
            ..Settings::default()
        };
        let uniform = Sampler::Uniform;
        let found = transfer(
            problem,
            library,
            &uniform,
            &settings,
            &Stop::new(),
            &mut |_| {},
        );
        let found = found.map_err(|e| not_found(paper.name, "transfer planning", e))?;
        let solution = &found.solution;
        verified(paper.name, scenario, &solution.path, &solution.cost)?;
        let seconds = solution.stats.first_plan.map_or(0.0, |f| f.seconds);
        self.graph.push(found.reused.graph_seconds);
        self.first.push(seconds);
        self.total.push(seconds + found.reused.graph_seconds);
        self.cost.push(solution.cost.total);
        layouts.push(found.reused.layout_seconds);
        Ok(())
    }

    #[allow(clippy::too_many_arguments)] // what a trial is made of
    fn anytime(
        &mut self,
        paper: &PaperRow,
        scenario: &Scenario,
        problem: &Problem,
        library: &Library,
        bench: &TransferBench,
        k: u64,
        best: f64,
    ) -> Result<(), TransferBenchError> {
        let settings = Settings {
            seed: bench.seed + k,
            iterations: u64::MAX,
            time_limit: Some(bench.anytime_seconds),
            ..Settings::default()
        };
        let reached = |cost: f64| cost <= best * (1.0 + 1e-9);
        let stop = Stop::new();
        let raised = stop.clone();
        let mut observe = |p: crate::planner::Progress| {
            if p.cost.is_some_and(reached) {
                raised.raise();
            }
        };
        let found = transfer(
            problem,
            library,
            &Sampler::Uniform,
            &settings,
            &stop,
            &mut observe,
        );
        let found = found.map_err(|e| not_found(paper.name, "transfer planning", e))?;
        let solution = &found.solution;
        verified(paper.name, scenario, &solution.path, &solution.cost)?;
        self.anytime_cost.push(solution.cost.total);
        let improvements = &solution.stats.improvements;
        let optimal = improvements.iter().find(|i| reached(i.cost));
        self.optimal_after.extend(optimal.map(|i| i.seconds));
        Ok(())
    }

    fn biased(
        &mut self,
        paper: &PaperRow,
        scenario: &Scenario,
        problem: &Problem,
        bench: &TransferBench,
        k: u64,
    ) -> Result<(), TransferBenchError> {
        let settings = Settings {
            seed: bench.seed + k,
            first: true,
            iterations: bench.biased_iterations,
            ..Settings::default()
        };
        let found = plan(
            problem,
            &Sampler::Biased,
            &settings,
            &Stop::new(),
            &mut |_| {},
        );
        let found = found.map_err(|e| not_found(paper.name, "the biased planner", e))?;
        verified(paper.name, scenario, &found.path, &found.cost)?;
        self.biased.push(found.stats.seconds);
        self.biased_cost.push(found.cost.total);
        Ok(())
    }
}

/// Formulas as they stand in the tables, for checks that they are what they should be.
#[must_use]
pub fn formulas() -> Vec<(&'static str, Formula)> {
    let parse = |row: &PaperRow| Some((row.name, row.formula.parse().ok()?));
    PAPER.iter().filter_map(parse).collect()
}
