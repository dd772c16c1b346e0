//! One map with its missions: drawn, planned by the expert, filtered.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::Point2;
use rand::RngExt;

use super::maps::{Family, draw_map, draw_start, round};
use super::missions::{Pattern, draw_pattern, draw_tree};
use super::record::{
    AutomatonRecord, Counts, MapRecord, MissionRecord, pair, rounded, to_millionth,
};
use super::{Expert, FormulaList, GenerateConfig};
use crate::automaton::{Limits, Task, TaskError, TranslateError};
use crate::encoding::region_order;
use crate::exact::{ExactConfig, Infeasible, Roadmap};
use crate::ltl::Formula;
use crate::plan::{Path, Waypoint, length};
use crate::planner::{self, PlanError, Problem, Sampler, Settings, Stop};
use crate::random::{Random, chance, choose, generator, weighted};
use crate::system::{Continuous, MapLayout, TransitionSystem, Ways};
use crate::verify::verify;
use crate::workspace::Workspace;

/// Missions drawn on one map, per mission wanted, before the map is drawn anew.
const DRAWS: usize = 40;

/// So many maps are given up one after the other before a sample is.
const MAPS: u64 = 100;

/// Why there is no sample.
pub(super) enum NoSample {
    /// It was told to stop.
    Stopped,
    /// Nothing fits what was asked for.
    Barren(Barren),
}

/// What was asked for allows too few missions, or none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "no map in {maps} has room for the missions that were asked for (dropped: {}): allow other formulas, more families, fewer steps or fewer missions on a map",
    listed(filtered)
)]
pub struct Barren {
    /// How many maps were drawn one after the other.
    pub maps: u64,
    /// How many maps and missions were dropped, by reason.
    pub filtered: Counts,
}

fn listed(counts: &Counts) -> String {
    let texts = counts.iter().map(|(reason, n)| format!("{n} {reason}"));
    texts.collect::<Vec<_>>().join(", ")
}

/// A map's line, and what was dropped on the way.
pub(super) struct Sample {
    pub(super) record: MapRecord,
    pub(super) filtered: Counts,
}

/// Makes the sample with this index; it depends on the settings' seed and the index alone. An
/// order to stop is looked for before each map and mission that is drawn.
pub(super) fn draw_sample(
    config: &GenerateConfig,
    index: u64,
    stop: &AtomicBool,
) -> Result<Sample, NoSample> {
    let mut random = generator(config.seed, index);
    let weights = config.families.iter().map(|&(_, w)| w);
    let family = weighted(&mut random, weights).map_or(Family::Paper, |i| config.families[i].0);
    let mut filtered = Counts::new();
    for _ in 0..MAPS {
        if stop.load(Ordering::Relaxed) {
            return Err(NoSample::Stopped);
        }
        let map = draw_map(family, &mut random);
        let mut record = MapRecord::new(index, &map);
        let Ok(workspace) = map.workspace().map(Arc::new) else {
            drop_for(&mut filtered, "unsound map");
            continue;
        };
        // Labels are rounded: their points keep away from borders.
        let usual = ExactConfig::default();
        let exact = ExactConfig {
            refined_inset: usual.inset,
            ..usual
        };
        let roadmap = Roadmap::new(&workspace, exact);
        let start = draw_start(&workspace, &mut random);
        if roadmap.reachable(start).len() < map.regions.len() {
            drop_for(&mut filtered, "map with unreachable regions");
            continue;
        }
        let Ok(system) = Continuous::new(Arc::clone(&workspace), start).map(Arc::new) else {
            drop_for(&mut filtered, "unsound map");
            continue;
        };
        let regions: Vec<Option<usize>> = (0..map.regions.len()).map(Some).collect();
        let ways = Ways::new(&*system, start, &regions);
        if (0..regions.len()).any(|k| ways.from(k).iter().any(|l| !l.is_finite())) {
            drop_for(&mut filtered, "map with unreachable regions");
            continue;
        }
        record.ways = (0..regions.len())
            .map(|k| rounded(&ways.from(k)[..=k]))
            .collect();
        let draw = Draw {
            config,
            system: &system,
            workspace: &workspace,
            roadmap: &roadmap,
        };
        let mut tree = chance(&mut random, config.random_share);
        for _ in 0..DRAWS * config.missions_per_map {
            if stop.load(Ordering::Relaxed) {
                return Err(NoSample::Stopped);
            }
            match draw.mission(tree, &record.missions, &mut random) {
                Ok(mission) => {
                    record.missions.push(mission);
                    // Random trees are dropped more often than patterns: the kind is drawn anew
                    // only after one was kept, so that shares are shares of what is written.
                    tree = chance(&mut random, config.random_share);
                }
                Err(reason) => drop_for(&mut filtered, reason),
            }
            if record.missions.len() == config.missions_per_map {
                return Ok(Sample { record, filtered });
            }
        }
        drop_for(&mut filtered, "map with too few missions");
    }
    Err(NoSample::Barren(Barren {
        maps: MAPS,
        filtered,
    }))
}

fn drop_for(filtered: &mut Counts, reason: &'static str) {
    *filtered.entry(reason.to_owned()).or_default() += 1;
}

/// What the missions of one map share.
struct Draw<'a> {
    config: &'a GenerateConfig,
    system: &'a Arc<Continuous>,
    workspace: &'a Workspace,
    roadmap: &'a Roadmap<'a>,
}

impl Draw<'_> {
    /// Draws a mission, or says why it is not worth keeping.
    fn mission(
        &self,
        tree: bool,
        others: &[MissionRecord],
        random: &mut Random,
    ) -> Result<MissionRecord, &'static str> {
        let regions = self.workspace.regions().len();
        let given = self.config.formulas.as_ref().map(FormulaList::formulas);
        let (pattern, formula) = match given.and_then(|given| choose(random, given)) {
            _ if !tree => draw_pattern(regions, random),
            Some(given) => (Pattern::Given, given.clone()),
            None => (Pattern::Random, draw_tree(regions, random)),
        };
        let start = draw_start(self.workspace, random);
        let text = formula.to_string();
        if others.iter().any(|m| m.formula == text) {
            return Err("repeated formula");
        }
        let alphabet = self.workspace.alphabet();
        let named = region_order(&formula).into_iter();
        let order: Vec<usize> = named.filter_map(|n| alphabet.proposition(n)).collect();
        if order.is_empty() {
            return Err("no region named");
        }
        let task = self.task(&formula, start)?;
        let pairs = task
            .feasible
            .iter()
            .flat_map(|&f| task.nba.initial.iter().map(move |&q| (q, f)));
        let steps = pairs
            .map(|(initial, accepting)| task.distances.to_go(initial, accepting))
            .min();
        if steps.is_none_or(|steps| steps < self.config.min_steps) {
            return Err("too few steps");
        }
        let plan = match self.config.expert {
            Expert::Exact => self.plan(start, &task)?,
            Expert::TlRrtStar { iterations } => self.sampled(start, &task, iterations, random)?,
        };
        let path = self.rounded(&plan).ok_or("lost by rounding")?;
        if length(&path.prefix) + length(&path.suffix) < self.config.min_length {
            return Err("no motion needed");
        }
        let weight = self.config.weight;
        let checked = verify(self.workspace, start, &formula, &path, weight, None);
        let cost = checked.map_err(|_| "refused by the checker")?.cost.total;
        let points = |part: &[Waypoint]| part.iter().map(|w| pair(w.at)).collect();
        let regions: Vec<Option<usize>> = (0..regions).map(Some).collect();
        let ways = Ways::from_start(&**self.system, start, &regions);
        if ways.iter().any(|l| !l.is_finite()) {
            return Err("start apart from regions");
        }
        Ok(MissionRecord {
            start: pair(start),
            ways: rounded(&ways),
            formula: text,
            pattern,
            automaton: AutomatonRecord::new(&task, &order).map_err(|_| "region without letters")?,
            order,
            prefix: points(&path.prefix),
            suffix: points(&path.suffix),
            visited: plan.states().iter().map(|q| q.0).collect(),
            cost: to_millionth(cost),
        })
    }

    fn task(&self, formula: &Formula, start: Point2<f64>) -> Result<Task, &'static str> {
        let places = MapLayout::of(self.system, start);
        let task = translate(formula, self.workspace, &places).map_err(|error| match error {
            TaskError::Translate(TranslateError::UnknownProposition { .. }) => {
                "regions that the map does not have"
            }
            TaskError::Translate(_) => "translation too large",
            _ => "unsatisfiable",
        })?;
        if task.feasible.is_empty() {
            return Err("unsatisfiable");
        }
        if task.nba.len() > self.config.max_states {
            return Err("too many states");
        }
        Ok(task)
    }

    fn plan(&self, start: Point2<f64>, task: &Task) -> Result<Path, &'static str> {
        let plan = self.roadmap.plan(start, task, self.config.weight);
        plan.map(|plan| plan.path).map_err(|reason| match reason {
            Infeasible::Unsatisfiable => "unsatisfiable",
            Infeasible::Stutter => "no run without stuttering",
            Infeasible::Start { .. } => "start not free",
            Infeasible::NoPrefix => "no prefix on this map",
            Infeasible::NoSuffix => "no suffix on this map",
            Infeasible::Halted => "search ended",
        })
    }

    /// The paper's expert (`nngtl.md`, IV-D).
    fn sampled(
        &self,
        start: Point2<f64>,
        task: &Task,
        iterations: u64,
        random: &mut Random,
    ) -> Result<Path, &'static str> {
        let settings = Settings {
            iterations,
            seed: random.random(),
            y_rand: 0.8,
            shorten: false,
            ..Settings::default()
        };
        let system: Arc<dyn TransitionSystem> = Arc::clone(self.system) as _;
        let problem = Problem {
            start: system.settle(start).ok_or("start not free")?,
            system,
            task: Arc::new(task.clone()),
            weight: self.config.weight,
        };
        let (stop, mut unobserved) = (Stop::new(), |_| {});
        match planner::plan(
            &problem,
            &Sampler::Biased,
            &settings,
            &stop,
            &mut unobserved,
        ) {
            Ok(solution) => Ok(solution.path),
            Err(PlanError::Unreachable(_)) => Err("unreachable on this map"),
            Err(_) => Err("no plan within the expert's iterations"),
        }
    }

    /// The plan with its points on the grid, without waits, if the word stays the same there.
    fn rounded(&self, plan: &Path) -> Option<Path> {
        let on_grid = |waypoints: &[Waypoint]| {
            let mut points: Vec<Waypoint> = Vec::with_capacity(waypoints.len());
            for w in waypoints {
                let at = round(w.at);
                if self.workspace.letter_at(at)? != self.workspace.letter_at(w.at)? {
                    return None;
                }
                if points.last().is_none_or(|last| last.at != at) {
                    points.push(Waypoint { at, ..*w });
                }
            }
            let steps = |w: &[Waypoint]| self.workspace.step(w[0].at, w[1].at);
            points.windows(2).all(steps).then_some(points)
        };
        Some(Path {
            prefix: on_grid(&plan.prefix)?,
            suffix: on_grid(&plan.suffix)?,
        })
    }
}

/// Translates with limits that are far above what is kept, and without a clock: the data set must
/// not depend on the machine's speed.
pub(super) fn translate(
    formula: &Formula,
    workspace: &Workspace,
    places: &MapLayout,
) -> Result<Task, TaskError> {
    let limits = Limits {
        states: 2_000,
        transitions: 50_000,
        time: None,
    };
    Task::on_map(formula, workspace.alphabet().clone(), &limits, places)
}
