//! The lower bound: below every verified plan of any planner on random missions, and close where it is
//! known how close it must be.
#![allow(clippy::print_stdout)] // tells how close the bounds were

use std::sync::Arc;

use nalgebra::Point2;
use nngtl::automaton::{Limits, Task};
use nngtl::dataset::maps::{Family, draw_map, draw_start};
use nngtl::dataset::missions::draw_pattern;
use nngtl::exact::{lower_bound, plan};
use nngtl::planner::{self, Problem, Sampler, Settings, Stop};
use nngtl::random::generator;
use nngtl::system::Continuous;
use nngtl::verify;
use nngtl::workspace::{Bounds, Polygon, Region, Workspace};

/// The bound must stay below plans that it was not told of: what it is given as a known cost is so
/// much higher.
const BLIND: f64 = 1.5;

fn missions() -> u64 {
    let scale = std::env::var("NNGTL_TEST_SCALE").ok();
    let scale: f64 = scale.and_then(|s| s.parse().ok()).unwrap_or(1.0);
    (18.0 * scale).max(1.0) as u64
}

#[test]
fn no_verified_plan_of_any_planner_is_below_the_bound() {
    let mut checked = 0;
    for seed in 0..missions() {
        let mut random = generator(seed, 79);
        let family = Family::ALL[seed as usize % Family::ALL.len()];
        let map = Arc::new(draw_map(family, &mut random).workspace().unwrap());
        let start = draw_start(&map, &mut random);
        let (_, formula) = draw_pattern(map.regions().len(), &mut random);
        let letters = Arc::clone(map.alphabet());
        let Ok(task) = Task::from_formula(&formula, letters, &Limits::default()) else {
            continue;
        };
        if task.nba.len() > 12 {
            continue; // slow without optimisation
        }
        let Ok(exact) = plan(&map, start, &task, 0.2) else {
            continue;
        };
        let lower = lower_bound(&map, start, &task, 0.2, BLIND * exact.cost.total);
        let mut costs = vec![("exact", exact.path, exact.cost)];
        let task = Arc::new(task);
        for sampler in [Sampler::Uniform, Sampler::Biased] {
            let system = Continuous::new(Arc::clone(&map), start).unwrap();
            let problem = Problem {
                start: system.start(),
                system: Arc::new(system),
                task: Arc::clone(&task),
                weight: 0.2,
            };
            let settings = Settings {
                iterations: 2_000,
                ..Settings::default()
            };
            let stop = Stop::new();
            if let Ok(s) = planner::plan(&problem, &sampler, &settings, &stop, &mut |_| {}) {
                costs.push((sampler.name(), s.path, s.cost));
            }
        }
        for (name, path, cost) in costs {
            verify::verify(&map, start, &formula, &path, 0.2, Some(&cost)).unwrap();
            let total = cost.total;
            assert!(
                lower <= total + 1e-9,
                "{seed} {name}: {lower} > {total} `{formula}`"
            );
            checked += 1;
        }
        println!(
            "{seed} {family} `{formula}`: {lower} ≤ {}",
            exact.cost.total
        );
    }
    assert!(checked >= missions(), "{checked}");
}

fn rectangle(x0: f64, y0: f64, x1: f64, y1: f64) -> Polygon {
    Polygon::rectangle(Point2::new(x0, y0), Point2::new(x1, y1)).unwrap()
}

/// The bound and the exact plan's cost on a map with a wall.
fn bounds(text: &str, weight: f64) -> (f64, f64) {
    let region = |name: &str, polygon| Region {
        name: name.to_owned(),
        polygon,
    };
    let regions = vec![
        region("a", rectangle(0.8, 0.1, 0.9, 0.2)),
        region("b", rectangle(0.1, 0.8, 0.2, 0.9)),
    ];
    let map = Workspace::new(Bounds::unit(), vec![rectangle(0.4, 0.0, 0.6, 0.7)], regions).unwrap();
    let letters = Arc::clone(map.alphabet());
    let task = Task::from_formula(&text.parse().unwrap(), letters, &Limits::default()).unwrap();
    let start = Point2::new(0.1, 0.1);
    let upper = plan(&map, start, &task, weight).unwrap().cost.total;
    (lower_bound(&map, start, &task, weight, upper), upper)
}

#[test]
fn bounds_are_close_on_small_missions() {
    for text in ["F a", "F b & G !a", "F (a & F b)", "(!a U b) & F a"] {
        let (lower, upper) = bounds(text, 0.5);
        assert!(
            lower <= upper && lower > 0.99 * upper,
            "{text}: {lower} {upper}"
        );
    }
    let (lower, upper) = bounds("G F a & G F b", 0.2);
    assert!(lower <= upper && lower > 0.9 * upper, "{lower} {upper}");
}
