//! How near samplers come to the optimum on random missions: gaps to the exact planner's plans, and of
//! these to certified lower bounds.
//!
//! `cargo bench --bench convergence [-- MISSIONS [SECONDS [SAMPLER…]]]`: maps of all families of the data
//! set, patterns of the mission catalogue; 100 missions, 1 second each, all samplers by default; the networks' time
//! is not counted. Progress goes to standard error.
//! `NNGTL_CSV=FILE` writes every search.

#![allow(clippy::print_stdout, clippy::print_stderr)] // a report is what this program is for

use std::sync::Arc;

use nngtl::automaton::{Limits, Task};
use nngtl::bench::{Case, Contender, CostSettings, Mark, Prediction, Strategy, converge};
use nngtl::dataset::maps::{Family, draw_map, draw_start};
use nngtl::dataset::missions::draw_pattern;
use nngtl::mission::{Question, predict_with};
use nngtl::nn::{DeviceChoice, Predictor};
use nngtl::planner::{Problem, Settings, Stop};
use nngtl::random::generator;
use nngtl::system::Continuous;

/// A random mission, if it has an automaton.
fn case(seed: u64, networks: Option<&mut Predictor>) -> Option<Case> {
    let mut random = generator(seed, 78);
    let family = Family::ALL[seed as usize % Family::ALL.len()];
    let map = draw_map(family, &mut random).workspace().ok()?;
    let start = draw_start(&map, &mut random);
    let (pattern, formula) = draw_pattern(map.regions().len(), &mut random);
    let letters = Arc::clone(map.alphabet());
    let task = Task::from_formula(&formula, letters, &Limits::default()).ok()?;
    let map = Arc::new(map);
    let system = Continuous::new(Arc::clone(&map), start).ok()?;
    let question = Question {
        map: &map,
        system: &system,
        start: system.start(),
        task: &task,
    };
    let guidance = networks.and_then(|n| predict_with(n, question).ok());
    Some(Case {
        name: format!("{seed}-{family}-{pattern}"),
        family: Some(family.name().to_owned()),
        problem: Problem {
            start: system.start(),
            system: Arc::new(system),
            task: Arc::new(task),
            weight: 0.2,
        },
        translate_seconds: 0.0,
        predictions: guidance.map(prediction).into_iter().collect(),
        labels: None,
    })
}

/// What the networks say; their time is left out.
fn prediction(found: nngtl::mission::Prediction) -> Prediction {
    Prediction {
        device: found.device,
        guidance: found.guidance,
        encode_seconds: 0.0,
        infer_seconds: 0.0,
        live: None,
    }
}

fn main() {
    let mut arguments = std::env::args().skip(1).filter(|a| !a.starts_with('-'));
    let missions = arguments.next().and_then(|a| a.parse().ok()).unwrap_or(100);
    let seconds = arguments.next().and_then(|a| a.parse().ok()).unwrap_or(1.0);
    let named: Vec<String> = arguments.collect();
    let mut strategies = vec![
        Strategy::Uniform,
        Strategy::Biased,
        Strategy::Directed,
        Strategy::Guided,
        Strategy::Auto,
    ];
    if !named.is_empty() {
        strategies.retain(|s| named.iter().any(|n| n == s.name()));
    }
    let asks = |s: &Strategy| matches!(s, Strategy::Guided | Strategy::Auto);
    let mut networks = strategies
        .iter()
        .any(asks)
        .then(|| Predictor::embedded(DeviceChoice::Cpu).ok())
        .flatten();
    let all = (0..).filter_map(|seed| case(seed, networks.as_mut()));
    let cases: Vec<Case> = all.take(missions).collect();
    let settings = Settings {
        iterations: u64::MAX,
        time_limit: Some(seconds),
        ..Settings::default()
    };
    let marks = vec![
        Mark::Iterations(1_000),
        Mark::Iterations(10_000),
        Mark::Iterations(100_000),
        Mark::Seconds(0.1),
        Mark::Seconds(1.0),
    ];
    let contenders: Vec<Contender> = strategies.into_iter().map(Contender::from).collect();
    let stop = Stop::new();
    let mut progress = |done| eprintln!("{done} of {} missions searched", cases.len());
    let report = converge(
        &cases,
        &contenders,
        &CostSettings {
            settings,
            trials: 1,
            marks,
            bounds: true,
        },
        &stop,
        &mut progress,
    )
    .expect("the settings are sound");
    print!("{}", report.to_markdown());
    if let Ok(path) = std::env::var("NNGTL_CSV") {
        std::fs::write(path, report.to_csv()).expect("the file can be written");
    }
}
