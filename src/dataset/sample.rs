//! One map with its missions: drawn, planned by the expert, filtered.

use nalgebra::Point2;
use rand::RngExt;

use super::GenerateConfig;
use super::maps::{Family, draw_map, draw_start, round};
use super::missions::{Pattern, draw_pattern};
use super::record::{AutomatonRecord, Counts, MapRecord, MissionRecord, pair, region_order, to_millionth};
use crate::automaton::Task;
use crate::exact::{ExactConfig, ExactPlan, Infeasible, Roadmap};
use crate::ltl::Formula;
use crate::plan::Waypoint;
use crate::random::{Random, chance, generator, weighted};
use crate::workspace::Workspace;

/// Missions drawn on one map, per mission wanted, before the map is drawn anew.
const DRAWS: usize = 40;

/// A map's line, and what was dropped on the way.
pub(super) struct Sample {
    pub(super) record: MapRecord,
    pub(super) filtered: Counts,
}

/// Makes the sample with this index; it depends on the settings' seed and the index alone.
pub(super) fn draw_sample(config: &GenerateConfig, index: u64) -> Sample {
    let mut random = generator(config.seed, index);
    let weights = config.families.iter().map(|&(_, w)| w);
    let family = weighted(&mut random, weights).map_or(Family::Paper, |i| config.families[i].0);
    let mut filtered = Counts::new();
    loop {
        let map = draw_map(family, &mut random);
        let mut record = MapRecord::new(index, &map);
        let Ok(workspace) = map.workspace() else {
            drop_for(&mut filtered, "unsound map");
            continue;
        };
        let roadmap = Roadmap::new(&workspace, ExactConfig::default());
        let start = draw_start(&workspace, &mut random);
        if roadmap.reachable(start).len() < map.regions.len() {
            drop_for(&mut filtered, "map with unreachable regions");
            continue;
        }
        let draw = Draw {
            config,
            workspace: &workspace,
            roadmap: &roadmap,
        };
        for _ in 0..DRAWS * config.missions_per_map {
            match draw.mission(&record.missions, &mut random) {
                Ok(mission) => record.missions.push(mission),
                Err(reason) => drop_for(&mut filtered, reason),
            }
            if record.missions.len() == config.missions_per_map {
                return Sample { record, filtered };
            }
        }
        drop_for(&mut filtered, "map with too few missions");
    }
}

fn drop_for(filtered: &mut Counts, reason: &'static str) {
    *filtered.entry(reason.to_owned()).or_default() += 1;
}

/// What the missions of one map share.
struct Draw<'a> {
    config: &'a GenerateConfig,
    workspace: &'a Workspace,
    roadmap: &'a Roadmap<'a>,
}

impl Draw<'_> {
    /// Draws a mission, or says why it is not worth keeping.
    fn mission(
        &self,
        others: &[MissionRecord],
        random: &mut Random,
    ) -> Result<MissionRecord, &'static str> {
        let regions = self.workspace.regions().len();
        let (pattern, formula) = if chance(random, self.config.random_share) {
            (Pattern::Random, random_tree(regions, random))
        } else {
            draw_pattern(regions, random)
        };
        let start = draw_start(self.workspace, random);
        let text = formula.to_string();
        if others.iter().any(|m| m.formula == text) {
            return Err("repeated formula");
        }
        let order = region_order(&formula);
        if order.is_empty() {
            return Err("no region named");
        }
        let task = self.task(&formula)?;
        let plan = self.plan(start, &task)?;
        let (prefix, suffix) = self.rounded(&plan).ok_or("lost by rounding")?;
        let length = polyline(&prefix) + polyline(&suffix);
        if length < self.config.min_length {
            return Err("no motion needed");
        }
        let weight = self.config.weight;
        let cost = weight * polyline(&prefix) + (1.0 - weight) * polyline(&suffix);
        Ok(MissionRecord {
            start: pair(start),
            formula: text,
            pattern,
            automaton: AutomatonRecord::new(&task, &order),
            order,
            prefix: prefix.into_iter().map(pair).collect(),
            suffix: suffix.into_iter().map(pair).collect(),
            visited: plan.visited.iter().map(|q| q.0).collect(),
            cost: to_millionth(cost),
        })
    }

    fn task(&self, formula: &Formula) -> Result<Task, &'static str> {
        let task = Task::from_formula(formula, self.workspace.alphabet())
            .map_err(|_| "translation gave up")?;
        if task.feasible.is_empty() {
            return Err("unsatisfiable");
        }
        if task.nba.len() > self.config.max_states {
            return Err("too many states");
        }
        Ok(task)
    }

    fn plan(&self, start: Point2<f64>, task: &Task) -> Result<ExactPlan, &'static str> {
        let plan = self.roadmap.plan(start, task, self.config.weight);
        plan.map_err(|reason| match reason {
            Infeasible::Unsatisfiable => "unsatisfiable",
            Infeasible::Stutter => "no run without stuttering",
            Infeasible::Start { .. } => "start not free",
            Infeasible::NoPrefix => "no prefix on this map",
            Infeasible::NoSuffix => "no suffix on this map",
        })
    }

    /// The plan's points on the grid, if the word stays the same there.
    fn rounded(&self, plan: &ExactPlan) -> Option<(Vec<Point2<f64>>, Vec<Point2<f64>>)> {
        let on_grid = |waypoints: &[Waypoint]| {
            let mut points: Vec<Point2<f64>> = Vec::with_capacity(waypoints.len());
            for w in waypoints {
                let p = round(w.at);
                if self.workspace.letter_at(p)? != self.workspace.letter_at(w.at)? {
                    return None;
                }
                if points.last() != Some(&p) {
                    points.push(p);
                }
            }
            let steps = |w: &[Point2<f64>]| self.workspace.step(w[0], w[1]);
            points.windows(2).all(steps).then_some(points)
        };
        Some((on_grid(&plan.path.prefix)?, on_grid(&plan.path.suffix)?))
    }
}

fn random_tree(regions: usize, random: &mut Random) -> Formula {
    let names = random.random_range(1..=regions);
    let _ = names;
    unimplemented!()
}

fn polyline(points: &[Point2<f64>]) -> f64 {
    points.windows(2).map(|w| (w[1] - w[0]).norm()).sum()
}
