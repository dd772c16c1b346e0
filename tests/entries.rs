//! Where a suffix is entered: anywhere on it, wherever prefix and suffix together cost least, for every
//! planner alike.

use std::sync::Arc;

use nalgebra::Point2;
use nngtl::automaton::{Limits, Task};
use nngtl::dataset::maps::{Family, draw_map, draw_start};
use nngtl::dataset::missions::draw_pattern;
use nngtl::exact::{self, lower_bound, quick_bound};
use nngtl::ltl::Formula;
use nngtl::plan::{Cost, Path};
use nngtl::planner::{self, Problem, Sampler, Settings, Stop};
use nngtl::random::generator;
use nngtl::system::{Continuous, Grid};
use nngtl::transfer::optimum;
use nngtl::verify;
use nngtl::workspace::{Bounds, Polygon, Region, Workspace};

fn p(x: f64, y: f64) -> Point2<f64> {
    Point2::new(x, y)
}

fn map(bounds: Bounds, regions: &[(&str, [f64; 4])]) -> Arc<Workspace> {
    let region = |&(name, [x0, y0, x1, y1]): &(&str, [f64; 4])| Region {
        name: name.to_owned(),
        polygon: Polygon::rectangle(p(x0, y0), p(x1, y1)).unwrap(),
    };
    let regions = regions.iter().map(region).collect();
    Arc::new(Workspace::new(bounds, Vec::new(), regions).unwrap())
}

fn problem(map: &Arc<Workspace>, start: Point2<f64>, formula: &Formula, weight: f64) -> Problem {
    let letters = Arc::clone(map.alphabet());
    let task = Task::from_formula(formula, letters, &Limits::default()).unwrap();
    let system = Continuous::new(Arc::clone(map), start).unwrap();
    Problem {
        start: system.start(),
        system: Arc::new(system),
        task: Arc::new(task),
        weight,
    }
}

fn sampled(problem: &Problem, sampler: &Sampler, settings: &Settings) -> Option<(Path, Cost)> {
    let found = planner::plan(problem, sampler, settings, &Stop::new(), &mut |_| {});
    found.ok().map(|s| (s.path, s.cost))
}

/// The plans of the exact planner and of TL-RRT*, verified.
fn plans(map: &Arc<Workspace>, start: Point2<f64>, text: &str, weight: f64) -> Vec<(Path, Cost)> {
    let formula: Formula = text.parse().unwrap();
    let problem = problem(map, start, &formula, weight);
    let plan = exact::plan(map, start, &problem.task, weight).unwrap();
    let settings = Settings {
        iterations: 3_000,
        ..Settings::default()
    };
    let mut all = vec![(plan.path, plan.cost)];
    for sampler in [Sampler::Uniform, Sampler::Biased] {
        all.push(sampled(&problem, &sampler, &settings).unwrap());
    }
    for (path, cost) in &all {
        verify::verify(map, start, &formula, path, weight, Some(cost)).unwrap();
    }
    all
}

const FACING: [(&str, [f64; 4]); 2] = [("a", [0.0, 0.1, 0.1, 0.9]), ("b", [0.9, 0.1, 1.0, 0.9])];

#[test]
fn a_patrol_that_passes_the_start_has_no_prefix() {
    let map = map(Bounds::unit(), &FACING);
    for (path, cost) in plans(&map, p(0.5, 0.5), "GF a & GF b", 0.2) {
        // To and fro between the borders; entered at a region it would cost 0.2 · 0.4 more.
        assert!(cost.prefix < 1e-4, "{cost:?}");
        assert!((cost.suffix - 1.6).abs() < 1e-4, "{cost:?}");
        assert!(cost.total < 0.8 * 1.6 + 1e-4);
        assert!(path.suffix.len() > 2);
    }
}

#[test]
fn beside_the_start_a_suffix_leans_over_to_where_the_legs_balance() {
    // Two corners of regions far apart, the start h below the middle of the way between them. Entered at distance d
    // from that way, a plan costs λ(h − d) + (1 − λ)·4·√(1/4·w² + d²) as long as the robot comes back the way
    // it went, or with one of the two ways leant over half of that: the least is found by hand below.
    let map = map(
        Bounds::unit(),
        &[("a", [0.0, 0.7, 0.05, 0.8]), ("b", [0.95, 0.7, 1.0, 0.8])],
    );
    let (h, w, weight) = (0.4, 0.9, 0.2);
    let cost = |d: f64| {
        let leaning = (w * w / 4.0 + d * d).sqrt();
        weight * (h - d) + (1.0 - weight) * (w + 2.0 * leaning)
    };
    let best = (0..=4_000).map(|k| cost(f64::from(k) * 1e-4));
    let best = best.fold(f64::INFINITY, f64::min);
    let straight = cost(0.0);
    let at_a_region = 0.2 * (w * w / 4.0 + h * h).sqrt() + 0.8 * 2.0 * w;
    assert!(best < straight && straight < at_a_region);
    for (_, cost) in plans(&map, p(0.5, 0.7 - h), "GF a & GF b", weight) {
        let gap = (cost.total - best) / best;
        assert!(gap.abs() < 2e-3, "{cost:?} {best}");
    }
}

#[test]
fn what_must_be_done_first_is_done_before_the_suffix_is_entered() {
    let regions = [FACING[0], FACING[1], ("c", [0.45, 0.0, 0.55, 0.1])];
    let map = map(Bounds::unit(), &regions);
    for (path, cost) in plans(&map, p(0.5, 0.5), "GF a & GF b & F c", 0.2) {
        // Down to c, and from there to the way between a and b, which is as long anywhere.
        let seen = path.prefix.iter().any(|w| w.at.y < 0.1);
        assert!(seen || path.suffix.iter().any(|w| w.at.y < 0.1), "{path:?}");
        assert!(cost.total <= 0.8 * 1.6 + 0.2 * 0.41, "{cost:?}");
    }
    // Never again once it was left: c may be on no suffix.
    for (path, _) in plans(&map, p(0.5, 0.5), "F c & F G !c & GF a & GF b", 0.2) {
        assert!(path.prefix.iter().any(|w| w.at.y < 0.1));
        assert!(path.suffix.iter().all(|w| w.at.y >= 0.1));
    }
}

#[test]
fn a_robot_that_can_stay_stays() {
    let map = map(Bounds::unit(), &FACING);
    for (path, cost) in plans(&map, p(0.5, 0.5), "F (a & F b)", 0.2) {
        assert_eq!(path.suffix.len(), 1);
        assert_eq!(cost.suffix, 0.0);
        assert!((cost.prefix - 1.2).abs() < 1e-3, "{cost:?}");
    }
}

#[test]
fn along_a_corridor_the_exact_plan_is_that_of_the_grid() {
    // One row of cells: the robot can only go to and fro, and a grid differs by the halves of the cells in
    // which it turns.
    let bounds = Bounds {
        min: p(0.0, 0.0),
        max: p(2.0, 0.1),
    };
    let cells = [("a", [0.5, 0.0, 0.6, 0.1]), ("b", [1.4, 0.0, 1.5, 0.1])];
    let map = map(bounds, &cells);
    let formula: Formula = "GF a & GF b".parse().unwrap();
    for (start, prefix) in [(0.15, 0.4), (0.95, 0.0), (1.85, 0.4)] {
        for weight in [0.2, 0.5] {
            let start = p(start, 0.05);
            let plane = problem(&map, start, &formula, weight);
            let plan = exact::plan(&map, start, &plane.task, weight).unwrap();
            let grid = Grid::new(Arc::clone(&map), [20, 1], 0.1, start).unwrap();
            let on_grid = Problem {
                start: grid.start(),
                system: Arc::new(grid),
                ..plane
            };
            let (_, cost) = optimum(&on_grid).unwrap();
            assert!((cost.prefix - prefix).abs() < 1e-9, "{cost:?}");
            let turn = if prefix > 0.0 { 0.05 } else { 0.0 };
            assert!((plan.cost.prefix - turn - cost.prefix).abs() < 1e-4);
            assert!((plan.cost.suffix + 0.2 - cost.suffix).abs() < 1e-4);
        }
    }
}

fn missions() -> u64 {
    let scale = std::env::var("NNGTL_TEST_SCALE").ok();
    let scale: f64 = scale.and_then(|s| s.parse().ok()).unwrap_or(1.0);
    (32.0 * scale).max(1.0) as u64
}

/// How much cheaper than the exact planner's a plan may be: refinement ends in a local optimum.
const SLACK: f64 = 5e-3;

#[test]
fn no_planner_is_cheaper_than_the_exact_one_and_that_not_below_the_bound() {
    let mut moving = 0;
    for seed in 0..missions() {
        let mut random = generator(seed, 81);
        let family = Family::ALL[seed as usize % Family::ALL.len()];
        let map = Arc::new(draw_map(family, &mut random).workspace().unwrap());
        let start = draw_start(&map, &mut random);
        let (_, formula) = draw_pattern(map.regions().len(), &mut random);
        let weight = [0.2, 0.5, 0.8][seed as usize / 4 % 3];
        let letters = Arc::clone(map.alphabet());
        let Ok(task) = Task::from_formula(&formula, letters, &Limits::default()) else {
            continue;
        };
        let Ok(plan) = exact::plan(&map, start, &task, weight) else {
            continue;
        };
        let total = plan.cost.total;
        moving += u64::from(plan.path.suffix.len() > 1);
        verify::verify(&map, start, &formula, &plan.path, weight, Some(&plan.cost)).unwrap();
        let small = task.nba.len() <= 12; // slow without optimisation
        let quick = quick_bound(&map, start, &task, weight, 1.5 * total);
        let refined =
            (small && seed % 4 == 0).then(|| lower_bound(&map, start, &task, weight, 1.1 * total));
        for lower in std::iter::once(quick).chain(refined) {
            assert!(
                lower <= total + 1e-9,
                "{seed}: {lower} > {total} `{formula}`"
            );
        }
        let problem = problem(&map, start, &formula, weight);
        let settings = Settings {
            iterations: 1_500,
            ..Settings::default()
        };
        for sampler in [Sampler::Uniform, Sampler::Biased] {
            let Some((path, cost)) = sampled(&problem, &sampler, &settings) else {
                continue;
            };
            verify::verify(&map, start, &formula, &path, weight, Some(&cost)).unwrap();
            assert!(
                total <= cost.total * (1.0 + SLACK),
                "{seed} {}: {total} > {} `{formula}`",
                sampler.name(),
                cost.total
            );
        }
    }
    assert!(moving >= missions() / 8, "{moving}");
}
