//! What every plan costs at least: below all plans that the checker accepts, of any planner and made for any weight.
#![allow(clippy::print_stdout)] // tells how close the bounds were

mod made;

use made::{corridor, options, scenario};
use nalgebra::Point2;
use nngtl::dataset::maps::{Family, draw_map, draw_start};
use nngtl::dataset::missions::draw_pattern;
use nngtl::exact::{Halt, least_cost};
use nngtl::mission::{self, SamplerChoice};
use nngtl::plan::Cost;
use nngtl::random::generator;
use nngtl::scenario::Scenario;

const WEIGHTS: [f64; 7] = [0.0, 0.2, 0.35, 0.5, 0.65, 0.9, 1.0];

fn missions() -> u64 {
    let scale = std::env::var("NNGTL_TEST_SCALE").ok();
    let scale: f64 = scale.and_then(|s| s.parse().ok()).unwrap_or(1.0);
    (24.0 * scale).max(1.0) as u64
}

fn shipped(name: &str) -> Scenario {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios");
    Scenario::load(folder.join(name)).unwrap()
}

fn least(scenario: &Scenario, weight: f64) -> Option<f64> {
    let task = mission::task(scenario).ok()?;
    let (map, start) = (&scenario.workspace, scenario.start);
    least_cost(map, start, &task, weight, Halt::NEVER)
}

/// The prefixes and suffixes of plans made for several weights by several planners.
fn plans(scenario: &Scenario) -> Vec<Cost> {
    let mut found = Vec::new();
    for weight in WEIGHTS {
        let mut scenario = scenario.clone();
        scenario.weight = weight;
        for sampler in [SamplerChoice::Exact, SamplerChoice::Directed] {
            if let Ok(planned) = mission::plan(&scenario, &options(sampler, 150)) {
                found.push(planned.verified.cost);
            }
        }
    }
    found
}

/// Compares the bounds of all weights with all plans; how close the bound of the default weight was.
fn check(scenario: &Scenario) -> Option<f64> {
    let plans = plans(scenario);
    for weight in WEIGHTS {
        let least = least(scenario, weight)?;
        for cost in &plans {
            let total = Cost::new(cost.prefix, cost.suffix, weight).total;
            assert!(
                least <= total * (1.0 + 1e-9),
                "{} at {weight}: {least} is not below {total}",
                scenario.task
            );
        }
    }
    let totals = plans
        .iter()
        .map(|c| Cost::new(c.prefix, c.suffix, 0.2).total);
    let best = totals.fold(f64::INFINITY, f64::min);
    (best.is_finite() && best > 0.0).then(|| least(scenario, 0.2).unwrap_or(0.0) / best)
}

#[test]
fn no_accepted_plan_is_below_the_bound() {
    let mut shares = Vec::new();
    for seed in 0..missions() {
        let mut random = generator(seed, 91);
        let family = Family::ALL[seed as usize % Family::ALL.len()];
        let map = draw_map(family, &mut random).workspace().unwrap();
        let start = draw_start(&map, &mut random);
        let (_, formula) = draw_pattern(map.regions().len(), &mut random);
        let scenario = scenario(map, start, &formula.to_string());
        if mission::task(&scenario).is_ok_and(|task| task.nba.len() <= 12) {
            shares.extend(check(&scenario));
        }
    }
    shares.sort_by(f64::total_cmp);
    println!("bound ÷ best plan: {shares:.2?}");
    assert!(shares.len() as u64 >= missions() / 2);
    assert!(shares[shares.len() / 2] > 0.8, "{shares:?}");
}

#[test]
fn loops_that_close_before_the_automaton_does_are_not_below_it() {
    for name in ["campus.toml", "overlap.toml", "patrol.toml"] {
        check(&shipped(name));
    }
    for task in [
        "G F a & G F b",
        "G F (a & F b) & (!b U a)",
        "G F (a & F (b & F c)) & (!b U a) & (!c U b)",
        "F (a & F (b & F (a & F b)))",
    ] {
        check(&scenario(corridor(), Point2::new(0.5, 0.5), task));
    }
}

/// In a corridor all that matters is how far the robot has to go.
#[test]
fn the_bound_is_the_optimum_where_nothing_is_left_open() {
    for (task, weight, optimum) in [
        ("F c", 0.2, 0.2 * 8.5),
        ("G F a & G F b", 0.2, 0.2 * 1.0 + 0.8 * 7.0),
        ("G F a & G F b", 0.9, 0.1 * 9.0),
    ] {
        let scenario = scenario(corridor(), Point2::new(0.5, 0.5), task);
        let found = least(&scenario, weight).unwrap();
        assert!(
            found <= optimum + 1e-9 && found > 0.97 * optimum,
            "{task}: {found}, {optimum}"
        );
    }
}
