//! From networks to a sampler.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use super::{MissionError, Options, SamplerChoice};
use crate::automaton::Task;
use crate::encoding::{AutomatonGraph, Encoding, MapInput};
use crate::guidance::Guidance;
use crate::nn::{DeviceChoice, PredictError, Predictor};
use crate::planner::{Deferred, Guide, PlanError, Problem, Sampler};
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
    let question = Question {
        map: &scenario.workspace,
        system: &*system,
        start,
        task,
    };
    predict_with(&mut load(options)?, question)
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

/// The sampler of a search, and what the networks say to it.
pub(super) struct Chosen {
    pub(super) sampler: Sampler,
    answer: Arc<Mutex<Answer>>,
}

/// What the networks said, if they were asked.
#[derive(Default)]
pub(super) struct Answer {
    pub(super) prediction: Option<Prediction>,
    pub(super) notices: Vec<String>,
    /// Seconds that the search waited for it.
    pub(super) waited: f64,
}

impl Chosen {
    /// A sampler without networks, which leaves the wanted device alone.
    pub(super) fn plain(sampler: Sampler, wanted: DeviceChoice) -> Self {
        let notice = unused_by(wanted, sampler.name());
        Self::new(sampler, Answer::without_networks(notice))
    }

    fn new(sampler: Sampler, answer: Answer) -> Self {
        let answer = Arc::new(Mutex::new(answer));
        Self { sampler, answer }
    }

    /// A search's failure, with what a user should know of the networks.
    pub(super) fn failed(&self, error: PlanError) -> PlanError {
        match error {
            PlanError::NotFound(mut why) => {
                why.notices = self.answer().notices;
                PlanError::NotFound(why)
            }
            other => other,
        }
    }

    /// What the networks have said by now.
    pub(super) fn answer(&self) -> Answer {
        std::mem::take(&mut self.answer.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// What is said where this sampler searches, if an adapter was asked for.
pub(super) fn unused_by(wanted: DeviceChoice, sampler: &str) -> Option<String> {
    let why = format!(", as the {sampler} sampler asks no networks (--sampler guided does)");
    unused_device(wanted, &why)
}

/// What is said if a search ends before it asks the networks, which are loaded by then only if they were `named`.
fn unasked(wanted: DeviceChoice, named: Option<&Predictor>) -> Option<String> {
    let looked = match named.map(Predictor::notice) {
        None => ", nor looked for".to_owned(),
        Some(None) => String::new(),
        Some(Some(missing)) => format!(": {missing}"),
    };
    let why = "the search ended before it asked the networks (--sampler guided asks them first)";
    unused_device(wanted, &format!("{looked}: {why}"))
}

/// What is said where an adapter was asked for and nothing ran on it. Nobody misses one that was left to `auto`.
pub(super) fn unused_device(wanted: DeviceChoice, why: &str) -> Option<String> {
    let adapter = matches!(wanted, DeviceChoice::Gpu | DeviceChoice::Software);
    adapter.then(|| format!("the device {wanted} was not used{why}"))
}

impl Answer {
    fn new(mut prediction: Prediction) -> Self {
        Self {
            notices: prediction.notice.take().into_iter().collect(),
            prediction: Some(prediction),
            waited: 0.0,
        }
    }

    fn without_networks(notice: Option<String>) -> Self {
        Self {
            notices: notice.into_iter().collect(),
            ..Self::default()
        }
    }

    /// The name of the sampler that the search ended with.
    pub(super) fn sampler(&self, begun: &Sampler) -> &'static str {
        match begun {
            Sampler::Deferred(_) if self.prediction.is_some() => "guided",
            Sampler::Deferred(_) => Sampler::Directed.name(),
            other => other.name(),
        }
    }
}

/// The sampler that the options ask for. `auto` asks the networks when the search has lasted for some time, and never fails: what keeps
/// the networks from guiding is told once, and the search goes by the same rules without predictions. Weights that were named
/// must load.
pub(super) fn choose(
    scenario: &Scenario,
    problem: &Problem,
    options: &Options,
) -> Result<Chosen, MissionError> {
    let sampler = match options.sampler {
        SamplerChoice::Uniform => Sampler::Uniform,
        SamplerChoice::Biased | SamplerChoice::Exact => Sampler::Biased,
        SamplerChoice::Directed => Sampler::Directed,
        SamplerChoice::Guided => {
            let mut networks = load(options)?;
            let (guide, prediction) = ask(&mut networks, &scenario.workspace, problem)?;
            let sampler = Sampler::Guided(Arc::new(guide));
            return Ok(Chosen::new(sampler, Answer::new(prediction)));
        }
        SamplerChoice::Auto => return deferred(scenario, problem, options),
    };
    Ok(Chosen::plain(sampler, options.device))
}

fn deferred(
    scenario: &Scenario,
    problem: &Problem,
    options: &Options,
) -> Result<Chosen, MissionError> {
    let named = options.model.as_ref().map(|_| load(options)).transpose()?;
    let (map, problem) = (Arc::clone(&scenario.workspace), problem.clone());
    let options = options.clone();
    let unasked = Answer::without_networks(unasked(options.device, named.as_ref()));
    let answer = Arc::new(Mutex::new(unasked));
    let into = Arc::clone(&answer);
    let sampler = Deferred::new(Deferred::WORTH_IT, move || {
        let began = Instant::now();
        let networks = named.map_or_else(|| load(&options), Ok);
        let found = networks.and_then(|mut networks| ask(&mut networks, &map, &problem));
        let (guide, mut said) = match found {
            Ok((guide, prediction)) => (Some(guide), Answer::new(prediction)),
            Err(e) => {
                let notice = format!("planning without guidance: {e}");
                (None, Answer::without_networks(Some(notice)))
            }
        };
        said.waited = began.elapsed().as_secs_f64();
        *into.lock().unwrap_or_else(PoisonError::into_inner) = said;
        guide
    });
    let sampler = Sampler::Deferred(sampler);
    Ok(Chosen { sampler, answer })
}

pub(super) fn load(options: &Options) -> Result<Predictor, MissionError> {
    Ok(match &options.model {
        Some(folder) => Predictor::load(folder, options.device)?,
        None => Predictor::embedded(options.device)?,
    })
}

pub(super) fn ask(
    networks: &mut Predictor,
    map: &Workspace,
    problem: &Problem,
) -> Result<(Guide, Prediction), MissionError> {
    let question = Question {
        map,
        system: &*problem.system,
        start: problem.start,
        task: &problem.task,
    };
    let prediction = predict_with(networks, question)?;
    let guide = Guide::new(&prediction.guidance, problem.task.nba.len())
        .map_err(|_| PredictError::Inconsistent("the prediction does not fit the automaton"))?;
    Ok((guide, prediction))
}
