//! Prefixes that cost more than suffixes: the round then begins early, and does what the prefix would have done.

mod made;

use made::{Edges, options, rectangles, scenario};
use nalgebra::Point2;
use nngtl::mission::{self, SamplerChoice};
use nngtl::scenario::Scenario;
use nngtl::workspace::Workspace;

fn map(side: f64, obstacles: &[Edges], regions: &[(&str, Edges)]) -> Workspace {
    rectangles(side, obstacles, regions).expect("the map is sound")
}

fn cost(scenario: &Scenario, sampler: SamplerChoice, seed: u64) -> f64 {
    let mut options = options(sampler, 3_000);
    options.settings.seed = seed;
    let planned = mission::plan(scenario, &options).expect("there is a plan");
    planned.verified.cost.total
}

fn compare(mut scenario: Scenario, weight: f64) {
    scenario.weight = weight;
    let best = cost(&scenario, SamplerChoice::Exact, 0);
    for seed in 0..4 {
        let cost = cost(&scenario, SamplerChoice::Directed, seed);
        assert!(cost < 1.02 * best, "seed {seed}: {cost}, exact {best}");
    }
}

/// The straight way back to the start leads through a region that is forbidden.
#[test]
fn a_round_by_the_start_leads_around_what_is_forbidden() {
    let regions = [
        ("a", [5.0, 8.0, 7.0, 9.0]),
        ("b", [4.0, 6.0, 5.0, 9.0]),
        ("c", [2.0, 9.0, 3.0, 11.0]),
    ];
    let map = map(12.0, &[], &regions);
    let task = "[]<> a && []<> c && [] !b";
    compare(scenario(map, Point2::new(1.661, 0.528), task), 0.9);
}

/// On the way there and back the robot passes `a` twice: the automaton must be back in its state at the start nevertheless.
#[test]
fn a_round_begins_at_the_start_where_the_automaton_can() {
    let obstacles = [[0.398, 0.075, 0.741, 0.377], [0.653, 0.357, 0.819, 0.662]];
    let regions = [
        ("a", [0.469, 0.429, 0.657, 0.685]),
        ("b", [0.315, 0.676, 0.7, 0.948]),
        ("c", [0.592, 0.148, 0.989, 0.457]),
    ];
    let map = map(1.0, &obstacles, &regions);
    let task = "G F a & G F b & G F c";
    compare(scenario(map, Point2::new(0.129, 0.594), task), 0.8);
}
