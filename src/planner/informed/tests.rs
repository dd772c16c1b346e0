//! Bounds against plans that were found without them.

use super::*;
use crate::automaton::{Limits, Task};
use crate::dataset::maps::{Family, draw_map, draw_start};
use crate::dataset::missions::draw_pattern;
use crate::plan::{Path, Waypoint, length};
use crate::planner::tests::run;
use crate::planner::{Problem, Sampler, Settings};
use crate::random::generator;
use crate::system::Continuous;

/// A random mission, if it has an automaton.
fn mission(seed: u64) -> Option<Problem> {
    let mut random = generator(seed, 31);
    let family = Family::ALL[seed as usize % Family::ALL.len()];
    let map = draw_map(family, &mut random).workspace().ok()?;
    let start = draw_start(&map, &mut random);
    let (_, formula) = draw_pattern(map.regions().len(), &mut random);
    let letters = Arc::clone(map.alphabet());
    let task = Task::from_formula(&formula, letters, &Limits::default()).ok()?;
    let system = Continuous::new(Arc::new(map), start).ok()?;
    let weight = [0.2, 0.5, 0.8][seed as usize % 3];
    Some(Problem {
        start: system.start(),
        system: Arc::new(system),
        task: Arc::new(task),
        weight,
    })
}

/// A plan of a search that knows no bounds.
fn uninformed(problem: &Problem) -> Option<Path> {
    let settings = Settings {
        iterations: 300,
        informed: false,
        ..Settings::default()
    };
    let found = run(problem, &Sampler::Directed, &settings);
    found.ok().map(|solution| solution.path)
}

/// Checks that no bound on a way is above what lies before and behind each of its points. Returns what is left from the first at least, as
/// a share of the whole.
fn check(informed: Informed, states: usize, way: &[Waypoint], slack: f64) -> f64 {
    let whole = length(way);
    let mut outlook = Outlook::new(states);
    outlook.inform(informed);
    for (i, w) in way.iter().enumerate() {
        let left = outlook.left_from(w.at, w.state);
        let behind = length(&way[i..]);
        assert!(left <= behind + slack, "{left} left of {behind}");
        let seen = outlook.look(w.at, whole + slack);
        assert!(seen, "{w:?} is on a way of {whole}");
        let seen = outlook.left(w.state);
        assert!(
            (seen - left).abs() <= 1e-9 * whole.max(1.0),
            "{seen} {left}"
        );
        assert!(outlook.least() <= seen);
    }
    outlook.left_from(way[0].at, way[0].state) / whole
}

#[test]
fn no_bound_is_above_what_plans_cost() {
    let (mut plans, mut loops, mut tight) = (0, 0, 0);
    for seed in 0..240 {
        let Some(problem) = mission(seed) else {
            continue;
        };
        let Some(path) = uninformed(&problem) else {
            continue;
        };
        let Task { nba, feasible, .. } = &*problem.task;
        let map = problem.system.plane().expect("a plane");
        let relaxed = Relaxed::of(map, nba, feasible).map(Arc::new);
        let relaxed = relaxed.expect("a small automaton");
        let slack = 1e-6 * map.bounds().side();
        // Up to the first accepting state that the suffix comes back to.
        let is_goal = |w: &&Waypoint| feasible.binary_search(&w.state).is_ok();
        let suffix = &path.suffix;
        let Some(pivot) = suffix.iter().position(|w| is_goal(&w)) else {
            continue;
        };
        let mut way = path.prefix.clone();
        way.extend_from_slice(&suffix[1.min(pivot)..=pivot]);
        let roots = (Some(problem.start.at), &*nba.initial);
        let informed = Informed::new(&relaxed, nba, roots, (None, feasible));
        tight += usize::from(check(informed, nba.len(), &way, slack) > 0.7);
        plans += 1;
        if suffix.len() > 1 {
            let count = suffix.len() - 1;
            let mut cycle: Vec<Waypoint> =
                (0..count).map(|k| suffix[(pivot + k) % count]).collect();
            cycle.push(cycle[0]);
            let round = length(&cycle);
            assert!(relaxed.least_cycle() <= round + slack);
            tight += usize::from(relaxed.least_cycle() > 0.7 * round);
            let end = [cycle[0].state];
            let ends = (Some(cycle[0].at), &end[..]);
            let informed = Informed::new(&relaxed, nba, ends, ends);
            check(informed, nba.len(), &cycle, slack);
            loops += 1;
        }
    }
    // Enough of them, and bounds that say something.
    assert!(plans > 150 && loops > 40 && tight > 100);
}
