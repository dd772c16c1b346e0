//! A maze with thousands of corners: missions on it are planned, and what that takes is printed.
#![allow(clippy::print_stdout)] // tells what was measured

use std::fmt::Write as _;
use std::sync::Arc;
use std::time::{Duration, Instant};

use nalgebra::Point2;
use nngtl::mission::{self, MissionError, Options, SamplerChoice};
use nngtl::planner::{PlanError, Settings};
use nngtl::random::{generator, unit};
use nngtl::scenario::{Overrides, Scenario};
use nngtl::workspace::Workspace;
use nngtl::workspace::visibility::VisibilityGraph;

mod made;

use made::{Edges, options, rectangles, scenario};

/// A maze of `n` × `n` rooms as a MovingAI map of 2n + 1 cells a side: a spanning tree drawn by a
/// depth-first walk, then one wall in twenty taken away, so that there are ways around.
fn maze(n: usize, seed: u64) -> String {
    let mut random = generator(seed, 0);
    let side = 2 * n + 1;
    let mut solid = vec![true; side * side];
    let mut stack = vec![(0_usize, 0_usize)];
    solid[side + 1] = false;
    while let Some(&(x, y)) = stack.last() {
        let around = [(2, 1, 1, 0), (0, 1, -1, 0), (1, 2, 0, 1), (1, 0, 0, -1)];
        let open: Vec<_> = around
            .iter()
            .filter(|&&(_, _, dx, dy)| {
                let (i, j) = (x as i64 + dx, y as i64 + dy);
                let inside = i >= 0 && j >= 0 && i < n as i64 && j < n as i64;
                inside && solid[(2 * j as usize + 1) * side + 2 * i as usize + 1]
            })
            .collect();
        if open.is_empty() {
            stack.pop();
            continue;
        }
        let &(wx, wy, dx, dy) = open[(unit(&mut random) * open.len() as f64) as usize];
        let next = ((x as i64 + dx) as usize, (y as i64 + dy) as usize);
        solid[(2 * y + wy) * side + 2 * x + wx] = false;
        solid[(2 * next.1 + 1) * side + 2 * next.0 + 1] = false;
        stack.push(next);
    }
    for y in 1..side - 1 {
        for x in 1..side - 1 {
            if x % 2 != y % 2 && unit(&mut random) < 0.05 {
                solid[y * side + x] = false;
            }
        }
    }
    let mut text = format!("type octile\nheight {side}\nwidth {side}\nmap\n");
    for row in solid.chunks(side) {
        text.extend(row.iter().map(|&s| if s { '@' } else { '.' }));
        text.push('\n');
    }
    text
}

/// Lower left corners of two rooms, some bends away from the start and not through each other.
fn near(map: &std::path::Path, rooms: usize) -> Vec<[f64; 2]> {
    let map = nngtl::maps::load(map, &nngtl::maps::MapOptions::default()).unwrap();
    let map = Workspace::new(map.bounds, map.obstacles, Vec::new()).unwrap();
    let graph = VisibilityGraph::new(Arc::new(map));
    let paths = graph.paths_to(Point2::new(1.5, 1.5));
    let all =
        (0..rooms * rooms).map(|i| [(2 * (i % rooms) + 1) as f64, (2 * (i / rooms) + 1) as f64]);
    let bends = |[x, y]: [f64; 2]| {
        let path = paths.path(&graph, Point2::new(x + 0.5, y + 0.5)).unwrap();
        path.len() - 2
    };
    let found: Vec<[f64; 2]> = all.filter(|&room| (6..9).contains(&bends(room))).collect();
    vec![found[0], found[found.len() - 1]]
}

/// Plans with the biased sampler; whether there is a plan, and what it took.
fn plan(scenario: &Scenario, narrow: bool) -> (bool, String) {
    let settings = Settings {
        iterations: 40_000,
        time_limit: (!narrow).then_some(10.0),
        first: true,
        ..Settings::default()
    };
    let settings = if narrow {
        // Corridors are narrow: steps should be short.
        Settings {
            distance_deviation: 0.02,
            radius: 0.1,
            ..settings
        }
    } else {
        settings
    };
    let options = Options {
        sampler: SamplerChoice::Biased,
        settings,
        ..Options::default()
    };
    let began = Instant::now();
    let (found, iterations) = match mission::plan(scenario, &options) {
        Ok(planned) => (true, planned.file.stats.unwrap().iterations),
        Err(MissionError::Plan(PlanError::NotFound(why))) => (false, why.stats.iterations),
        Err(other) => panic!("{other}"),
    };
    let seconds = began.elapsed().as_secs_f64();
    let text = format!(
        "biased, {}: {} after {iterations} iterations in {seconds:.2} s ({:.0}/s)",
        if narrow {
            "short steps"
        } else {
            "default settings"
        },
        if found { "first plan" } else { "no plan" },
        iterations as f64 / seconds
    );
    (found, text)
}

fn run(rooms: usize) {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("maze.map"), maze(rooms, 1)).unwrap();
    let side = (2 * rooms + 1) as f64;
    let mut text = "start = [1.5, 1.5]\ntask = \"<> (a && <> b)\"\n[map]\nfile = \"maze.map\"\n[workspace.regions]\n".to_owned();
    let rooms_near = near(&folder.path().join("maze.map"), rooms);
    for (name, [x, y]) in [("a", rooms_near[0]), ("b", rooms_near[1])] {
        let _ = writeln!(
            text,
            "{name} = [[{x}, {y}], [{0}, {y}], [{0}, {1}], [{x}, {1}]]",
            x + 1.0,
            y + 1.0
        );
    }
    let path = folder.path().join("maze.toml");
    std::fs::write(&path, text).unwrap();
    let began = Instant::now();
    let scenario = Scenario::load(&path).unwrap();
    let loaded = began.elapsed();
    let vertices: usize = scenario
        .workspace
        .obstacles()
        .iter()
        .map(|o| o.vertices().len())
        .sum();
    let began = Instant::now();
    let graph = VisibilityGraph::new(Arc::clone(&scenario.workspace));
    let meshed = began.elapsed();
    let began = Instant::now();
    let far = Point2::new(side - 1.5, side - 1.5);
    let paths = graph.paths_to(far);
    let first = began.elapsed();
    let began = Instant::now();
    let paths_again = graph.paths_to(Point2::new(1.5, side - 1.5));
    let again = began.elapsed();
    let way = paths.path(&graph, scenario.start).unwrap();
    assert!(paths_again.first_leg(&graph, far).is_some());
    for leg in way.windows(2) {
        assert!(scenario.workspace.is_free_segment(leg[0], leg[1]));
    }
    let began = Instant::now();
    let mut random = generator(2, 0);
    let queries = 300;
    for _ in 0..queries {
        let from = scenario.workspace.sample_free(&mut random);
        assert!(paths.first_leg(&graph, from).is_some());
    }
    let entry = began.elapsed() / queries;
    let began = Instant::now();
    for _ in 0..20 {
        let from = scenario.workspace.sample_free(&mut random);
        assert!(graph.first_leg(from, far).is_some());
    }
    let single = began.elapsed() / 20;
    println!(
        "{rooms} × {rooms} rooms: {} obstacles, {vertices} vertices; loaded in {loaded:.2?}, triangulated in {meshed:.2?}, a wavefront begun in {first:.2?}, another in {again:.2?}, first leg {entry:.2?}, first leg to a new point {single:.2?}; way across: {} bends",
        scenario.workspace.obstacles().len(),
        way.len() - 2
    );
    for (formula, narrow) in [
        ("<> (a && <> b)", false),
        ("<> (a && <> b)", true),
        ("[]<> a && []<> b", true),
    ] {
        let overrides = Overrides {
            task: Some(formula.to_owned()),
            ..Overrides::default()
        };
        let scenario = Scenario::load_with(&path, None, &overrides).unwrap();
        let (found, text) = plan(&scenario, narrow);
        println!("  {formula}: {text}");
        assert!(found, "{text}");
    }
    assert!(loaded < Duration::from_secs(60), "{loaded:?}");
}

/// Among thousands of specks on an open field almost all corners see each other: whoever looked for ways from everywhere to a place would
/// be busy for minutes, translating and searching.
#[test]
fn missions_run_on_a_field_of_specks() {
    let mut random = generator(3, 1);
    let mut specks: Vec<Edges> = Vec::new();
    while specks.len() < 3_000 {
        let [x, y] = [(); 2].map(|()| 998.0 * unit(&mut random));
        let middle = |v: f64| (30.0..970.0).contains(&v);
        if middle(x) || middle(y) {
            specks.push([x, y, x + 0.7, y + 0.7]);
        }
    }
    let regions = [
        ("a", [5.0, 5.0, 12.0, 12.0]),
        ("b", [980.0, 980.0, 990.0, 990.0]),
    ];
    let map = rectangles(1000.0, &specks, &regions).unwrap();
    let scenario = scenario(map, Point2::new(500.0, 500.0), "G F a & G F b");
    for sampler in [SamplerChoice::Directed, SamplerChoice::Auto] {
        let planned = mission::plan(&scenario, &options(sampler, 300)).unwrap();
        let cost = planned.verified.cost;
        // There and back between the regions.
        let straight = 2.0 * f64::hypot(968.0, 968.0);
        assert!(
            cost.suffix > straight - 1e-6 && cost.suffix < 1.01 * straight,
            "{sampler:?} {cost:?}"
        );
    }
}

#[test]
fn missions_run_on_mazes() {
    run(60);
    let scale = std::env::var("NNGTL_TEST_SCALE").ok();
    if scale.and_then(|s| s.parse::<f64>().ok()).unwrap_or(1.0) > 1.0 {
        run(100);
        run(200);
    }
}
