//! The exact planner on maps whose shortest missions are known, with automata written by hand.

use nalgebra::Point2;
use nngtl::alphabet::{Alphabet, Props};
use nngtl::automaton::{Nba, StateId, Task, Transition};
use nngtl::exact::{ExactConfig, ExactPlan, Infeasible, Roadmap, plan};
use nngtl::workspace::{Bounds, Polygon, Region, Workspace};

type Corners = ((f64, f64), (f64, f64));

fn point(x: f64, y: f64) -> Point2<f64> {
    Point2::new(x, y)
}

fn rectangle(((x0, y0), (x1, y1)): Corners) -> Polygon {
    Polygon::rectangle(point(x0, y0), point(x1, y1)).unwrap()
}

fn map(obstacles: &[Corners], regions: &[Corners]) -> Workspace {
    let regions = regions.iter().enumerate().map(|(i, &r)| Region {
        name: format!("l{}", i + 1),
        polygon: rectangle(r),
    });
    let obstacles = obstacles.iter().map(|&o| rectangle(o)).collect();
    Workspace::new(Bounds::unit(), obstacles, regions.collect()).unwrap()
}

/// A task from a step function over states and sets of propositions: `step(q, props)` lists the
/// successors. State 0 is initial.
fn task(
    workspace: &Workspace,
    states: u32,
    accepting: &[u32],
    step: impl Fn(u32, Props) -> Vec<u32>,
) -> Task {
    let alphabet: &Alphabet = workspace.alphabet();
    let row = |q: u32| {
        (0..states)
            .map(|to| Transition {
                target: StateId(to),
                guard: alphabet.filter(|props| step(q, props).contains(&to)),
            })
            .filter(|t| !t.guard.is_empty())
            .collect()
    };
    let nba = Nba {
        alphabet: workspace.alphabet().clone(),
        initial: vec![StateId(0)],
        accepting: (0..states).map(|q| accepting.contains(&q)).collect(),
        transitions: (0..states).map(row).collect(),
    };
    Task::from_trimmed(nba, None)
}

/// `F l1 & F l2 & …`: the state is the set of regions visited.
fn visit_all(workspace: &Workspace, count: u32) -> Task {
    let full = (1 << count) - 1;
    task(workspace, full + 1, &[full], |q, props| {
        vec![q | (props.0 as u32 & full)]
    })
}

/// `G F l1 & G F l2`
fn patrol(workspace: &Workspace) -> Task {
    task(workspace, 3, &[2], |q, props| {
        let waiting_for_second = q == 1;
        match (waiting_for_second, props.contains(0), props.contains(1)) {
            (false, true, _) => vec![1],
            (false, false, _) => vec![0],
            (true, _, true) => vec![2],
            (true, _, false) => vec![1],
        }
    })
}

/// Every step keeps the segment rule, and the waypoint word has the run that the plan states.
fn check(workspace: &Workspace, task: &Task, plan: &ExactPlan) {
    for part in [&plan.path.prefix, &plan.path.suffix] {
        for w in part.windows(2) {
            assert!(
                workspace.step(w[0].at, w[1].at),
                "{:?} to {:?}",
                w[0].at,
                w[1].at
            );
            let letter = workspace.letter_at(w[0].at).unwrap();
            let mut next = task.nba.successors(w[0].state, letter);
            assert!(next.any(|q| q == w[1].state));
        }
    }
    let entry = plan.path.prefix.last().unwrap();
    let mut round = plan.path.suffix.iter();
    assert!(round.any(|w| task.feasible.contains(&w.state)));
    assert_eq!(plan.path.suffix.first(), Some(entry));
    assert_eq!(plan.path.suffix.last(), Some(entry));
    assert!(task.nba.initial.contains(&plan.path.prefix[0].state));
}

fn solve(workspace: &Workspace, start: Point2<f64>, task: &Task) -> ExactPlan {
    let plan = plan(workspace, start, task, 0.2).unwrap();
    check(workspace, task, &plan);
    plan
}

/// Two visits cost their insets at most; sampling of borders must be refined away.
const SLACK: f64 = 5e-3;

#[test]
fn the_nearest_point_of_a_region_is_visited() {
    let map = map(&[], &[((0.7, 0.4), (0.9, 0.8))]);
    let plan = solve(&map, point(0.2, 0.5), &visit_all(&map, 1));
    assert!((plan.cost.prefix - 0.5).abs() < SLACK, "{:?}", plan.cost);
    assert_eq!(plan.cost.suffix, 0.0);
    assert_eq!(plan.path.suffix.len(), 1);
}

#[test]
fn a_touched_border_reflects_the_path() {
    // From (0.2, 0.5) up to the long strip and down to the small region: mirror the goal.
    let strip = ((0.0, 0.8), (1.0, 0.9));
    let goal = ((0.8, 0.49), (0.82, 0.51));
    let map = map(&[], &[strip, goal]);
    let task = task(&map, 3, &[2], |q, props| match q {
        0 if props.contains(0) => vec![1],
        1 if props.contains(1) => vec![2],
        q => vec![q],
    });
    let plan = solve(&map, point(0.2, 0.5), &task);
    let mirrored = point(0.2, 1.1) - point(0.8, 0.51);
    assert!(
        (plan.cost.prefix - mirrored.norm()).abs() < SLACK,
        "{:?}",
        plan.cost
    );
}

#[test]
fn paths_bend_at_obstacle_corners() {
    let map = map(&[((0.4, 0.0), (0.6, 0.8))], &[((0.9, 0.1), (1.0, 0.2))]);
    let plan = solve(&map, point(0.1, 0.1), &visit_all(&map, 1));
    let over = (point(0.4, 0.8) - point(0.1, 0.1)).norm()
        + 0.2
        + (point(0.9, 0.2) - point(0.6, 0.8)).norm();
    assert!((plan.cost.prefix - over).abs() < SLACK, "{:?}", plan.cost);
}

/// A region that stands where the obstacle does hides none of its corners.
#[test]
fn corners_on_the_borders_of_regions_are_bent_at() {
    let wall = ((0.25, 0.5), (0.75, 0.75));
    let goal = ((0.0, 0.75), (0.25, 1.0));
    let map = map(&[wall], &[goal, wall]);
    let task = visit_all(&map, 1);
    let plan = solve(&map, point(0.5, 0.5), &task);
    // Along the wall's lower side and up its left one.
    assert!((plan.cost.prefix - 0.5).abs() < 2e-3, "{:?}", plan.cost);
}

/// An obstacle's corner on the border of one region, in line with another of its corners, and between two regions: from
/// there the first one is left and the second one entered.
#[test]
fn a_corner_in_line_with_others_is_the_only_way() {
    // Twelfths of the map.
    let at = |x: f64, y: f64| (x / 12.0, y / 12.0);
    let obstacles = [(at(3.0, 3.0), at(9.0, 7.0)), (at(6.0, 0.0), at(8.0, 6.0))];
    let regions = [(at(8.0, 3.0), at(11.0, 6.0)), (at(7.0, 4.0), at(9.0, 10.0))];
    let workspace = map(&obstacles, &regions);
    let roadmap = Roadmap::of_regions(&workspace, ExactConfig::default(), Props::single(0));
    let task = visit_all(&workspace, 1);
    let found = roadmap.plan(point(0.18, 0.23), &task, 0.2).unwrap();
    check(&workspace, &task, &found);
    let way = [(0.18, 0.23), at(3.0, 7.0), at(9.0, 7.0), at(9.0, 6.0)].map(|(x, y)| point(x, y));
    let length: f64 = way.windows(2).map(|leg| (leg[1] - leg[0]).norm()).sum();
    let prefix = found.cost.prefix;
    assert!(
        (prefix - length).abs() < SLACK,
        "{prefix}, shortest {length}"
    );
}

#[test]
fn regions_without_meaning_are_crossed_straight() {
    let map = map(&[], &[((0.8, 0.4), (0.9, 0.6)), ((0.3, 0.2), (0.5, 0.8))]);
    let only_first = task(&map, 2, &[1], |q, props| {
        vec![u32::from(q == 1 || props.contains(0))]
    });
    let plan = solve(&map, point(0.1, 0.5), &only_first);
    assert!((plan.cost.prefix - 0.7).abs() < SLACK, "{:?}", plan.cost);
    // One waypoint in the region that is crossed, one before and one after it at most.
    assert!(plan.path.prefix.len() <= 5, "{:?}", plan.path.prefix);
}

#[test]
fn forbidden_regions_are_gone_round() {
    let map = map(&[], &[((0.8, 0.4), (0.9, 0.6)), ((0.3, 0.0), (0.5, 0.8))]);
    let avoiding = task(&map, 2, &[1], |q, props| match (q, props.contains(1)) {
        (0, true) => vec![],
        (q, _) => vec![u32::from(q == 1 || props.contains(0))],
    });
    let plan = solve(&map, point(0.1, 0.5), &avoiding);
    let round = (point(0.3, 0.8) - point(0.1, 0.5)).norm()
        + 0.2
        + (point(0.8, 0.6) - point(0.5, 0.8)).norm();
    assert!(
        (plan.cost.prefix - round).abs() < 2.0 * SLACK,
        "{:?}",
        plan.cost
    );
}

#[test]
fn a_patrol_goes_to_and_fro_between_facing_borders() {
    let map = map(&[], &[((0.1, 0.1), (0.2, 0.2)), ((0.7, 0.1), (0.8, 0.2))]);
    let task = patrol(&map);
    let plan = solve(&map, point(0.4, 0.15), &task);
    assert!((plan.cost.suffix - 1.0).abs() < SLACK, "{:?}", plan.cost);
    // The start lies on the loop.
    assert!(plan.cost.prefix < SLACK, "{:?}", plan.cost);
}

#[test]
fn the_cheapest_order_wins() {
    let regions = [
        ((0.1, 0.8), (0.15, 0.85)),
        ((0.5, 0.8), (0.55, 0.85)),
        ((0.9, 0.8), (0.95, 0.85)),
    ];
    let map = map(&[], &regions);
    let plan = solve(&map, point(0.05, 0.82), &visit_all(&map, 3));
    assert!((plan.cost.prefix - 0.85).abs() < SLACK, "{:?}", plan.cost);
}

#[test]
fn each_kind_of_failure_says_why() {
    let wall = ((0.4, 0.0), (0.6, 1.0));
    let closed = map(
        &[wall],
        &[((0.1, 0.1), (0.2, 0.2)), ((0.7, 0.1), (0.8, 0.2))],
    );
    let at = |x, y, task: &Task| plan(&closed, point(x, y), task, 0.2).unwrap_err();
    assert_eq!(at(0.3, 0.5, &visit_all(&closed, 2)), Infeasible::NoPrefix);
    let start = at(0.5, 0.5, &visit_all(&closed, 2));
    assert!(matches!(start, Infeasible::Start { x: 0.5, .. }));
    let never = task(&closed, 1, &[], |q, _| vec![q]);
    assert_eq!(at(0.3, 0.5, &never), Infeasible::Unsatisfiable);
    // Accepting once in l1, and again only in l2, beyond the wall.
    let there_and_over = task(&closed, 2, &[1], |q, props| match q {
        0 if props.contains(0) => vec![1],
        1 if props.contains(1) => vec![0],
        0 => vec![0],
        _ => vec![],
    });
    assert_eq!(at(0.3, 0.5, &there_and_over), Infeasible::NoSuffix);
}

#[test]
fn refinement_never_costs_and_sampling_finer_hardly_gains() {
    let obstacles = [((0.3, 0.35), (0.5, 0.6)), ((0.6, 0.1), (0.75, 0.45))];
    let regions = [
        ((0.05, 0.7), (0.15, 0.9)),
        ((0.8, 0.7), (0.95, 0.8)),
        ((0.8, 0.05), (0.9, 0.2)),
        ((0.45, 0.1), (0.55, 0.2)),
    ];
    let map = map(&obstacles, &regions);
    let task = visit_all(&map, 4);
    let cost = |config: ExactConfig| {
        let roadmap = Roadmap::new(&map, config);
        let plan = roadmap.plan(point(0.1, 0.1), &task, 0.2).unwrap();
        check(&map, &task, &plan);
        plan.cost.total
    };
    let config = ExactConfig::default();
    let (rough, refined) = (
        cost(ExactConfig {
            sweeps: 0,
            ..config
        }),
        cost(config),
    );
    let fine = cost(ExactConfig {
        spacing: 0.01,
        ..config
    });
    assert!(refined <= rough);
    assert!((refined - fine) / fine < 2e-3, "{refined} against {fine}");
}
