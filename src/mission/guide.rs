//! From networks to a sampler.

use std::sync::Arc;

use nalgebra::Point2;

use super::{Chosen, MissionError, Options, SamplerChoice};
use crate::automaton::Task;
use crate::encoding::{AutomatonGraph, MapInput};
use crate::guidance::Guidance;
use crate::nn::{LoadError, PredictError, Predictor};
use crate::planner::{Guide, Sampler, Settings};
use crate::scenario::Scenario;
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

/// Runs the networks on a mission.
///
/// # Errors
/// [`MissionError::Load`] for weights that cannot be loaded, [`MissionError::Predict`] for a
/// mission that they do not fit.
pub fn predict(
    scenario: &Scenario,
    task: &Task,
    options: &Options,
) -> Result<Prediction, MissionError> {
    let mut predictor = match &options.model {
        Some(folder) => Predictor::load(folder, options.device)?,
        None => Predictor::embedded(options.device)?,
    };
    predict_with(&mut predictor, &scenario.workspace, scenario.start, task)
}

/// As [`predict`], with networks that are loaded already.
///
/// # Errors
/// [`MissionError::Predict`] for a mission that they do not fit.
pub fn predict_with(
    predictor: &mut Predictor,
    map: &Workspace,
    start: Point2<f64>,
    task: &Task,
) -> Result<Prediction, MissionError> {
    let (graph, names) = AutomatonGraph::of_task(task)
        .map_err(|_| PredictError::Inconsistent("a region of the task is not on the map"))?;
    let region = |name: &String| map.regions().iter().find(|r| r.name == *name);
    let input = MapInput {
        bounds: [map.bounds().min, map.bounds().max],
        obstacles: map.obstacles().iter().map(Polygon::vertices).collect(),
        regions: names
            .iter()
            .filter_map(region)
            .map(|r| r.polygon.vertices())
            .collect(),
        start,
    };
    let (guidance, timings) = predictor.predict(&input, &graph)?;
    Ok(Prediction {
        guidance,
        device: predictor.device().to_owned(),
        model_hash: predictor.hash().to_owned(),
        encode: timings.encode.as_secs_f64(),
        infer: (timings.start + timings.infer).as_secs_f64(),
        notice: predictor
            .take_notice()
            .map(|why| format!("{why}; the CPU ran the networks instead")),
    })
}

/// The sampler that the options ask for. `auto` leaves the networks out of short searches and never fails: what keeps the networks from
/// guiding is told once, and the search goes by the same rules without predictions.
pub(super) fn choose(
    scenario: &Scenario,
    task: &Arc<Task>,
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
    match guided(scenario, task, options) {
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
    task: &Arc<Task>,
    options: &Options,
) -> Result<Chosen, MissionError> {
    let mut prediction = predict(scenario, task, options)?;
    let guide = Guide::new(&prediction.guidance, task.nba.len())
        .map_err(|_| PredictError::Inconsistent("the prediction does not fit the automaton"))?;
    Ok(Chosen {
        sampler: Sampler::Guided(Arc::new(guide)),
        notices: prediction.notice.take().into_iter().collect(),
        prediction: Some(prediction),
    })
}
