//! Where directed and guided points lie.

use super::*;
use crate::automaton::{Limits, Nba, Transition};
use crate::random::generator;
use crate::system::Continuous;
use crate::workspace::{Bounds, Polygon, Region, Side, Workspace};

const DRAWS: usize = 2_000;

fn p(x: f64, y: f64) -> Point2<f64> {
    Point2::new(x, y)
}

fn rectangle(x0: f64, y0: f64, x1: f64, y1: f64) -> Polygon {
    Polygon::rectangle(p(x0, y0), p(x1, y1)).unwrap()
}

/// "Visit a", with the start in the lower left and the region in the lower right.
fn world(obstacles: Vec<Polygon>) -> (Continuous, Task) {
    world_with(obstacles, None, false)
}

/// The same with another region b, which must not be entered before a if it is `barred`.
fn world_with(obstacles: Vec<Polygon>, b: Option<Polygon>, barred: bool) -> (Continuous, Task) {
    let a = Region {
        name: "a".to_owned(),
        polygon: rectangle(0.8, 0.1, 0.9, 0.2),
    };
    let b = b.map(|polygon| Region {
        name: "b".to_owned(),
        polygon,
    });
    let regions = std::iter::once(a).chain(b).collect();
    let map = Workspace::new(Bounds::unit(), obstacles, regions).unwrap();
    let alphabet = Arc::clone(map.alphabet());
    let there = alphabet.letters_with(alphabet.proposition("a").unwrap());
    let mut waits = there.complement();
    if barred && let Some(b) = alphabet.proposition("b") {
        waits.subtract(&alphabet.letters_with(b));
    }
    let to = |target, guard| Transition {
        target: StateId(target),
        guard,
    };
    let nba = Nba {
        initial: vec![StateId(0)],
        accepting: vec![false, true],
        transitions: vec![
            vec![to(0, waits), to(1, there)],
            vec![to(1, alphabet.all())],
        ],
        alphabet,
    };
    let system = Continuous::new(Arc::new(map), p(0.1, 0.1)).unwrap();
    (system, Task::from_trimmed(nba, None))
}

fn a_wall() -> Vec<Polygon> {
    vec![rectangle(0.4, 0.0, 0.6, 0.7)]
}

/// Points that a sampler proposes, with the chosen nodes' places, for a tree with the start and further places in it.
fn draws(
    world: &(Continuous, Task),
    settings: &Settings,
    sampler: &Sampler,
    further: &[Point2<f64>],
) -> Vec<(Point2<f64>, Option<Point2<f64>>)> {
    draws_for(false, world, settings, sampler, further)
}

/// The same, in the search for better plans if one is known already.
fn draws_for(
    reached: bool,
    world: &(Continuous, Task),
    settings: &Settings,
    sampler: &Sampler,
    further: &[Point2<f64>],
) -> Vec<(Point2<f64>, Option<Point2<f64>>)> {
    let (system, task) = world;
    let mut tree = Tree::new(system, &task.nba, system.start(), &task.nba.initial);
    for &at in further {
        let near = settings.near(tree.site_count(), 1.0);
        tree.extend(system.settle(at).unwrap(), near, &[]).unwrap();
    }
    let mut random = generator(11, 0);
    let view = View {
        system,
        task,
        settings,
        tree: &tree,
        aim: Aim::Prefix { reached },
    };
    (0..DRAWS)
        .filter_map(|_| sampler.draw(&view, &mut random))
        .map(|d| (d.at, d.closest.map(|n| tree.spot(n).at)))
        .collect()
}

fn mostly_directed() -> Settings {
    Settings {
        y_rand: 0.99,
        alpha: 0.99,
        ..Settings::default()
    }
}

fn by_the_paper() -> Settings {
    Settings {
        y_rand: 0.99,
        alpha: 0.99,
        ..Settings::default().paper_rule()
    }
}

fn share<T>(all: &[T], is: impl Fn(&T) -> bool) -> f64 {
    all.iter().filter(|x| is(x)).count() as f64 / all.len() as f64
}

fn within(at: Point2<f64>, centre: Point2<f64>, half: f64) -> bool {
    (at - centre).amax() <= half + 1e-12
}

#[test]
fn a_target_in_sight_is_drawn_from_its_region() {
    let world = world(Vec::new());
    let found = draws(&world, &mostly_directed(), &Sampler::Directed, &[]);
    let hits = share(&found, |d| within(d.0, p(0.85, 0.15), 0.05));
    assert!(hits > 0.8, "{hits} of the points lie in the region");
    let found = draws(&world, &by_the_paper(), &Sampler::Directed, &[]);
    let hits = share(&found, |d| within(d.0, p(0.85, 0.15), 0.05));
    assert!(
        hits < 0.4,
        "C-2 draws from the rectangle: {hits} lie in the region"
    );
}

#[test]
fn a_tree_begins_with_the_rules_alone() {
    let world = world(Vec::new());
    let seldom = |settings: Settings| Settings {
        y_rand: 0.1,
        alpha: 0.1,
        ..settings
    };
    let hits = |settings: Settings, sampler: &Sampler| {
        let found = draws(&world, &seldom(settings), sampler, &[]);
        let (first, later) = found.split_at(32);
        [first, later].map(|part| share(part, |d| within(d.0, p(0.85, 0.15), 0.05)))
    };
    let ours = Settings::default();
    let [first, later] = hits(ours.clone(), &Sampler::Directed);
    assert_eq!(first, 1.0, "of the first points");
    assert!(later < 0.1, "{later} of the others");
    for (settings, sampler) in [
        (ours.paper_rule(), Sampler::Directed),
        (Settings::default(), Sampler::Biased),
    ] {
        let [first, _] = hits(settings, &sampler);
        assert!(first < 0.5, "{first} by {}", sampler.name());
    }
}

#[test]
fn a_hidden_target_is_drawn_around_the_corner() {
    let world = world(a_wall());
    let settings = mostly_directed();
    // A cell of the heatmap that the square cuts counts whole.
    let square = settings.corner + 1.0 / 200.0;
    let corner = p(0.4, 0.7);
    let guide = |states| Guide::new(&Guidance::flat(states), states).unwrap();
    for sampler in [Sampler::Directed, Sampler::Guided(Arc::new(guide(2)))] {
        let found = draws(&world, &settings, &sampler, &[]);
        let near = share(&found, |d| within(d.0, corner, square));
        assert!(
            near > 0.9,
            "{}: {near} lie around the corner",
            sampler.name()
        );
    }
    let found = draws(&world, &by_the_paper(), &Sampler::Directed, &[]);
    let above = share(&found, |d| d.0.y > 0.2);
    assert!(
        above < 0.1,
        "C-2's rectangle holds no way around: {above} lie above it"
    );
}

#[test]
fn the_node_with_the_least_way_left_leads_and_tires() {
    let world = world(a_wall());
    let ahead = p(0.5, 0.8);
    let places = [p(0.2, 0.3), p(0.1, 0.9), ahead, p(0.3, 0.5)];
    let found = draws(&world, &mostly_directed(), &Sampler::Directed, &places);
    assert_eq!(found[0].1, Some(ahead));
    let nodes: std::collections::BTreeSet<_> = found
        .iter()
        .filter_map(|d| d.1)
        .map(|at| (at.x.to_bits(), at.y.to_bits()))
        .collect();
    assert_eq!(
        nodes.len(),
        5,
        "none brought anything new, so each had its turn"
    );
    let found = draws(&world, &by_the_paper(), &Sampler::Directed, &places);
    let first = share(&found, |d| d.1 == Some(ahead));
    assert!((first - 0.2).abs() < 0.05, "S-2 draws uniformly: {first}");
}

#[test]
fn what_is_barred_is_gone_around() {
    // Across the straight way to the target, open below.
    let pond = rectangle(0.4, 0.05, 0.6, 0.9);
    let barred = world_with(Vec::new(), Some(pond.clone()), true);
    let found = draws(&barred, &mostly_directed(), &Sampler::Directed, &[]);
    let below = share(&found, |d| within(d.0, p(0.4, 0.05), 0.05));
    assert!(below > 0.9, "{below} lie around the pond's lower corner");
    let wet = share(&found, |d| {
        let inside = |x: f64, low: f64, high: f64| low < x && x < high;
        inside(d.0.x, 0.4, 0.6) && inside(d.0.y, 0.05, 0.9)
    });
    assert!(
        wet < 0.05,
        "{wet} lie in the pond, from where nothing follows"
    );
}

#[test]
fn a_region_on_the_way_is_stopped_in_or_passed_beside_it() {
    let (start, target) = (p(0.1, 0.1), rectangle(0.8, 0.1, 0.9, 0.2));
    // From side to side: the leg across needs a stop inside.
    let wide = world_with(Vec::new(), Some(rectangle(0.4, 0.0, 0.6, 1.0)), false);
    let found = draws(&wide, &mostly_directed(), &Sampler::Directed, &[]);
    let inside = share(&found, |d| (0.4..=0.6).contains(&d.0.x));
    assert!(inside > 0.9, "{inside} lie in the river");
    // Less high: two moves lead beside it, and three across.
    let small = world_with(Vec::new(), Some(rectangle(0.4, 0.0, 0.5, 0.2)), false);
    let map = small.0.map();
    let two_moves = |at: Point2<f64>| {
        let middle = p(0.85, 0.15);
        map.step(start, at) && map.step(at, middle) && target.side_of(at, 1e-9) == Side::Outside
    };
    let first = |reached| {
        let found = draws_for(reached, &small, &mostly_directed(), &Sampler::Directed, &[]);
        share(&found, |d| two_moves(d.0))
    };
    let (before, after) = (first(false), first(true));
    assert!(before > 0.8, "{before} lead to the target in two moves");
    assert!(after < 0.5, "once a plan is known, lengths count: {after}");
}

#[test]
fn where_obstacles_touch_the_corner_itself_is_drawn() {
    // Two walls that meet in a point in the middle of the map leave no other way.
    let tip = p(0.5, 0.5);
    let wall = |x: f64, y: f64| Polygon::new(vec![tip, p(x, y), p(1.0 - x, y)]).unwrap();
    let walls = vec![wall(0.3, 0.0), wall(0.3, 1.0)];
    let found = draws(&world(walls), &mostly_directed(), &Sampler::Directed, &[]);
    let there = share(&found, |d| d.0 == tip);
    assert!(there > 0.9, "{there} lie where the walls meet");
}

#[test]
fn the_nearest_of_several_targets_comes_first() {
    let region = |name: &str, polygon| Region {
        name: name.to_owned(),
        polygon,
    };
    let (near, far) = (rectangle(0.2, 0.1, 0.3, 0.2), rectangle(0.8, 0.8, 0.9, 0.9));
    let regions = vec![region("near", near), region("far", far)];
    let map = Workspace::new(Bounds::unit(), Vec::new(), regions).unwrap();
    let system = Continuous::new(Arc::new(map), p(0.1, 0.1)).unwrap();
    let formula = "F near & F far".parse().unwrap();
    let alphabet = Arc::clone(system.map().alphabet());
    let task = Task::from_formula(&formula, alphabet, &Limits::default()).unwrap();
    let world = (system, task);
    let (system, task) = (&world.0, &world.1);
    // A node that is chosen again and again without gain tires, so each draw is the first of its tree.
    let far_off = |lead| {
        let settings = Settings {
            lead,
            ..mostly_directed()
        };
        let first = |seed| {
            let tree = Tree::new(system, &task.nba, system.start(), &task.nba.initial);
            let view = View {
                system,
                task,
                settings: &settings,
                tree: &tree,
                aim: Aim::Prefix { reached: false },
            };
            let draw = Sampler::Directed.draw(&view, &mut generator(seed, 0));
            draw.is_some_and(|d| d.at.x > 0.5)
        };
        (0..200).filter(|&seed| first(seed)).count()
    };
    let (ours, drawn) = (far_off(0.95), far_off(0.0));
    assert!(ours < 40, "{ours} of 200 head for the far region");
    assert!(drawn > 70, "without regard to the way: {drawn} of 200");
}

#[test]
fn dead_ends_stay_out_of_the_tree() {
    let pond = rectangle(0.4, 0.05, 0.6, 0.9);
    for barred in [true, false] {
        let (system, task) = world_with(Vec::new(), Some(pond.clone()), barred);
        let mut tree = Tree::new(&system, &task.nba, system.start(), &task.nba.initial);
        let near = Settings::default().near(1, 1.0);
        let there = system.settle(p(0.5, 0.5)).unwrap();
        assert_eq!(tree.extend(there, near, &[]).is_none(), barred);
        tree.check(&system, &task.nba);
    }
}

#[test]
fn a_gap_of_any_width_is_found() {
    for gap in [0.03, 0.003, 0.0003] {
        let walls = vec![
            rectangle(0.4, gap, 0.42, 1.0),
            rectangle(0.5, 0.0, 0.52, 1.0 - gap),
        ];
        let world = world(walls);
        // Beside the first gap: what is needed lies behind it.
        let ahead = p(0.38, gap / 2.0);
        let found = draws(&world, &mostly_directed(), &Sampler::Directed, &[ahead]);
        let behind = share(&found, |d| d.0.x > 0.42 && d.0.y < 0.1);
        assert!(
            behind > 0.05,
            "{behind} of the points lie behind a gap of {gap}"
        );
    }
}

#[test]
fn a_node_whose_letter_takes_another_step_does_not_lead() {
    // a, then b, then a again; the region of b has nodes in the state that waits for b.
    let world = {
        let (system, _) = world_with(Vec::new(), Some(rectangle(0.4, 0.4, 0.5, 0.5)), false);
        let alphabet = Arc::clone(system.map().alphabet());
        let formula = "F (b && F a)".parse().unwrap();
        let task = Task::from_formula(&formula, alphabet, &Default::default()).unwrap();
        (system, task)
    };
    let (inside, beside) = (p(0.45, 0.45), p(0.38, 0.38));
    let found = draws(
        &world,
        &mostly_directed(),
        &Sampler::Directed,
        &[inside, beside],
    );
    // The node inside has seen b: all that is left for it is a.
    let wrong = share(&found, |d| d.1 == Some(inside) && within(d.0, inside, 0.05));
    assert!(wrong < 0.05, "{wrong} go from b to b");
}

#[test]
fn regions_are_met_where_they_are_entered() {
    let world = world(Vec::new());
    let border = |at: Point2<f64>| (at.x - 0.8).min(at.y - 0.1).abs() < 1e-3;
    let found = draws(&world, &mostly_directed(), &Sampler::Directed, &[]);
    let hits = share(&found, |d| border(d.0));
    assert!(hits > 0.7, "{hits} lie where the legs enter the region");
    let found = draws(&world, &by_the_paper(), &Sampler::Directed, &[]);
    let hits = share(&found, |d| border(d.0));
    assert!(hits < 0.1, "by the paper's rule {hits} lie there");
}

#[test]
fn better_plans_are_looked_for_at_the_corners_of_a_region() {
    let world = world(Vec::new());
    let corners = [p(0.8, 0.1), p(0.9, 0.1), p(0.9, 0.2), p(0.8, 0.2)];
    let around = |at: Point2<f64>, k: usize| within(at, corners[k], 0.01);
    let shares = |reached: bool, settings: &Settings| -> [f64; 4] {
        let found = draws_for(reached, &world, settings, &Sampler::Directed, &[]);
        std::array::from_fn(|k| share(&found, |d| around(d.0, k)))
    };
    let better = shares(true, &mostly_directed());
    assert!(better.iter().all(|&s| s > 0.05), "{better:?}");
    let first = shares(false, &mostly_directed());
    assert!(first[2] < 0.02, "the far corner: {first:?}");
    let paper = shares(true, &by_the_paper());
    assert!(paper.iter().all(|&s| s < 0.05), "{paper:?}");
}

#[test]
fn a_node_on_a_corner_goes_on_to_the_next() {
    // Shortened plans turn on corners to the last digit, and are put into the tree.
    let world = world(a_wall());
    let corner = p(0.4, 0.7);
    for reached in [false, true] {
        let found = draws_for(
            reached,
            &world,
            &mostly_directed(),
            &Sampler::Directed,
            &[corner],
        );
        let from: Vec<_> = found.iter().filter(|d| d.1 == Some(corner)).collect();
        let on = share(&from, |d| within(d.0, p(0.6, 0.7), 0.045));
        assert!(
            from.len() > DRAWS / 4 && on > 0.8,
            "{on} of {} lie around the next corner",
            from.len()
        );
    }
}

/// Points of a large tree come along a curve, and lie all over the map as those of a small one do.
#[test]
fn uniform_points_of_large_trees_are_neighbours() {
    let world = world(Vec::new());
    let settings = Settings::default();
    let points = |further: &[Point2<f64>]| -> Vec<Point2<f64>> {
        let found = draws(&world, &settings, &Sampler::Uniform, further);
        found.into_iter().map(|(at, _)| at).collect()
    };
    let mut random = generator(3, 1);
    let further: Vec<_> = (0..9_000)
        .map(|_| world.0.sample_free(&mut random))
        .collect();
    let (small, large) = (points(&further[..100]), points(&further));
    let step = |points: &[Point2<f64>]| {
        let steps = points.windows(2).map(|w| (w[1] - w[0]).norm());
        steps.sum::<f64>() / (points.len() - 1) as f64
    };
    assert!(step(&small) > 0.4, "{}", step(&small));
    assert!(step(&large) < 0.05, "{}", step(&large));
    // A batch is a quarter of the tree, of which what is drawn here is the greater part.
    let count = |points: &[Point2<f64>]| {
        let mut cells = [0; 16];
        for at in points {
            cells[(at.x * 4.0) as usize * 4 + (at.y * 4.0) as usize] += 1;
        }
        cells
    };
    let expected = 9_000.0 / 4.0 / 16.0;
    let even = |n: &&i32| (f64::from(**n) - expected).abs() < 0.3 * expected;
    assert!(
        count(&large).iter().filter(even).count() >= 13,
        "{:?}",
        count(&large)
    );
}
