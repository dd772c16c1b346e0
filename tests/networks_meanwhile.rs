//! Guided search begins while the networks run: what it draws depends on samples counted, not on who was faster.

mod made;

use std::sync::{Arc, Mutex};

use made::{options, scenario};
use nalgebra::Point2;
use nngtl::mission::{self, Options, Planned, SamplerChoice, Thinking};
use nngtl::nn::{DeviceChoice, Predictor};
use nngtl::planner::{HeadStart, Problem, Sampler, Settings, Solution, Stop, plan};
use nngtl::scenario::Scenario;
use nngtl::workspace::{Bounds, Polygon, Region, Workspace};

const USUAL: [u64; 3] = {
    let HeadStart {
        begin,
        states,
        heatmap,
    } = HeadStart::USUAL;
    [begin, states, heatmap]
};

fn shipped() -> Scenario {
    Scenario::load("scenarios/case-study.toml").unwrap()
}

fn problem(scenario: &Scenario) -> Problem {
    let task = Arc::new(mission::task(scenario).unwrap());
    mission::problem(scenario, task).unwrap()
}

fn settings(iterations: u64) -> Settings {
    Settings {
        iterations,
        ..Settings::default()
    }
}

/// A guided search whose networks run on a thread of their own, or where they are waited for.
fn searched(scenario: &Scenario, aside: bool, [begin, states, heatmap]: [u64; 3]) -> Solution {
    let head_start = HeadStart {
        begin,
        states,
        heatmap,
    };
    let problem = problem(scenario);
    let networks = Predictor::embedded(DeviceChoice::Cpu).unwrap();
    let networks = Arc::new(Mutex::new(networks));
    let map = Arc::clone(&scenario.workspace);
    let thinking = Thinking::new(networks, map, problem.clone(), aside);
    let sampler = Sampler::Deferred(thinking.sampler(head_start, &problem));
    let found = plan(
        &problem,
        &sampler,
        &settings(300),
        &Stop::new(),
        &mut |_| {},
    )
    .unwrap();
    let prediction = thinking.finish().unwrap().unwrap();
    assert_eq!(prediction.device, "cpu");
    assert!(thinking.finish().is_none(), "taken already");
    found
}

#[test]
fn plans_do_not_depend_on_where_the_networks_run() {
    let scenario = shipped();
    let [beside, inline] = [true, false].map(|aside| searched(&scenario, aside, USUAL));
    assert_eq!(beside.edges, inline.edges);
    assert_eq!(beside.path, inline.path);
    // And it is another search than one that waits, or one that never hears of them.
    assert_ne!(beside.edges, searched(&scenario, true, [0; 3]).edges);
    let directed = plan(
        &problem(&scenario),
        &Sampler::Directed,
        &settings(300),
        &Stop::new(),
        &mut |_| {},
    );
    assert_ne!(beside.edges, directed.unwrap().edges);
}

/// When the networks begin is a matter of time, and not of the plan.
#[test]
fn the_moment_at_which_the_networks_begin_changes_no_plan() {
    let scenario = shipped();
    let [at_once, soon, late] = [0, 8, 24].map(|begin| searched(&scenario, true, [begin, 24, 64]));
    assert_eq!(at_once.edges, soon.edges);
    assert_eq!(soon.edges, late.edges);
}

/// Missions planned one after the other, and at once, share the networks' thread; none waits for ever, and each has its own answer.
#[test]
fn many_missions_at_once_get_the_plans_that_they_get_alone() {
    let scenario = shipped();
    let alone = searched(&scenario, false, [0, 2, 4]);
    std::thread::scope(|scope| {
        let search = || searched(&scenario, true, [0, 2, 4]);
        let all: Vec<_> = (0..6).map(|_| scope.spawn(search)).collect();
        for one in all {
            assert_eq!(one.join().unwrap().edges, alone.edges);
        }
    });
}

/// A search that ends before the networks have begun leaves them alone, and one that ends while they are at work can wait for them.
#[test]
fn networks_that_have_not_begun_do_not_begin_any_more() {
    let scenario = shipped();
    let problem = problem(&scenario);
    let networks = || {
        let networks = Predictor::embedded(DeviceChoice::Cpu).unwrap();
        let map = Arc::clone(&scenario.workspace);
        Thinking::new(Arc::new(Mutex::new(networks)), map, problem.clone(), true)
    };
    let idle = networks();
    idle.settle();
    let refused = idle.finish().unwrap().unwrap_err().to_string();
    assert!(refused.contains("the networks gave up"), "{refused}");
    let busy = networks();
    busy.begin();
    let answer = busy.finish().unwrap().unwrap();
    assert_eq!(answer.device, "cpu");
    busy.settle();
}

#[test]
fn both_answers_count_from_their_own_sample_on() {
    let scenario = shipped();
    let of = |head_start| searched(&scenario, true, head_start).edges;
    let [now, later, never] = [[0, 0, 0], [0, 0, 24], [0, 0, 1_000]].map(of);
    assert!(now != later && later != never && now != never);
}

fn guided(scenario: &Scenario, networks_first: bool, await_networks: bool) -> Planned {
    let options = Options {
        sampler: SamplerChoice::Guided,
        settings: Settings {
            first: true,
            networks_first,
            ..settings(1_000)
        },
        await_networks,
        ..Options::default()
    };
    mission::plan(scenario, &options).unwrap()
}

#[test]
fn a_search_that_is_over_sooner_says_that_it_asked_nobody() {
    let region = |name: &str, x: f64| Region {
        name: name.to_owned(),
        polygon: Polygon::rectangle(Point2::new(x, 0.4), Point2::new(x + 0.1, 0.6)).unwrap(),
    };
    let map = Workspace::new(Bounds::unit(), vec![], vec![region("a", 0.5)]).unwrap();
    let scenario = scenario(map, Point2::new(0.2, 0.5), "<> a");
    let [meanwhile, first] = [false, true].map(|first| guided(&scenario, first, false));
    assert!(meanwhile.file.first.unwrap().iterations <= HeadStart::USUAL.begin);
    assert!(meanwhile.guidance.is_none() && meanwhile.file.device.is_none());
    assert_eq!(meanwhile.file.sampler.as_deref(), Some("guided"));
    assert!(first.guidance.is_some() && first.file.device.is_some());
    // A picture of what they say can still be had, and changes no plan.
    let awaited = guided(&scenario, false, true);
    assert_eq!(awaited.guidance, first.guidance);
    assert_eq!(awaited.path, meanwhile.path);
}

#[test]
fn missions_that_the_networks_do_not_fit_are_planned_without_them_and_told() {
    let labels = Predictor::embedded(DeviceChoice::Cpu).unwrap().labels();
    let name = |k: usize| format!("r{k}");
    let regions = (0..=labels).map(|k| {
        let low = Point2::new(0.05 + 0.1 * k as f64, 0.5);
        Region {
            name: name(k),
            polygon: Polygon::rectangle(low, low + nalgebra::Vector2::repeat(0.05)).unwrap(),
        }
    });
    let map = Workspace::new(Bounds::unit(), vec![], regions.collect()).unwrap();
    let any: Vec<String> = (0..=labels).map(name).collect();
    let scenario = scenario(
        map,
        Point2::new(0.5, 0.1),
        &format!("<> ({})", any.join(" | ")),
    );
    for networks_first in [false, true] {
        let mut options = options(SamplerChoice::Guided, 100);
        options.settings.networks_first = networks_first;
        let planned = mission::plan(&scenario, &options).unwrap();
        assert_eq!(planned.file.sampler.as_deref(), Some("directed"));
        let told = format!(
            "uses {} regions, the networks were trained for {labels}",
            labels + 1
        );
        assert!(
            planned.notices.iter().any(|n| n.contains(&told)),
            "{:?}",
            planned.notices
        );
    }
}
