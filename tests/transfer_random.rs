//! Random formulas on random grids: every transferred plan passes the independent checker, also with a
//! library whose map has changed, and costs converge to the optimum of the product.

// Shown when a test fails; the types stand where they are used once.
#![allow(clippy::print_stdout, clippy::type_complexity)]

use std::sync::Arc;

use nalgebra::Point2;
use nngtl::automaton::{Limits, Task};
use nngtl::ltl::Formula;
use nngtl::plan::{Cost, Path};
use nngtl::planner::{PlanError, Problem, Sampler, Settings, Stop};
use nngtl::random::{Random, chance, generator, unit};
use nngtl::scenario::GridSpec;
use nngtl::system::{Grid, TransitionSystem};
use nngtl::transfer::{BuildSampler, BuildSettings, Library, build, optimum, transfer};
use nngtl::verify::verify_on_grid;
use nngtl::workspace::{Bounds, Polygon, Region, Workspace};

/// Cells per side; coordinates are cell numbers.
const SIDE: u32 = 6;

const GRID: GridSpec = GridSpec {
    cells: [SIDE, SIDE],
    cell: 1.0,
};

fn below(random: &mut Random, n: u32) -> u32 {
    (unit(random) * f64::from(n)) as u32
}

fn cell(i: u32, j: u32) -> Polygon {
    let corner = |i, j| Point2::new(f64::from(i), f64::from(j));
    Polygon::rectangle(corner(i, j), corner(i + 1, j + 1)).unwrap()
}

/// Regions a, b, c of one cell each in different places, and a share of the other cells as obstacles.
/// `more` adds obstacles to the same map.
fn map(random: &mut Random, obstacles: f64) -> (Vec<(u32, u32)>, [(u32, u32); 3]) {
    let mut regions = Vec::new();
    while regions.len() < 3 {
        let at = (below(random, SIDE), below(random, SIDE));
        if at != (0, 0) && !regions.contains(&at) {
            regions.push(at);
        }
    }
    let mut blocked = Vec::new();
    for i in 0..SIDE {
        for j in 0..SIDE {
            let kept = (i, j) == (0, 0) || regions.contains(&(i, j));
            if !kept && chance(random, obstacles) {
                blocked.push((i, j));
            }
        }
    }
    (blocked, [regions[0], regions[1], regions[2]])
}

fn workspace(blocked: &[(u32, u32)], regions: &[(u32, u32); 3]) -> Arc<Workspace> {
    let bounds = Bounds {
        min: Point2::new(0.0, 0.0),
        max: Point2::new(f64::from(SIDE), f64::from(SIDE)),
    };
    let obstacles = blocked.iter().map(|&(i, j)| cell(i, j)).collect();
    let regions = ["a", "b", "c"].iter().zip(regions);
    let regions = regions.map(|(name, &(i, j))| Region {
        name: (*name).to_owned(),
        polygon: cell(i, j),
    });
    Arc::new(Workspace::new(bounds, obstacles, regions.collect()).unwrap())
}

fn grid(map: &Arc<Workspace>) -> Grid {
    Grid::new(
        Arc::clone(map),
        GRID.cells,
        GRID.cell,
        Point2::new(0.5, 0.5),
    )
    .unwrap()
}

/// A random formula with every operator that plans are made for, X included.
fn formula(random: &mut Random, depth: u32) -> Formula {
    let prop = |random: &mut Random| Formula::prop(["a", "b", "c"][below(random, 3) as usize]);
    if depth == 0 {
        return prop(random);
    }
    let kind = below(random, 12);
    let next = |random: &mut Random| formula(random, depth - 1);
    match kind {
        0 | 1 => next(random).and(next(random)),
        2 => next(random).or(next(random)),
        3 => prop(random).not(),
        4 | 5 => next(random).finally(),
        6 | 7 => next(random).finally().globally(),
        8 => prop(random).implies(next(random).next()).globally(),
        9 => prop(random).not().until(next(random)),
        10 => next(random).next(),
        _ => prop(random),
    }
}

fn problem(grid: Grid, task: Task, weight: f64) -> Problem {
    Problem {
        start: grid.start(),
        system: Arc::new(grid),
        task: Arc::new(task),
        weight,
    }
}

fn library(grid: &Grid) -> Library {
    let visit: Formula = "F a & F b & F c".parse().unwrap();
    let letters = Arc::clone(grid.alphabet());
    let task = Task::from_formula(&visit, letters, &Limits::default()).unwrap();
    let settings = BuildSettings {
        samples: 400,
        ..BuildSettings::default()
    };
    let built = build(
        grid,
        grid.start(),
        &task,
        &BuildSampler::Uniform,
        &settings,
        &Stop::new(),
        &mut |_| {},
    );
    built.unwrap().library
}

/// What one case did.
enum Outcome {
    /// No word satisfies the formula, or its automaton is large.
    Skipped,
    /// There is no plan, and none was found.
    NoPlan,
    /// The plan's cost and the optimum.
    Plan(f64, f64),
}

fn run(
    map: &Arc<Workspace>,
    formula: &Formula,
    library: &Library,
    weight: f64,
    iterations: u64,
    case: &str,
) -> Outcome {
    let grid = grid(map);
    let letters = Arc::clone(grid.alphabet());
    let limits = Limits {
        states: 200,
        ..Limits::default()
    };
    let Ok(task) = Task::from_formula(formula, letters, &limits) else {
        return Outcome::Skipped;
    };
    let problem = problem(grid, task, weight);
    let settings = Settings {
        iterations,
        ..Settings::default()
    };
    let found = transfer(
        &problem,
        library,
        &Sampler::Uniform,
        &settings,
        &Stop::new(),
        &mut |_| {},
    );
    let best = optimum(&problem);
    let check = |path: &Path, cost: &Cost| {
        verify_on_grid(
            map,
            GRID,
            problem.start.at,
            formula,
            path,
            weight,
            Some(cost),
        )
        .unwrap_or_else(|e| panic!("{case}: {formula}: {e}"))
    };
    if let Some((path, cost)) = &best {
        check(path, cost);
    }
    match (found, &best) {
        (Ok(found), Some((_, best))) => {
            let solution = &found.solution;
            check(&solution.path, &solution.cost);
            assert!(
                solution.cost.total >= best.total - 1e-9,
                "{case}: {formula}: {} beats the optimum {}",
                solution.cost.total,
                best.total
            );
            Outcome::Plan(solution.cost.total, best.total)
        }
        (Ok(_), None) => panic!("{case}: {formula}: a plan where exhaustive search finds none"),
        (Err(PlanError::NotFound(_)), None) => Outcome::NoPlan,
        (Err(PlanError::NotFound(_)), Some((_, best))) => {
            panic!(
                "{case}: {formula}: no plan, though one costs {}",
                best.total
            )
        }
        (Err(e), _) => panic!("{case}: {formula}: {e}"),
    }
}

#[test]
fn plans_verify_and_converge_to_the_optimum() {
    let (mut plans, mut optimal, mut none) = (0, 0, 0);
    for seed in 0..120 {
        let mut random = generator(seed, 0);
        let (blocked, regions) = map(&mut random, 0.15);
        let map = workspace(&blocked, &regions);
        let library = library(&grid(&map));
        let formula = formula(&mut random, 3);
        match run(
            &map,
            &formula,
            &library,
            0.5,
            3_000,
            &format!("case {seed}"),
        ) {
            Outcome::Plan(cost, best) => {
                plans += 1;
                if cost <= best * (1.0 + 1e-9) {
                    optimal += 1;
                } else {
                    println!("case {seed}: {formula}: {cost} above {best}");
                }
            }
            Outcome::NoPlan => none += 1,
            Outcome::Skipped => {}
        }
    }
    println!("{plans} plans, {optimal} of them optimal, {none} without a plan");
    assert!(plans >= 60, "only {plans} plans");
    assert!(none >= 1, "no infeasible case was drawn");
    assert_eq!(optimal, plans, "not all costs converged");
}

/// Where a part of the plan weighs nothing, it must be there all the same, and end where it should.
#[test]
fn the_optimum_is_one_at_every_weight() {
    let mut plans = 0;
    for seed in 2_000..2_150 {
        let mut random = generator(seed, 0);
        let (blocked, regions) = map(&mut random, 0.15);
        let map = workspace(&blocked, &regions);
        let weight = [0.0, 0.1, 0.8, 1.0][seed as usize % 4];
        let (library, formula) = (library(&grid(&map)), formula(&mut random, 3));
        let case = format!("case {seed}, weight {weight}");
        if let Outcome::Plan(..) = run(&map, &formula, &library, weight, 500, &case) {
            plans += 1;
        }
    }
    assert!(plans >= 60, "only {plans} plans");
}

#[test]
fn plans_with_the_library_of_a_map_that_changed_verify() {
    let mut plans = 0;
    for seed in 1_000..1_060 {
        let mut random = generator(seed, 0);
        let (mut blocked, regions) = map(&mut random, 0.1);
        let before = workspace(&blocked, &regions);
        let old = grid(&before);
        let file = library(&old).to_file(&old);
        for _ in 0..4 {
            let at = (below(&mut random, SIDE), below(&mut random, SIDE));
            if at != (0, 0) && !regions.contains(&at) {
                blocked.push(at);
            }
        }
        let after = workspace(&blocked, &regions);
        let new = grid(&after);
        let loaded = file.bind(&new);
        assert_eq!(
            loaded.library.skills().len() + loaded.dropped.len(),
            file.skills.len()
        );
        let formula = formula(&mut random, 3);
        let case = format!("case {seed}");
        if let Outcome::Plan(..) = run(&after, &formula, &loaded.library, 0.5, 600, &case) {
            plans += 1;
        }
    }
    assert!(plans >= 25, "only {plans} plans");
}
