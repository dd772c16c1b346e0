//! From networks to a sampler.

use std::sync::Arc;
use std::time::Instant;

use super::{Chosen, MissionError, Options, SamplerChoice};
use crate::automaton::Task;
use crate::encoding::{AutomatonGraph, Encoding, MapInput};
use crate::guidance::Guidance;
use crate::nn::{LoadError, PredictError, Predictor};
use crate::planner::{Guide, Problem, Sampler, Settings};
use crate::scenario::Scenario;
use crate::system::{Spot, TransitionSystem, Ways};
use crate::workspace::{Polygon, Workspace};

/// What the networks said about a mission.
#[derive(Clone, Debug)]
pub struct Prediction {
    /// Heatmap and state probabilities.
    pub guidance: Guidance,
    /// What ran the networks: `cpu`, or an adapter's name.
    pub device: String,
    /// The digest of the weights.
    pub model_hash: String,
    /// Seconds from map and automaton to tensors.
    pub encode: f64,
    /// Seconds to start the device and to run the networks.
    pub infer: f64,
    /// Why another device than the wanted one ran them, if so.
    pub notice: Option<String>,
}

/// What the networks are asked about: where the robot is to do what.
#[derive(Clone, Copy)]
pub struct Question<'a> {
    /// The map.
    pub map: &'a Workspace,
    /// The world that the robot moves in on that map: lengths of ways are taken from it.
    pub system: &'a dyn TransitionSystem,
    /// Where it starts.
    pub start: Spot,
    /// What it is to do.
    pub task: &'a Task,
}

/// Runs the networks on a mission.
///
/// # Errors
/// As [`world`](super::world), and
/// [`MissionError::Load`] for weights that cannot be loaded, [`MissionError::Predict`] for a
/// mission that they do not fit.
pub fn predict(
    scenario: &Scenario,
    task: &Task,
    options: &Options,
) -> Result<Prediction, MissionError> {
    let (system, start) = super::world(scenario)?;
    predict_in(scenario, &*system, start, task, options)
}

/// As [`predict`], in a world that is at hand already.
pub(super) fn predict_in(
    scenario: &Scenario,
    system: &dyn TransitionSystem,
    start: Spot,
    task: &Task,
    options: &Options,
) -> Result<Prediction, MissionError> {
    let mut predictor = match &options.model {
        Some(folder) => Predictor::load(folder, options.device)?,
        None => Predictor::embedded(options.device)?,
    };
    let question = Question {
        map: &scenario.workspace,
        system,
        start,
        task,
    };
    predict_with(&mut predictor, question)
}

/// As [`predict`], with networks that are loaded already.
///
/// # Errors
/// [`MissionError::Predict`] for a mission that they do not fit.
pub fn predict_with(
    predictor: &mut Predictor,
    question: Question<'_>,
) -> Result<Prediction, MissionError> {
    let mut found = predict_many(predictor, &[question]);
    found.pop().unwrap_or_else(|| {
        let reason = PredictError::Inconsistent("there is no mission");
        Err(reason.into())
    })
}

/// As [`predict_with`], for many missions at once. What the user should
/// know of the device is told with the first.
pub fn predict_many(
    predictor: &mut Predictor,
    missions: &[Question<'_>],
) -> Vec<Result<Prediction, MissionError>> {
    let [path, state] = predictor.encodings();
    let [path_ways, state_ways] = predictor.read_ways();
    let encoded: Vec<_> = missions
        .iter()
        .map(|question| {
            let begin = Instant::now();
            // Networks that read the same see the same.
            let shared = path == state;
            let first = encode(question, path, path_ways || shared && state_ways)?;
            let second = (!shared)
                .then(|| encode(question, state, state_ways))
                .transpose()?;
            Ok((first, second, begin.elapsed()))
        })
        .collect();
    let pairs: Vec<_> = encoded
        .iter()
        .flatten()
        .map(|(first, second, _)| {
            let second = second.as_ref().unwrap_or(first);
            [(&first.0, &first.1), (&second.0, &second.1)]
        })
        .collect();
    let mut predicted = predictor.predict_many(&pairs).into_iter();
    let mut notice = predictor
        .take_notice()
        .map(|why| format!("{why}; the CPU ran the networks instead"));
    encoded
        .iter()
        .map(|mission| {
            let (_, _, graph_time) = mission.as_ref().map_err(PredictError::clone)?;
            let missing = PredictError::Inconsistent("the mission was not predicted");
            let (guidance, timings) = predicted.next().unwrap_or(Err(missing))?;
            Ok(Prediction {
                guidance,
                device: predictor.device().to_owned(),
                model_hash: predictor.hash().to_owned(),
                encode: (*graph_time + timings.encode).as_secs_f64(),
                infer: (timings.start + timings.infer).as_secs_f64(),
                notice: notice.take(),
            })
        })
        .collect()
}

/// Map and automaton as networks of this encoding see them.
fn encode<'a>(
    question: &Question<'a>,
    encoding: Encoding,
    ways: bool,
) -> Result<(MapInput<'a>, AutomatonGraph), PredictError> {
    let &Question {
        map,
        system,
        start,
        task,
    } = question;
    let (graph, names) = match encoding {
        Encoding::Own => {
            let (graph, names) = AutomatonGraph::of_task(task).map_err(|_| {
                PredictError::Inconsistent("a region of the task is not on the map")
            })?;
            (graph, names.into_iter().map(Some).collect())
        }
        Encoding::Published => AutomatonGraph::published(task),
    };
    let outline = |name: &Option<String>| {
        let region = map
            .regions()
            .iter()
            .find(|r| Some(&r.name) == name.as_ref());
        // An outline without corners marks no cell.
        region.map_or(&[][..], |r| r.polygon.vertices())
    };
    let number = |name: &Option<String>| system.alphabet().proposition(name.as_ref()?);
    let ways = ways.then(|| {
        let regions: Vec<Option<usize>> = names.iter().map(number).collect();
        Ways::new(system, start.at, &regions).into_lengths()
    });
    let input = MapInput {
        bounds: [map.bounds().min, map.bounds().max],
        obstacles: map.obstacles().iter().map(Polygon::vertices).collect(),
        regions: names.iter().map(outline).collect(),
        start: start.at,
        ways: ways.unwrap_or_default(),
    };
    Ok((input, graph))
}

/// The sampler that the options ask for. `auto` leaves the networks out of short searches and never fails: what keeps the networks from
/// guiding is told once, and the search goes by the same rules without predictions.
pub(super) fn choose(
    scenario: &Scenario,
    problem: &Problem,
    options: &Options,
) -> Result<Chosen, MissionError> {
    let plain = |sampler| Chosen {
        sampler,
        prediction: None,
        notices: Vec::new(),
    };
    match options.sampler {
        SamplerChoice::Uniform => return Ok(plain(Sampler::Uniform)),
        SamplerChoice::Biased | SamplerChoice::Exact => return Ok(plain(Sampler::Biased)),
        SamplerChoice::Directed => return Ok(plain(Sampler::Directed)),
        SamplerChoice::Auto if is_short(&options.settings) => return Ok(plain(Sampler::Directed)),
        SamplerChoice::Auto | SamplerChoice::Guided => {}
    }
    match guided(scenario, problem, options) {
        Ok(chosen) => Ok(chosen),
        Err(e) if options.sampler == SamplerChoice::Auto && is_no_guidance(&e, options) => {
            let mut chosen = plain(Sampler::Directed);
            chosen
                .notices
                .push(format!("planning without guidance: {e}"));
            Ok(chosen)
        }
        Err(e) => Err(e),
    }
}

/// Seconds of search below which the networks are not worth the wait for them.
const WORTH_IT: f64 = 0.1;

/// Whether a search will be over before networks could have paid for themselves: they make plans cheaper, but first plans
/// hardly sooner, and those take less time than one inference (`docs/guidance.md`).
fn is_short(settings: &Settings) -> bool {
    settings.first || settings.time_limit.is_some_and(|s| s < WORTH_IT)
}

/// Whether `auto` may go on without the networks. Weights that were named must load.
fn is_no_guidance(e: &MissionError, options: &Options) -> bool {
    match e {
        MissionError::Load(LoadError::NotEmbedded) | MissionError::Predict(_) => true,
        MissionError::Load(_) => options.model.is_none(),
        _ => false,
    }
}

fn guided(
    scenario: &Scenario,
    problem: &Problem,
    options: &Options,
) -> Result<Chosen, MissionError> {
    let (system, task) = (&*problem.system, &*problem.task);
    let mut prediction = predict_in(scenario, system, problem.start, task, options)?;
    let guide = Guide::new(&prediction.guidance, task.nba.len())
        .map_err(|_| PredictError::Inconsistent("the prediction does not fit the automaton"))?;
    Ok(Chosen {
        sampler: Sampler::Guided(Arc::new(guide)),
        notices: prediction.notice.take().into_iter().collect(),
        prediction: Some(prediction),
    })
}
