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
