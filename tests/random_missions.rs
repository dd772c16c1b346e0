//! Random maps with random missions: every plan passes the checker, every mission without a plan
//! says why, nothing panics.
#![allow(clippy::print_stdout)] // tells how many missions ended how

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use nngtl::dataset::maps::{Family, draw_map, draw_start};
use nngtl::dataset::missions::{draw_pattern, draw_tree};
use nngtl::exact;
use nngtl::guidance::Guidance;
use nngtl::mission::{self, MissionError, Unreachable};
use nngtl::plan::{Cost, Path};
use nngtl::planner::{Guide, PlanError, Problem, Sampler, Settings, Stop, plan};
use nngtl::random::generator;
use nngtl::scenario::Scenario;
use nngtl::system::Continuous;
use nngtl::verify;

/// How many missions; more with `NNGTL_TEST_SCALE` (a factor): 50 makes ten thousand.
fn missions() -> u64 {
    let scale = std::env::var("NNGTL_TEST_SCALE").ok();
    let scale: f64 = scale.and_then(|s| s.parse().ok()).unwrap_or(1.0);
    (200.0 * scale).max(1.0) as u64
}

fn scenario(seed: u64) -> Scenario {
    let mut random = generator(seed, 77);
    let family = Family::ALL[seed as usize % Family::ALL.len()];
    let workspace = draw_map(family, &mut random).workspace().unwrap();
    let start = draw_start(&workspace, &mut random);
    let regions = workspace.regions().len();
    let formula = if seed.is_multiple_of(3) {
        draw_tree(regions, &mut random)
    } else {
        draw_pattern(regions, &mut random).1
    };
    Scenario {
        name: format!("random-{seed}"),
        workspace: Arc::new(workspace),
        start,
        task: formula.to_string(),
        formula,
        weight: 0.2,
        robot_radius: 0.0,
        hash: String::new(),
        grid: None,
    }
}

/// Asks the checker about a plan.
fn check(scenario: &Scenario, by: &str, path: &Path, cost: &Cost) {
    let (map, start) = (&scenario.workspace, scenario.start);
    let refused = verify::verify(map, start, &scenario.formula, path, 0.2, Some(cost)).err();
    if let Some(why) = refused {
        panic!("{} `{}` {by}: {why}", scenario.name, scenario.task);
    }
    VERIFIED.fetch_add(1, Ordering::Relaxed);
}

/// Plans that passed the checker.
static VERIFIED: AtomicU64 = AtomicU64::new(0);

/// Plans with all samplers; the outcome in a word.
fn outcome(seed: u64) -> &'static str {
    let scenario = &scenario(seed);
    let task = match mission::task(scenario) {
        Ok(task) => Arc::new(task),
        Err(why @ (MissionError::Task(_) | MissionError::NotOnThisMap(_))) => {
            assert!(why.to_string().len() > 20, "{why}");
            return "no automaton";
        }
        Err(other) => panic!("{}: {other}", scenario.name),
    };
    let system = Continuous::new(Arc::clone(&scenario.workspace), scenario.start).unwrap();
    let problem = Problem {
        start: system.start(),
        system: Arc::new(system),
        task: Arc::clone(&task),
        weight: scenario.weight,
    };
    let states = task.nba.len();
    let guide = Guide::new(&Guidance::flat(states), states).unwrap();
    let guided = Sampler::Guided(Arc::new(guide));
    let samplers = [Sampler::Biased, Sampler::Directed, guided, Sampler::Uniform];
    let search = |sampler: &Sampler, iterations: u64, first: bool| {
        let settings = Settings {
            iterations,
            first,
            seed,
            ..Settings::default()
        };
        match plan(&problem, sampler, &settings, &Stop::new(), &mut |_| {}) {
            Ok(found) => {
                check(scenario, sampler.name(), &found.path, &found.cost);
                true
            }
            Err(PlanError::NotFound(why)) => {
                assert_eq!(why.stats.iterations, iterations);
                assert!(why.steps_left > 0 || why.stats.goals > 0);
                false
            }
            Err(other) => panic!("{}: {other}", scenario.name),
        }
    };
    let first = |sampler: &&Sampler| search(sampler, 3_000, true);
    let solved = samplers[..3].iter().filter(first).count();
    // One of them goes on, and shortens what it finds.
    let improved = search(&samplers[seed as usize % 4], 300, false);
    let exact = exact::plan(&scenario.workspace, scenario.start, &task, 0.2);
    if let Ok(found) = &exact {
        check(scenario, "exact", &found.path, &found.cost);
    }
    let impossible = Unreachable::find(scenario, &task, &*problem.system);
    if let Some(why) = impossible {
        assert!(solved == 0 && !improved, "{}: {why}", scenario.name);
        assert!(exact.is_err(), "{}: {why}", scenario.name);
        return "impossible, and said so";
    }
    assert!(exact.is_ok(), "{} `{}`", scenario.name, scenario.task);
    let words = [
        "not found in the budget",
        "found by one",
        "found by two",
        "found by all",
    ];
    words[solved]
}

#[test]
fn every_plan_verifies_and_every_failure_says_why() {
    let mut outcomes: BTreeMap<&str, u64> = BTreeMap::new();
    for seed in 0..missions() {
        *outcomes.entry(outcome(seed)).or_default() += 1;
    }
    let verified = VERIFIED.load(Ordering::Relaxed);
    println!("{outcomes:?}; the checker passed {verified} plans");
    let found = outcomes.get("found by all").copied().unwrap_or(0);
    let infeasible = ["no automaton", "impossible, and said so"].iter();
    let infeasible: u64 = infeasible.filter_map(|name| outcomes.get(name)).sum();
    assert!(
        found * 20 >= (missions() - infeasible) * 19,
        "nineteen of twenty feasible missions are planned: {outcomes:?}"
    );
}

/// The same through the whole house, with anytime improvement: the cost never gets worse than the
/// first plan's, and `plan` refuses what its own checker refuses.
#[test]
fn whole_missions_improve_and_verify() {
    for seed in 0..missions().min(24) {
        let scenario = scenario(seed);
        let options = mission::Options {
            sampler: mission::SamplerChoice::Biased,
            settings: Settings {
                iterations: 1_500,
                ..Settings::default()
            },
            ..mission::Options::default()
        };
        match mission::plan(&scenario, &options) {
            Ok(planned) => {
                let (first, cost) = (planned.file.first.unwrap(), planned.file.cost.unwrap());
                assert!(cost.total <= first.cost + 1e-9, "{}", scenario.name);
            }
            Err(MissionError::Refused(why)) => panic!("{}: {why}", scenario.name),
            Err(why) => assert!(!why.to_string().is_empty()),
        }
    }
}
