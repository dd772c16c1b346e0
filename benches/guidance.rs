//! What guidance costs and what it saves: the first plan of the same missions by biased search and
//! by guided search with inference included, on every device that is here.
//!
//! Timed: encoding, inference (the device is open, the weights are loaded) and search until the
//! first plan, over the same ten seeds. Not timed: reading the scenario, translation, loading
//! weights, opening the device, verification. Every plan is verified before anything is timed.
#![allow(clippy::print_stderr)] // tells which device is left out

use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use nngtl::automaton::Task;
use nngtl::mission::{self, Question};
use nngtl::nn::{DeviceChoice, Predictor};
use nngtl::planner::{Guide, Problem, Sampler, Settings, Solution, Stop, plan};
use nngtl::scenario::Scenario;
use nngtl::system::Continuous;
use nngtl::verify;

const SCENARIOS: [&str; 3] = ["case-study", "tl-rrt-star", "delivery"];
const SEEDS: u64 = 10;

fn problem(scenario: &Scenario, task: &Task) -> Problem {
    let system = Continuous::new(Arc::clone(&scenario.workspace), scenario.start)
        .expect("the start is free");
    Problem {
        start: system.start(),
        system: Arc::new(system),
        task: Arc::new(task.clone()),
        weight: scenario.weight,
    }
}

fn first_plan(problem: &Problem, sampler: &Sampler, seed: u64) -> Solution {
    let settings = Settings {
        seed,
        first: true,
        ..Settings::default()
    };
    plan(problem, sampler, &settings, &Stop::new(), &mut |_| {}).expect("there is a plan")
}

fn guided(predictor: &mut Predictor, scenario: &Scenario, problem: &Problem) -> Sampler {
    let question = Question {
        map: &scenario.workspace,
        system: &*problem.system,
        start: problem.start,
        task: &problem.task,
    };
    let prediction =
        mission::predict_with(predictor, question).expect("the networks fit the mission");
    let states = problem.task.nba.len();
    let guide = Guide::new(&prediction.guidance, states).expect("one probability per state");
    Sampler::Guided(Arc::new(guide))
}

/// Checks the plan of every seed.
fn check(scenario: &Scenario, problem: &Problem, sampler: &Sampler) {
    for seed in 0..SEEDS {
        let found = first_plan(problem, sampler, seed);
        verify::verify(
            &scenario.workspace,
            scenario.start,
            &scenario.formula,
            &found.path,
            scenario.weight,
            Some(&found.cost),
        )
        .expect("the plan passes the checker");
    }
}

fn guidance(c: &mut Criterion) {
    for name in SCENARIOS {
        let scenario = Scenario::load(format!("scenarios/{name}.toml")).expect("it is shipped");
        let task = mission::task(&scenario).expect("the mission is sound");
        let problem = problem(&scenario, &task);
        let mut group = c.benchmark_group(format!("first-plan/{name}"));
        check(&scenario, &problem, &Sampler::Biased);
        group.bench_function("biased", |b| {
            let mut seed = 0;
            b.iter(|| {
                seed = (seed + 1) % SEEDS;
                first_plan(black_box(&problem), &Sampler::Biased, seed)
            });
        });
        let mut timed: Vec<String> = Vec::new();
        for device in [DeviceChoice::Cpu, DeviceChoice::Software, DeviceChoice::Gpu] {
            let mut predictor = Predictor::embedded(device).expect("weights are built in");
            let sampler = guided(&mut predictor, &scenario, &problem);
            // A device that is not here was replaced, by one that is timed under its own name.
            let label = predictor.device().to_owned();
            if timed.contains(&label) {
                eprintln!("{name}: no device for {device:?}: left out");
                continue;
            }
            timed.push(label.clone());
            check(&scenario, &problem, &sampler);
            group.bench_function(format!("guided, inference on {label}"), |b| {
                let mut seed = 0;
                b.iter(|| {
                    seed = (seed + 1) % SEEDS;
                    let sampler = guided(&mut predictor, black_box(&scenario), &problem);
                    first_plan(&problem, &sampler, seed)
                });
            });
            group.bench_function(format!("guided, search alone, predicted on {label}"), |b| {
                let mut seed = 0;
                b.iter(|| {
                    seed = (seed + 1) % SEEDS;
                    first_plan(black_box(&problem), &sampler, seed)
                });
            });
        }
        group.finish();
    }
}

criterion_group!(benches, guidance);
criterion_main!(benches);
