//! The shipped scenarios: they load without warnings, and show what they are there to show.

use std::path::Path;

use nalgebra::Point2;
use nngtl::scenario::Scenario;
use nngtl::workspace::visibility::VisibilityGraph;

fn shipped(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("scenarios")
        .join(name)
}

#[test]
fn every_shipped_scenario_loads_without_a_warning() {
    let mut names = Vec::new();
    for entry in std::fs::read_dir(shipped("")).unwrap() {
        let path = entry.unwrap().path();
        // Map files lie beside the scenarios that name them.
        let ending = path.extension().unwrap_or_default();
        if !["toml", "json", "jsonl"].iter().any(|e| ending == *e) {
            continue;
        }
        for scenario in Scenario::load_all(&path).unwrap() {
            let scenario =
                scenario.unwrap_or_else(|e| panic!("{e}\n{}", e.snippet().unwrap_or_default()));
            assert_eq!(scenario.warnings(), [""; 0], "{}", path.display());
            names.push(scenario.name);
        }
    }
    names.sort();
    let several = names.len();
    names.dedup();
    assert_eq!(
        names.len(),
        several,
        "two scenarios share a name: {names:?}"
    );
    assert!(several >= 10, "{names:?}");
}

/// The length of the shortest way from the start through the named regions in this order, around
/// obstacles. Regions are sampled densely, so the true infimum is up to a few thousandths less.
fn shortest_through(scenario: &Scenario, order: [&str; 3]) -> f64 {
    const STEPS: usize = 12;
    let map = &scenario.workspace;
    let graph = VisibilityGraph::new(map.clone());
    let mut from = vec![(scenario.start, 0.0)];
    for name in order {
        let region = map.regions().iter().position(|r| r.name == name).unwrap();
        let polygon = &map.regions()[region].polygon;
        let (min, max) = (polygon.min(), polygon.max());
        let at = |i: usize, j: usize| {
            let share = |k: usize| (k as f64 + 0.5) / STEPS as f64;
            Point2::new(
                min.x + (max.x - min.x) * share(i),
                min.y + (max.y - min.y) * share(j),
            )
        };
        let inside = |p: &Point2<f64>| {
            map.letter_at(*p)
                .is_some_and(|l| map.alphabet().props(l).contains(region))
        };
        let next: Vec<(Point2<f64>, f64)> = (0..STEPS * STEPS)
            .map(|n| at(n % STEPS, n / STEPS))
            .filter(inside)
            .map(|p| {
                let paths = graph.paths_to(p);
                let through = |&(a, length): &(Point2<f64>, f64)| {
                    paths
                        .first_leg(&graph, a)
                        .map_or(f64::INFINITY, |leg| length + leg.0)
                };
                (p, from.iter().map(through).fold(f64::INFINITY, f64::min))
            })
            .collect();
        assert!(next.len() > 50, "too few points in {name}");
        from = next;
    }
    from.iter().map(|p| p.1).fold(f64::INFINITY, f64::min)
}

/// `nngtl.md`, V-A: both orders are feasible, and l2 → l3 → l1 is the cheaper one. Here by far more
/// than the 5 % that make it unmistakable.
#[test]
fn the_case_study_has_two_orders_and_the_papers_is_cheaper() {
    let scenario = Scenario::load(shipped("case-study.toml")).unwrap();
    let papers = shortest_through(&scenario, ["l2", "l3", "l1"]);
    let other = shortest_through(&scenario, ["l3", "l2", "l1"]);
    assert!(other.is_finite());
    assert!(other > 1.05 * papers, "{papers} and {other}");
}

/// The published map of TL-RRT*, number by number.
#[test]
fn the_reference_case_is_the_published_one() {
    let scenario = Scenario::load(shipped("tl-rrt-star.toml")).unwrap();
    let map = &scenario.workspace;
    assert_eq!(
        (scenario.start, scenario.weight),
        (Point2::new(0.8, 0.1), 0.2)
    );
    assert_eq!(map.obstacles().len(), 2);
    let corners = [
        (0.1, 0.7),
        (0.7, 0.7),
        (0.7, 0.3),
        (0.3, 0.3),
        (0.0, 0.1),
        (0.0, 0.4),
    ];
    for (region, (x, y)) in map.regions().iter().zip(corners) {
        assert!(
            (region.polygon.area() - 0.02).abs() < 1e-12,
            "{}",
            region.name
        );
        let corner = Point2::new(x, y);
        assert!(
            region.polygon.vertices().contains(&corner),
            "{}",
            region.name
        );
        assert_eq!(region.polygon.min(), corner, "{}", region.name);
    }
}
