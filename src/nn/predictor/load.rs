//! From weight files to a predictor.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use sha2::{Digest, Sha256};

use super::Predictor;
use crate::nn::config::Kind;
use crate::nn::cpu::Session;
use crate::nn::device::{Backend, DeviceChoice, Estimate};
use crate::nn::models::Model;
use crate::nn::program::GraphSize;
use crate::nn::weights::{Examined, WeightError, WeightFile};
use crate::number::hex;

/// The file names of a model's two networks in its directory.
pub const MODEL_FILES: [&str; 2] = ["pathnet.safetensors", "statenet.safetensors"];

/// Bytes that begin where numbers may stand, so that weights need not be moved to be read.
#[repr(align(16))]
struct Aligned<T: ?Sized>(T);

static PATHNET: &Aligned<[u8]> = &Aligned(*include_bytes!(
    "../../../models/compact/pathnet.safetensors"
));
static STATENET: &Aligned<[u8]> = &Aligned(*include_bytes!(
    "../../../models/compact/statenet.safetensors"
));

/// The weights that are built into the program, PathNet's and StateNet's.
#[must_use]
pub fn embedded() -> Option<[&'static [u8]; 2]> {
    Some([&PATHNET.0, &STATENET.0])
}

/// The automaton size that device estimates assume; the map's part of the work is far larger.
pub(super) const TYPICAL: GraphSize = GraphSize {
    states: 12,
    transitions: 60,
};

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
    /// Both files are at fault.
    #[error("{0}\n{1}")]
    Both(Box<Self>, Box<Self>),
    /// No weights are built in.
    #[error("no weights are built into this program: name a directory with weights")]
    NotEmbedded,
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

impl Predictor {
    /// Loads `pathnet.safetensors` and `statenet.safetensors` from a directory.
    ///
    /// A device that cannot be had is no error: the predictor falls back to the CPU and
    /// [`Self::take_notice`] says why.
    ///
    /// # Errors
    /// Files that cannot be read or are at fault.
    pub fn load(directory: &Path, options: impl Into<LoadOptions>) -> Result<Self, LoadError> {
        let [path, state] = MODEL_FILES;
        let load = |name: &str, kind| {
            let path = directory.join(name);
            let file = path.display().to_string();
            match std::fs::read(&path) {
                Ok(bytes) => Network::new(WeightFile::examine(&file, &bytes), kind),
                Err(source) => Err(LoadError::Read { file, source }),
            }
        };
        Self::from_networks(
            side_by_side(|| load(path, Kind::PathNet), || load(state, Kind::StateNet)),
            options.into(),
        )
    }

    /// Loads the weights that are built into the program.
    ///
    /// # Errors
    /// If there are none.
    pub fn embedded(options: impl Into<LoadOptions>) -> Result<Self, LoadError> {
        let [path, state] = embedded().ok_or(LoadError::NotEmbedded)?;
        let load = |name, bytes, kind| Network::new(WeightFile::examine_trusted(name, bytes), kind);
        Self::from_networks(
            side_by_side(
                || load("built-in PathNet", path, Kind::PathNet),
                || load("built-in StateNet", state, Kind::StateNet),
            ),
            options.into(),
        )
    }

    /// Loads PathNet and StateNet from the contents of their files; each comes with a name for
    /// messages.
    ///
    /// # Errors
    /// Files that are at fault.
    pub fn from_bytes(
        [path, state]: [(&str, &[u8]); 2],
        options: impl Into<LoadOptions>,
    ) -> Result<Self, LoadError> {
        let load = |(name, bytes), kind| Network::new(WeightFile::examine(name, bytes), kind);
        Self::from_networks(
            side_by_side(|| load(path, Kind::PathNet), || load(state, Kind::StateNet)),
            options.into(),
        )
    }

    fn from_networks(
        networks: (Result<Network, LoadError>, Result<Network, LoadError>),
        options: LoadOptions,
    ) -> Result<Self, LoadError> {
        let networks = match networks {
            (Ok(path), Ok(state)) => [path, state],
            // Tell all that is wrong with either file at once.
            (Err(a), Err(b)) => return Err(LoadError::Both(Box::new(a), Box::new(b))),
            (Err(error), _) | (_, Err(error)) => return Err(error),
        };
        let mut digest = Sha256::new();
        for network in &networks {
            digest.update(&network.identity);
        }
        let models = networks.map(|network| network.model);
        let estimate = estimate(&models, &options);
        let begin = Instant::now();
        let programs = models.each_ref().map(|m| &m.program);
        let (backend, notice) = Backend::open(options.device, estimate, programs);
        Ok(Self {
            models: Arc::new(models),
            hash: hex(&digest.finalize()),
            backend,
            sessions: [Session::new(options.threads), Session::new(options.threads)],
            rasters: Vec::new(),
            threads: options.threads,
            start: begin.elapsed(),
            notice,
        })
    }
}

/// A network, and what tells its weights and configuration from others'.
struct Network {
    model: Model,
    identity: String,
}

impl Network {
    fn new(file: Result<Examined<'_>, WeightError>, expected: Kind) -> Result<Self, LoadError> {
        let (file, model) = file?.build(Model::new)?;
        let found = model.config.kind();
        if found != expected {
            return Err(LoadError::Kind {
                file: file.name,
                found,
                expected,
            });
        }
        Ok(Self {
            model,
            identity: format!("{}{}", file.sha256, file.config),
        })
    }
}

/// Runs both, the second on a thread of its own where there is a core for it.
fn side_by_side<T: Send>(first: impl FnOnce() -> T, second: impl Fn() -> T + Sync) -> (T, T) {
    if std::thread::available_parallelism().map_or(1, usize::from) == 1 {
        return (first(), second());
    }
    std::thread::scope(|scope| {
        let thread = std::thread::Builder::new().spawn_scoped(scope, &second);
        let first = first();
        let second = match thread.map(|thread| thread.join()) {
            Ok(Ok(made)) => made,
            Ok(Err(panic)) => std::panic::resume_unwind(panic),
            // There is no thread to be had.
            Err(_) => second(),
        };
        (first, second)
    })
}

/// What `auto` weighs for these networks.
pub(super) fn estimate(models: &[Model; 2], options: &LoadOptions) -> Estimate {
    let work = models
        .iter()
        .map(|m| m.program.multiply_adds(TYPICAL))
        .sum();
    Estimate::new(work, options.missions, options.threads)
}
