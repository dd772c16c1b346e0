//! Transfer planning in the continuous workspace: the TL-RRT* reference case with four missions.

use std::sync::Arc;

use serde::Serialize;

use super::super::stats::Summary;
use super::{
    GridLibrary, TransferBench, TransferBenchError, library_of, not_found, problem_of, summary,
    verified,
};
use crate::mission::{Options, predict};
use crate::planner::{Guide, Problem, Sampler, Settings, Stop, plan};
use crate::scenario::{Scenario, ScenarioError, ScenarioErrorKind, ScenarioSpec};
use crate::transfer::{SubtaskCounts, count_subtasks, transfer};

/// The reference case, as shipped.
const REFERENCE: &str = include_str!("../../../scenarios/tl-rrt-star.toml");

/// The mission that the library is built from.
const LIBRARY: &str = "<> l1 && <> l2 && <> l3 && <> l4 && <> l5 && <> l6";

/// The missions, by name: a patrol, the reference case's own, a delivery in order, a long round.
const MISSIONS: [(&str, &str); 4] = [
    ("psi1", "[]<> l1 && []<> l2"),
    ("psi2", "<> l1 && []<> (l2 && <> l3) && (!l3 U l4) && []!l5"),
    ("psi3", "<> (l6 && <> (l4 && <> l1)) && []<> l3 && []!l5"),
    (
        "psi4",
        "[]<> l1 && []<> l2 && []<> l3 && []<> l4 && []<> l6 && (!l2 U l1)",
    ),
];

/// One mission, with one way of sampling.
#[derive(Clone, Debug, Serialize)]
pub struct ContinuousRow {
    /// The mission's name.
    pub name: &'static str,
    /// The mission.
    pub formula: &'static str,
    /// `uniform` or `guided`: where the anytime phase, and the search where skills do not suffice,
    /// look for places.
    pub sampler: &'static str,
    /// #T and %T.
    pub counts: SubtaskCounts,
    /// t_Ω in seconds.
    pub graph: Summary,
    /// t to the first plan in seconds, without t_Ω.
    pub first: Summary,
    /// J of the first plan.
    pub cost: Summary,
    /// J when the anytime phase ended.
    pub anytime_cost: Summary,
    /// Seconds to the first plan of the same sampler without a library (biased for `uniform`).
    pub without: Summary,
    /// J of that plan.
    pub without_cost: Summary,
    /// J of the same sampler without a library after as long.
    pub without_anytime_cost: Summary,
}

/// The table of the continuous workspace.
#[derive(Clone, Debug, Serialize)]
pub struct ContinuousTable {
    /// The format's version.
    pub version: u32,
    /// How it was made.
    pub settings: TransferBench,
    /// Skills in the library.
    pub skills: usize,
    /// Seconds to build it.
    pub build_seconds: f64,
    /// Why there is no guided row, if so.
    pub unguided: Option<String>,
    /// The rows.
    pub rows: Vec<ContinuousRow>,
}

fn scenario(formula: &str) -> Result<Scenario, ScenarioError> {
    let mut spec: ScenarioSpec = toml::from_str(REFERENCE)
        .map_err(|e| ScenarioError::from(ScenarioErrorKind::Syntax(e.to_string())))?;
    spec.task = Some(formula.to_owned());
    spec.weight = 0.5;
    Scenario::from_spec(&spec)
}

/// Measures the table; `progress` is called with the number of missions done, of four. Guided rows are
/// there if the networks load and fit.
///
/// # Errors
/// A mission without a plan, or a plan that does not verify.
pub fn continuous_workspace(
    settings: &TransferBench,
    options: &Options,
    progress: &mut dyn FnMut(usize),
) -> Result<ContinuousTable, TransferBenchError> {
    let library = library_of(&scenario(LIBRARY)?, settings.seed)?;
    let mut table = ContinuousTable {
        version: 1,
        settings: settings.clone(),
        skills: library.library.skills().len(),
        build_seconds: library.seconds,
        unguided: None,
        rows: Vec::new(),
    };
    for (done, (name, formula)) in MISSIONS.into_iter().enumerate() {
        let scenario = scenario(formula)?;
        let problem = problem_of(name, &scenario)?;
        let mut case = Case {
            name,
            formula,
            scenario: &scenario,
            problem: &problem,
            library: &library,
            settings,
        };
        table
            .rows
            .push(case.row("uniform", &Sampler::Uniform, &Sampler::Biased)?);
        match guided(&scenario, &problem, options) {
            Ok(sampler) => table.rows.push(case.row("guided", &sampler, &sampler)?),
            Err(why) => table.unguided = Some(why),
        }
        progress(done + 1);
    }
    Ok(table)
}

fn guided(scenario: &Scenario, problem: &Problem, options: &Options) -> Result<Sampler, String> {
    let prediction = predict(scenario, &problem.task, options).map_err(|e| e.to_string())?;
    let guide = Guide::new(&prediction.guidance, problem.task.nba.len());
    let guide = guide.map_err(|e| e.to_string())?;
    Ok(Sampler::Guided(Arc::new(guide)))
}

struct Case<'a> {
    name: &'static str,
    formula: &'static str,
    scenario: &'a Scenario,
    problem: &'a Problem,
    library: &'a GridLibrary,
    settings: &'a TransferBench,
}

impl Case<'_> {
    fn row(
        &mut self,
        label: &'static str,
        sampler: &Sampler,
        without: &Sampler,
    ) -> Result<ContinuousRow, TransferBenchError> {
        let library = &self.library.library;
        let mut graph = Vec::new();
        let mut with = Runs::default();
        let mut bare = Runs::default();
        for k in 0..self.settings.trials.max(1) {
            let settings = Settings {
                seed: self.settings.seed + k,
                iterations: u64::MAX,
                time_limit: Some(self.settings.anytime_seconds),
                ..Settings::default()
            };
            let stop = Stop::new();
            let found = transfer(
                self.problem,
                library,
                sampler,
                &settings,
                &stop,
                &mut |_| {},
            );
            let found = found.map_err(|e| not_found(self.name, "transfer planning", e))?;
            graph.push(found.reused.graph_seconds);
            with.take(self, &found.solution)?;
            let found = plan(self.problem, without, &settings, &stop, &mut |_| {});
            let found = found.map_err(|e| not_found(self.name, "the planner", e))?;
            bare.take(self, &found)?;
        }
        Ok(ContinuousRow {
            name: self.name,
            formula: self.formula,
            sampler: label,
            counts: count_subtasks(self.problem, library),
            graph: summary(&graph),
            first: summary(&with.first),
            cost: summary(&with.cost),
            anytime_cost: summary(&with.anytime),
            without: summary(&bare.first),
            without_cost: summary(&bare.cost),
            without_anytime_cost: summary(&bare.anytime),
        })
    }
}

#[derive(Default)]
struct Runs {
    first: Vec<f64>,
    cost: Vec<f64>,
    anytime: Vec<f64>,
}

impl Runs {
    fn take(
        &mut self,
        case: &Case<'_>,
        solution: &crate::planner::Solution,
    ) -> Result<(), TransferBenchError> {
        verified(case.name, case.scenario, &solution.path, &solution.cost)?;
        if let Some(first) = &solution.stats.first_plan {
            self.first.push(first.seconds);
            self.cost.push(first.cost);
        }
        self.anytime.push(solution.cost.total);
        Ok(())
    }
}
