//! The speed of TL-RRT*: iterations a second by the size of the tree, of the map and of the automaton,
//! what an iteration spends its time on, and a plain reach-avoid mission as other planners solve it.
//!
//! `cargo bench --bench planner [-- PART…]` runs the parts named (`mission`, `tree`, `obstacles`,
//! `automaton`, `split`), all of them by default. Timed is the search alone; maps, automata and roadmaps
//! are made before. One seed, one thread. Ratios are between lines of one run.

#![allow(clippy::print_stdout)] // a report is what this program is for

use std::sync::Arc;
use std::time::Instant;

use nalgebra::Point2;
use nngtl::alphabet::Alphabet;
use nngtl::automaton::{Limits, Nba, StateId, Task, Transition};
use nngtl::planner::{
    First, Improvement, PlanError, Problem, Progress, Sampler, Settings, Solution, Stats, Stop,
    plan, profile,
};
use nngtl::system::Continuous;
use nngtl::workspace::{Bounds, Polygon, Region, Workspace};

fn point(x: f64, y: f64) -> Point2<f64> {
    Point2::new(x, y)
}

fn rectangle(x0: f64, y0: f64, x1: f64, y1: f64) -> Polygon {
    Polygon::rectangle(point(x0, y0), point(x1, y1)).expect("a rectangle with area")
}

fn region(name: &str, polygon: Polygon) -> Region {
    Region {
        name: name.to_owned(),
        polygon,
    }
}

/// What a unit of the prefix costs. From more than one half on a plan may rather go on in circles than end at its goal, and of such circles
/// nothing can be left out.
const WEIGHT: f64 = 0.5;

fn problem(map: Workspace, start: Point2<f64>, task: impl Fn(&Arc<Alphabet>) -> Task) -> Problem {
    let system = Continuous::new(Arc::new(map), start).expect("the start is free");
    let task = task(system.map().alphabet());
    Problem {
        start: system.start(),
        system: Arc::new(system),
        task: Arc::new(task),
        weight: WEIGHT,
    }
}

fn translated(text: &'static str) -> impl Fn(&Arc<Alphabet>) -> Task {
    move |letters| {
        let formula = text.parse().expect("the formula is sound");
        Task::from_formula(&formula, Arc::clone(letters), &Limits::default())
            .expect("the formula has an automaton")
    }
}

/// Runs of which the fastest counts.
const REPEATS: usize = 5;

/// Half the side of the mission's goal region: what its point may lie off the target.
const GOAL: f64 = 5e-5;

/// The length of the shortest path to the goal region's centre: along two obstacle corners.
fn optimum() -> f64 {
    2.0 * (0.35_f64.powi(2) + 0.25_f64.powi(2)).sqrt() + 0.2
}

/// From (0.05, 0.95) to a tiny region around (0.95, 0.95) in the unit square with two obstacles.
fn reach_avoid() -> Problem {
    let goal = rectangle(0.95 - GOAL, 0.95 - GOAL, 0.95 + GOAL, 0.95 + GOAL);
    let obstacles = vec![rectangle(0.3, 0.0, 0.7, 0.2), rectangle(0.4, 0.7, 0.6, 1.0)];
    let map = Workspace::new(Bounds::unit(), obstacles, vec![region("goal", goal)]);
    problem(
        map.expect("the map is sound"),
        point(0.05, 0.95),
        translated("F goal"),
    )
}

/// RRT* by its radius rule: γ = √(2·(1 + 1/2))·√(μ / π) (S. Karaman, E. Frazzoli, IJRR 2011, theorem 38)
/// with μ = 1, the area of the map, and a tenth more, as OMPL's RRT* has it.
fn by_radius() -> Settings {
    Settings {
        range: Some(0.25),
        radius: 1.1 * (3.0 / std::f64::consts::PI).sqrt(),
        neighbours: 1e6,
        ..Settings::default()
    }
}

/// RRT* by its k-nearest rule.
fn by_count() -> Settings {
    Settings {
        range: Some(0.25),
        radius: 1e6,
        max_radius: 2.0,
        ..Settings::default()
    }
}

/// Searches, whether or not a plan is found.
fn search(problem: &Problem, sampler: &Sampler, settings: &Settings) -> (Stats, Option<Solution>) {
    match plan(problem, sampler, settings, &Stop::new(), &mut |_| {}) {
        Ok(found) => (found.stats.clone(), Some(found)),
        Err(PlanError::NotFound(why)) => (why.stats, None),
        Err(other) => panic!("{other}"),
    }
}

/// Iterations that added a vertex, a second.
fn rate(stats: &Stats) -> f64 {
    (stats.iterations - stats.failed_samples) as f64 / stats.seconds
}

/// The best cost after so many seconds.
fn cost_after(improvements: &[Improvement], seconds: f64) -> Option<f64> {
    let known = improvements.iter().take_while(|i| i.seconds <= seconds);
    known.last().map(|i| i.cost)
}

/// How the points of the mission are drawn: what a line of its table is named, and what of the settings it changes.
struct Drawing {
    name: &'static str,
    sampler: Sampler,
    /// Probability that a point is drawn towards the goal.
    towards: f64,
    /// Of these, the share on the shortest way itself.
    on_the_way: f64,
    informed: bool,
}

impl Drawing {
    fn settings(&self, rule: &Settings) -> Settings {
        Settings {
            y_rand: self.towards,
            p_target: self.on_the_way,
            informed: self.informed,
            ..rule.clone()
        }
    }
}

/// The drawings that are compared. `one in 20` draws uniform points and one in twenty towards the goal, as OMPL's RRT* does by default, whose
/// goal bias is 0.05: its speed, its first path and its lengths are those of one configuration.
fn drawings() -> [Drawing; 5] {
    let usual = Settings::default();
    let one_in_20 = |name, informed| Drawing {
        name,
        sampler: Sampler::Directed,
        towards: 0.05,
        on_the_way: usual.p_target,
        informed,
    };
    [
        Drawing {
            name: "uniform",
            sampler: Sampler::Uniform,
            towards: 0.0,
            on_the_way: 0.0,
            informed: true,
        },
        Drawing {
            name: "biased",
            sampler: Sampler::Biased,
            towards: usual.y_rand,
            on_the_way: usual.p_target,
            informed: true,
        },
        Drawing {
            name: "biased, half of it on the way",
            sampler: Sampler::Biased,
            towards: 0.95,
            on_the_way: 0.5,
            informed: true,
        },
        one_in_20("directed, one in 20", true),
        one_in_20("directed, one in 20, uninformed", false),
    ]
}

/// The median of the first plans of several seeds, by time; none where no seed has one in a hundredth of a second
/// (uniform points rarely meet so small a goal).
fn first_plans(problem: &Problem, sampler: &Sampler, settings: &Settings) -> Option<First> {
    let first = |seed| {
        let settings = Settings {
            seed,
            time_limit: Some(0.01),
            ..settings.clone()
        };
        search(problem, sampler, &settings).0.first_plan
    };
    let mut all: Vec<First> = (0..21).filter_map(first).collect();
    all.sort_by(|a, b| a.seconds.total_cmp(&b.seconds));
    all.get(10).copied()
}

fn mission() {
    let problem = reach_avoid();
    println!(
        "reach-avoid mission, optimum {:.6}; first path: median of 21 seeds; lengths and plans of seed 0",
        optimum()
    );
    println!(
        "| sampler | near | vertices | added a second | first path ms (iterations) | length first | 0.01 s | 0.1 s | 1 s |"
    );
    println!("| --- | --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: |");
    for drawing in &drawings() {
        let sampler = &drawing.sampler;
        for (rule, settings) in [("radius", by_radius()), ("k-nearest", by_count())] {
            let settings = drawing.settings(&settings);
            let growth = Settings {
                iterations: 14_700,
                ..settings.clone()
            };
            let runs = (0..REPEATS).map(|_| search(&problem, sampler, &growth).0);
            let grown = runs.max_by(|a, b| rate(a).total_cmp(&rate(b)));
            let grown = grown.expect("at least one run");
            let timed = Settings {
                iterations: u64::MAX,
                time_limit: Some(1.0),
                ..settings
            };
            let (stats, found) = search(&problem, sampler, &timed);
            let length = |s| {
                let cost = cost_after(&stats.improvements, s);
                cost.map_or("–".to_owned(), |c| format!("{:.5}", c / WEIGHT))
            };
            let first = first_plans(&problem, sampler, &timed);
            if let Some(found) = found {
                assert!(found.cost.total / WEIGHT > optimum() - 3.0 * GOAL);
            }
            println!(
                "| {} | {rule} | {} | {:.0} | {} | {} | {} | {} | {} |",
                drawing.name,
                grown.sites,
                rate(&grown),
                first.map_or("–".to_owned(), |f| format!(
                    "{:.3} ({})",
                    1e3 * f.seconds,
                    f.iterations
                )),
                stats
                    .first_plan
                    .map_or("–".to_owned(), |f| format!("{:.5}", f.cost / WEIGHT)),
                length(0.01),
                length(0.1),
                length(1.0),
            );
        }
    }
}

/// Sizes of the tree, in iterations, that the cost of an iteration is told at.
const SIZES: [u64; 8] = [1_000, 2_000, 4_000, 8_000, 16_000, 32_000, 64_000, 100_000];

/// Iterations that are timed together: few, so that other programs on the machine leave many of the
/// timings alone.
const WINDOW: u64 = 64;

/// Runs that the cost of an iteration is taken from.
const RUNS: usize = 12;

/// For each size the microseconds of an iteration while the tree grew the last fifth to it: the mean of its
/// windows, and the least. All runs do the same work, so what counts of a window is the fastest of its runs: that
/// leaves out other programs, and keeps what is seldom done, as when arrays grow or the index is put in order.
fn growth(problem: &Problem) -> Vec<[f64; 2]> {
    let windows = (SIZES[SIZES.len() - 1] / WINDOW + 1) as usize;
    let mut fastest = vec![f64::INFINITY; windows];
    for _ in 0..RUNS {
        let settings = Settings {
            iterations: SIZES[SIZES.len() - 1] + WINDOW,
            ..by_count()
        };
        let mut last = (0, Instant::now());
        let mut observe = |progress: Progress| {
            if !progress.iterations.is_multiple_of(WINDOW) {
                return;
            }
            let now = Instant::now();
            let (from, began) = std::mem::replace(&mut last, (progress.iterations, now));
            let each = 1e6 * (now - began).as_secs_f64() / WINDOW as f64;
            if let Some(least) = fastest.get_mut((from / WINDOW) as usize) {
                *least = least.min(each);
            }
        };
        // Uniform points do not meet so small a goal.
        let _ = plan(
            problem,
            &Sampler::Uniform,
            &settings,
            &Stop::new(),
            &mut observe,
        );
    }
    let cost = |size: &u64| {
        let part = &fastest[(size * 4).div_ceil(5 * WINDOW) as usize..(size / WINDOW) as usize];
        let least = part.iter().copied().fold(f64::INFINITY, f64::min);
        [part.iter().sum::<f64>() / part.len() as f64, least]
    };
    SIZES.iter().map(cost).collect()
}

fn tree() {
    println!(
        "\nan iteration by the size of the tree (uniform sampler, k-nearest rule; windows of {WINDOW} iterations, of each the fastest of {RUNS} runs)"
    );
    println!("| iterations | µs, mean | µs, fastest | against the first line | ln n |");
    println!("| ---: | ---: | ---: | ---: | ---: |");
    let all = growth(&reach_avoid());
    for (size, [mean, least]) in SIZES.iter().zip(&all) {
        println!(
            "| {size} | {mean:.2} | {least:.2} | {:.2}, {:.2} | {:.2} |",
            mean / all[0][0],
            least / all[0][1],
            (*size as f64).ln() / (SIZES[0] as f64).ln(),
        );
    }
}

/// A square lattice of small obstacles.
fn lattice(count: usize) -> Problem {
    let row = (count as f64).sqrt().round() as usize;
    let cell = 1.0 / row as f64;
    let obstacles = (0..row * row)
        .map(|k| {
            let (x, y) = ((k % row) as f64 * cell, (k / row) as f64 * cell);
            rectangle(
                x + 0.3 * cell,
                y + 0.3 * cell,
                x + 0.7 * cell,
                y + 0.7 * cell,
            )
        })
        .collect();
    let side = 0.1 * cell;
    let goal = region("goal", rectangle(1.0 - side, 1.0 - side, 1.0, 1.0));
    let map = Workspace::new(Bounds::unit(), obstacles, vec![goal]).expect("the map is sound");
    problem(map, point(0.1 * cell, 0.1 * cell), translated("F goal"))
}

fn obstacles() {
    println!("\niterations a second by the number of obstacles (20,000 iterations)");
    println!(
        "| polygons | sampler | vertices | added a second | µs an iteration | against the first line |"
    );
    println!("| ---: | --- | ---: | ---: | ---: | ---: |");
    let mut first = None;
    for count in [1, 100, 1_024, 10_000] {
        let problem = lattice(count);
        for sampler in [Sampler::Uniform, Sampler::Biased] {
            let settings = Settings {
                iterations: 20_000,
                range: Some(0.25),
                ..Settings::default()
            };
            let (stats, _) = search(&problem, &sampler, &settings);
            let each = 1e6 * stats.seconds / stats.iterations as f64;
            let base = *first.get_or_insert(each);
            println!(
                "| {count} | {} | {} | {:.0} | {each:.2} | {:.2} |",
                sampler.name(),
                stats.sites,
                rate(&stats),
                each / base,
            );
        }
    }
}

/// A cycle of states that is walked by visiting two regions in turn: every state of an automaton of
/// any size can be reached.
fn counter(letters: &Arc<Alphabet>, states: u32) -> Task {
    let row = |q: u32| {
        let name = if q.is_multiple_of(2) { "a" } else { "b" };
        let there = letters.letters_with(letters.proposition(name).expect("a region"));
        let mut row = vec![
            Transition {
                target: StateId(q),
                guard: there.complement(),
            },
            Transition {
                target: StateId((q + 1) % states),
                guard: there,
            },
        ];
        row.sort_by_key(|t| t.target);
        row
    };
    let nba = Nba {
        alphabet: Arc::clone(letters),
        initial: vec![StateId(0)],
        accepting: (0..states).map(|q| q == states - 1).collect(),
        transitions: (0..states).map(row).collect(),
    };
    Task::from_nba(nba).expect("the automaton accepts something")
}

fn automaton() {
    println!("\niterations a second by the number of automaton states (20,000 iterations)");
    println!(
        "| states | sampler | vertices | product states | iterations a second | µs each | added product states a second |"
    );
    println!("| ---: | --- | ---: | ---: | ---: | ---: | ---: |");
    for states in [2, 10, 50, 200] {
        let regions = vec![
            region("a", rectangle(0.05, 0.4, 0.35, 0.9)),
            region("b", rectangle(0.65, 0.1, 0.95, 0.6)),
        ];
        let map = Workspace::new(Bounds::unit(), vec![], regions).expect("the map is sound");
        let problem = problem(map, point(0.5, 0.5), |letters| counter(letters, states));
        for sampler in [Sampler::Uniform, Sampler::Biased] {
            let settings = Settings {
                iterations: 20_000,
                ..Settings::default()
            };
            let (stats, _) = search(&problem, &sampler, &settings);
            println!(
                "| {states} | {} | {} | {} | {:.0} | {:.2} | {:.0} |",
                sampler.name(),
                stats.sites,
                stats.nodes,
                stats.iterations as f64 / stats.seconds,
                1e6 * stats.seconds / stats.iterations as f64,
                stats.nodes as f64 / stats.seconds,
            );
        }
    }
}

fn split() {
    println!(
        "\nwhat an iteration spends its time on (30,000 iterations; reading the clock included)"
    );
    let problem = reach_avoid();
    for sampler in [Sampler::Uniform, Sampler::Biased] {
        let settings = Settings {
            iterations: 30_000,
            ..by_count()
        };
        let split = profile(&problem, &sampler, &settings).expect("the settings are sound");
        let parts = split.parts();
        let total: f64 = parts.iter().map(|p| p.1).sum();
        print!("{}: {:.2} µs", sampler.name(), 1e6 * total / 30_000.0);
        for (name, seconds) in parts {
            print!(", {name} {:.0} %", 100.0 * seconds / total);
        }
        println!();
    }
}

fn main() {
    let wanted: Vec<String> = std::env::args()
        .skip(1)
        .filter(|a| !a.starts_with('-'))
        .collect();
    let parts: [(&str, fn()); 5] = [
        ("mission", mission),
        ("tree", tree),
        ("obstacles", obstacles),
        ("automaton", automaton),
        ("split", split),
    ];
    let began = Instant::now();
    for (name, part) in parts {
        if wanted.is_empty() || wanted.iter().any(|w| w == name) {
            part();
        }
    }
    println!("\n{:.1} s in all", began.elapsed().as_secs_f64());
}
