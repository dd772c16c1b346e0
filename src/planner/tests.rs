//! Searches with automata made by hand, so that the planner is tested without a translator.

use std::sync::Arc;

use nalgebra::Point2;
use proptest::prelude::*;

use super::*;
use crate::alphabet::Alphabet;
use crate::automaton::{Nba, StateId, Transition};
use crate::guidance::Guidance;
use crate::system::{Continuous, Grid, TransitionSystem};
use crate::workspace::{Bounds, Polygon, Region, Workspace};

fn p(x: f64, y: f64) -> Point2<f64> {
    Point2::new(x, y)
}

fn rectangle(x0: f64, y0: f64, x1: f64, y1: f64) -> Polygon {
    Polygon::rectangle(p(x0, y0), p(x1, y1)).unwrap()
}

fn map() -> Arc<Workspace> {
    let region = |name: &str, polygon| Region {
        name: name.to_owned(),
        polygon,
    };
    let obstacles = vec![rectangle(0.4, 0.0, 0.6, 0.7)];
    let regions = vec![
        region("a", rectangle(0.8, 0.1, 0.9, 0.2)),
        region("b", rectangle(0.1, 0.8, 0.2, 0.9)),
    ];
    Arc::new(Workspace::new(Bounds::unit(), obstacles, regions).unwrap())
}

/// An automaton from (from, to, letters by name, where `*` is any) and accepting states.
fn nba(alphabet: &Arc<Alphabet>, accepting: &[bool], edges: &[(u32, u32, &str)]) -> Nba {
    let mut transitions = vec![Vec::new(); accepting.len()];
    for &(from, to, names) in edges {
        let guard = match names.strip_prefix('!') {
            _ if names == "*" => alphabet.all(),
            Some(name) => alphabet
                .letters_with(alphabet.proposition(name).unwrap())
                .complement(),
            None => alphabet.letters_with(alphabet.proposition(names).unwrap()),
        };
        let target = StateId(to);
        transitions[from as usize].push(Transition { target, guard });
    }
    Nba {
        alphabet: Arc::clone(alphabet),
        initial: vec![StateId(0)],
        accepting: accepting.to_vec(),
        transitions,
    }
}

fn problem(start: Point2<f64>, weight: f64, task: impl Fn(&Arc<Alphabet>) -> Nba) -> Problem {
    let system = Continuous::new(map(), start).unwrap();
    let task = Task::from_trimmed(task(system.map().alphabet()), None);
    Problem {
        start: system.start(),
        system: Arc::new(system),
        task: Arc::new(task),
        weight,
    }
}

/// `F a`.
fn visit(alphabet: &Arc<Alphabet>) -> Nba {
    nba(
        alphabet,
        &[false, true],
        &[(0, 0, "!a"), (0, 1, "a"), (1, 1, "*")],
    )
}

/// `GF a & GF b`.
fn patrol(alphabet: &Arc<Alphabet>) -> Nba {
    let edges = [
        (0, 0, "!a"),
        (0, 1, "a"),
        (1, 1, "!b"),
        (1, 2, "b"),
        (2, 0, "!a"),
        (2, 1, "a"),
    ];
    nba(alphabet, &[false, false, true], &edges)
}

fn flat(task: &Task) -> Sampler {
    let guidance = Guidance::flat(task.nba.len());
    Sampler::Guided(Arc::new(Guide::new(&guidance, task.nba.len()).unwrap()))
}

pub(super) fn run(
    problem: &Problem,
    sampler: &Sampler,
    settings: &Settings,
) -> Result<Solution, PlanError> {
    plan(problem, sampler, settings, &Stop::new(), &mut |_| {})
}

fn samplers(problem: &Problem) -> [Sampler; 4] {
    let flat = flat(&problem.task);
    [Sampler::Uniform, Sampler::Biased, Sampler::Directed, flat]
}

#[test]
fn networks_are_asked_once_and_only_by_a_search_that_lasts() {
    let problem = problem(p(0.1, 0.1), 0.5, visit);
    let states = problem.task.nba.len();
    let asked = Arc::new(std::sync::atomic::AtomicUsize::new(0));
    let search = |iterations: u64, threads: usize, answers: bool| {
        let count = Arc::clone(&asked);
        count.store(0, std::sync::atomic::Ordering::Relaxed);
        let deferred = Deferred::new(50, move || {
            count.fetch_add(1, std::sync::atomic::Ordering::Relaxed);
            // Another heatmap than a flat one: the lower half alone.
            let mut guidance = Guidance::flat(states);
            for row in guidance.heatmap.values.chunks_exact_mut(200) {
                row[100..].fill(0.0);
            }
            answers.then(|| Guide::new(&guidance, states).unwrap())
        });
        let deferred = Arc::new(deferred);
        let settings = Settings {
            iterations,
            threads,
            ..Settings::default()
        };
        let found = run(&problem, &Sampler::Deferred(deferred), &settings).unwrap();
        let directed = run(&problem, &Sampler::Directed, &settings).unwrap();
        let times = asked.load(std::sync::atomic::Ordering::Relaxed);
        (times, found.edges == directed.edges)
    };
    assert_eq!(search(50, 1, true), (0, true), "over before");
    assert_eq!(search(51, 1, false), (1, true), "no answer: directed");
    assert_eq!(search(400, 1, true), (1, false));
    assert_eq!(search(400, 3, true).0, 1, "one answer for all searches");
}

#[test]
fn a_reach_mission_ends_in_a_trivial_suffix_near_the_optimum() {
    let problem = problem(p(0.1, 0.1), 0.5, visit);
    for sampler in samplers(&problem) {
        let solution = run(&problem, &sampler, &Settings::default()).unwrap();
        let (prefix, suffix) = (&solution.path.prefix, &solution.path.suffix);
        assert_eq!(prefix[0].at, p(0.1, 0.1));
        assert_eq!(suffix.len(), 1);
        assert_eq!(suffix[0].at, prefix.last().unwrap().at);
        // Over the wall's two upper corners, to the region's nearest corner.
        let optimum = (0.3_f64.powi(2) + 0.6_f64.powi(2)).sqrt()
            + 0.2
            + (0.2_f64.powi(2) + 0.5_f64.powi(2)).sqrt();
        let length = solution.cost.prefix;
        assert!(
            length > optimum - 1e-9,
            "{} {length} < {optimum}",
            sampler.name()
        );
        assert!(
            length < 1.03 * optimum,
            "{} {length} > {optimum}",
            sampler.name()
        );
    }
}

#[test]
fn a_patrol_has_a_suffix_that_returns() {
    let problem = problem(p(0.1, 0.1), 0.2, patrol);
    for sampler in samplers(&problem) {
        let solution = run(&problem, &sampler, &Settings::default()).unwrap();
        let suffix = &solution.path.suffix;
        assert!(suffix.len() > 2);
        assert_eq!(suffix[0], *solution.path.prefix.last().unwrap());
        assert_eq!(suffix[0], *suffix.last().unwrap());
        let length = crate::plan::length(suffix);
        assert!((length - solution.cost.suffix).abs() < 1e-9);
        // There and back along the shortest way between the regions' nearest corners.
        let one_way =
            (0.4_f64.powi(2) + 0.1_f64.powi(2)).sqrt() + (0.2_f64.powi(2) + 0.5_f64.powi(2)).sqrt();
        assert!(length > 2.0 * one_way - 1e-9, "{length}");
        assert!(
            length < 2.4 * one_way,
            "{} {length} {one_way}",
            sampler.name()
        );
        let word: Vec<StateId> = suffix.iter().map(|w| w.state).collect();
        assert!(word.contains(&StateId(2)));
    }
}

/// `b` once, then `a` again and again: after `b` an accepting state is entered that no cycle leads back to from there.
fn then_again_and_again(alphabet: &Arc<Alphabet>) -> Nba {
    let edges = [
        (0, 0, "!b"),
        (0, 1, "b"),
        (1, 1, "a"),
        (1, 2, "!a"),
        (2, 1, "a"),
        (2, 2, "!a"),
    ];
    nba(alphabet, &[false, true, false], &edges)
}

/// `a` again and again, unless `b` is never met.
fn unless_it_is_left_alone(alphabet: &Arc<Alphabet>) -> Nba {
    let edges = [
        (0, 0, "!b"),
        (0, 1, "b"),
        (1, 1, "!a"),
        (1, 2, "a"),
        (2, 1, "!a"),
        (2, 2, "a"),
    ];
    nba(alphabet, &[true, false, true], &edges)
}

#[test]
fn accepting_states_that_are_only_passed_are_no_goals() {
    // Out of sight of a, the second one in b, where the accepting state that it begins in is left for good.
    for problem in [
        problem(p(0.1, 0.1), 0.2, then_again_and_again),
        problem(p(0.15, 0.85), 0.2, unless_it_is_left_alone),
    ] {
        let nba = &problem.task.nba;
        for sampler in samplers(&problem) {
            for seed in 0..5 {
                let settings = Settings {
                    iterations: 800,
                    first: true,
                    seed,
                    ..Settings::default()
                };
                let solution = run(&problem, &sampler, &settings)
                    .unwrap_or_else(|e| panic!("{} {seed}: {e}", sampler.name()));
                let path = &solution.path;
                // The states are those of the automaton that was given.
                for ends in path.prefix.windows(2).chain(path.suffix.windows(2)) {
                    let letter = problem.system.settle(ends[0].at).unwrap().letter;
                    let guard = nba.guard(ends[0].state, ends[1].state).unwrap();
                    assert!(guard.contains(letter), "{path:?}");
                }
                assert!(path.suffix.iter().any(|w| nba.is_accepting(w.state)));
            }
        }
    }
}

#[test]
fn cycles_close_in_regions_that_are_not_seen_through() {
    // The automaton cannot wait in its accepting state, so the robot has to come back to the root from where the region is in
    // sight of it.
    let corners = [
        p(0.1, 0.4),
        p(0.6, 0.4),
        p(0.6, 0.9),
        p(0.1, 0.9),
        p(0.1, 0.85),
        p(0.55, 0.85),
        p(0.55, 0.45),
        p(0.1, 0.45),
    ];
    let hook = Polygon::new(corners.to_vec()).unwrap();
    let region = |name: &str, polygon| Region {
        name: name.to_owned(),
        polygon,
    };
    let regions = vec![
        region("a", rectangle(0.8, 0.1, 0.9, 0.2)),
        region("b", hook),
    ];
    let map = Workspace::new(Bounds::unit(), Vec::new(), regions).unwrap();
    let system = Continuous::new(Arc::new(map), p(0.1, 0.1)).unwrap();
    let task = Task::from_trimmed(patrol(system.map().alphabet()), None);
    let problem = Problem {
        start: system.start(),
        system: Arc::new(system),
        task: Arc::new(task),
        weight: 0.2,
    };
    for seed in 0..40 {
        let settings = Settings {
            first: true,
            seed,
            ..Settings::default()
        };
        let found = run(&problem, &Sampler::Directed, &settings).unwrap();
        assert!(found.stats.iterations <= 15, "{seed}: {:?}", found.stats);
    }
}

#[test]
fn the_same_seed_gives_the_same_plan() {
    let problem = problem(p(0.1, 0.1), 0.2, patrol);
    for sampler in samplers(&problem) {
        let settings = Settings {
            iterations: 2_000,
            seed: 7,
            // Shortened plans of different seeds are often the same.
            shorten: false,
            ..Settings::default()
        };
        let (one, two) = (
            run(&problem, &sampler, &settings).unwrap(),
            run(&problem, &sampler, &settings).unwrap(),
        );
        assert_eq!(one.path, two.path);
        let other = Settings {
            seed: 8,
            ..settings
        };
        assert_ne!(one.path, run(&problem, &sampler, &other).unwrap().path);
    }
}

#[test]
fn threads_are_deterministic_and_no_worse_than_one() {
    let problem = problem(p(0.1, 0.1), 0.2, patrol);
    for first in [false, true] {
        let one = Settings {
            iterations: 2_000,
            shorten: false,
            first,
            ..Settings::default()
        };
        let three = Settings {
            threads: 3,
            ..one.clone()
        };
        let alone = run(&problem, &Sampler::Biased, &one).unwrap();
        let (a, b) = (
            run(&problem, &Sampler::Biased, &three).unwrap(),
            run(&problem, &Sampler::Biased, &three).unwrap(),
        );
        assert_eq!((&a.path, a.cost), (&b.path, b.cost));
        assert_eq!(a.stats.threads, 3);
        if first {
            let found = |s: &Solution| s.stats.first_plan.unwrap().iterations;
            assert!(found(&a) <= found(&alone));
        } else {
            assert!(a.cost.total <= alone.cost.total);
            assert_eq!(a.stats.iterations, 6_000);
        }
    }
}

#[test]
fn a_raised_stop_ends_all_threads_with_the_best_so_far() {
    let problem = problem(p(0.1, 0.1), 0.5, visit);
    let stop = Stop::new();
    let flag = stop.clone();
    let mut observe = move |progress: Progress| {
        if progress.cost.is_some() {
            flag.raise();
        }
    };
    let settings = Settings {
        iterations: u64::MAX,
        threads: 2,
        ..Settings::default()
    };
    let solution = plan(&problem, &Sampler::Biased, &settings, &stop, &mut observe).unwrap();
    assert!(solution.cost.total > 0.0);
}

#[test]
fn first_stops_at_the_first_plan_and_more_iterations_improve_it() {
    let problem = problem(p(0.1, 0.1), 0.2, patrol);
    let first = Settings {
        first: true,
        ..Settings::default()
    };
    let one = run(&problem, &Sampler::Biased, &first).unwrap();
    let found = one.stats.first_plan.unwrap();
    assert_eq!(found.iterations, one.stats.iterations);
    assert_eq!(one.stats.improvements.len(), 1);
    let many = run(&problem, &Sampler::Biased, &Settings::default()).unwrap();
    assert!(many.cost.total < one.cost.total);
    assert_eq!(many.stats.first_plan.unwrap().iterations, found.iterations);
    assert!(
        many.stats
            .improvements
            .windows(2)
            .all(|w| w[1].cost < w[0].cost)
    );
}

#[test]
fn a_start_that_is_a_goal_needs_no_iteration() {
    let problem = problem(p(0.85, 0.15), 0.5, visit);
    let settings = Settings {
        first: true,
        ..Settings::default()
    };
    let solution = run(&problem, &Sampler::Uniform, &settings).unwrap();
    assert_eq!(solution.cost.total, 0.0);
    assert_eq!(solution.stats.iterations, 0);
}

#[test]
fn a_spent_budget_says_how_far_it_got() {
    let problem = problem(p(0.1, 0.1), 0.5, visit);
    let settings = Settings {
        iterations: 1,
        ..Settings::default()
    };
    let Err(PlanError::NotFound(why)) = run(&problem, &Sampler::Uniform, &settings) else {
        panic!("one iteration cannot find a plan here");
    };
    assert_eq!((why.steps_left, why.stats.iterations), (1, 1));
    assert_eq!(why.reason, EndReason::Iterations);
    let alphabet = problem.system.alphabet();
    let names: Vec<String> = why.missing.iter().map(|l| alphabet.show(l)).collect();
    assert_eq!(names, ["{a}"]);
}

/// Connecting a known place in one state can make the node cheaper from which it is to be connected in
/// another; that saving must not be lost.
#[test]
fn costs_stay_sums_of_moves_when_a_place_is_drawn_again() {
    let grid = Grid::new(map(), [10, 10], 0.1, p(0.05, 0.05)).unwrap();
    let task = visit(grid.alphabet());
    let mut tree = Tree::new(&grid, &task, grid.start(), &task.initial);
    let place = |x, y| grid.settle(p(x, y)).unwrap();
    // The corridor was reached by a long detour; from it the region was visited. Since then a shorter way
    // to a place next to the corridor was found.
    let (corridor, region, aside) = (place(0.75, 0.15), place(0.85, 0.15), place(0.75, 0.25));
    let sites = [corridor, region, aside].map(|spot| tree.site_for(spot));
    let (root, before, after) = (tree.in_state(StateId(0))[0], StateId(0), StateId(1));
    let (slow, _) = tree.hop(root, sites[0], before, 10.0);
    let (visited, _) = tree.hop(slow, sites[1], before, 0.1);
    tree.hop(root, sites[0], after, 100.0);
    tree.hop(root, sites[2], before, 1.0);
    tree.extend(corridor, Near::ball(1.0), &[]);
    let cost = |site: SiteId, state: StateId| {
        let here = tree.at_site(site).iter().find(|(q, _)| *q == state);
        tree.cost(here.unwrap().1)
    };
    assert!((cost(sites[0], before) - 1.1).abs() < 1e-12);
    assert!((tree.cost(visited) - 1.2).abs() < 1e-12);
    assert!((cost(sites[0], after) - 1.3).abs() < 1e-12);
}

#[test]
fn bad_settings_are_refused_by_name() {
    let problem = problem(p(0.1, 0.1), 0.5, visit);
    let settings = Settings {
        y_rand: 1.0,
        ..Settings::default()
    };
    let error = run(&problem, &Sampler::Uniform, &settings).unwrap_err();
    assert!(error.to_string().contains("y_rand"), "{error}");
}

#[test]
fn a_raised_stop_ends_with_the_best_so_far() {
    let problem = problem(p(0.1, 0.1), 0.5, visit);
    let stop = Stop::new();
    let flag = stop.clone();
    let mut observe = move |progress: Progress| {
        if progress.cost.is_some() {
            flag.raise();
        }
    };
    let settings = Settings {
        iterations: u64::MAX,
        ..Settings::default()
    };
    let solution = plan(&problem, &Sampler::Biased, &settings, &stop, &mut observe).unwrap();
    assert!(solution.cost.total > 0.0);
}

#[test]
fn what_no_cheaper_plan_can_visit_is_left_out() {
    let search = |problem: &Problem, informed: bool| {
        let settings = Settings {
            iterations: 6_000,
            informed,
            ..Settings::default()
        };
        let found = run(problem, &Sampler::Biased, &settings);
        let Solution { cost, stats, .. } = found.unwrap();
        (cost.total, stats.nodes)
    };
    // A plan that stays, and one that goes round.
    let problems = [
        problem(p(0.1, 0.1), 0.2, visit),
        problem(p(0.1, 0.1), 0.5, patrol),
    ];
    for (problem, share) in problems.iter().zip([0.4, 1.0]) {
        let ((least, few), (cost, all)) = (search(problem, true), search(problem, false));
        assert!((few as f64) < share * all as f64, "{few} of {all} nodes");
        assert!(least <= cost * (1.0 + 1e-3), "{least} {cost}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    /// After every growth the tree keeps its invariants.
    #[test]
    fn trees_keep_their_invariants(seed in 0_u64..1_000) {
        let problem = problem(p(0.1, 0.1), 0.5, patrol);
        let system = &*problem.system;
        let mut random = crate::random::generator(seed, 0);
        let mut tree = Tree::new(system, &problem.task.nba, problem.start, &problem.task.nba.initial);
        // Savings come down at once, or so slowly that many wait.
        tree.pass_on_at_most(if seed % 2 == 0 { usize::MAX } else { 1 });
        for k in 1..200_u32 {
            let at = if k % 3 == 0 {
                system.sample_letter(Letter(k % 3), &mut random)
            } else {
                system.sample_free(&mut random)
            };
            let spot = system.settle(at).unwrap();
            let anchor = tree.nearest(at);
            let near = Near {
                radius: 0.3,
                count: 20,
                more: 100,
            };
            tree.extend(spot, near, &[anchor]);
        }
        tree.check(system, &problem.task.nba);
    }
}
