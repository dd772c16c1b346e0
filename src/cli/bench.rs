//! `nngtl bench`.

use std::path::Path;
use std::sync::Arc;

use nalgebra::Point2;

use super::args::{BenchArgs, StrategyName};
use super::console::Console;
use super::failure::Failure;
use super::files;
use crate::automaton::Task;
use crate::bench::{Case, Comparison, Mark, Strategy, compare, converge};
use crate::dataset;
use crate::guidance::Guidance;
use crate::mission::{self, MissionError};
use crate::nn::Predictor;
use crate::planner::{Problem, Settings};
use crate::scenario::Scenario;
use crate::system::Continuous;
use crate::workspace::Workspace;

/// A mission before the networks have seen it.
struct Mission {
    name: String,
    map: Arc<Workspace>,
    start: Point2<f64>,
    task: Task,
    weight: f64,
    /// The guidance that a data set's labels make.
    labels: Option<Guidance>,
}

pub(super) fn run(args: &BenchArgs, console: &Console) -> Result<(), Failure> {
    files::check_folders(
        [&args.report, &args.csv]
            .into_iter()
            .flatten()
            .map(|p| p.as_path()),
    )?;
    let strategies: Vec<Strategy> = args.samplers.iter().map(|&s| strategy(s)).collect();
    let mut missions = Vec::new();
    for path in &args.scenarios {
        let left = args.limit.map_or(usize::MAX, |n| n - missions.len());
        missions.extend(read(path, left, console)?);
    }
    let mut predictor = strategies
        .contains(&Strategy::Guided)
        .then(|| load(args))
        .transpose()?;
    let cases = cases(missions, predictor.as_mut(), console)?;
    if args.gaps {
        return gaps(args, &cases, &strategies, console);
    }
    let comparison = Comparison {
        strategies,
        trials: args.trials,
        settings: settings(args),
    };
    let stop = super::interrupt::stop_on_interrupt();
    let bar = console.progress(cases.len() as u64, "comparing");
    let report = compare(&cases, &comparison, &stop, &mut |done| {
        bar.set_position(done as u64);
    })
    .map_err(|e| Failure::input(e.to_string()))?;
    bar.finish_and_clear();
    if stop.is_raised() {
        console.note("interrupted: these are the missions that were done");
    }
    let markdown = report.to_markdown();
    if let Some(path) = &args.report {
        files::write(path, markdown.as_bytes(), console)?;
    }
    if let Some(path) = &args.csv {
        files::write(path, report.to_csv().as_bytes(), console)?;
    }
    let text = if console.json() {
        let object = serde_json::to_string(&report).map_err(|e| Failure::input(e.to_string()))?;
        format!("{object}\n")
    } else {
        markdown
    };
    Ok(console.result(&text)?)
}

/// Costs over time, beside the exact planner's and a lower bound.
fn gaps(
    args: &BenchArgs,
    cases: &[Case],
    strategies: &[Strategy],
    console: &Console,
) -> Result<(), Failure> {
    let settings = Settings {
        time_limit: args.time_limit,
        ..settings(args)
    };
    let powers = (3..).map(|k| 10_u64.pow(k));
    let mut marks: Vec<Mark> = powers
        .take_while(|&n| n < args.iterations)
        .take(6)
        .map(Mark::Iterations)
        .collect();
    marks.push(Mark::Iterations(args.iterations));
    if let Some(limit) = args.time_limit {
        let seconds = [0.1, 1.0, 10.0].into_iter().filter(|&s| s < limit);
        marks.extend(seconds.chain([limit]).map(Mark::Seconds));
    }
    let stop = super::interrupt::stop_on_interrupt();
    let bar = console.progress(cases.len() as u64, "searching");
    let report = converge(
        cases,
        strategies,
        &settings,
        &marks,
        args.bounds,
        &stop,
        &mut |done| {
            bar.set_position(done as u64);
        },
    )
    .map_err(|e| Failure::input(e.to_string()))?;
    bar.finish_and_clear();
    if stop.is_raised() {
        console.note("interrupted: these are the missions that were done");
    }
    let markdown = report.to_markdown();
    if let Some(path) = &args.report {
        files::write(path, markdown.as_bytes(), console)?;
    }
    if let Some(path) = &args.csv {
        files::write(path, report.to_csv().as_bytes(), console)?;
    }
    let text = if console.json() {
        let object = serde_json::to_string(&report).map_err(|e| Failure::input(e.to_string()))?;
        format!("{object}\n")
    } else {
        markdown
    };
    Ok(console.result(&text)?)
}

fn settings(args: &BenchArgs) -> Settings {
    let settings = Settings {
        seed: args.seed,
        iterations: args.iterations,
        y_rand: args.y_rand,
        alpha: args.alpha,
        lead: args.guided.lead,
        p_region: args.guided.p_region,
        corner: args.guided.corner,
        ..Settings::default()
    };
    if args.paper_rule {
        settings.paper_rule()
    } else {
        settings
    }
}

fn strategy(name: StrategyName) -> Strategy {
    match name {
        StrategyName::Uniform => Strategy::Uniform,
        StrategyName::Biased => Strategy::Biased,
        StrategyName::Directed => Strategy::Directed,
        StrategyName::Flat => Strategy::Flat,
        StrategyName::Guided => Strategy::Guided,
        StrategyName::Oracle => Strategy::Oracle,
    }
}

fn load(args: &BenchArgs) -> Result<Predictor, Failure> {
    let device = crate::nn::DeviceChoice::from(args.network.device);
    let loaded = match &args.network.model {
        Some(folder) => Predictor::load(folder, device),
        None => Predictor::embedded(device),
    };
    Ok(loaded.map_err(MissionError::from)?)
}

/// The missions of a scenario file or of a data set's folder. Those that cannot be read or
/// translated are told and left out.
fn read(path: &Path, limit: usize, console: &Console) -> Result<Vec<Mission>, Failure> {
    let mut found = Vec::new();
    let skip = |why: String| console.warn(&format!("{}: left out: {why}", path.display()));
    if path.is_dir() {
        let missions =
            dataset::labelled_missions(path).map_err(|e| Failure::input(e.to_string()))?;
        for mission in missions.take(limit) {
            match mission {
                Ok(m) => found.push(Mission {
                    name: format!("{}-{}", m.map, found.len()),
                    labels: Some(m.guidance()),
                    map: m.workspace,
                    start: m.start,
                    task: m.task,
                    weight: 0.2,
                }),
                Err(e) => skip(e.to_string()),
            }
        }
        return Ok(found);
    }
    let scenarios = Scenario::load_all(path).map_err(|e| Failure::input(e.to_string()))?;
    for scenario in scenarios.into_iter().take(limit) {
        let ready = scenario
            .map_err(|e| e.to_string())
            .and_then(|s| mission::task(&s).map(|t| (s, t)).map_err(|e| e.to_string()));
        match ready {
            Ok((s, task)) => found.push(Mission {
                name: s.name,
                map: s.workspace,
                start: s.start,
                task,
                weight: s.weight,
                labels: None,
            }),
            Err(e) => skip(e),
        }
    }
    Ok(found)
}

/// The missions of these files and folders, with predictions.
pub(super) fn missions(
    paths: &[std::path::PathBuf],
    limit: Option<usize>,
    predictor: &mut Predictor,
    console: &Console,
) -> Result<Vec<Case>, Failure> {
    let mut found = Vec::new();
    for path in paths {
        let left = limit.map_or(usize::MAX, |n| n - found.len());
        found.extend(read(path, left, console)?);
    }
    cases(found, Some(predictor), console)
}

/// Missions with what the networks say about them, all at once.
fn cases(
    missions: Vec<Mission>,
    predictor: Option<&mut Predictor>,
    console: &Console,
) -> Result<Vec<Case>, Failure> {
    let mut predictions = match predictor {
        None => Vec::new(),
        Some(predictor) => {
            let asked: Vec<_> = missions
                .iter()
                .map(|m| (&*m.map, m.start, &m.task))
                .collect();
            mission::predict_many(predictor, &asked)
        }
    }
    .into_iter();
    missions
        .into_iter()
        .map(|mission| case(mission, predictions.next(), console))
        .collect()
}

fn case(
    mission: Mission,
    prediction: Option<Result<mission::Prediction, MissionError>>,
    console: &Console,
) -> Result<Case, Failure> {
    let Mission {
        name,
        map,
        start,
        task,
        weight,
        labels,
    } = mission;
    let mut guidance = None;
    let mut inference_seconds = 0.0;
    match prediction {
        Some(Ok(prediction)) => {
            if let Some(notice) = prediction.notice {
                console.warn(&notice);
            }
            inference_seconds = prediction.encode + prediction.infer;
            guidance = Some(prediction.guidance);
        }
        Some(Err(e)) => console.warn(&format!("{name}: without guidance: {e}")),
        None => {}
    }
    let system = Continuous::new(map, start).map_err(MissionError::from)?;
    Ok(Case {
        name,
        problem: Problem {
            start: system.start(),
            system: Arc::new(system),
            task: Arc::new(task),
            weight,
        },
        guidance,
        labels,
        inference_seconds,
    })
}
