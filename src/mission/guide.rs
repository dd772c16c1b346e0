//! From networks to a sampler.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use super::think::Thinking;
use super::{MissionError, Options, SamplerChoice};
use crate::automaton::Task;
use crate::encoding::{AutomatonGraph, Encoding, MapInput, region_order};
use crate::guidance::Guidance;
use crate::nn::{DeviceChoice, EncodedMission, PredictError, Predictor, Timings};
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
    let encoded: Vec<_> = missions
        .iter()
        .map(|question| Encoded::new(predictor, question))
        .collect();
    let pairs: Vec<_> = encoded.iter().flatten().map(Encoded::pair).collect();
    let mut predicted = predictor.predict_many(&pairs).into_iter();
    encoded
        .iter()
        .map(|mission| {
            let mission = mission.as_ref().map_err(PredictError::clone)?;
            let missing = PredictError::Inconsistent("the mission was not predicted");
            let found = predicted.next().unwrap_or(Err(missing))?;
            Ok(mission.prediction(predictor, found))
        })
        .collect()
}

/// As [`predict_with`], and tells the states' probabilities as soon as they are known.
///
/// # Errors
/// [`MissionError::Predict`] for a mission that they do not fit.
pub(super) fn predict_telling(
    predictor: &mut Predictor,
    question: &Question<'_>,
    tell: &mut dyn FnMut(&[f32]),
) -> Result<Prediction, MissionError> {
    let mission = Encoded::new(predictor, question)?;
    let found = predictor.predict_telling(mission.pair(), tell)?;
    Ok(mission.prediction(predictor, found))
}

/// A mission as PathNet and StateNet see it; `None` where networks that read the same see the same.
struct Encoded<'a> {
    first: (MapInput<'a>, AutomatonGraph),
    second: Option<(MapInput<'a>, AutomatonGraph)>,
    seconds: f64,
}

impl<'a> Encoded<'a> {
    fn new(predictor: &Predictor, question: &Question<'a>) -> Result<Self, PredictError> {
        let begin = Instant::now();
        let [path, state] = predictor.encodings();
        for used in [path, state].map(|encoding| named(question.task, encoding)) {
            predictor.fits(used.unwrap_or(0))?;
        }
        let [path_ways, state_ways] = predictor.read_ways();
        let shared = path == state;
        let first = encode(question, path, path_ways || shared && state_ways)?;
        let second = (!shared)
            .then(|| encode(question, state, state_ways))
            .transpose()?;
        Ok(Self {
            first,
            second,
            seconds: begin.elapsed().as_secs_f64(),
        })
    }

    fn pair(&self) -> [EncodedMission<'_>; 2] {
        let second = self.second.as_ref().unwrap_or(&self.first);
        [(&self.first.0, &self.first.1), (&second.0, &second.1)]
    }

    /// What was predicted of it; what the user should know of the device is told with the first.
    fn prediction(
        &self,
        predictor: &mut Predictor,
        (guidance, timings): (Guidance, Timings),
    ) -> Prediction {
        let notice = predictor.take_notice();
        Prediction {
            guidance,
            device: predictor.device().to_owned(),
            model_hash: predictor.hash().to_owned(),
            encode: self.seconds + timings.encode.as_secs_f64(),
            infer: (timings.start + timings.infer).as_secs_f64(),
            notice: notice.map(|why| format!("{why}; the CPU ran the networks instead")),
        }
    }
}

/// How many channels a formula needs, where that is known before the automaton is encoded: to encode one of ten thousand states takes seconds,
/// and a formula with so many names many regions.
fn named(task: &Task, encoding: Encoding) -> Option<usize> {
    let formula = task
        .formula
        .as_ref()
        .filter(|_| encoding == Encoding::Own)?;
    Some(region_order(formula).len())
}

/// The automaton as networks of this encoding see it, and the regions that their channels stand for.
fn graph(
    task: &Task,
    encoding: Encoding,
) -> Result<(AutomatonGraph, Vec<Option<String>>), PredictError> {
    match encoding {
        Encoding::Own => {
            let (graph, names) = AutomatonGraph::of_task(task).map_err(|_| {
                PredictError::Inconsistent("a region of the task is not on the map")
            })?;
            Ok((graph, names.into_iter().map(Some).collect()))
        }
        Encoding::Published => Ok(AutomatonGraph::published(task)),
    }
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
    let (graph, names) = graph(task, encoding)?;
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
    source: Source,
}

/// Where to learn what the networks said.
enum Source {
    /// It is there, or will be when the search has asked.
    Answer(Arc<Mutex<Answer>>),
    /// They begin soon after the search does.
    Thinking {
        networks: Thinking,
        /// Whether what they say is told in any case.
        is_wanted: bool,
        /// Whether they must be through before the program may end, if they have begun: a driver does not like to be left alone.
        on_adapter: bool,
        /// What is said if the search was over before it waited for them.
        unasked: Option<String>,
    },
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
        let source = Source::Answer(Arc::new(Mutex::new(answer)));
        Self { sampler, source }
    }

    /// A search's failure, with what a user should know of the networks.
    pub(super) fn failed(&self, error: PlanError) -> MissionError {
        match (error, self.answer()) {
            (PlanError::NotFound(_), Err(networks)) => networks,
            (PlanError::NotFound(mut why), Ok(answer)) => {
                why.notices = answer.notices;
                PlanError::NotFound(why).into()
            }
            (other, _) => other.into(),
        }
    }

    /// What the networks have said by now, if the search has asked them.
    ///
    /// # Errors
    /// What kept the networks from an answer that was to guide.
    pub(super) fn answer(&self) -> Result<Answer, MissionError> {
        match &self.source {
            Source::Answer(answer) => Ok(std::mem::take(
                &mut answer.lock().unwrap_or_else(PoisonError::into_inner),
            )),
            Source::Thinking {
                networks,
                is_wanted,
                on_adapter,
                unasked,
            } => {
                let is_told = *is_wanted || networks.is_asked();
                if *on_adapter && !is_told {
                    networks.settle();
                }
                // What nobody asked for may fail unheard.
                let said = is_told.then(|| networks.finish()).flatten();
                Ok(match said.transpose()? {
                    Some(prediction) => Answer {
                        waited: networks.waited().iter().sum(),
                        ..Answer::new(prediction)
                    },
                    None => Answer::without_networks(unasked.clone()),
                })
            }
        }
    }

    /// The name of the sampler that the search ended with.
    pub(super) fn name(&self, answer: &Answer) -> &'static str {
        match (&self.source, &self.sampler) {
            (Source::Thinking { .. }, _) => "guided",
            (_, Sampler::Deferred(_)) if answer.prediction.is_some() => "guided",
            (_, Sampler::Deferred(_)) => Sampler::Directed.name(),
            (_, other) => other.name(),
        }
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
    let why = "the search ended before it asked the networks (--sampler guided --networks-first waits for them)";
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
}

/// The sampler that the options ask for. `auto` asks the networks when the search has lasted for some time, and never fails: what keeps
/// the networks from guiding is told once, and the search goes by the same rules without predictions. Weights that were named
/// must load. `guided` asks soon, and searches meanwhile, unless the settings want the networks first.
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
            let first = options.settings.networks_first;
            let search = if first { guided_from_the_first } else { guided };
            return unless_too_many(search(scenario, problem, options));
        }
        SamplerChoice::Auto => return deferred(scenario, problem, options),
    };
    Ok(Chosen::plain(sampler, options.device))
}

/// Where the mission has more regions than the networks have channels, that is told, and the search goes by the same rules without them.
pub(super) fn unless_too_many(
    chosen: Result<Chosen, MissionError>,
) -> Result<Chosen, MissionError> {
    match chosen {
        Err(MissionError::Predict(why @ PredictError::TooManyRegions { .. })) => {
            let notice = format!("planning without guidance: {why}");
            let answer = Answer::without_networks(Some(notice));
            Ok(Chosen::new(Sampler::Directed, answer))
        }
        other => other,
    }
}

/// Guided search that waits for the networks before its first sample.
///
/// # Errors
/// As [`choose`].
pub(super) fn guided_from_the_first(
    scenario: &Scenario,
    problem: &Problem,
    options: &Options,
) -> Result<Chosen, MissionError> {
    let mut networks = load(options)?;
    let (guide, prediction) = ask(&mut networks, &scenario.workspace, problem)?;
    let sampler = Sampler::Guided(Arc::new(guide));
    Ok(Chosen::new(sampler, Answer::new(prediction)))
}

fn guided(
    scenario: &Scenario,
    problem: &Problem,
    options: &Options,
) -> Result<Chosen, MissionError> {
    let networks = load(options)?;
    for encoding in networks.encodings() {
        let used = match named(&problem.task, encoding) {
            Some(used) => used,
            None => graph(&problem.task, encoding)?.0.regions,
        };
        networks.fits(used)?;
    }
    let on_adapter = !networks.is_on_cpu();
    let unasked = unasked(options.device, Some(&networks));
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let networks = Thinking::new(
        Arc::new(Mutex::new(networks)),
        Arc::clone(&scenario.workspace),
        problem.clone(),
        cores > options.settings.threads,
    );
    let sampler = networks.sampler(options.settings.head_start(), problem);
    Ok(Chosen {
        sampler: Sampler::Deferred(sampler),
        source: Source::Thinking {
            networks,
            is_wanted: options.await_networks,
            on_adapter,
            unasked,
        },
    })
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
    Ok(Chosen {
        sampler: Sampler::Deferred(Arc::new(sampler)),
        source: Source::Answer(answer),
    })
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
