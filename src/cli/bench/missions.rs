//! The missions of a comparison: read or drawn, with what the networks say about them.

use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::thread;
use std::time::Instant;

use crate::automaton::{Limits, Task};
use crate::bench::{Asked, Case, Live, Prediction};
use crate::cli::args::BenchMissionArgs;
use crate::cli::console::Console;
use crate::cli::failure::Failure;
use crate::cli::files;
use crate::dataset::maps::Family;
use crate::dataset::{self, GenerateConfig, LabelledMission};
use crate::guidance::Guidance;
use crate::mission::{self, MissionError, Question, Thinking};
use crate::nn::Predictor;
use crate::planner::{Problem, Stop};
use crate::scenario::Scenario;
use crate::system::Continuous;
use crate::workspace::Workspace;

/// λ of missions that name none, as in the data sets.
const WEIGHT: f64 = 0.2;

/// A mission before the networks have seen it.
pub(super) struct Mission {
    name: String,
    family: Option<Family>,
    map: Arc<Workspace>,
    problem: Problem,
    translate_seconds: f64,
    /// The guidance that a data set's labels make.
    labels: Option<Guidance>,
}

impl Mission {
    fn labelled(mission: LabelledMission, number: usize) -> Result<Self, MissionError> {
        let labels = Some(mission.guidance());
        let system = Continuous::new(Arc::clone(&mission.workspace), mission.start)?;
        Ok(Self {
            name: format!("{}-{number}", mission.map),
            family: Some(mission.family),
            labels,
            map: mission.workspace,
            problem: Problem {
                start: system.start(),
                system: Arc::new(system),
                task: Arc::new(mission.task),
                weight: WEIGHT,
            },
            translate_seconds: mission.translate_seconds,
        })
    }
}

/// The missions of these files and folders, with the predictions of one device, which searches do not ask anew.
pub(in crate::cli) fn missions(
    paths: &[PathBuf],
    limit: Option<usize>,
    predictor: &mut Predictor,
    console: &Console,
) -> Result<Vec<Case>, Failure> {
    let found = read_all(paths, limit, &Limits::default(), console)?;
    let mut cases = cases(found, std::slice::from_mut(predictor), console)?;
    let predictions = cases.iter_mut().flat_map(|case| &mut case.predictions);
    predictions.for_each(|p| p.live = None);
    Ok(cases)
}

/// The missions that the arguments ask for.
pub(super) fn wanted(
    paths: &[PathBuf],
    args: &BenchMissionArgs,
    stop: &Stop,
    console: &Console,
) -> Result<Vec<Mission>, Failure> {
    if paths.is_empty() {
        return drawn(args, stop, console);
    }
    read_all(paths, args.limit, &(&args.limits).into(), console)
}

/// Draws missions, each on a map of its own.
fn drawn(args: &BenchMissionArgs, stop: &Stop, console: &Console) -> Result<Vec<Mission>, Failure> {
    let wanted = args
        .limit
        .map_or(args.missions, |n| args.missions.min(n as u64));
    let config = GenerateConfig {
        to: wanted,
        missions_per_map: 1,
        families: args.families(),
        random_share: args.random_share(),
        min_steps: args.min_steps(),
        max_states: args.most_states,
        formulas: files::formulas(args.formulas.as_deref())?,
        ..GenerateConfig::new("", args.mission_seed, wanted)
    };
    let bar = console.progress(wanted, "drawing");
    let mut found = Vec::new();
    for mission in dataset::drawn_missions(&config, stop.flag()) {
        let mission = mission.map_err(|e| Failure::input(e.to_string()))?;
        found.push(Mission::labelled(mission, found.len())?);
        bar.inc(1);
    }
    bar.finish_and_clear();
    Ok(found)
}

fn read_all(
    paths: &[PathBuf],
    limit: Option<usize>,
    limits: &Limits,
    console: &Console,
) -> Result<Vec<Mission>, Failure> {
    let mut found = Vec::new();
    for path in paths {
        let left = limit.map_or(usize::MAX, |n| n - found.len());
        found.extend(read(path, left, limits, console)?);
    }
    // Names tell missions apart, and two files may use the same.
    let mut names = HashSet::new();
    for mission in &mut found {
        let plain = mission.name.clone();
        let mut copy = 1;
        while !names.insert(mission.name.clone()) {
            copy += 1;
            mission.name = format!("{plain} ({copy})");
        }
    }
    Ok(found)
}

/// The missions of a scenario file or of a data set's folder. Those that cannot be read or
/// translated are told and left out.
fn read(
    path: &Path,
    limit: usize,
    limits: &Limits,
    console: &Console,
) -> Result<Vec<Mission>, Failure> {
    let mut found = Vec::new();
    let skip = |why: String| console.warn(&format!("{}: left out: {why}", path.display()));
    if !path.exists() {
        let what = "there is no such scenario file or folder of a data set";
        return Err(Failure::input(format!("{}: {what}", path.display())));
    }
    if path.is_dir() {
        let missions =
            dataset::labelled_missions(path).map_err(|e| Failure::input(e.to_string()))?;
        for mission in missions.take(limit) {
            match mission {
                Ok(mission) => match Mission::labelled(mission, found.len()) {
                    Ok(mission) => found.push(mission),
                    Err(e) => skip(e.to_string()),
                },
                Err(e) => skip(e.to_string()),
            }
        }
        return Ok(found);
    }
    let scenarios = Scenario::load_all(path).map_err(|e| Failure::input(e.to_string()))?;
    for scenario in scenarios.into_iter().take(limit) {
        let begin = Instant::now();
        let ready = scenario.map_err(Failure::from).and_then(|s| {
            let task = mission::task_within(&s, limits)?;
            let translated = begin.elapsed().as_secs_f64();
            let problem = feasible(&s, task)?;
            Ok((s, problem, translated))
        });
        match ready {
            Ok((s, problem, translate_seconds)) => found.push(Mission {
                name: s.name,
                family: None,
                map: s.workspace,
                problem,
                translate_seconds,
                labels: None,
            }),
            Err(e) => skip(e.message),
        }
    }
    Ok(found)
}

/// The mission in its own world. Refuses one that no search can fulfil: its runs would say nothing about samplers.
fn feasible(scenario: &Scenario, task: Task) -> Result<Problem, MissionError> {
    let problem = mission::problem(scenario, Arc::new(task))?;
    mission::check_reachable(scenario, &problem.task, &*problem.system)?;
    Ok(problem)
}

/// Missions with what the networks say about them on each device, all at once.
pub(super) fn cases(
    missions: Vec<Mission>,
    predictors: &mut [Predictor],
    console: &Console,
) -> Result<Vec<Case>, Failure> {
    let mut networks = Vec::new();
    let mut predictions: Vec<Vec<Prediction>> = missions.iter().map(|_| Vec::new()).collect();
    let asked: Vec<_> = missions
        .iter()
        .map(|m| Question {
            map: &m.map,
            system: &*m.problem.system,
            start: m.problem.start,
            task: &m.problem.task,
        })
        .collect();
    for predictor in predictors {
        let found = mission::predict_many(predictor, &asked);
        // Only now is it known what ran them.
        let device = predictor.device().to_owned();
        if networks.iter().any(|(known, _)| *known == device) {
            let notices = found.iter().flatten().filter_map(|p| p.notice.as_deref());
            notices.for_each(|notice| console.warn(notice));
            let says = format!("two of the devices are {device}: it is measured once");
            console.warn(&says);
            continue;
        }
        networks.push((device.clone(), Arc::new(Mutex::new(predictor.clone()))));
        for ((mission, all), prediction) in missions.iter().zip(&mut predictions).zip(found) {
            match prediction {
                Ok(prediction) => {
                    if let Some(notice) = &prediction.notice {
                        console.warn(notice);
                    }
                    all.push(Prediction {
                        device: device.clone(),
                        guidance: prediction.guidance,
                        encode_seconds: prediction.encode,
                        infer_seconds: prediction.infer,
                        live: None,
                    });
                }
                Err(e) => console.warn(&format!("{}: without guidance: {e}", mission.name)),
            }
        }
    }
    missions
        .into_iter()
        .zip(predictions)
        .map(|(mission, mut predictions)| {
            let problem = mission.problem;
            for (device, networks) in &networks {
                let prediction = predictions.iter_mut().find(|p| p.device == *device);
                if let Some(prediction) = prediction {
                    prediction.live = Some(live(networks, &mission.map, &problem));
                }
            }
            Ok(Case {
                name: mission.name,
                family: mission.family.map(|f| f.name().to_owned()),
                problem,
                translate_seconds: mission.translate_seconds,
                predictions,
                labels: mission.labels,
            })
        })
        .collect()
}

/// The networks as a guided search asks them: they run while it goes on.
fn live(networks: &Arc<Mutex<Predictor>>, map: &Arc<Workspace>, problem: &Problem) -> Live {
    let (networks, map, problem) = (Arc::clone(networks), Arc::clone(map), problem.clone());
    let aside = thread::available_parallelism().is_ok_and(|cores| cores.get() > 1);
    Live::new(move |head_start| {
        let (networks, map) = (Arc::clone(&networks), Arc::clone(&map));
        let thinking = Thinking::new(networks, map, problem.clone(), aside);
        Asked {
            sampler: thinking.sampler(head_start, &problem),
            finish: Box::new(move || {
                thinking.settle();
                thinking.waited()
            }),
        }
    })
}
