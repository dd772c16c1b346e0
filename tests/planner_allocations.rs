//! Growing trees allocates nothing once their buffers have grown: counted by an allocator of its own.

#![allow(clippy::print_stdout)] // tells what was counted

mod counting;

use std::sync::Arc;
use std::sync::atomic::Ordering;

use counting::COUNT;
use nalgebra::Point2;
use nngtl::automaton::{Limits, Task};
use nngtl::guidance::{Guidance, Heatmap};
use nngtl::planner::{Guide, Problem, Sampler, Settings, Stop, plan};
use nngtl::system::Continuous;
use nngtl::workspace::{Bounds, Polygon, Region, Workspace};

fn rectangle(x0: f64, y0: f64, x1: f64, y1: f64) -> Polygon {
    Polygon::rectangle(Point2::new(x0, y0), Point2::new(x1, y1)).unwrap()
}

/// A mission in rooms: four walls with doors, clutter, and `regions` small regions.
fn problem(regions: usize, task: &str) -> Problem {
    let region = |i: usize| {
        let (x, y) = ((i % 3) as f64 * 0.35 + 0.12, (i / 3) as f64 * 0.35 + 0.11);
        Region {
            name: ["a", "b", "c", "d", "e", "f", "g"][i].to_owned(),
            polygon: rectangle(x, y, x + 0.08, y + 0.08),
        }
    };
    let mut obstacles = vec![
        rectangle(0.3, 0.0, 0.33, 0.7),
        rectangle(0.6, 0.3, 0.63, 1.0),
        rectangle(0.33, 0.6, 0.5, 0.63),
        rectangle(0.0, 0.65, 0.2, 0.68),
    ];
    for i in 0..25_u32 {
        let (x, y) = (f64::from(i % 5) * 0.2 + 0.03, f64::from(i / 5) * 0.2 + 0.03);
        obstacles.push(rectangle(x, y, x + 0.03, y + 0.02));
    }
    let regions = (0..regions).map(region).collect();
    let map = Workspace::new(Bounds::unit(), obstacles, regions).unwrap();
    let system = Continuous::new(Arc::new(map), Point2::new(0.1, 0.15)).unwrap();
    let letters = Arc::clone(system.map().alphabet());
    let formula = task.parse().unwrap();
    let task = Task::from_formula(&formula, letters, &Limits::default()).unwrap();
    Problem {
        start: system.start(),
        system: Arc::new(system),
        task: Arc::new(task),
        weight: 0.2,
    }
}

/// What a search did between the moments.
struct Found {
    allocations: [u64; 2],
    suffix_trees: u64,
    /// How often it found a cheaper plan.
    cheaper: [u64; 2],
}

/// Counts the allocations of a search between the moments, in iterations.
fn search(problem: &Problem, sampler: &Sampler, moments: [u64; 3]) -> Found {
    let settings = Settings {
        iterations: moments[2],
        ..Settings::default()
    };
    let mut counts = [0; 3];
    let mut observe = |progress: nngtl::planner::Progress| {
        let now = COUNT.load(Ordering::Relaxed);
        for (count, &moment) in counts.iter_mut().zip(&moments) {
            // The last observation comes before the last iterations.
            if progress.iterations <= moment {
                *count = now;
            }
        }
    };
    let found = plan(problem, sampler, &settings, &Stop::new(), &mut observe).unwrap();
    let [first, second, third] = counts;
    Found {
        allocations: [second - first, third - second],
        suffix_trees: found.stats.suffix_trees,
        cheaper: [0, 1].map(|k| {
            let times = found.stats.improvements.iter().map(|i| i.iterations);
            times
                .filter(|i| (moments[k]..moments[k + 1]).contains(i))
                .count() as u64
        }),
    }
}

/// Networks that favour the diagonal.
fn guide(problem: &Problem) -> Guide {
    let side = 200;
    let cell = |k: usize| {
        if (k / side).abs_diff(k % side) < 40 {
            0.9
        } else {
            0.1
        }
    };
    let states = problem.task.nba.len();
    let guidance = Guidance {
        heatmap: Heatmap {
            side,
            values: (0..side * side).map(cell).collect(),
        },
        states: vec![0.5; states],
    };
    Guide::new(&guidance, states).unwrap()
}

/// What grows with a tree: sites, nodes and their lists, the spatial index, buffers. While the tree doubles each
/// array doubles about once.
const DOUBLINGS: u64 = 64;

/// A cheaper plan is kept, and others like it are looked for, with visits in other orders and around other sides of obstacles.
const PLAN: u64 = 2_000;

/// Paths that cost little more than the best plan are shortened once each, and again when they have got notably cheaper: each takes some rows
/// of points. One allocation in so many iterations is left to that.
const SHORTENED: u64 = 50;

/// A mission, when to count, and how many further lists its tree keeps: of nodes by state, and by state and target (the middle
/// of a region that is still to be seen, three of six on average, or one of its four corners), which double, and of letters
/// that may be passed, by state and target; and of what follows and precedes each pair of letter and state, which informed search finds out once.
struct Case {
    name: &'static str,
    regions: usize,
    task: &'static str,
    moments: [u64; 3],
    lists: u64,
}

#[test]
fn iterations_allocate_nothing_but_doublings() {
    let cases = [
        Case {
            name: "stays at its goal",
            regions: 3,
            task: "F (a & F b) & G !c",
            moments: [10_000, 20_000, 40_000],
            lists: 0,
        },
        Case {
            name: "patrols",
            regions: 3,
            task: "GF a & GF b & G !c",
            moments: [10_000, 20_000, 40_000],
            lists: 0,
        },
        Case {
            name: "has 64 states",
            regions: 6,
            task: "F a & F b & F c & F d & F e & F f",
            moments: [2_000, 4_000, 8_000],
            lists: 64 * (1 + 3 * (1 + 4) + 6) + 2 * 6 * 64,
        },
    ];
    for case in cases {
        let problem = problem(case.regions, case.task);
        let guided = Sampler::Guided(Arc::new(guide(&problem)));
        for sampler in [Sampler::Uniform, Sampler::Biased, Sampler::Directed, guided] {
            // From each moment to the next the tree doubles: were anything allocated in proportion to the
            // iterations, it would be thousands, and the second count twice the first.
            let found = search(&problem, &sampler, case.moments);
            let (counts, trees, cheaper) = (found.allocations, found.suffix_trees, found.cheaper);
            let name = format!("{}, {}", case.name, sampler.name());
            println!("{name}: {counts:?}, {trees} suffix trees, {cheaper:?} plans");
            let passed = case.moments.windows(2).map(|m| m[1] - m[0]);
            // Most of the lists are begun before the second moment.
            let lists = [case.lists, case.lists / 4];
            for (((count, cheaper), passed), lists) in
                counts.into_iter().zip(cheaper).zip(passed).zip(lists)
            {
                let most = (1 + trees) * DOUBLINGS + lists + passed / SHORTENED;
                assert!(count <= most + cheaper * PLAN, "{name}: {counts:?}");
            }
        }
    }
}
