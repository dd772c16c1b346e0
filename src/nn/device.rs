//! Which device runs the networks.

use std::fmt;
use std::str::FromStr;

/// Which device the user wants.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DeviceChoice {
    /// Whichever is estimated to be done sooner; never a software adapter.
    #[default]
    Auto,
    /// A hardware GPU.
    Gpu,
    /// A software adapter: for tests, not for speed.
    Software,
    /// The native CPU path.
    Cpu,
}

/// A device name that is none.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{0}` is no device, expected auto, gpu, software or cpu")]
pub struct UnknownDevice(pub String);

impl FromStr for DeviceChoice {
    type Err = UnknownDevice;
    fn from_str(text: &str) -> Result<Self, UnknownDevice> {
        match text {
            "auto" => Ok(Self::Auto),
            "gpu" => Ok(Self::Gpu),
            "software" => Ok(Self::Software),
            "cpu" => Ok(Self::Cpu),
            _ => Err(UnknownDevice(text.to_owned())),
        }
    }
}

impl fmt::Display for DeviceChoice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Auto => "auto",
            Self::Gpu => "gpu",
            Self::Software => "software",
            Self::Cpu => "cpu",
        })
    }
}

/// Why the CPU runs the networks although another device was asked for.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum Fallback {
    /// The program was built without the feature `gpu`.
    #[error("this program was built without GPU support (feature `gpu`)")]
    NotBuilt,
    /// There is no adapter of the wanted kind.
    #[error("no {wanted} adapter was found: install its Vulkan driver, or choose the device cpu")]
    NoAdapter {
        /// `gpu` or `software`.
        wanted: DeviceChoice,
    },
    /// The device could not be opened, or its memory or limits do not suffice.
    #[error("the device {device} cannot run these networks: {reason}")]
    Unfit {
        /// The adapter's name.
        device: String,
        /// What it said.
        reason: String,
    },
    /// The device failed while it ran.
    #[error("the device {device} was lost: {reason}")]
    Lost {
        /// The adapter's name.
        device: String,
        /// What it said.
        reason: String,
    },
}

/// What runs the networks.
#[derive(Clone, Debug)]
pub(super) enum Backend {
    /// The native CPU path.
    Cpu,
}

/// What a backend is, once started.
pub(super) enum Start {
    /// The caller runs the networks itself.
    Cpu,
    /// [`Backend::run`] runs them.
    #[allow(dead_code)] // only adapters run by themselves
    Running,
}

/// Multiply-adds a second of the CPU path on one core, as low as slow laptops have it.
const CPU_RATE: f64 = 2e10;

/// Multiply-adds a second of a hardware GPU with these kernels, as low as integrated ones have it.
const GPU_RATE: f64 = 2e11;

/// Seconds from opening the Vulkan loader to the first result of a hardware GPU: 30 ms with warm
/// caches, 300 ms without, as measured with drivers' caches on disk.
const GPU_START: f64 = 0.15;

/// Seconds of one inference on a hardware GPU beside its arithmetic: some hundred dispatches, one
/// upload, one read-back.
const GPU_OVERHEAD: f64 = 0.001;

/// The estimated seconds of `missions` inferences of `work` multiply-adds each, on the CPU path
/// with `threads` threads.
#[must_use]
pub fn cpu_seconds(work: u64, missions: usize, threads: usize) -> f64 {
    missions as f64 * work as f64 / (CPU_RATE * threads.max(1) as f64)
}

/// The estimated seconds of `missions` inferences of `work` multiply-adds each on a hardware GPU,
/// its start included.
#[must_use]
pub fn gpu_seconds(work: u64, missions: usize) -> f64 {
    GPU_START + missions as f64 * (GPU_OVERHEAD + work as f64 / GPU_RATE)
}

impl Backend {
    pub(super) fn choose(options: &super::LoadOptions, _work: u64) -> (Self, Option<Fallback>) {
        let wanted = matches!(options.device, DeviceChoice::Gpu | DeviceChoice::Software);
        (Self::Cpu, wanted.then_some(Fallback::NotBuilt))
    }

    pub(super) fn name(&self) -> String {
        "cpu".to_owned()
    }

    pub(super) fn start(&mut self, _: &[super::models::Model; 2]) -> Result<Start, Fallback> {
        Ok(Start::Cpu)
    }

    pub(super) fn run(
        &mut self,
        _: &[super::models::Model; 2],
        _: &[super::inputs::Inputs<'_>; 2],
    ) -> Result<[Vec<f32>; 2], Fallback> {
        Err(Fallback::NotBuilt)
    }
}
