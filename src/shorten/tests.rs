//! Paths on maps whose shortest ones are known.

use std::sync::Arc;

use nalgebra::Point2;
use proptest::prelude::*;

use super::*;
use crate::automaton::{Limits, StateId};
use crate::plan::Waypoint;
use crate::system::Continuous;
use crate::workspace::{Bounds, Region};

fn p(x: f64, y: f64) -> Point2<f64> {
    Point2::new(x, y)
}

fn rectangle(x0: f64, y0: f64, x1: f64, y1: f64) -> Polygon {
    Polygon::rectangle(p(x0, y0), p(x1, y1)).unwrap()
}

fn map(obstacles: &[Polygon], regions: &[Polygon]) -> Workspace {
    let region = |(i, polygon): (usize, &Polygon)| Region {
        name: format!("l{}", i + 1),
        polygon: polygon.clone(),
    };
    let regions = regions.iter().enumerate().map(region).collect();
    Workspace::new(Bounds::unit(), obstacles.to_vec(), regions).unwrap()
}

fn task(map: &Workspace, text: &str) -> Task {
    let letters = Arc::clone(map.alphabet());
    Task::from_formula(&text.parse().unwrap(), letters, &Limits::default()).unwrap()
}

/// A plan through points, whose states do not matter.
fn path(prefix: &[Point2<f64>], suffix: &[Point2<f64>]) -> Path {
    let waypoint = |&at: &Point2<f64>| Waypoint {
        at,
        state: StateId(0),
    };
    Path {
        prefix: prefix.iter().map(waypoint).collect(),
        suffix: suffix.iter().map(waypoint).collect(),
    }
}

/// Shortens and verifies with the checker.
fn shorten(map: &Workspace, text: &str, given: &Path, weight: f64) -> Cost {
    let task = task(map, text);
    let (path, cost) = Shortener::new(map, &task, weight)
        .shorten(given, 20)
        .unwrap();
    let start = given.prefix[0].at;
    crate::verify::verify(
        map,
        start,
        &text.parse().unwrap(),
        &path,
        weight,
        Some(&cost),
    )
    .unwrap();
    cost
}

#[test]
fn strings_are_pulled_around_corners() {
    let walls = [
        rectangle(0.3, 0.0, 0.7, 0.5),
        rectangle(0.45, 0.5, 0.5, 0.6),
    ];
    let map = map(&walls, &[rectangle(0.9, 0.0, 1.0, 0.1)]);
    let points = [
        p(0.1, 0.05),
        p(0.2, 0.7),
        p(0.5, 0.95),
        p(0.8, 0.8),
        p(0.95, 0.05),
    ];
    let cost = shorten(&map, "F l1", &path(&points, &points[4..]), 1.0);
    // Over the peg's corners, past the wall's, to the region's top left corner.
    let way = [
        p(0.1, 0.05),
        p(0.3, 0.5),
        p(0.45, 0.6),
        p(0.5, 0.6),
        p(0.7, 0.5),
        p(0.9, 0.1),
    ];
    let best: f64 = way.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
    let found = cost.prefix;
    assert!(found > best - 1e-9 && found < best + 1e-5, "{found} {best}");
}

#[test]
fn visits_slide_along_borders_to_the_mirror_point() {
    let map = map(
        &[],
        &[rectangle(0.1, 0.8, 0.9, 1.0), rectangle(0.6, 0.1, 0.7, 0.2)],
    );
    let points = [p(0.1, 0.2), p(0.85, 0.95), p(0.65, 0.15)];
    let cost = shorten(&map, "F (l1 & F l2)", &path(&points, &points[2..]), 1.0);
    // By reflection at the line y = 0.8, to the second region's near corner.
    let best = (0.5_f64.powi(2) + (0.6 + 0.6_f64).powi(2)).sqrt();
    assert!((cost.prefix - best).abs() < 1e-5, "{} {best}", cost.prefix);
}

/// The waypoints on both sides of the border hold each other unless they move together.
#[test]
fn visits_that_touch_a_border_slide_along_it() {
    let map = map(&[], &[rectangle(0.7, 0.2, 0.9, 0.8)]);
    let start = p(0.3, 0.5);
    let (inside, outside) = (p(0.700_002, 0.71), p(0.699_998, 0.71));
    // Into the region and out again, to stay: nearest straight ahead.
    let left = path(&[start, inside, outside], &[outside]);
    let cost = shorten(&map, "F l1 & FG !l1", &left, 1.0);
    assert!((cost.total - 0.4).abs() < 1e-4, "{cost:?}");
    // In and out for ever, entered at one of the two.
    let ring = path(&[start, outside], &[outside, inside, outside]);
    let cost = shorten(&map, "GF l1 & GF !l1", &ring, 0.5);
    assert!((cost.prefix - 0.4).abs() < 1e-4, "{cost:?}");
    assert!(cost.suffix < 1e-4, "{cost:?}");
    // Not beyond the end of the border.
    let low = path(&[p(0.3, 0.1), inside, outside], &[outside]);
    let cost = shorten(&map, "F l1 & FG !l1", &low, 1.0);
    assert!((cost.total - 0.4_f64.hypot(0.1)).abs() < 1e-4, "{cost:?}");
}

#[test]
fn who_leaves_a_region_stops_beside_it() {
    let map = map(&[], &[rectangle(0.4, 0.4, 0.5, 0.5)]);
    // Staying outside, far from where it was left; and back in from there.
    let there = p(0.42, 0.45);
    let out = path(&[p(0.1, 0.45), there, p(0.9, 0.1)], &[p(0.9, 0.1)]);
    let back = path(&[p(0.1, 0.45), there, p(0.6, 0.9), there], &[there]);
    for (task, given, length) in [
        ("F(l1 & F G !l1)", &out, 0.3),
        ("F(l1 & F(!l1 & F l1))", &back, 0.3),
    ] {
        let cost = shorten(&map, task, given, 0.2);
        assert!((cost.prefix - length).abs() < 1e-4, "{task}: {cost:?}");
    }
}

/// From nearer to a corner than waypoints come by themselves, too.
#[test]
fn a_loop_across_a_border_slides_along_all_of_it() {
    let map = map(&[], &[rectangle(0.4, 0.6, 0.6, 0.8)]);
    let inset = 1e-6;
    let [out, within] = [
        p(0.6 - 1.2 * inset, 0.6 - inset),
        p(0.6 - 1.1 * inset, 0.6 + inset),
    ];
    let given = path(&[p(0.1, 0.3), out], &[out, within, out]);
    let cost = shorten(&map, "GF l1 & GF !l1", &given, 0.2);
    let straight = (p(0.4, 0.6) - p(0.1, 0.3)).norm();
    assert!((cost.prefix - straight).abs() < 1e-4, "{cost:?} {straight}");
}

#[test]
fn avoided_regions_are_gone_round() {
    let map = map(
        &[],
        &[rectangle(0.4, 0.0, 0.6, 0.5), rectangle(0.9, 0.0, 1.0, 0.1)],
    );
    let points = [p(0.1, 0.05), p(0.2, 0.9), p(0.8, 0.9), p(0.95, 0.05)];
    let cost = shorten(&map, "F l2 & G !l1", &path(&points, &points[3..]), 1.0);
    let way = [p(0.1, 0.05), p(0.4, 0.5), p(0.6, 0.5), p(0.9, 0.1)];
    let best: f64 = way.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
    assert!((cost.prefix - best).abs() < 1e-5, "{} {best}", cost.prefix);
}

#[test]
fn loops_shrink_to_the_shortest_between_regions() {
    let map = map(
        &[],
        &[rectangle(0.1, 0.4, 0.3, 0.6), rectangle(0.8, 0.2, 0.9, 0.9)],
    );
    // Which of the two visits completes the round is the automaton's choice: so is where the suffix begins.
    let (left, right) = (p(0.2, 0.5), p(0.85, 0.8));
    let task = task(&map, "GF l1 & GF l2");
    let shortener = Shortener::new(&map, &task, 0.2);
    let shorten = |from: Point2<f64>, to: Point2<f64>| {
        let prefix = [p(0.2, 0.1), left, right, left, from];
        let suffix = [from, p(0.5, 0.7), to, p(0.6, 0.3), from];
        shortener.shorten(&path(&prefix, &suffix), 20)
    };
    let found = shorten(left, right).or_else(|| shorten(right, left));
    let (path, cost) = found.expect("one of them is a plan");
    let formula = "GF l1 & GF l2".parse().unwrap();
    crate::verify::verify(&map, p(0.2, 0.1), &formula, &path, 0.2, Some(&cost)).unwrap();
    assert!((cost.suffix - 1.0).abs() < 2e-5, "{cost:?}");
}

#[test]
fn loops_are_entered_around_obstacles() {
    let map = map(
        &[rectangle(0.2, 0.3, 0.75, 0.4)],
        &[rectangle(0.1, 0.6, 0.2, 0.7), rectangle(0.8, 0.6, 0.9, 0.7)],
    );
    let task = task(&map, "GF l1 & GF l2");
    let shortener = Shortener::new(&map, &task, 0.2);
    let start = p(0.6, 0.2);
    let system = Continuous::new(Arc::new(map.clone()), start).unwrap();
    let walk = |from, to| {
        system
            .shortest_path(from, to)
            .map_or(vec![], |way| way[1..].to_vec())
    };
    // By the left end of the wall, though the right one is nearer to the other half of the loop.
    let (left, right) = (p(0.15, 0.65), p(0.85, 0.65));
    let given = [start, p(0.2, 0.3), p(0.2, 0.4), left];
    let shorten = |more: &[Point2<f64>], from, to| {
        let prefix = [&given, more, &[from]].concat();
        shortener.shorten(&path(&prefix, &[from, to, from]), 20)
    };
    let found = shorten(&[right], left, right).or_else(|| shorten(&[right, left], right, left));
    let (by_left, cost) = found.expect("one of them is a plan");
    assert!(cost.prefix > 0.65, "{cost:?}");
    let (by_right, less) = shortener
        .enter_around(&by_left, &walk)
        .expect("a better entry");
    assert!(less.total < cost.total && less.prefix < 0.55, "{less:?}");
    let formula = "GF l1 & GF l2".parse().unwrap();
    crate::verify::verify(&map, start, &formula, &by_right, 0.2, Some(&less)).unwrap();
    assert!(
        shortener.enter_around(&by_right, &walk).is_none(),
        "once is enough"
    );
}

/// Shortest ways around obstacles, as the planner asks for them.
fn walks(map: &Workspace) -> impl Fn(Point2<f64>, Point2<f64>) -> Vec<Point2<f64>> {
    let system = Continuous::new(Arc::new(map.clone()), p(0.01, 0.01)).unwrap();
    move |from, to| {
        let mut way = Vec::new();
        crate::system::TransitionSystem::walk(&system, from, to, &mut |p| way.push(p));
        way
    }
}

/// Verifies with the checker that a plan begins at `start` and does what `text` says.
fn check(
    map: &Workspace,
    text: &str,
    start: Point2<f64>,
    (path, cost): &(Path, Cost),
    weight: f64,
) {
    let formula = text.parse().unwrap();
    crate::verify::verify(map, start, &formula, path, weight, Some(cost)).unwrap();
}

#[test]
fn legs_take_the_other_way_around_an_obstacle_where_that_is_shorter() {
    let map = map(
        &[rectangle(0.3, 0.4, 0.8, 0.6)],
        &[
            rectangle(0.35, 0.0, 0.45, 0.1),
            rectangle(0.1, 0.45, 0.2, 0.55),
        ],
    );
    let (start, end) = (p(0.4, 0.9), p(0.4, 0.05));
    let by_right = path(&[start, p(0.85, 0.7), p(0.85, 0.3), end], &[end]);
    let walk = walks(&map);
    for text in ["F l1", "F l1 & G !l2"] {
        let task = task(&map, text);
        let shortener = Shortener::new(&map, &task, 1.0);
        let (taut, cost) = shortener.shorten(&by_right, 20).unwrap();
        // The other side of the obstacle is never seen by strings that are pulled.
        assert!(cost.total > 1.15, "{cost:?}");
        let found = shortener.go_around(&taut, &walk).unwrap();
        check(&map, text, start, &found, 1.0);
        assert!(found.1.total < 0.9, "{:?}", found.1);
        assert!(
            shortener.go_around(&found.0, &walk).is_none(),
            "once is enough"
        );
    }
}

#[test]
fn a_way_around_that_the_task_forbids_is_not_taken() {
    // The left way leads through l2.
    let map = map(
        &[rectangle(0.3, 0.4, 0.8, 0.6)],
        &[
            rectangle(0.35, 0.0, 0.45, 0.1),
            rectangle(0.0, 0.45, 0.35, 0.55),
        ],
    );
    let (start, end) = (p(0.4, 0.9), p(0.4, 0.05));
    let by_right = path(&[start, p(0.85, 0.7), p(0.85, 0.3), end], &[end]);
    let task = task(&map, "F l1 & G !l2");
    let shortener = Shortener::new(&map, &task, 1.0);
    let (taut, _) = shortener.shorten(&by_right, 20).unwrap();
    assert!(shortener.go_around(&taut, &walks(&map)).is_none());
}

/// Regions in the corners of a square, from the lower left one counter-clockwise.
fn four_corners() -> Workspace {
    let square = |x: f64, y: f64| rectangle(x, y, x + 0.1, y + 0.1);
    map(
        &[rectangle(0.45, 0.45, 0.55, 0.55)],
        &[
            square(0.1, 0.1),
            square(0.8, 0.1),
            square(0.8, 0.8),
            square(0.1, 0.8),
        ],
    )
}

#[test]
fn visits_are_put_in_another_order_where_the_task_allows_it() {
    let map = four_corners();
    let walk = walks(&map);
    let [a, b, c, d] = [p(0.15, 0.15), p(0.85, 0.15), p(0.85, 0.85), p(0.15, 0.85)];
    let start = p(0.15, 0.5);
    let (below, above) = (p(0.6, 0.4), p(0.6, 0.6));
    let crossing = path(&[start, c, below, a, d, above, b], &[b]);
    let patrol = path(&[start, a], &[a, below, c, d, above, b, a]);
    for (text, given, least, most) in [
        ("F l1 & F l2 & F l3 & F l4", &crossing, 2.0, 2.4),
        (
            "GF l1 & G(l1 -> F l2) & G(l1 -> F l3) & G(l1 -> F l4)",
            &patrol,
            2.0,
            2.9,
        ),
    ] {
        let task = task(&map, text);
        let shortener = Shortener::new(&map, &task, 0.2);
        let (mut plan, mut cost) = shortener.shorten(given, 20).expect(text);
        let before = cost.total;
        while let Some(found) = shortener.reorder(&plan, &walk, 1.0) {
            assert!(found.1.total < cost.total, "{text}");
            (plan, cost) = found;
            check(&map, text, start, &(plan.clone(), cost), 0.2);
        }
        let length = cost.prefix + cost.suffix;
        assert!(cost.total < 0.95 * before, "{text}: {before} {cost:?}");
        assert!((least..most).contains(&length), "{text}: {cost:?}");
    }
    // The same visits one after another: no other order is a plan.
    let task = task(&map, "F (l3 & F (l1 & F (l4 & F l2)))");
    let shortener = Shortener::new(&map, &task, 0.2);
    let (plan, _) = shortener.shorten(&crossing, 20).unwrap();
    assert!(shortener.reorder(&plan, &walk, 1.0).is_none());
}

#[test]
fn each_other_order_is_given_once() {
    for (count, to_last) in [(3, false), (4, true), (6, false), (7, true)] {
        let all = orders(count, to_last);
        let mut once = all.clone();
        once.sort();
        once.dedup();
        assert_eq!(once.len(), all.len(), "{count}");
        let old: Vec<usize> = (0..count).collect();
        for order in &all {
            assert!(*order != old && order[0] == 0, "{order:?}");
            assert!(!to_last || order[count - 1] == count - 1, "{order:?}");
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert_eq!(sorted, old);
        }
    }
}

/// A round of visits that ends where the robot has to stay: the nine shortest orders end elsewhere, and the automaton refuses them; and in
/// the second case no move of a few visits helps, though two of them together do.
#[test]
fn orders_are_found_behind_many_that_the_task_rules_out() {
    let cases = [
        (
            [
                (0.77, 0.83),
                (0.11, 0.79),
                (0.72, 0.25),
                (0.6, 0.11),
                (0.51, 0.6),
                (0.64, 0.56),
            ],
            2.107,
        ),
        (
            [
                (0.4, 0.6),
                (0.23, 0.44),
                (0.32, 0.75),
                (0.58, 0.61),
                (0.59, 0.27),
                (0.74, 0.59),
            ],
            1.393,
        ),
    ];
    for (places, shortest) in cases {
        let around = |&(x, y): &(f64, f64)| rectangle(x - 0.01, y - 0.01, x + 0.01, y + 0.01);
        let regions: Vec<Polygon> = places[1..].iter().map(around).collect();
        let map = map(&[], &regions);
        let text = "F l1 & F l2 & F l3 & F l4 & F G l5";
        let task = task(&map, text);
        let shortener = Shortener::new(&map, &task, 0.2);
        let points = places.map(|(x, y)| p(x, y));
        let (mut plan, mut cost) = shortener.shorten(&path(&points, &points[5..]), 20).unwrap();
        while let Some(found) = shortener.reorder(&plan, &walks(&map), 1.0) {
            check(&map, text, points[0], &found, 0.2);
            (plan, cost) = found;
        }
        // By way of the middles; the plan touches the regions.
        assert!(cost.prefix < shortest, "{cost:?}");
    }
}

/// Between two visits a leg has a waypoint, since what is seen changes twice along it. That is no visit: six would be too many.
#[test]
fn waypoints_between_visits_are_no_visits() {
    let xs = [0.1, 0.25, 0.4, 0.55, 0.7, 0.85];
    let map = map(&[], &xs.map(|x| rectangle(x, 0.1, x + 0.05, 0.15)));
    let text = "F l1 & F l2 & F l3 & F l4 & F l5 & F l6";
    let task = task(&map, text);
    let shortener = Shortener::new(&map, &task, 0.2);
    let start = p(0.05, 0.3);
    let mut points = vec![start];
    points.extend([0, 1, 4, 3, 2, 5].map(|i| p(xs[i] + 0.02, 0.14)));
    let given = path(&points, &points[6..]);
    let (plan, cost) = shortener.shorten(&given, 20).unwrap();
    assert!(plan.prefix.len() > 12, "{plan:?}");
    let found = shortener.reorder(&plan, &walks(&map), 1.0).unwrap();
    assert!(found.1.prefix < cost.prefix - 0.25, "{found:?} {cost:?}");
    check(&map, text, start, &found, 0.2);
}

/// The order that is shorter once it is taut is longer before, as `l1` is passed deep inside.
#[test]
fn orders_are_tried_that_are_shorter_only_once_they_are_taut() {
    let obstacles = [
        rectangle(0.425, 0.525, 0.81, 0.94),
        rectangle(0.5, 0.615, 0.935, 0.88),
    ];
    let regions = [
        rectangle(0.225, 0.225, 0.315, 0.31),
        rectangle(0.56, 0.17, 0.64, 0.28),
        rectangle(0.325, 0.61, 0.375, 0.73),
        rectangle(0.33, 0.25, 0.4, 0.325),
    ];
    let map = map(&obstacles, &regions);
    let text = "F l3 & (!l2 U l1) & F l2 & G F (l1 & F l4) & (!l4 U l1)";
    let task = task(&map, text);
    let shortener = Shortener::new(&map, &task, 0.2);
    let start = p(0.2663, 0.1378);
    let [first, third, second] = [p(0.296, 0.2675), p(0.36, 0.62), p(0.57, 0.27)];
    let [turn, back] = [p(0.34, 0.26), p(0.31, 0.26)];
    let given = path(&[start, first, third, second, turn], &[turn, back, turn]);
    let (plan, cost) = shortener.shorten(&given, 20).unwrap();
    let found = shortener.reorder(&plan, &walks(&map), SLACK).unwrap();
    assert!(found.1.total < 0.98 * cost.total, "{found:?} {cost:?}");
    check(&map, text, start, &found, 0.2);
}

#[test]
fn three_waypoints_across_a_border_slide_along_it_together() {
    let map = map(&[], &[rectangle(0.4, 0.1, 0.9, 0.5)]);
    // In, out and in again, far from where that is near.
    let text = "F (l1 & F (!l1 & F G l1))";
    let task = task(&map, text);
    let start = p(0.45, 0.9);
    let given = path(
        &[
            start,
            p(0.85, 0.499999),
            p(0.85, 0.500001),
            p(0.85, 0.499998),
        ],
        &[p(0.85, 0.499998)],
    );
    let found = Shortener::new(&map, &task, 0.2)
        .shorten(&given, SWEEPS)
        .unwrap();
    check(&map, text, start, &found, 0.2);
    assert!(found.1.prefix < 0.401, "{:?}", found.1);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    /// Hero's point is where the way by the segment is shortest, on whichever sides the ends lie.
    #[test]
    fn mirror_points_are_shortest(ends in proptest::array::uniform8(0.0..1.0_f64)) {
        let [ax, ay, bx, by, x, y, u, v] = ends;
        let (a, b, from, to) = (p(ax, ay), p(bx, by), p(x, y), p(u, v));
        prop_assume!((b - a).norm() > 1e-3);
        let way = |q: Point2<f64>| (q - from).norm() + (to - q).norm();
        let found = pull::mirror(a, b, from, to).expect("not on one line");
        let (least, _) = pull::least(a, b, &way);
        prop_assert!((way(found) - least).abs() < 1e-9, "{} {least}", way(found));
    }

    /// The taut string is free wherever the given one is, no longer, and clear of all corners.
    #[test]
    fn taut_strings_clear_their_corners(
        corners in proptest::collection::vec((0.0..1.0, 0.0..1.0), 0..20),
        ends in proptest::array::uniform6(0.0..1.0_f64),
    ) {
        let corners: Vec<Point2<f64>> = corners.into_iter().map(|(x, y)| p(x, y)).collect();
        let [ax, ay, x, y, bx, by] = ends;
        let (a, at, b) = (p(ax, ay), p(x, y), p(bx, by));
        let mut string = vec![a];
        string.extend(pull::taut(a, at, b, &corners));
        string.push(b);
        let length: f64 = string.windows(2).map(|w| (w[1] - w[0]).norm()).sum();
        prop_assert!(length <= (at - a).norm() + (b - at).norm() + 1e-9);
        let side = (b - a).perp(&(at - a)).signum();
        for w in string.windows(2) {
            for c in &corners {
                // A corner of the triangle beyond the string, on the side of `at`, would be crossed over.
                let in_triangle = side * (b - a).perp(&(c - a)) > 1e-9
                    && side * (at - a).perp(&(c - a)) < -1e-9
                    && side * (b - at).perp(&(c - at)) < -1e-9;
                let ahead = (w[1] - w[0]).dot(&(c - w[0])) / (w[1] - w[0]).norm_squared();
                let beyond = side * (w[1] - w[0]).perp(&(c - w[0]));
                prop_assert!(!(in_triangle && (0.0..=1.0).contains(&ahead) && beyond > 1e-9));
            }
        }
    }
}

#[test]
fn a_cheap_suffix_does_what_the_prefix_did() {
    // Both regions lie behind a wall; in a suffix of a tenth the price the whole round begins at the start.
    let map = map(
        &[rectangle(0.4, 0.3, 0.5, 0.7)],
        &[
            rectangle(0.7, 0.4, 0.8, 0.45),
            rectangle(0.7, 0.55, 0.8, 0.6),
        ],
    );
    let (start, corner) = (p(0.1, 0.5), p(0.45, 0.8));
    let (low, high) = (p(0.75, 0.43), p(0.75, 0.57));
    let given = path(&[start, corner, high], &[high, low, high]);
    let walk = walks(&map);
    let text = "G F l1 & G F l2";
    let task = task(&map, text);
    let round = |weight: f64| {
        let shortener = Shortener::new(&map, &task, weight);
        let (taut, cost) = shortener.shorten(&given, 20).unwrap();
        (shortener.begin_earlier(&taut, &walk), cost)
    };
    assert!(round(0.2).0.is_none(), "a longer suffix costs more");
    let (found, cost) = round(0.9);
    let found = found.unwrap();
    check(&map, text, start, &found, 0.9);
    // There and back above the wall, or below it on the way back.
    assert!(found.1.prefix < 1e-9, "{:?}", found.1);
    assert!(found.1.total < 0.3 * cost.total, "{:?}, {cost:?}", found.1);
}

#[test]
fn a_plan_that_stays_can_become_a_round() {
    let map = map(&[], &[rectangle(0.7, 0.4, 0.8, 0.6)]);
    let (start, end) = (p(0.1, 0.5), p(0.75, 0.5));
    let task = task(&map, "G F l1");
    let shortener = Shortener::new(&map, &task, 0.9);
    let (taut, _) = shortener.shorten(&path(&[start, end], &[end]), 20).unwrap();
    let found = shortener.begin_earlier(&taut, &walks(&map)).unwrap();
    check(&map, "G F l1", start, &found, 0.9);
    // Twice 0.6 at a tenth of the price, in place of 0.6 at nine tenths.
    assert!((found.1.total - 0.12).abs() < 1e-5, "{:?}", found.1);
}

#[test]
fn suffixes_are_entered_at_the_start_around_a_wall_that_is_in_the_way_of_their_legs() {
    // The suffix goes round two regions on either side; the start lies behind a wall.
    let map = map(
        &[rectangle(0.3, 0.45, 0.7, 0.55)],
        &[
            rectangle(0.05, 0.8, 0.15, 0.9),
            rectangle(0.85, 0.8, 0.95, 0.9),
        ],
    );
    let start = p(0.5, 0.4);
    let (left, right) = (p(0.1, 0.82), p(0.9, 0.82));
    let given = path(&[start, p(0.2, 0.4), left], &[left, right, left]);
    let text = "G F l1 & G F l2";
    let task = task(&map, text);
    let shortener = Shortener::new(&map, &task, 0.9);
    let (taut, cost) = shortener.shorten(&given, 20).unwrap();
    let found = shortener.enter_around(&taut, &walks(&map)).unwrap();
    check(&map, text, start, &found, 0.9);
    assert!(found.1.prefix < 1e-9, "{:?}", found.1);
    assert!(found.1.total < 0.6 * cost.total, "{:?}, {cost:?}", found.1);
}
