//! The loop of a plan begins as soon as the mission allows it, also where the automaton makes the first round in states of its own.

mod made;

use made::{Edges, corridor, options, rectangles, scenario};
use nalgebra::Point2;
use nngtl::dataset::maps::{Family, draw_map, draw_start};
use nngtl::mission::{self, Change, SamplerChoice};
use nngtl::planner::{Problem, Stop};
use nngtl::random::{Random, generator};
use nngtl::scenario::{GridSpec, Scenario};
use nngtl::transfer::optimum;
use rand::RngExt as _;

#[test]
fn an_ordered_patrol_is_entered_where_the_robot_meets_it() {
    for (task, prefix, suffix) in [
        ("G F (a & F b) & (!b U a)", 1.0, 7.0),
        ("G F (a & F (b & F c)) & (!b U a) & (!c U b)", 1.0, 15.0),
        ("G F c & G F b & (!c U b)", 5.0, 7.0),
    ] {
        let scenario = scenario(corridor(), Point2::new(0.5, 0.5), task);
        for (sampler, iterations) in [
            (SamplerChoice::Exact, 1),
            (SamplerChoice::Directed, 400),
            (SamplerChoice::Biased, 4_000),
        ] {
            let planned = mission::plan(&scenario, &options(sampler, iterations)).unwrap();
            let cost = planned.verified.cost;
            assert_eq!(planned.file.cost, Some(cost));
            let optimum = 0.2 * prefix + 0.8 * suffix;
            assert!(cost.total > optimum - 1e-6, "{task} {sampler:?}: {cost:?}");
            assert!(cost.total < 1.01 * optimum, "{task} {sampler:?}: {cost:?}");
        }
    }
}

/// What has to be seen once is seen in every round if the loop can then be entered beside the start: the mail is fetched again, though
/// once is enough, and a round that passes beside the post room costs as little.
#[test]
fn a_round_visits_again_what_makes_it_begin_sooner() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/office.toml");
    let mut scenario = Scenario::load(&path).unwrap();
    for (weight, least, most) in [(0.6, 10.5, 12.0), (0.8, 5.7, 6.1)] {
        scenario.weight = weight;
        let planned = mission::plan(&scenario, &options(SamplerChoice::Directed, 60)).unwrap();
        let cost = planned.verified.cost;
        assert!((least..most).contains(&cost.total), "{weight}: {cost:?}");
    }
}

/// The gym is visited by a loop on its way from the books to the mensa, though the automaton wants it on a way of its own, there and back.
#[test]
fn a_loop_passes_what_it_visits_on_its_way() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("scenarios/campus.toml");
    let mut scenario = Scenario::load(&path).unwrap();
    scenario.weight = 0.5;
    let exact = mission::plan(&scenario, &options(SamplerChoice::Exact, 1)).unwrap();
    let sampled = mission::plan(&scenario, &options(SamplerChoice::Directed, 1_000)).unwrap();
    let [exact, sampled] = [exact, sampled].map(|planned| planned.verified.cost.total);
    assert!(sampled < 1.001 * exact, "{sampled} {exact}");
}

/// Where a unit of the prefix costs as much as one of the suffix, or more, the first round is part of the loop: it begins at the start,
/// for every planner.
#[test]
fn a_round_begins_at_the_start_where_the_prefix_is_dear() {
    for (task, round) in [
        ("G F a & G F b", 9.0),
        ("G F (a & F b) & (!b U a)", 9.0),
        ("F G !c & G F a & G F b", 9.0),
    ] {
        let mut scenario = scenario(corridor(), Point2::new(0.5, 0.5), task);
        scenario.weight = 0.9;
        for sampler in [SamplerChoice::Exact, SamplerChoice::Directed] {
            let planned = mission::plan(&scenario, &options(sampler, 1_000)).unwrap();
            let cost = planned.verified.cost;
            assert!(
                (cost.total / (0.1 * round) - 1.0).abs() < 0.02,
                "{task} {sampler:?}: {cost:?}"
            );
            // A bound beside a plan holds for it.
            if let Some(bound) = planned.file.bound {
                assert!(
                    bound.cost <= cost.total + 1e-9,
                    "{task}: {bound:?}, {cost:?}"
                );
            }
        }
    }
}

#[test]
fn a_first_plan_is_left_as_it_was_found() {
    let scenario = scenario(
        corridor(),
        Point2::new(0.5, 0.5),
        "G F (a & F b) & (!b U a)",
    );
    let mut first = options(SamplerChoice::Directed, 400);
    first.settings.first = true;
    let planned = mission::plan(&scenario, &first).unwrap();
    let found = planned.file.first.unwrap().cost;
    assert!((planned.verified.cost.total - found).abs() < 1e-9);
}

#[test]
fn on_grids_the_first_step_counts_to_the_loop_where_it_can() {
    let mut scenario = scenario(corridor(), Point2::new(1.25, 0.75), "G (a <-> X !a)");
    scenario.grid = Some(GridSpec {
        cells: [22, 2],
        cell: 0.5,
    });
    for sampler in [SamplerChoice::Exact, SamplerChoice::Directed] {
        let planned = mission::plan(&scenario, &options(sampler, 2_000)).unwrap();
        let cost = planned.verified.cost;
        assert!(
            cost.prefix == 0.0 && cost.suffix <= 1.0,
            "{sampler:?} {cost:?}"
        );
    }
}

/// A grid of `side` × `side` cells of which `walls` are obstacles and three are places, where the robot may start anywhere else; the
/// tasks take turns.
fn drawn_grid(seed: u64, side: usize, walls: usize, tasks: [&str; 3]) -> Scenario {
    let mut random = generator(seed, 8);
    let cells = draw_cells(&mut random, side * side, 4 + walls);
    let square = |k: &usize| {
        let [x, y] = [k / side, k % side].map(|i| i as f64);
        [x, y, x + 1.0, y + 1.0]
    };
    let squares: Vec<Edges> = cells.iter().map(square).collect();
    let names = ["a", "b", "c"];
    let regions: Vec<_> = names
        .into_iter()
        .zip(squares[1..4].iter().copied())
        .collect();
    let map = rectangles(side as f64, &squares[4..], &regions).unwrap();
    let start = Point2::new(squares[0][0] + 0.5, squares[0][1] + 0.5);
    let mut scenario = scenario(map, start, tasks[seed as usize % 3]);
    scenario.grid = Some(GridSpec {
        cells: [side as u32; 2],
        cell: 1.0,
    });
    scenario
}

/// `count` different numbers below `limit`.
fn draw_cells(random: &mut Random, limit: usize, count: usize) -> Vec<usize> {
    let mut drawn = Vec::new();
    while drawn.len() < count {
        let k = random.random_range(0..limit);
        if !drawn.contains(&k) {
            drawn.push(k);
        }
    }
    drawn
}

/// On grids what the way there visited becomes part of the loop, and detours are cut short: with any weight a sampled plan costs about
/// what the plan from the product's optimum does, also where both are far below that.
#[test]
fn on_grids_sampled_plans_come_near_the_exact_ones_at_every_weight() {
    let mut below = 0;
    for seed in 0..24 {
        let tasks = [
            "GF c & (!a U b)",
            "GF a & F b & (!b U c)",
            "GF (a & F b) & F c",
        ];
        let mut scenario = drawn_grid(seed, 20, 20, tasks);
        let Ok(problem) = mission::task(&scenario)
            .map_err(|e| e.to_string())
            .and_then(|task| mission::problem(&scenario, task.into()).map_err(|e| e.to_string()))
        else {
            continue;
        };
        for weight in [0.2, 0.5, 0.8] {
            scenario.weight = weight;
            let plan = |sampler| mission::plan(&scenario, &options(sampler, 1_000));
            let (Ok(exact), Ok(sampled)) =
                (plan(SamplerChoice::Exact), plan(SamplerChoice::Directed))
            else {
                panic!("{seed}: every place can be reached");
            };
            let of_product = optimum(&Problem {
                weight,
                ..problem.clone()
            })
            .unwrap()
            .1
            .total;
            let [exact, sampled] = [exact, sampled].map(|p| p.verified.cost.total);
            assert!(exact <= of_product + 1e-9, "{seed} {weight}");
            assert!(
                sampled < 1.2 * exact + 1e-9,
                "{seed} {weight}: {sampled} {exact}"
            );
            below += usize::from(sampled < 0.7 * of_product);
        }
    }
    assert!(below > 10, "{below}");
}

/// Where a way has a hundred waypoints, and where the task can count how long a letter stays, most rounds that would be cheap see what
/// the task refuses: those are not all tried before the one that it allows.
#[test]
fn on_large_grids_a_loop_begins_at_the_start_too() {
    let mut found = 0;
    for seed in 0..9 {
        let tasks = [
            "GF a & GF b & F c & (!b U c)",
            "GF a & G (a -> X (!a U b)) & F c",
            "GF (a & F b) & F c & (!a U c)",
        ];
        let mut scenario = drawn_grid(seed, 60, 900, tasks);
        scenario.weight = 0.8;
        let plan = |sampler| mission::plan(&scenario, &options(sampler, 1_000));
        for sampler in [SamplerChoice::Exact, SamplerChoice::Directed] {
            // A place may be walled in.
            let Ok(planned) = plan(sampler) else { continue };
            let cost = planned.verified.cost;
            assert_eq!(cost.prefix, 0.0, "{seed} {sampler:?} {cost:?}");
            found += 1;
        }
    }
    assert!(found >= 10, "{found}");
}

#[test]
fn plans_whose_loop_begins_sooner_still_hold_on_their_map() {
    let mut sooner = 0;
    for seed in 0..40 {
        let mut random = generator(seed, 7);
        let map = draw_map(Family::Paper, &mut random).workspace().unwrap();
        let start = draw_start(&map, &mut random);
        let text = "G F (l1 & F (l2 & F l3)) & (!l2 U l1) & (!l3 U l2)";
        let scenario = scenario(map, start, text);
        let Ok(task) = mission::task(&scenario) else {
            continue;
        };
        let exact = options(SamplerChoice::Exact, 1);
        let Ok(planned) = mission::plan(&scenario, &exact) else {
            continue;
        };
        let raw = nngtl::exact::plan(&scenario.workspace, start, &task, scenario.weight).unwrap();
        let total = planned.verified.cost.total;
        assert!(total <= raw.cost.total);
        sooner += usize::from(total < 0.99 * raw.cost.total);

        let directed = options(SamplerChoice::Directed, 100);
        let stop = Stop::new();
        let (again, change) = mission::replan_task(
            &scenario,
            task,
            &planned.path,
            None,
            &directed,
            &stop,
            &mut |_| {},
        )
        .unwrap();
        assert_eq!(change, Change::None, "{seed}");
        assert!(again.verified.cost.total <= total + 1e-9, "{seed}");
    }
    assert!(sooner > 5, "{sooner}");
}
