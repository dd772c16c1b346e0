//! Patrols: the map decides in which order their places are visited, and where the round begins, not the formula.

mod made;

use std::sync::Arc;

use made::{corridor, options, scenario};
use nalgebra::Point2;
use nngtl::automaton::Task;
use nngtl::dataset::maps::{Family, draw_map, draw_start};
use nngtl::mission::{self, Change, SamplerChoice};
use nngtl::planner::{Settings, Stop};
use nngtl::random::{Random, generator};
use nngtl::scenario::Scenario;
use nngtl::transfer::{Replanned, replan};
use nngtl::workspace::{Bounds, Polygon, Region, Workspace};
use rand::RngExt;

/// To visit the regions with these numbers again and again.
fn patrol(workspace: Workspace, start: Point2<f64>, order: &[usize]) -> Scenario {
    let names = workspace.regions().iter().map(|r| r.name.clone());
    let names: Vec<String> = names.collect();
    let all = order.iter().map(|&i| format!("[]<> {}", names[i]));
    let task = all.collect::<Vec<_>>().join(" && ");
    scenario(workspace, start, &task)
}

/// Squares in the corners of the unit square, named around it.
fn corners() -> Workspace {
    let region = |(name, [x, y]): (&str, [f64; 2])| Region {
        name: name.to_owned(),
        polygon: Polygon::rectangle(Point2::new(x, y), Point2::new(x + 0.1, y + 0.1)).unwrap(),
    };
    let corners = [
        ("sw", [0.1, 0.1]),
        ("se", [0.8, 0.1]),
        ("ne", [0.8, 0.8]),
        ("nw", [0.1, 0.8]),
    ];
    let regions = corners.map(region).to_vec();
    Workspace::new(Bounds::unit(), Vec::new(), regions).unwrap()
}

#[test]
fn four_corners_are_visited_around_whatever_their_order_in_the_formula() {
    let around = 4.0 * 0.6;
    for order in [[0, 1, 2, 3], [0, 2, 1, 3], [0, 1, 3, 2], [3, 1, 2, 0]] {
        let scenario = patrol(corners(), Point2::new(0.5, 0.1), &order);
        for (sampler, iterations) in [
            (SamplerChoice::Exact, 1),
            (SamplerChoice::Directed, 300),
            (SamplerChoice::Biased, 3_000),
        ] {
            let planned = mission::plan(&scenario, &options(sampler, iterations)).unwrap();
            let suffix = planned.verified.cost.suffix;
            assert!(suffix < 1.02 * around, "{order:?} {sampler:?}: {suffix}");
            assert!(suffix > around - 1e-4, "{order:?} {sampler:?}: {suffix}");
        }
    }
}

#[test]
fn rounds_along_a_corridor_begin_where_the_robot_meets_them() {
    let corridor = corridor();
    // To and fro between the outer ones is 15; before b the robot is on the round already.
    for (x, prefix) in [(0.5, 0.5), (7.0, 0.0), (10.5, 1.0)] {
        for order in [
            &[0, 1, 2][..],
            &[0, 2, 1],
            &[1, 0, 2],
            &[1, 2, 0],
            &[2, 0, 1],
            &[2, 1, 0],
            &[0, 2],
            &[2, 0],
        ] {
            let scenario = patrol(corridor.clone(), Point2::new(x, 0.5), order);
            let planned = mission::plan(&scenario, &options(SamplerChoice::Exact, 1)).unwrap();
            let cost = planned.verified.cost;
            // The round can also begin at its far end, and the way there counts to the prefix.
            assert!(
                cost.total < 0.2 * (prefix + 0.51) + 0.8 * 15.02,
                "{x} {order:?} {cost:?}"
            );
            assert!(cost.suffix > 14.99, "{x} {order:?} {cost:?}");
        }
    }
}

fn shuffled(n: usize, random: &mut Random) -> Vec<usize> {
    let mut order: Vec<usize> = (0..n).collect();
    for i in (1..n).rev() {
        order.swap(i, random.random_range(0..=i));
    }
    order
}

#[test]
fn the_order_in_the_formula_changes_no_cost() {
    let exact = options(SamplerChoice::Exact, 1);
    for seed in 0..12 {
        let mut random = generator(seed, 5);
        let family = Family::ALL[seed as usize % Family::ALL.len()];
        let map = draw_map(family, &mut random).workspace().unwrap();
        let start = draw_start(&map, &mut random);
        let places = map.regions().len().min(2 + seed as usize % 4);
        let mut costs = Vec::new();
        for _ in 0..3 {
            let order = shuffled(places, &mut random);
            let scenario = patrol(map.clone(), start, &order);
            costs.push(
                mission::plan(&scenario, &exact)
                    .unwrap()
                    .verified
                    .cost
                    .total,
            );
        }
        for cost in &costs {
            assert!((cost / costs[0] - 1.0).abs() < 0.01, "{family:?} {costs:?}");
        }
    }
}

#[test]
fn a_repaired_patrol_keeps_its_order_where_another_is_shorter_now() {
    let (mut kept, mut other) = (0, 0);
    for seed in 0..40 {
        let mut random = generator(seed, 6);
        let map = draw_map(Family::Paper, &mut random).workspace().unwrap();
        let start = draw_start(&map, &mut random);
        let before = patrol(map.clone(), start, &shuffled(5, &mut random));
        let directed = options(SamplerChoice::Directed, 200);
        let plan = mission::plan(&before, &directed).unwrap().path;
        // A wall across one leg of the round.
        let leg = random.random_range(0..plan.suffix.len() - 1);
        let middle = nalgebra::center(&plan.suffix[leg].at, &plan.suffix[leg + 1].at);
        let wide = random.random_bool(0.5);
        let half = if wide { [0.1, 0.01] } else { [0.01, 0.1] };
        let half = nalgebra::Vector2::from(half);
        let wall = Polygon::rectangle(middle - half, middle + half).unwrap();
        let obstacles = [map.obstacles(), &[wall]].concat();
        let Ok(changed) = Workspace::new(map.bounds(), obstacles, map.regions().to_vec()) else {
            continue;
        };
        let after = Scenario {
            workspace: Arc::new(changed),
            ..before.clone()
        };
        let Ok(task) = mission::task(&after) else {
            continue;
        };
        let own = task.nba.clone();
        let stop = Stop::new();
        let answer = mission::replan_task(&after, task, &plan, None, &directed, &stop, &mut |_| {});
        let Ok((planned, change)) = answer else {
            continue;
        };
        assert!(planned.verified.cost.suffix > 0.0);
        if !matches!(change, Change::Anew(_)) {
            kept += 1;
            let Ok(problem) = mission::problem(&after, Arc::new(Task::from_nba(own).unwrap()))
            else {
                unreachable!("the mission was planned on this map");
            };
            // Without the formula there is no other order.
            let alone = replan(&problem, &plan, &Settings::default());
            other += usize::from(matches!(alone, Replanned::Hopeless(_)));
        }
    }
    assert!(kept >= 10 && other > 0, "{kept} {other}");
}
