//! Both networks on a device: from an encoded mission to guidance.

mod info;
mod load;

use std::sync::Arc;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::config::Config;
use super::cpu::{Planes, PlanesMut, Scratch, Session, upsample};
use super::device::{Backend, Estimate, Fallback};
use super::inputs::Inputs;
use super::models::Model;
use super::program::Program;
use crate::encoding::{AutomatonGraph, Encoding, MapInput, MapTensor};
use crate::guidance::{Guidance, Heatmap, are_finite};

pub use info::ModelInfo;
pub use load::{LoadError, LoadOptions, MODEL_FILES, embedded};

/// Cells per side of the heatmap (`nngtl.md`, IV-A).
pub const HEATMAP_SIDE: usize = 200;

/// Why a mission has no prediction.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PredictError {
    /// The mission uses more regions than the networks were trained for.
    #[error(
        "the mission uses {used} regions, the networks were trained for {labels}: --model takes others"
    )]
    TooManyRegions {
        /// Regions that the mission uses.
        used: usize,
        /// Region channels of the networks.
        labels: usize,
    },
    /// Map and automaton disagree on the regions, or the automaton's lists do not fit together.
    #[error("the encoded mission is inconsistent: {0}")]
    Inconsistent(&'static str),
    /// The bounds are not a rectangle.
    #[error("the workspace's bounds are empty or not finite, expected a lower and a higher corner")]
    Bounds,
    /// The networks' result is not a number.
    #[error("the networks' results are not finite: the weights do not suit this mission")]
    NotFinite,
}

/// Where the time of a prediction went.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timings {
    /// Rasterising the map (the automaton is encoded before).
    pub encode: Duration,
    /// Opening the device; with the first prediction only.
    pub start: Duration,
    /// Running the networks, transfers included.
    pub infer: Duration,
}

/// A mission as one network sees it: the map's outlines by channel, and the automaton.
pub type EncodedMission<'a> = (&'a MapInput<'a>, &'a AutomatonGraph);

/// Missions that are encoded, and sent to an adapter, at a time.
const BATCH: usize = 32;

/// Both networks, loaded and ready to predict.
///
/// A predictor runs one mission at a time; clone it for several threads (the weights are shared).
#[derive(Clone, Debug)]
pub struct Predictor {
    models: Arc<[Model; 2]>,
    hash: String,
    backend: Backend,
    sessions: [Session; 2],
    /// Two for each mission of a batch, kept for the next.
    rasters: Vec<MapTensor>,
    threads: usize,
    /// How long the device took to open; told with the first prediction.
    start: Duration,
    notice: Option<Fallback>,
}

impl Predictor {
    /// What `auto` weighs for this model.
    #[must_use]
    pub fn estimate(&self, options: &LoadOptions) -> Estimate {
        load::estimate(&self.models, options)
    }

    /// The number of region channels: missions with more used regions have no prediction.
    #[must_use]
    pub fn labels(&self) -> usize {
        self.models
            .iter()
            .map(|m| m.config.labels())
            .min()
            .unwrap_or(0)
    }

    /// Whether a mission that uses so many regions has a prediction.
    ///
    /// # Errors
    /// [`PredictError::TooManyRegions`].
    pub fn fits(&self, used: usize) -> Result<(), PredictError> {
        let labels = self.labels();
        if used > labels {
            return Err(PredictError::TooManyRegions { used, labels });
        }
        Ok(())
    }

    /// Whether PathNet and StateNet read the lengths of ways between regions ([`MapInput::ways`]).
    #[must_use]
    pub fn read_ways(&self) -> [bool; 2] {
        self.models.each_ref().map(|m| m.config.reads_ways())
    }

    /// How the inputs of PathNet and of StateNet are encoded.
    #[must_use]
    pub fn encodings(&self) -> [Encoding; 2] {
        self.models.each_ref().map(|m| m.encoding)
    }

    /// A digest of both networks, weights and configuration, in hexadecimal.
    #[must_use]
    pub fn hash(&self) -> &str {
        &self.hash
    }

    /// The device that runs the networks: `cpu`, or an adapter's name.
    #[must_use]
    pub fn device(&self) -> &str {
        self.backend.name()
    }

    /// Whether the CPU runs the networks.
    #[must_use]
    pub fn is_on_cpu(&self) -> bool {
        self.device() == Backend::Cpu.name()
    }

    /// Why the CPU is to run the networks although another device was asked for, unless that was taken already.
    #[must_use]
    pub fn notice(&self) -> Option<&Fallback> {
        self.notice.as_ref()
    }

    /// Why the CPU runs the networks although another device was asked for: once.
    pub fn take_notice(&mut self) -> Option<Fallback> {
        self.notice.take()
    }

    /// Makes the device fail, for tests of what happens then.
    #[doc(hidden)]
    pub fn lose_device(&self) {
        #[cfg(feature = "gpu")]
        if let Backend::Gpu(gpu) = &self.backend {
            gpu.lose();
        }
    }

    /// The two networks, PathNet first.
    #[must_use]
    pub fn models(&self) -> &[Model; 2] {
        &self.models
    }

    /// Predicts where good paths run and which automaton states they visit.
    ///
    /// The heatmap has side 200; all values are multiples of 1/65535. A device that fails on the
    /// way is replaced by the CPU ([`Self::take_notice`]).
    ///
    /// # Errors
    /// A mission that the networks were not trained for, or that is inconsistent.
    pub fn predict(
        &mut self,
        map: &MapInput<'_>,
        graph: &AutomatonGraph,
    ) -> Result<(Guidance, Timings), PredictError> {
        self.predict_each([(map, graph), (map, graph)])
    }

    /// As [`Self::predict`], for networks whose inputs are encoded differently
    /// ([`Self::encodings`]): one encoded mission for each, PathNet's first.
    ///
    /// # Errors
    /// As [`Self::predict`].
    pub fn predict_each(
        &mut self,
        missions: [EncodedMission<'_>; 2],
    ) -> Result<(Guidance, Timings), PredictError> {
        let mut found = self.predict_many(&[missions]);
        found
            .pop()
            .unwrap_or(Err(PredictError::Inconsistent("there is no mission")))
    }

    /// As [`Self::predict_each`], and tells the states' probabilities as soon as they are known: on the CPU before PathNet runs.
    ///
    /// # Errors
    /// As [`Self::predict`].
    pub fn predict_telling(
        &mut self,
        missions: [EncodedMission<'_>; 2],
        tell: &mut dyn FnMut(&[f32]),
    ) -> Result<(Guidance, Timings), PredictError> {
        let mut rasters = std::mem::take(&mut self.rasters);
        rasters.resize_with(2.max(rasters.len()), MapTensor::default);
        let begin = Instant::now();
        let given = match rasters.as_chunks_mut::<2>().0 {
            [rasters, ..] => self.encode(&missions, rasters)?,
            [] => return Err(PredictError::Inconsistent("there is no raster")),
        };
        let encode = begin.elapsed();
        let begin = Instant::now();
        let output = self.run_telling(&given, &mut |states| {
            let states = Guidance {
                heatmap: Heatmap::flat(0),
                states: states.to_vec(),
            };
            tell(&states.quantised().states);
        });
        self.rasters = rasters;
        let guidance = self.guidance(output)?;
        let timings = Timings {
            encode,
            start: std::mem::take(&mut self.start),
            infer: begin.elapsed(),
        };
        Ok((guidance, timings))
    }

    /// Runs StateNet, tells what it says, and runs PathNet; on an adapter both in one submission, which takes no longer than one.
    fn run_telling(
        &mut self,
        inputs: &[Inputs<'_>; 2],
        tell: &mut dyn FnMut(&[f32]),
    ) -> [Vec<f32>; 2] {
        let programs = self.models.each_ref().map(|m| &m.program);
        match self.backend.run(programs, std::slice::from_ref(inputs)) {
            Some(Ok(mut outputs)) if outputs.len() == 1 => {
                let output = outputs.remove(0);
                tell(&output[1]);
                return output;
            }
            Some(Ok(_)) | None => {}
            Some(Err(reason)) => self.fall_back(reason),
        }
        let [path_model, state_model] = &*self.models;
        let [path, state] = &mut self.sessions;
        let states = state.run(&state_model.program, &inputs[1]).to_vec();
        tell(&states);
        [path.run(&path_model.program, &inputs[0]).to_vec(), states]
    }

    /// As [`Self::predict_each`], for many missions: on adapters one read-back for all of them, on
    /// the CPU as many side by side as the predictor has threads. The time to open the device is
    /// told with the first.
    pub fn predict_many(
        &mut self,
        missions: &[[EncodedMission<'_>; 2]],
    ) -> Vec<Result<(Guidance, Timings), PredictError>> {
        let mut found = Vec::with_capacity(missions.len());
        for batch in missions.chunks(BATCH) {
            found.extend(self.predict_batch(batch));
        }
        if let Some(Ok((_, timings))) = found.iter_mut().find(|f| f.is_ok()) {
            timings.start = std::mem::take(&mut self.start);
        }
        found
    }

    fn predict_batch(
        &mut self,
        missions: &[[EncodedMission<'_>; 2]],
    ) -> Vec<Result<(Guidance, Timings), PredictError>> {
        let mut rasters = std::mem::take(&mut self.rasters);
        rasters.resize_with(2 * missions.len().max(1), MapTensor::default);
        let mut encoded = Vec::with_capacity(missions.len());
        let mut inputs = Vec::with_capacity(missions.len());
        for (mission, rasters) in missions.iter().zip(rasters.as_chunks_mut::<2>().0) {
            let begin = Instant::now();
            let given = self.encode(mission, rasters);
            encoded.push(given.map(|given| {
                inputs.push(given);
                begin.elapsed()
            }));
        }
        let mut outputs = self.run(&inputs).into_iter();
        drop(inputs);
        self.rasters = rasters;
        let mut finish = |encode| {
            let missing = PredictError::Inconsistent("the device left it out");
            let (output, infer) = outputs.next().ok_or(missing)?;
            let begin = Instant::now();
            let guidance = self.guidance(output)?;
            let timings = Timings {
                encode,
                infer: infer + begin.elapsed(),
                ..Timings::default()
            };
            Ok((guidance, timings))
        };
        encoded
            .into_iter()
            .map(|encode| encode.and_then(&mut finish))
            .collect()
    }

    /// Checks a mission and draws its map; networks that see the same share what they see.
    fn encode<'a>(
        &self,
        mission: &[EncodedMission<'a>; 2],
        rasters: &'a mut [MapTensor; 2],
    ) -> Result<[Inputs<'a>; 2], PredictError> {
        for (model, (map, graph)) in self.models.iter().zip(mission) {
            check(&model.config, map, graph)?;
        }
        let [(path_map, path_graph), (state_map, state_graph)] = *mission;
        let [path_side, state_side] = self.models.each_ref().map(|m| m.config.resolution());
        rasters[0].fill(path_map, path_side);
        let shared = [path_side, 0].contains(&state_side) && std::ptr::eq(path_map, state_map);
        if !shared {
            rasters[1].fill(state_map, state_side);
        }
        let inputs = [(0, path_graph), (usize::from(!shared), state_graph)];
        Ok(inputs.map(|(raster, graph)| Inputs {
            map: &rasters[raster],
            graph,
            given: &[],
        }))
    }

    /// Runs both networks on each mission, on the CPU if the device fails; tells what each took.
    fn run(&mut self, missions: &[[Inputs<'_>; 2]]) -> Vec<([Vec<f32>; 2], Duration)> {
        if missions.is_empty() {
            return Vec::new();
        }
        let programs = self.models.each_ref().map(|m| &m.program);
        let begin = Instant::now();
        match self.backend.run(programs, missions) {
            Some(Ok(outputs)) => {
                let each = begin.elapsed() / missions.len() as u32;
                return outputs.into_iter().map(|output| (output, each)).collect();
            }
            Some(Err(reason)) => self.fall_back(reason),
            None => {}
        }
        let programs = self.models.each_ref().map(|m| &m.program);
        if missions.len() > 1 && self.threads > 1 {
            let sessions = || [Session::new(1), Session::new(1)];
            let run = |sessions: &mut [Session; 2], inputs| run_both(sessions, programs, inputs, 1);
            return missions.par_iter().map_init(sessions, run).collect();
        }
        let (sessions, threads) = (&mut self.sessions, self.threads);
        missions
            .iter()
            .map(|inputs| run_both(sessions, programs, inputs, threads))
            .collect()
    }

    fn fall_back(&mut self, reason: Fallback) {
        // Told by who asked: see `take_notice`.
        log::info!("{reason}; the CPU runs the networks instead");
        self.backend = Backend::Cpu;
        self.notice = Some(reason);
    }

    fn guidance(&self, [mut cells, states]: [Vec<f32>; 2]) -> Result<Guidance, PredictError> {
        if !(are_finite(&cells) && are_finite(&states)) {
            return Err(PredictError::NotFinite);
        }
        let side = cells.len().isqrt();
        if side != HEATMAP_SIDE {
            cells = resized(&cells, side, HEATMAP_SIDE);
        }
        sharpen(&mut cells, self.models[0].config.power());
        let heatmap = Heatmap {
            side: HEATMAP_SIDE,
            values: cells,
        };
        Ok(Guidance { heatmap, states }.quantised())
    }
}

/// Runs both networks on the CPU, side by side if there are threads for it.
fn run_both(
    sessions: &mut [Session; 2],
    [path_program, state_program]: [&Program; 2],
    inputs: &[Inputs<'_>; 2],
    threads: usize,
) -> ([Vec<f32>; 2], Duration) {
    let begin = Instant::now();
    let [path, state] = sessions;
    let mut run_path = || path.run(path_program, &inputs[0]).to_vec();
    let mut run_state = || state.run(state_program, &inputs[1]).to_vec();
    let outputs = if threads > 1 {
        let (path, state) = rayon::join(run_path, run_state);
        [path, state]
    } else {
        [run_path(), run_state()]
    };
    (outputs, begin.elapsed())
}

/// Whether a network can be asked about a mission.
fn check(config: &Config, map: &MapInput<'_>, graph: &AutomatonGraph) -> Result<(), PredictError> {
    let (labels, used) = (config.labels(), graph.regions);
    let reads_ways = config.reads_ways();
    if used > labels {
        return Err(PredictError::TooManyRegions { used, labels });
    }
    if map.regions.len() != used {
        let reason = "the map has another number of regions than the automaton";
        return Err(PredictError::Inconsistent(reason));
    }
    if reads_ways && map.ways.len() != (used + 1) * (used + 1) {
        let reason =
            "the lengths of ways are missing, or not those between the regions and the start";
        return Err(PredictError::Inconsistent(reason));
    }
    if map.ways.iter().any(|length| length.is_nan()) {
        return Err(PredictError::Inconsistent("a length is not a number"));
    }
    graph.check().map_err(PredictError::Inconsistent)?;
    let [low, high] = map.bounds;
    let side = (high.x - low.x).min(high.y - low.y);
    if !(side > 0.0 && (high - low).iter().all(|v| v.is_finite())) {
        return Err(PredictError::Bounds);
    }
    Ok(())
}

/// A square grid at another resolution, by bilinear interpolation.
fn resized(cells: &[f32], from: usize, to: usize) -> Vec<f32> {
    let mut values = vec![0.0; to * to];
    let x = Planes {
        data: cells,
        channels: 1,
        height: from,
        width: from,
    };
    let y = PlanesMut {
        data: &mut values,
        channels: 1,
        height: to,
        width: to,
    };
    upsample(x, y, &mut Scratch::default());
    values
}

/// `(p / max p)^power`; nothing for power 1.
fn sharpen(cells: &mut [f32], power: f32) {
    if power == 1.0 {
        return;
    }
    let largest = cells.iter().copied().fold(0.0, f32::max);
    if largest > 0.0 {
        cells
            .iter_mut()
            .for_each(|p| *p = libm::powf(*p / largest, power));
    }
}
