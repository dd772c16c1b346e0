//! Times transfer planning on the transfer paper's workspace: the graph of subtasks with its matching,
//! the first plan, and the repair of a plan. Building the library and translating formulas are not
//! timed. Every plan is verified before timing.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use nalgebra::Vector2;
use nngtl::bench::transfer::{PAPER, grid_library, grid_scenario};
use nngtl::mission;
use nngtl::planner::{Sampler, Settings, Stop, plan};
use nngtl::scenario::Scenario;
use nngtl::transfer::{Replanned, count_subtasks, replan, transfer};
use nngtl::workspace::{Polygon, Workspace};

fn transfers(c: &mut Criterion) {
    let library = grid_library(0)
        .expect("the shipped workspace is sound")
        .library;
    for paper in &PAPER {
        let scenario = grid_scenario(Some(paper.formula)).expect("the formula is sound");
        let task = mission::task(&scenario).expect("the formula has an automaton");
        let problem = mission::problem(&scenario, Arc::new(task)).expect("the start is free");
        let settings = Settings {
            first: true,
            iterations: 1_000_000,
            ..Settings::default()
        };
        let run = || {
            transfer(
                &problem,
                &library,
                &Sampler::Uniform,
                &settings,
                &Stop::new(),
                &mut |_| {},
            )
            .expect("there is a plan")
        };
        let found = run().solution;
        mission::verify(&scenario, None, &found.path, 0.5, Some(&found.cost))
            .expect("plans verify");
        let mut group = c.benchmark_group(format!("transfer/{}", paper.name));
        group.sample_size(20);
        group.bench_function("subtasks", |b| {
            b.iter(|| count_subtasks(black_box(&problem), &library));
        });
        group.bench_function("first", |b| b.iter(run));
        group.bench_function("biased", |b| {
            b.iter(|| {
                plan(
                    &problem,
                    &Sampler::Biased,
                    &settings,
                    &Stop::new(),
                    &mut |_| {},
                )
            });
        });
        let changed = blocked(&scenario, &found.path.prefix[1].at);
        let task = mission::task(&changed).expect("the formula has an automaton");
        let after = mission::problem(&changed, Arc::new(task)).expect("the start is free");
        if let Replanned::Repaired(repair) = replan(&after, &found.path, &settings) {
            mission::verify(&changed, None, &repair.path, 0.5, Some(&repair.cost))
                .expect("repaired plans verify");
            group.bench_function("repair", |b| {
                b.iter(|| replan(black_box(&after), &found.path, &settings));
            });
        }
        group.finish();
    }
}

/// The scenario with one cell turned into an obstacle.
fn blocked(scenario: &Scenario, at: &nalgebra::Point2<f64>) -> Scenario {
    let half = Vector2::repeat(0.025);
    let map = &scenario.workspace;
    let mut obstacles = map.obstacles().to_vec();
    obstacles.push(Polygon::rectangle(at - half, at + half).expect("a cell is a rectangle"));
    let changed = Workspace::new(map.bounds(), obstacles, map.regions().to_vec());
    Scenario {
        workspace: Arc::new(changed.expect("the map is sound")),
        ..scenario.clone()
    }
}

criterion_group!(benches, transfers);
criterion_main!(benches);
