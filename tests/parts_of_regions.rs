//! Regions in parts: overlapping ones, and those that walls divide. Which part is visited decides what a plan costs.

mod made;

use made::{Edges, options, rectangles, scenario};
use nalgebra::Point2;
use nngtl::dataset::maps::draw_start;
use nngtl::mission::{self, MissionError, SamplerChoice};
use nngtl::random::{Random, generator};
use nngtl::scenario::Scenario;
use nngtl::workspace::Workspace;
use rand::RngExt;

fn map(obstacles: &[Edges], regions: &[(&str, Edges)]) -> Option<Workspace> {
    rectangles(1.0, obstacles, regions)
}

/// The cost of a plan, and how many samples there were before the first.
fn planned(scenario: &Scenario, sampler: SamplerChoice, iterations: u64, seed: u64) -> (f64, u64) {
    let mut options = options(sampler, iterations);
    options.settings.seed = seed;
    let planned = mission::plan(scenario, &options).expect("there is a plan");
    let first = planned.file.first;
    (
        planned.verified.cost.total,
        first.map_or(0, |f| f.iterations),
    )
}

/// A wall divides `b`: the part before it is near the start, that behind it near `a`.
#[test]
fn a_round_goes_to_the_part_of_a_region_that_is_near_the_others() {
    let obstacles = [
        [0.098, 0.675, 0.222, 0.78],
        [0.496, 0.449, 0.765, 0.747],
        [0.421, 0.117, 0.652, 0.303],
        [0.73, 0.703, 0.819, 0.974],
    ];
    let regions = [
        ("a", [0.111, 0.622, 0.438, 0.906]),
        ("b", [0.571, 0.501, 0.84, 0.864]),
        ("c", [0.301, 0.469, 0.598, 0.812]),
    ];
    let map = map(&obstacles, &regions).unwrap();
    let task = "G F a & G F b & F G !c";
    let scenario = scenario(map, Point2::new(0.974, 0.889), task);
    let (best, _) = planned(&scenario, SamplerChoice::Exact, 1, 0);
    for seed in 0..6 {
        let (cost, _) = planned(&scenario, SamplerChoice::Directed, 3_000, seed);
        assert!(cost < 1.02 * best, "seed {seed}: {cost}, exact {best}");
    }
}

/// The round between the far ends of two regions is half as long as that between the near ones.
#[test]
fn a_round_is_looked_for_at_the_far_end_of_a_region_too() {
    let obstacles = [
        [0.245, 0.305, 0.425, 0.538],
        [0.552, 0.359, 0.749, 0.443],
        [0.087, 0.136, 0.369, 0.444],
        [0.426, 0.47, 0.732, 0.794],
    ];
    let regions = [
        ("a", [0.098, 0.079, 0.485, 0.221]),
        ("b", [0.011, 0.317, 0.311, 0.675]),
    ];
    let map = map(&obstacles, &regions).unwrap();
    let scenario = scenario(map, Point2::new(0.696, 0.119), "G F a & G F b");
    let (best, _) = planned(&scenario, SamplerChoice::Exact, 1, 0);
    for seed in 0..6 {
        let (cost, _) = planned(&scenario, SamplerChoice::Directed, 10_000, seed);
        assert!(cost < 1.02 * best, "seed {seed}: {cost}, exact {best}");
    }
}

/// From `a` the straight way to `c` leads through where `a` and `b` overlap, which is forbidden.
#[test]
fn the_way_around_a_forbidden_overlap_is_found() {
    let obstacles = [
        [0.308, 0.385, 0.59, 0.543],
        [0.396, 0.133, 0.651, 0.351],
        [0.46, 0.744, 0.759, 0.894],
        [0.702, 0.071, 0.984, 0.224],
        [0.867, 0.507, 0.999, 0.711],
    ];
    let regions = [
        ("a", [0.5, 0.528, 0.765, 0.827]),
        ("b", [0.56, 0.43, 0.935, 0.776]),
        ("c", [0.553, 0.281, 0.767, 0.53]),
        ("d", [0.312, 0.04, 0.687, 0.412]),
    ];
    let map = map(&obstacles, &regions).unwrap();
    let task = "G F a & G F c & G !(a & b)";
    let scenario = scenario(map, Point2::new(0.033, 0.398), task);
    for seed in 0..6 {
        let (_, first) = planned(&scenario, SamplerChoice::Directed, 1_000, seed);
        assert!(first < 300, "seed {seed}: the first after {first}");
    }
}

fn rectangle(random: &mut Random, least: f64, most: f64) -> Edges {
    let [w, h] = std::array::from_fn(|_| random.random_range(least..most));
    let [x, y] = [w, h].map(|side| random.random_range(0.0..1.0 - side));
    [x, y, x + w, y + h]
}

/// Patrols, sequences and prohibitions on maps whose regions overlap: sampling comes close to the exact planner.
#[test]
fn random_overlapping_regions_are_planned_well() {
    let tasks = [
        "G F a & G F b & G F c",
        "F (a & F b) & F c",
        "G F a & G F c & G !(a & b)",
        "G F a & G F b & F G !c",
        "G F (a & !b) & G F c",
        "F a & F b & (!c U a)",
        "F (a & b) & F c",
    ];
    let (mut gaps, mut without) = (Vec::new(), 0);
    for k in 0..70 {
        let mut random = generator(11, k);
        let count = random.random_range(2..6);
        let obstacles: Vec<Edges> = (0..count)
            .map(|_| rectangle(&mut random, 0.08, 0.3))
            .collect();
        let regions = ["a", "b", "c"].map(|name| (name, rectangle(&mut random, 0.1, 0.4)));
        let Some(map) = map(&obstacles, &regions) else {
            continue;
        };
        let start = draw_start(&map, &mut random);
        let scenario = scenario(map, start, tasks[k as usize % tasks.len()]);
        match mission::plan(&scenario, &options(SamplerChoice::Exact, 1)) {
            Ok(exact) => {
                let (cost, _) = planned(&scenario, SamplerChoice::Directed, 4_000, 0);
                let best = exact.verified.cost.total;
                gaps.push((cost - best) / best.max(1e-3));
            }
            Err(MissionError::Plan(_)) => panic!("{}: the exact planner gave up", scenario.task),
            Err(_) => without += 1, // no way, which is told before any search
        }
    }
    assert!(
        gaps.len() >= 40,
        "{} missions, {without} without",
        gaps.len()
    );
    let far = gaps.iter().filter(|gap| **gap > 0.02).count();
    assert!(
        20 * far <= gaps.len(),
        "{far} of {} are far: {gaps:?}",
        gaps.len()
    );
}
