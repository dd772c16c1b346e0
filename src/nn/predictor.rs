//! Both networks on a device: from an encoded mission to guidance.

use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use rayon::prelude::*;
use sha2::{Digest, Sha256};

use super::config::Kind;
use super::cpu::{Planes, PlanesMut, Scratch, Session, upsample};
use super::device::{Backend, DeviceChoice, Estimate, Fallback};
use super::inputs::Inputs;
use super::models::Model;
use super::program::{GraphSize, Program};
use super::weights::{WeightError, WeightFile, hex};
use crate::encoding::{AutomatonGraph, Encoding, MapInput, MapTensor};
use crate::guidance::{Guidance, Heatmap};

/// Cells per side of the heatmap (`nngtl.md`, IV-A).
pub const HEATMAP_SIDE: usize = 200;

/// The file names of a model's two networks in its directory.
pub const MODEL_FILES: [&str; 2] = ["pathnet.safetensors", "statenet.safetensors"];

/// The weights that are built into the program, PathNet's and StateNet's.
#[must_use]
pub fn embedded() -> Option<[&'static [u8]; 2]> {
    Some([
        include_bytes!("../../models/compact/pathnet.safetensors"),
        include_bytes!("../../models/compact/statenet.safetensors"),
    ])
}

/// Why a model could not be loaded.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum LoadError {
    /// A file could not be read.
    #[error("cannot read weight file {file}: {source}")]
    Read {
        /// Its path.
        file: String,
        /// What the system said.
        source: std::io::Error,
    },
    /// A file is at fault.
    #[error(transparent)]
    Weights(#[from] WeightError),
    /// A file holds the other network.
    #[error("{file} holds a {found:?}, expected a {expected:?}: exchange the two files")]
    Kind {
        /// Which file.
        file: String,
        /// What it holds.
        found: Kind,
        /// What was expected.
        expected: Kind,
    },
    /// No weights are built in.
    #[error("no weights are built into this program: name a directory with weights")]
    NotEmbedded,
}

/// Why a mission has no prediction.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PredictError {
    /// The mission uses more regions than the networks were trained for.
    #[error(
        "the mission uses {used} regions, the networks were trained for {labels}: plan without guidance or use another model"
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

/// How to load a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LoadOptions {
    /// Which device is wanted.
    pub device: DeviceChoice,
    /// How many missions will be predicted, roughly: `auto` weighs start-up against it.
    pub missions: usize,
    /// Threads of the CPU path; they are used where they pay.
    pub threads: usize,
}

impl Default for LoadOptions {
    fn default() -> Self {
        Self {
            device: DeviceChoice::Auto,
            missions: 1,
            threads: 1,
        }
    }
}

impl From<DeviceChoice> for LoadOptions {
    fn from(device: DeviceChoice) -> Self {
        Self {
            device,
            ..Self::default()
        }
    }
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

/// The automaton size that device estimates assume; the map's part of the work is far larger.
const TYPICAL: GraphSize = GraphSize {
    states: 12,
    transitions: 60,
};

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
    /// Loads `pathnet.safetensors` and `statenet.safetensors` from a directory.
    ///
    /// A device that cannot be had is no error: the predictor falls back to the CPU and
    /// [`Self::take_notice`] says why.
    ///
    /// # Errors
    /// Files that cannot be read or are at fault.
    pub fn load(directory: &Path, options: impl Into<LoadOptions>) -> Result<Self, LoadError> {
        let read = |name: &str| {
            let path = directory.join(name);
            let file = path.display().to_string();
            match std::fs::read(&path) {
                Ok(bytes) => Ok((file, bytes)),
                Err(source) => Err(LoadError::Read { file, source }),
            }
        };
        let [path, state] = MODEL_FILES.map(read);
        let (path, state) = (path?, state?);
        Self::from_bytes([(&path.0, &path.1), (&state.0, &state.1)], options)
    }

    /// Loads the weights that are built into the program.
    ///
    /// # Errors
    /// If there are none.
    pub fn embedded(options: impl Into<LoadOptions>) -> Result<Self, LoadError> {
        let [path, state] = embedded().ok_or(LoadError::NotEmbedded)?;
        Self::from_files(
            [
                WeightFile::parse_trusted("built-in PathNet", path),
                WeightFile::parse_trusted("built-in StateNet", state),
            ],
            options,
        )
    }

    /// Loads PathNet and StateNet from the contents of their files; each comes with a name for
    /// messages.
    ///
    /// # Errors
    /// Files that are at fault.
    pub fn from_bytes(
        files: [(&str, &[u8]); 2],
        options: impl Into<LoadOptions>,
    ) -> Result<Self, LoadError> {
        Self::from_files(
            files.map(|(name, bytes)| WeightFile::parse(name, bytes)),
            options,
        )
    }

    fn from_files(
        [path, state]: [Result<WeightFile, WeightError>; 2],
        options: impl Into<LoadOptions>,
    ) -> Result<Self, LoadError> {
        // Tell all that is wrong with either file at once.
        let files = match (path, state) {
            (Ok(path), Ok(state)) => [path, state],
            (Err(error), Ok(_)) | (Ok(_), Err(error)) => return Err(error.into()),
            (Err(mut a), Err(b)) => {
                a.file = format!("{}, {}", a.file, b.file);
                a.faults.extend(b.faults);
                return Err(a.into());
            }
        };
        let hash = model_hash(&files);
        let models = [
            model(&files[0], Kind::PathNet)?,
            model(&files[1], Kind::StateNet)?,
        ];
        let options = options.into();
        let estimate = estimate(&models, &options);
        let begin = Instant::now();
        let programs = models.each_ref().map(|m| &m.program);
        let (backend, notice) = Backend::open(options.device, estimate, programs);
        Ok(Self {
            models: Arc::new(models),
            hash,
            backend,
            sessions: [Session::new(options.threads), Session::new(options.threads)],
            rasters: Vec::new(),
            threads: options.threads,
            start: begin.elapsed(),
            notice,
        })
    }

    /// What `auto` weighs for this model.
    #[must_use]
    pub fn estimate(&self, options: &LoadOptions) -> Estimate {
        estimate(&self.models, options)
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
        let mut found: Vec<Result<(Guidance, Timings), PredictError>> = Vec::new();
        let mut inputs = Vec::new();
        for (mission, rasters) in missions.iter().zip(rasters.as_chunks_mut::<2>().0) {
            let begin = Instant::now();
            let encoded = self.encode(mission, rasters);
            let encode = begin.elapsed();
            // What stands here is replaced by what the networks say.
            found.push(encoded.map(|given| {
                inputs.push(given);
                let timings = Timings {
                    encode,
                    ..Timings::default()
                };
                (Guidance::flat(0), timings)
            }));
        }
        let mut outputs = self.run(&inputs).into_iter();
        drop(inputs);
        self.rasters = rasters;
        for found in &mut found {
            let Ok((guidance, timings)) = found else {
                continue;
            };
            let Some((output, infer)) = outputs.next() else {
                continue;
            };
            let begin = Instant::now();
            match self.guidance(output) {
                Ok(made) => {
                    *guidance = made;
                    timings.infer = infer + begin.elapsed();
                }
                Err(e) => *found = Err(e),
            }
        }
        found
    }

    /// Checks a mission and draws its map; networks that see the same share what they see.
    fn encode<'a>(
        &self,
        mission: &[EncodedMission<'a>; 2],
        rasters: &'a mut [MapTensor; 2],
    ) -> Result<[Inputs<'a>; 2], PredictError> {
        for (model, (map, graph)) in self.models.iter().zip(mission) {
            check(model.config.labels(), map, graph)?;
        }
        let [(path_map, path_graph), (state_map, state_graph)] = *mission;
        let [path_side, state_side] = self.models.each_ref().map(|m| m.config.resolution());
        rasters[0].fill(path_map, path_side);
        let shared = path_side == state_side && std::ptr::eq(path_map, state_map);
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
        log::warn!("{reason}; the CPU runs the networks instead");
        self.backend = Backend::Cpu;
        self.notice = Some(reason);
    }

    fn guidance(&self, [mut cells, states]: [Vec<f32>; 2]) -> Result<Guidance, PredictError> {
        if cells.iter().chain(&states).any(|v| !v.is_finite()) {
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

/// Whether a network with `labels` region channels can be asked about a mission.
fn check(labels: usize, map: &MapInput<'_>, graph: &AutomatonGraph) -> Result<(), PredictError> {
    let used = graph.regions;
    if used > labels {
        return Err(PredictError::TooManyRegions { used, labels });
    }
    if map.regions.len() != used {
        let reason = "the map has another number of regions than the automaton";
        return Err(PredictError::Inconsistent(reason));
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

fn estimate(models: &[Model; 2], options: &LoadOptions) -> Estimate {
    let work = models
        .iter()
        .map(|m| m.program.multiply_adds(TYPICAL))
        .sum();
    Estimate::new(work, options.missions, options.threads)
}

fn model(file: &WeightFile, expected: Kind) -> Result<Model, LoadError> {
    let model = Model::new(file)?;
    let found = model.config.kind();
    if found == expected {
        Ok(model)
    } else {
        Err(LoadError::Kind {
            file: file.name.clone(),
            found,
            expected,
        })
    }
}

fn model_hash(files: &[WeightFile; 2]) -> String {
    let mut digest = Sha256::new();
    for file in files {
        digest.update(file.sha256.as_bytes());
        digest.update(file.config.to_string().as_bytes());
    }
    hex(&digest.finalize())
}

/// What a weight file holds: for people to read.
#[derive(Clone, Debug, serde::Serialize)]
pub struct ModelInfo {
    /// The file.
    pub file: String,
    /// Its size in bytes.
    pub bytes: usize,
    /// The configuration.
    pub config: serde_json::Value,
    /// The training record.
    pub training: serde_json::Value,
    /// The digest of the tensors.
    pub sha256: String,
    /// Name, shape and stored type of each tensor, by name.
    pub tensors: Vec<(String, Vec<usize>, &'static str)>,
    /// How many numbers the tensors hold.
    pub parameters: usize,
    /// Multiply-adds of one run, for an automaton of 12 states and 60 transitions.
    pub multiply_adds: u64,
}

impl ModelInfo {
    /// Reads a weight file and checks it as loading does.
    ///
    /// # Errors
    /// As [`Predictor::load`].
    pub fn read(path: &Path) -> Result<Self, LoadError> {
        let file = path.display().to_string();
        match std::fs::read(path) {
            Ok(bytes) => Self::parse(&file, &bytes),
            Err(source) => Err(LoadError::Read { file, source }),
        }
    }

    /// As [`Self::read`], from a file's contents.
    ///
    /// # Errors
    /// Files that are at fault.
    pub fn parse(name: &str, bytes: &[u8]) -> Result<Self, LoadError> {
        let file = WeightFile::parse(name, bytes)?;
        let model = Model::new(&file)?;
        Ok(Self {
            parameters: file.parameters(),
            multiply_adds: model.program.multiply_adds(TYPICAL),
            bytes: bytes.len(),
            tensors: file
                .tensors
                .into_iter()
                .map(|(name, t)| (name, t.shape, t.stored))
                .collect(),
            file: file.name,
            config: file.config,
            training: file.training,
            sha256: file.sha256,
        })
    }
}
