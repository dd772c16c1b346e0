//! Table II: new obstacles on a plan's way, repair against planning anew.

use std::sync::Arc;
use std::time::Instant;

use nalgebra::Point2;
use rand::RngExt;
use serde::Serialize;

use super::super::stats::Summary;
use super::{
    GridLibrary, PAPER, PaperRow, TransferBench, TransferBenchError, grid_scenario, not_found,
    problem_of, summary, verified,
};
use crate::plan::Path;
use crate::planner::{Problem, Sampler, Settings, Stop, plan};
use crate::random::{Random, generator};
use crate::scenario::Scenario;
use crate::transfer::{Library, Replanned, optimum, replan, transfer};
use crate::workspace::{Polygon, Workspace};

/// One formula with one number of new obstacles.
#[derive(Clone, Debug, Serialize)]
pub struct ChangedRow {
    /// The paper's figures.
    pub paper: PaperRow,
    /// New obstacles.
    pub obstacles: usize,
    /// Environments that have a plan.
    pub environments: usize,
    /// Environments drawn in which no plan exists (by exhaustive search); left out.
    pub infeasible: usize,
    /// Runs that repaired the plan.
    pub repaired: usize,
    /// Runs that had to plan anew, since no repair was possible.
    pub anew: usize,
    /// Seconds from the changed map to a plan in it, without its verification: repair, and planning
    /// anew with the library where repair was not possible.
    pub seconds: Summary,
    /// Seconds to verify the plan.
    pub verify_seconds: Summary,
    /// J of the plan.
    pub cost: Summary,
    /// Seconds of the biased planner to its first plan in the changed environment.
    pub biased: Summary,
    /// J of that plan.
    pub biased_cost: Summary,
}

/// Table II, measured.
#[derive(Clone, Debug, Serialize)]
pub struct ChangedTable {
    /// The format's version.
    pub version: u32,
    /// How it was made.
    pub settings: TransferBench,
    /// One row for each formula and number of obstacles.
    pub rows: Vec<ChangedRow>,
}

/// Measures Table II; `progress` is called with the number of rows done, of 18.
///
/// # Errors
/// An environment that has a plan but got none, or a plan that does not verify.
pub fn changed_environments(
    library: &GridLibrary,
    settings: &TransferBench,
    progress: &mut dyn FnMut(usize),
) -> Result<ChangedTable, TransferBenchError> {
    let mut rows = Vec::new();
    for (number, paper) in PAPER.into_iter().enumerate() {
        let scenario = grid_scenario(Some(paper.formula))?;
        let problem = problem_of(paper.name, &scenario)?;
        let first = Settings {
            seed: settings.seed,
            first: true,
            ..Settings::default()
        };
        let library = &library.library;
        let original = transfer(
            &problem,
            library,
            &Sampler::Uniform,
            &first,
            &Stop::new(),
            &mut |_| {},
        );
        let original = original.map_err(|e| not_found(paper.name, "transfer planning", e))?;
        let case = Case {
            paper,
            scenario: &scenario,
            problem: &problem,
            original: &original.solution.path,
            library,
            settings,
        };
        for obstacles in 1..=3 {
            rows.push(case.row(obstacles, number as u64)?);
            progress(rows.len());
        }
    }
    Ok(ChangedTable {
        version: 1,
        settings: settings.clone(),
        rows,
    })
}

/// A formula with the plan that is to be repaired.
struct Case<'a> {
    paper: PaperRow,
    scenario: &'a Scenario,
    problem: &'a Problem,
    original: &'a Path,
    library: &'a Library,
    settings: &'a TransferBench,
}

/// What the runs of one row took.
#[derive(Default)]
struct Runs {
    repaired: usize,
    anew: usize,
    seconds: Vec<f64>,
    verify: Vec<f64>,
    cost: Vec<f64>,
    biased: Vec<f64>,
    biased_cost: Vec<f64>,
}

impl Case<'_> {
    fn row(&self, obstacles: usize, stream: u64) -> Result<ChangedRow, TransferBenchError> {
        let mut random = generator(self.settings.seed, 1 + 10 * stream + obstacles as u64);
        let mut runs = Runs::default();
        let (mut environments, mut infeasible) = (0, 0);
        while environments < self.settings.environments as usize {
            let Some(changed) = self.change(obstacles, &mut random) else {
                break;
            };
            let problem = problem_of(self.paper.name, &changed)?;
            if optimum(&problem).is_none() {
                infeasible += 1;
                continue;
            }
            environments += 1;
            for k in 0..self.settings.trials {
                self.run(&changed, &problem, k, &mut runs)?;
            }
        }
        Ok(ChangedRow {
            paper: self.paper,
            obstacles,
            environments,
            infeasible,
            repaired: runs.repaired,
            anew: runs.anew,
            seconds: summary(&runs.seconds),
            verify_seconds: summary(&runs.verify),
            cost: summary(&runs.cost),
            biased: summary(&runs.biased),
            biased_cost: summary(&runs.biased_cost),
        })
    }

    fn run(
        &self,
        changed: &Scenario,
        problem: &Problem,
        k: u64,
        runs: &mut Runs,
    ) -> Result<(), TransferBenchError> {
        let name = self.paper.name;
        let settings = Settings {
            seed: self.settings.seed + k,
            first: true,
            iterations: self.settings.biased_iterations,
            ..Settings::default()
        };
        let began = Instant::now();
        let (path, cost) = match replan(problem, self.original, &settings) {
            Replanned::Unchanged(repair) | Replanned::Repaired(repair) => {
                runs.repaired += 1;
                (repair.path, repair.cost)
            }
            Replanned::Hopeless(_) => {
                runs.anew += 1;
                let system = &*problem.system;
                let loaded = self.library.to_file(&*self.problem.system).bind(system);
                let uniform = Sampler::Uniform;
                let stop = Stop::new();
                let found = transfer(
                    problem,
                    &loaded.library,
                    &uniform,
                    &settings,
                    &stop,
                    &mut |_| {},
                );
                let found = found.map_err(|e| not_found(name, "planning anew", e))?;
                (found.solution.path, found.solution.cost)
            }
        };
        runs.seconds.push(began.elapsed().as_secs_f64());
        let began = Instant::now();
        verified(name, changed, &path, &cost)?;
        runs.verify.push(began.elapsed().as_secs_f64());
        runs.cost.push(cost.total);
        let found = plan(
            problem,
            &Sampler::Biased,
            &settings,
            &Stop::new(),
            &mut |_| {},
        );
        let found = found.map_err(|e| not_found(name, "the biased planner", e))?;
        verified(name, changed, &found.path, &found.cost)?;
        runs.biased.push(found.stats.seconds);
        runs.biased_cost.push(found.cost.total);
        Ok(())
    }

    /// The scenario with new obstacles, one cell each, on waypoints of the plan or between them; never
    /// on a region or where the robot stands.
    fn change(&self, obstacles: usize, random: &mut Random) -> Option<Scenario> {
        let grid = self.scenario.grid?;
        let map = &self.scenario.workspace;
        let mut cells = self.cells_on_the_way(grid.cell);
        if cells.len() < obstacles {
            return None;
        }
        let mut polygons = map.obstacles().to_vec();
        for _ in 0..obstacles {
            let centre = cells.swap_remove(random.random_range(0..cells.len()));
            let half = nalgebra::Vector2::repeat(grid.cell / 2.0);
            polygons.push(Polygon::rectangle(centre - half, centre + half).ok()?);
        }
        let workspace = Workspace::new(map.bounds(), polygons, map.regions().to_vec()).ok()?;
        Some(Scenario {
            workspace: Arc::new(workspace),
            ..self.scenario.clone()
        })
    }

    fn cells_on_the_way(&self, cell: f64) -> Vec<Point2<f64>> {
        let system = &*self.problem.system;
        let mut found: Vec<Point2<f64>> = Vec::new();
        for part in [&self.original.prefix, &self.original.suffix] {
            for leg in part.windows(2) {
                let along = leg[1].at - leg[0].at;
                let steps = (along.norm() / cell).round().max(1.0);
                for i in 0..=steps as usize {
                    let at = leg[0].at + along * (i as f64 / steps);
                    let Some(spot) = system.settle(at) else {
                        continue;
                    };
                    let free = system.alphabet().props(spot.letter).is_empty();
                    if free && spot.at != self.problem.start.at && !found.contains(&spot.at) {
                        found.push(spot.at);
                    }
                }
            }
        }
        found
    }
}
