//! Times the exact planner: the roadmap of a map, and a mission on it. Drawing the map and
//! translating the formula are not timed. Every plan is checked for its length before timing.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use nngtl::automaton::{Limits, Task};
use nngtl::dataset::maps::{Family, draw_map, draw_start};
use nngtl::exact::{ExactConfig, Roadmap};
use nngtl::ltl::Formula;
use nngtl::random::generator;

/// Missions over the seven regions of the paper's maps, by name.
const MISSIONS: [(&str, &str); 4] = [
    ("visit", "F l1"),
    ("case-study", "G F l1 & (!l1 U l2) & F l3"),
    ("visit-all", "F l1 & F l2 & F l3 & F l4"),
    ("patrol", "G F l1 & G F l2 & G F l3 & G !l4"),
];

fn exact(c: &mut Criterion) {
    for family in Family::ALL {
        let map = draw_map(family, &mut generator(5, 0));
        let workspace = map.workspace().expect("a drawn map is sound");
        let start = draw_start(&workspace, &mut generator(5, 1));
        let mut group = c.benchmark_group(format!("exact/{family}"));
        group.bench_function("roadmap", |b| {
            b.iter(|| Roadmap::new(black_box(&workspace), ExactConfig::default()));
        });
        let roadmap = Roadmap::new(&workspace, ExactConfig::default());
        for (name, text) in MISSIONS {
            let formula: Formula = text.parse().expect("the formula is sound");
            let letters = Arc::clone(workspace.alphabet());
            let task = Task::from_formula(&formula, letters, &Limits::default())
                .expect("the formula has an automaton");
            let plan = roadmap
                .plan(start, &task, 0.2)
                .expect("all regions can be reached");
            assert!(plan.cost.total > 0.0);
            group.bench_function(name, |b| {
                b.iter(|| roadmap.plan(black_box(start), &task, 0.2));
            });
        }
        group.finish();
    }
}

criterion_group!(benches, exact);
criterion_main!(benches);
