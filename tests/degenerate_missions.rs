//! Missions on degenerate maps: borders that touch, overlap and repeat, slivers, points in a line, starts
//! on borders, huge and tiny coordinates. Every plan passes the checker, everything else is refused
//! with a reason, and nothing panics.
#![allow(clippy::print_stdout)] // tells how many missions ended how

use std::collections::BTreeMap;

use nngtl::dataset::missions::draw_pattern;
use nngtl::mission::{self, MissionError, Options, SamplerChoice};
use nngtl::planner::Settings;
use nngtl::random::{Random, generator, unit};
use nngtl::scenario::{DEFAULT_WEIGHT, RegionSpecs, Scenario, ScenarioSpec, WorkspaceSpec};

/// How many missions; more with `NNGTL_TEST_SCALE` (a factor): 20 makes ten thousand.
fn missions() -> u64 {
    let scale = std::env::var("NNGTL_TEST_SCALE").ok();
    let scale: f64 = scale.and_then(|s| s.parse().ok()).unwrap_or(1.0);
    (500.0 * scale).max(1.0) as u64
}

fn below(random: &mut Random, n: usize) -> usize {
    ((unit(random) * n as f64) as usize).min(n - 1)
}

/// A coordinate on a coarse grid, where borders coincide, or anywhere.
fn coordinate(random: &mut Random) -> f64 {
    if unit(random) < 0.8 {
        below(random, 9) as f64 / 8.0
    } else {
        unit(random)
    }
}

type Shape = Vec<[f64; 2]>;

fn rectangle(x: f64, y: f64, w: f64, h: f64) -> Shape {
    vec![[x, y], [x + w, y], [x + w, y + h], [x, y + h]]
}

/// One of the shapes that give trouble; `others` are there already.
fn shape(random: &mut Random, others: &[Shape]) -> Shape {
    let size = |random: &mut Random| (1 + below(random, 3)) as f64 / 8.0;
    let (x, y) = (coordinate(random), coordinate(random));
    let base = match below(random, 8) {
        // A sliver, down to the resolution of the map.
        0 => {
            let thin = [1e-3, 1e-6, 1e-8, 1e-9, 1e-10][below(random, 5)];
            let long = size(random);
            if unit(random) < 0.5 {
                rectangle(x, y, long, thin)
            } else {
                vec![
                    [x, y],
                    [x + long, y + long / 2.0],
                    [x + long, y + long / 2.0 + thin],
                ]
            }
        }
        1 => {
            let s = size(random);
            vec![[x, y], [x + s, y], [x, y + s]]
        }
        // A notch, whose inner corner touches others.
        2 => {
            let s = 0.25;
            vec![
                [x, y],
                [x + s, y],
                [x + s, y + s],
                [x + s / 2.0, y + s / 2.0],
                [x, y + s],
            ]
        }
        // The same again, a part of it, or moved by next to nothing.
        3 | 4 if !others.is_empty() => {
            let other = &others[below(random, others.len())];
            let (cx, cy) = other
                .iter()
                .fold((0.0, 0.0), |(x, y), p| (x + p[0], y + p[1]));
            let n = other.len() as f64;
            let shrink = [1.0, 0.5, 1.0 - 1e-9, 1.0 + 1e-9, 2.0][below(random, 5)];
            let nudge = [0.0, 1e-12, 1e-9, 3e-9][below(random, 4)];
            other
                .iter()
                .map(|p| {
                    let [x, y] = [cx / n, cy / n];
                    [x + (p[0] - x) * shrink + nudge, y + (p[1] - y) * shrink]
                })
                .collect()
        }
        _ => rectangle(x, y, size(random), size(random)),
    };
    // Points in a line, repeated points, another beginning, another direction.
    let mut shape = Vec::new();
    for (i, &p) in base.iter().enumerate() {
        shape.push(p);
        let next = base[(i + 1) % base.len()];
        if unit(random) < 0.15 {
            shape.push([(p[0] + next[0]) / 2.0, (p[1] + next[1]) / 2.0]);
        }
        if unit(random) < 0.05 {
            shape.push(p);
        }
    }
    let turn = below(random, shape.len());
    shape.rotate_left(turn);
    if unit(random) < 0.3 {
        shape.reverse();
    }
    shape
}

/// The first of some scenarios that loads, or the last.
fn scenario(seed: u64) -> ScenarioSpec {
    let mut all = (0..8).map(|attempt| draw(seed, attempt));
    let loads = |spec: &ScenarioSpec| {
        let scenario = Scenario::from_spec(spec);
        scenario.is_ok_and(|s| s.workspace.hidden_regions().is_empty())
    };
    all.find(loads).unwrap_or_else(|| draw(seed, 8))
}

fn draw(seed: u64, attempt: u64) -> ScenarioSpec {
    let mut random = generator(seed, 91 + attempt);
    let random = &mut random;
    let mut shapes: Vec<Shape> = Vec::new();
    for _ in 0..below(random, 7) {
        let next = shape(random, &shapes);
        shapes.push(next);
    }
    let obstacles = shapes.clone();
    let names = ["a", "b", "c"];
    let mut regions = Vec::new();
    for name in names {
        let next = shape(random, &shapes);
        shapes.push(next.clone());
        regions.push((name.to_owned(), next));
    }
    // On a corner, on a border, or anywhere.
    let start = match below(random, 4) {
        0 => shapes[below(random, shapes.len())][0],
        1 => {
            let shape = &shapes[below(random, shapes.len())];
            let t = unit(random);
            [0, 1].map(|k| shape[0][k] + (shape[1][k] - shape[0][k]) * t)
        }
        2 => [coordinate(random), coordinate(random)],
        _ => [unit(random), unit(random)],
    };
    let (_, formula) = draw_pattern(3, random);
    let mut task = formula.to_string();
    for (i, name) in names.iter().enumerate() {
        task = task.replace(&format!("l{}", i + 1), name);
    }
    // Where the unit square lies, and how large it is.
    let (scale, offset) = [
        (1.0, [0.0, 0.0]),
        (1e6, [0.0, 0.0]),
        (1.0, [1e6, -1e6]),
        (1e-6, [0.0, 0.0]),
        (1e6, [-5e5, 1e6]),
        (1e-3, [1e3, 1e3]),
    ][below(random, 6)];
    let place = |p: &[f64; 2]| [0, 1].map(|k| p[k] * scale + offset[k]);
    let all = |shape: &Shape| shape.iter().map(place).collect::<Vec<_>>();
    ScenarioSpec {
        name: format!("degenerate-{seed}"),
        start: place(&start),
        task: Some(task),
        weight: DEFAULT_WEIGHT,
        workspace: WorkspaceSpec {
            bounds: [place(&[0.0, 0.0]), place(&[1.0, 1.0])],
            obstacles: obstacles.iter().map(all).collect(),
            regions: RegionSpecs(
                regions
                    .into_iter()
                    .map(|(name, shape)| (name, all(&shape)))
                    .collect(),
            ),
            grid: None,
        },
    }
}

/// Plans a mission; the outcome in a few words.
fn outcome(seed: u64) -> &'static str {
    let spec = scenario(seed);
    let scenario = match Scenario::from_spec(&spec) {
        Ok(scenario) => scenario,
        Err(e) => {
            assert!(e.to_string().len() > 20, "{}: {e}", spec.name);
            return "refused when read";
        }
    };
    let sampler = match seed % 10 {
        0 => SamplerChoice::Uniform,
        1 => SamplerChoice::Exact,
        2 | 3 => SamplerChoice::Directed,
        _ => SamplerChoice::Biased,
    };
    let options = Options {
        sampler,
        settings: Settings {
            iterations: 400,
            seed,
            ..Settings::default()
        },
        ..Options::default()
    };
    match mission::plan(&scenario, &options) {
        Ok(_) => "planned and verified",
        Err(MissionError::Refused(why)) => {
            let text = serde_json::to_string(&spec).unwrap();
            panic!("{} ({sampler:?}): {why}\n{text}", spec.name)
        }
        Err(e) => {
            assert!(e.to_string().len() > 12, "{}: {e}", spec.name);
            match e {
                MissionError::Task(_) | MissionError::NotOnThisMap(_) => "no word",
                MissionError::Unreachable(_) => "unreachable",
                MissionError::Exact(_) => "no path on the roadmap",
                MissionError::Plan(_) => "budget spent",
                other => panic!("{}: {other}", spec.name),
            }
        }
    }
}

#[test]
fn every_plan_on_a_degenerate_map_verifies() {
    let mut outcomes: BTreeMap<&str, u64> = BTreeMap::new();
    let mut faults = Vec::new();
    for seed in 0..missions() {
        match std::panic::catch_unwind(|| outcome(seed)) {
            Ok(how) => *outcomes.entry(how).or_default() += 1,
            Err(_) => faults.push(seed),
        }
    }
    println!("{outcomes:?}");
    assert!(
        faults.is_empty(),
        "{} faults, seeds {faults:?}",
        faults.len()
    );
    let planned = outcomes.get("planned and verified").copied().unwrap_or(0);
    assert!(planned * 3 > missions(), "{outcomes:?}");
}
