//! Which device runs the networks.

use std::fmt;
use std::str::FromStr;

use super::inputs::Inputs;
use super::program::Program;

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

/// The kind of an adapter, best first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DeviceKind {
    /// A GPU with memory of its own.
    Discrete,
    /// A GPU that shares the processor's memory.
    Integrated,
    /// A GPU behind a virtual machine.
    Virtual,
    /// Unknown.
    Other,
    /// A driver that computes on the processor.
    Software,
}

/// An adapter, for people to read.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct AdapterSummary {
    /// Its name.
    pub name: String,
    /// Its kind.
    pub kind: DeviceKind,
    /// The interface it is reached through.
    pub backend: String,
    /// Its driver and the driver's version.
    pub driver: String,
    /// Whether it computes in 16-bit floating point.
    pub f16: bool,
    /// Whether it has subgroup operations.
    pub subgroups: bool,
    /// Whether it measures time.
    pub timestamps: bool,
    /// Whether its compiled kernels can be kept on disk.
    pub pipeline_cache: bool,
    /// The largest buffer, in bytes.
    pub largest_buffer: u64,
    /// The largest part of a buffer that a kernel can see, in bytes.
    pub largest_binding: u64,
}

/// All adapters of this machine. Opens the drivers' loader, which takes 30 to 300 ms.
#[must_use]
pub fn adapters() -> Vec<AdapterSummary> {
    #[cfg(feature = "gpu")]
    let found = super::gpu::list();
    #[cfg(not(feature = "gpu"))]
    let found = Vec::new();
    found
}

/// Multiply-adds a second of the CPU path on one core: what networks of all sizes were seen to
/// reach at least on a server core with AVX-512 (`nngtl bench inference`), halved for those with
/// AVX2 alone.
const CPU_RATE: f64 = 1.8e10;

/// Seconds of one mission on the CPU beside the arithmetic: encoding, small layers.
const CPU_OVERHEAD: f64 = 0.000_5;

/// Multiply-adds a second of a hardware GPU with these kernels, as low as integrated ones have it.
const GPU_RATE: f64 = 2e11;

/// Seconds from opening the drivers' loader to the first result of a hardware GPU: between the
/// 30 ms of warm caches and the 300 ms of cold ones.
const GPU_START: f64 = 0.15;

/// Seconds of one inference on a hardware GPU beside its arithmetic: some hundred dispatches, an
/// upload and a read-back.
const GPU_OVERHEAD: f64 = 0.001;

/// What `auto` weighs.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Estimate {
    /// Seconds on the CPU path.
    pub cpu: f64,
    /// Seconds on a hardware GPU, its start included.
    pub gpu: f64,
}

impl Estimate {
    /// For `missions` inferences of `multiply_adds` each, with so many threads of the CPU.
    #[must_use]
    pub fn new(multiply_adds: u64, missions: usize, threads: usize) -> Self {
        let (work, missions) = (multiply_adds as f64, missions as f64);
        Self {
            cpu: missions * (CPU_OVERHEAD + work / (CPU_RATE * threads.max(1) as f64)),
            gpu: GPU_START + missions * (GPU_OVERHEAD + work / GPU_RATE),
        }
    }

    /// From how many missions in one go on a hardware GPU is done sooner, its start included; this
    /// estimate is for one mission. `None` if never.
    #[must_use]
    pub fn missions_for_gpu(self) -> Option<u64> {
        let saved = self.cpu - (self.gpu - GPU_START);
        (saved > 0.0).then(|| (GPU_START / saved).floor() as u64 + 1)
    }

    /// Whether looking for a GPU is worth it.
    #[must_use]
    pub fn prefers_gpu(self) -> bool {
        self.gpu < self.cpu
    }
}

/// What runs the networks.
#[derive(Clone, Debug)]
pub(super) enum Backend {
    /// The native CPU path.
    Cpu,
    /// An adapter.
    #[cfg(feature = "gpu")]
    Gpu(super::gpu::Gpu),
}

impl Backend {
    /// The backend for a wish, and why it is not what was wished for. `auto` that ends on the CPU
    /// is no disappointment.
    pub(super) fn open(
        wanted: DeviceChoice,
        estimate: Estimate,
        programs: [&Program; 2],
    ) -> (Self, Option<Fallback>) {
        let auto = wanted == DeviceChoice::Auto;
        if wanted == DeviceChoice::Cpu || (auto && !estimate.prefers_gpu()) {
            return (Self::Cpu, None);
        }
        match Self::open_gpu(wanted, programs) {
            Ok(backend) => (backend, None),
            Err(reason) if auto => {
                log::info!("{reason}; the CPU runs the networks");
                (Self::Cpu, None)
            }
            Err(reason) => (Self::Cpu, Some(reason)),
        }
    }

    #[cfg(feature = "gpu")]
    fn open_gpu(wanted: DeviceChoice, programs: [&Program; 2]) -> Result<Self, Fallback> {
        let settings = super::gpu::GpuSettings::from_env();
        super::gpu::Gpu::open_with(wanted, &programs, &settings).map(Self::Gpu)
    }

    #[cfg(not(feature = "gpu"))]
    fn open_gpu(_: DeviceChoice, _: [&Program; 2]) -> Result<Self, Fallback> {
        Err(Fallback::NotBuilt)
    }

    /// `cpu`, or the adapter's name.
    pub(super) fn name(&self) -> &str {
        match self {
            Self::Cpu => "cpu",
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => gpu.name(),
        }
    }

    /// Runs both networks on each mission, if that is not left to the caller.
    #[cfg_attr(not(feature = "gpu"), allow(unused_variables))] // only adapters run by themselves
    pub(super) fn run(
        &self,
        programs: [&Program; 2],
        missions: &[[Inputs<'_>; 2]],
    ) -> Option<Result<Vec<[Vec<f32>; 2]>, Fallback>> {
        match self {
            Self::Cpu => None,
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => {
                let missions: Vec<&[Inputs<'_>]> = missions.iter().map(|m| &m[..]).collect();
                let outputs = gpu.run_many(&programs, &missions).and_then(|outputs| {
                    let both = outputs.into_iter().map(TryInto::try_into);
                    both.collect::<Result<_, _>>().map_err(|_| Fallback::Lost {
                        device: gpu.name().to_owned(),
                        reason: "it did not answer for both networks".to_owned(),
                    })
                });
                Some(outputs)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn compact_networks_stay_on_the_cpu_and_large_sets_do_not() {
        let compact = 100_000_000;
        assert!(!Estimate::new(compact, 1, 1).prefers_gpu());
        let from = Estimate::new(compact, 1, 1).missions_for_gpu().unwrap() as usize;
        assert!(Estimate::new(compact, from, 1).prefers_gpu());
        assert!(!Estimate::new(compact, from - 1, 1).prefers_gpu());
        assert!(Estimate::new(8_000_000_000, 1, 1).prefers_gpu());
    }

    #[test]
    fn device_names_round_trip() {
        for choice in [
            DeviceChoice::Auto,
            DeviceChoice::Gpu,
            DeviceChoice::Software,
            DeviceChoice::Cpu,
        ] {
            assert_eq!(choice.to_string().parse(), Ok(choice));
        }
        assert!(
            "tpu"
                .parse::<DeviceChoice>()
                .unwrap_err()
                .to_string()
                .contains("`tpu`")
        );
    }
}
