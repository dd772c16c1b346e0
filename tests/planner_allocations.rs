//! Growing trees allocates nothing once their buffers have grown: counted by an allocator of its own.

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

/// A mission in rooms: four walls with doors, clutter, and three regions, one of them to be avoided.
fn problem() -> Problem {
    let region = |name: &str, polygon| Region {
        name: name.to_owned(),
        polygon,
    };
    let regions = vec![
        region("a", rectangle(0.8, 0.1, 0.9, 0.2)),
        region("b", rectangle(0.1, 0.8, 0.2, 0.9)),
        region("c", rectangle(0.45, 0.45, 0.55, 0.55)),
    ];
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
    let map = Workspace::new(Bounds::unit(), obstacles, regions).unwrap();
    let system = Continuous::new(Arc::new(map), Point2::new(0.1, 0.15)).unwrap();
    let letters = Arc::clone(system.map().alphabet());
    let formula = "F (a & F b) & G !c".parse().unwrap();
    let task = Task::from_formula(&formula, letters, &Limits::default()).unwrap();
    Problem {
        start: system.start(),
        system: Arc::new(system),
        task: Arc::new(task),
        weight: 0.2,
    }
}

/// Allocations from one moment of a search to another.
fn allocations(problem: &Problem, sampler: &Sampler, from: u64, to: u64) -> u64 {
    let settings = Settings {
        iterations: to,
        shorten: false,
        ..Settings::default()
    };
    let mut before = None;
    let mut after = 0;
    let mut observe = |progress: nngtl::planner::Progress| {
        let now = COUNT.load(Ordering::Relaxed);
        if progress.iterations >= from {
            before.get_or_insert(now);
        }
        after = now;
    };
    plan(problem, sampler, &settings, &Stop::new(), &mut observe).unwrap();
    after - before.unwrap()
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

#[test]
fn iterations_allocate_nothing_but_doublings() {
    let problem = problem();
    let guided = Sampler::Guided(Arc::new(guide(&problem)));
    for sampler in [Sampler::Uniform, Sampler::Biased, guided] {
        // Arrays double a few times, and each better plan is written down once.
        let count = allocations(&problem, &sampler, 20_000, 50_000);
        assert!(
            count < 300,
            "{}: {count} in 30,000 iterations",
            sampler.name()
        );
    }
}
