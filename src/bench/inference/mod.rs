//! How long the networks take on this machine, and from when on that pays.
//!
//! Every network on every device: start-up, first run, steady state; how much of the device's
//! measured peak that is; and guided against biased search with inference included.

mod break_even;
mod networks;
mod plot;
mod start;
mod text;

use std::time::{Duration, Instant};

use serde::Serialize;

use super::stats::Summary;
use crate::nn::cpu::matmul::{Operand, matmul};
use crate::nn::cpu::{MatMut, Session};
#[cfg(feature = "gpu")]
use crate::nn::device::DeviceKind;
use crate::nn::inputs::Inputs;
use crate::nn::program::Program;
use crate::nn::weights::WeightError;

pub use break_even::{BreakEven, MissionTimes, break_even, generated_cases};
pub use networks::{Network, SampleMission, WIDTHS, Weights, paper_networks};
pub use start::StartRow;

/// How long to measure.
#[derive(Clone, Debug, Serialize)]
pub struct InferenceBench {
    /// Runs of each network on each device, at least; fewer where that takes too long.
    pub runs: usize,
    /// Seconds for the runs of one network on one device, about.
    pub seconds: f64,
    /// Threads of the CPU path.
    pub threads: usize,
    /// Multiply-adds above which a network is left out on software adapters: it would take
    /// minutes and tell nothing.
    pub software_limit: u64,
}

impl Default for InferenceBench {
    fn default() -> Self {
        Self {
            runs: 30,
            seconds: 2.0,
            threads: 1,
            software_limit: 600_000_000,
        }
    }
}

/// One network on one device.
#[derive(Clone, Debug, Serialize)]
pub struct InferenceRow {
    /// The network.
    pub network: String,
    /// The device.
    pub device: String,
    /// Multiply-adds of one run.
    pub multiply_adds: u64,
    /// Milliseconds to read and check the weights and to open the device.
    pub start_ms: f64,
    /// Milliseconds of the first run: memory is taken, kernels are compiled, weights are fetched.
    pub first_ms: f64,
    /// Milliseconds of the runs after it.
    pub steady_ms: Summary,
    /// Milliseconds of processor time of a run, mean: what it takes where nobody else wants the
    /// core. On Linux, for one thread of the CPU path.
    pub cpu_ms: Option<f64>,
    /// Billions of floating-point operations a second, in the median run.
    pub gflops: f64,
    /// The same of the fastest run: what an undisturbed machine does.
    pub best_gflops: f64,
    /// The share of the device's measured peak that the fastest run reaches.
    pub peak_share: f64,
}

/// A network that was not measured on a device.
#[derive(Clone, Debug, Serialize)]
pub struct LeftOut {
    /// The network.
    pub network: String,
    /// The device.
    pub device: String,
    /// Why.
    pub reason: &'static str,
}

/// A device and what it can do.
#[derive(Clone, Debug, Serialize)]
pub struct DeviceRow {
    /// `cpu`, or the adapter's name.
    pub name: String,
    /// What kind of device it is.
    pub kind: &'static str,
    /// Billions of floating-point operations a second in a large matrix product.
    pub peak_gflops: f64,
}

/// The measurements.
#[derive(Clone, Debug, Serialize)]
pub struct InferenceTable {
    /// The format's version.
    pub version: u32,
    /// How they were made.
    pub settings: InferenceBench,
    /// Processor architecture and cores.
    pub machine: String,
    /// The devices.
    pub devices: Vec<DeviceRow>,
    /// What a single mission waits for, on each device.
    pub start: Vec<StartRow>,
    /// One row for each network and device.
    pub rows: Vec<InferenceRow>,
    /// What is missing among them, and why.
    pub left_out: Vec<LeftOut>,
    /// From when on guidance pays, if that was measured.
    pub break_even: Option<BreakEven>,
}

impl InferenceTable {
    /// A table without rows.
    #[must_use]
    pub fn new(settings: InferenceBench) -> Self {
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        Self {
            version: 1,
            settings,
            machine: format!(
                "{} {}, {cores} cores, vector instructions {}",
                std::env::consts::OS,
                std::env::consts::ARCH,
                vectors()
            ),
            devices: Vec::new(),
            start: Vec::new(),
            rows: Vec::new(),
            left_out: Vec::new(),
            break_even: None,
        }
    }

    /// Measures networks on a device; `done` is called after each.
    ///
    /// # Errors
    /// A weight file at fault.
    pub fn measure(
        &mut self,
        device: &BenchDevice,
        networks: &[Network],
        done: &mut dyn FnMut(),
    ) -> Result<(), WeightError> {
        let mission = SampleMission::default();
        let peak_gflops = device.peak(&self.settings);
        self.devices.push(DeviceRow {
            name: device.name(),
            kind: device.kind(),
            peak_gflops,
        });
        for network in networks {
            match self.row(device, network, &mission, peak_gflops)? {
                Ok(row) => self.rows.push(row),
                Err(reason) => self.left_out.push(LeftOut {
                    network: network.name.clone(),
                    device: device.name(),
                    reason,
                }),
            }
            done();
        }
        Ok(())
    }

    fn row(
        &self,
        device: &BenchDevice,
        network: &Network,
        mission: &SampleMission,
        peak: f64,
    ) -> Result<Result<InferenceRow, &'static str>, WeightError> {
        let begin = Instant::now();
        let model = network.build()?;
        let built = begin.elapsed();
        let raster = mission.raster(model.program.resolution);
        let inputs = mission.inputs(&raster);
        let multiply_adds = model.program.multiply_adds(inputs.size());
        if device.kind() == "software" && multiply_adds > self.settings.software_limit {
            return Ok(Err(
                "too large for an adapter that computes on the processor",
            ));
        }
        let begin = Instant::now();
        let Some(mut run) = device.open(&model.program, self.settings.threads) else {
            return Ok(Err("the device could not be opened for it"));
        };
        let start = built + begin.elapsed();
        let first = Instant::now();
        if !run(&model.program, &inputs) {
            return Ok(Err("the device failed in its first run"));
        }
        let first_ms = milliseconds(first.elapsed());
        let before = thread_seconds();
        let times = self.settings.times(&mut || run(&model.program, &inputs));
        let spent = thread_seconds()
            .zip(before)
            .map(|(after, before)| after - before);
        let alone = device.kind() == "cpu" && self.settings.threads <= 1;
        let Some(steady_ms) = Summary::of(&times) else {
            return Ok(Err("the device failed in a later run"));
        };
        let gflops = |ms: f64| 2e-6 * multiply_adds as f64 / ms;
        let cpu_ms = spent
            .filter(|_| alone)
            .map(|s| 1e3 * s / times.len() as f64);
        Ok(Ok(InferenceRow {
            network: network.name.clone(),
            device: device.name(),
            multiply_adds,
            start_ms: milliseconds(start),
            first_ms,
            cpu_ms,
            gflops: gflops(steady_ms.median),
            best_gflops: gflops(steady_ms.min),
            peak_share: gflops(steady_ms.min) / peak,
            steady_ms,
        }))
    }
}

/// Processor time of this thread so far, where the system tells it in a file.
fn thread_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds: f64 = text.split_whitespace().next()?.parse().ok()?;
    Some(1e-9 * nanoseconds)
}

/// What the CPU's kernels were chosen for when the program began.
fn vectors() -> String {
    let arch = format!("{:?}", pulp::Arch::new());
    // `V4(…)` is followed by a list of all that it takes.
    arch.split('(').next().unwrap_or_default().to_lowercase()
}

fn milliseconds(time: Duration) -> f64 {
    1e3 * time.as_secs_f64()
}

impl InferenceBench {
    /// Milliseconds of each run.
    fn times(&self, run: &mut dyn FnMut() -> bool) -> Vec<f64> {
        let begin = Instant::now();
        let mut times = Vec::new();
        loop {
            let start = Instant::now();
            if !run() {
                return Vec::new();
            }
            times.push(milliseconds(start.elapsed()));
            let (spent, enough) = (begin.elapsed().as_secs_f64(), times.len() > self.runs);
            let late = spent > 4.0 * self.seconds;
            if times.len() > 3 && (late || (enough && spent > self.seconds)) {
                return times;
            }
        }
    }
}

/// A device to measure on.
#[derive(Clone, Debug)]
pub enum BenchDevice {
    /// The native CPU path.
    Cpu,
    /// An adapter.
    #[cfg(feature = "gpu")]
    Adapter(crate::nn::DeviceChoice, String, DeviceKind),
}

/// Runs a program once, and says whether that went well.
type Run = Box<dyn FnMut(&Program, &Inputs<'_>) -> bool>;

impl BenchDevice {
    /// The devices of this machine: the CPU, then a hardware GPU and a software adapter if there
    /// are any.
    #[must_use]
    pub fn present() -> Vec<Self> {
        let mut found = vec![Self::Cpu];
        found.extend(Self::adapters());
        found
    }

    #[cfg(feature = "gpu")]
    fn adapters() -> Vec<Self> {
        use crate::nn::DeviceChoice::{Gpu, Software};
        let open = |choice| {
            let gpu = crate::nn::gpu::Gpu::open(choice, &[]).ok()?;
            Some(Self::Adapter(choice, gpu.name().to_owned(), gpu.kind()))
        };
        [Gpu, Software].into_iter().filter_map(open).collect()
    }

    #[cfg(not(feature = "gpu"))]
    fn adapters() -> Vec<Self> {
        Vec::new()
    }

    /// `cpu`, or the adapter's name.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Cpu => "cpu".to_owned(),
            #[cfg(feature = "gpu")]
            Self::Adapter(_, name, _) => name.clone(),
        }
    }

    /// `cpu`, `gpu` or `software`.
    #[must_use]
    pub fn kind(&self) -> &'static str {
        match self {
            Self::Cpu => "cpu",
            #[cfg(feature = "gpu")]
            Self::Adapter(_, _, DeviceKind::Software) => "software",
            #[cfg(feature = "gpu")]
            Self::Adapter(..) => "gpu",
        }
    }

    /// What names it to a predictor.
    #[must_use]
    pub fn choice(&self) -> crate::nn::DeviceChoice {
        match self {
            Self::Cpu => crate::nn::DeviceChoice::Cpu,
            #[cfg(feature = "gpu")]
            Self::Adapter(choice, ..) => *choice,
        }
    }

    /// Makes ready to run a network, or nothing if the device cannot.
    #[cfg_attr(not(feature = "gpu"), allow(unused_variables))] // only adapters upload weights
    fn open(&self, program: &Program, threads: usize) -> Option<Run> {
        match self {
            Self::Cpu => {
                let mut session = Session::new(threads);
                Some(Box::new(move |program, inputs| {
                    !session.run(program, inputs).is_empty()
                }))
            }
            #[cfg(feature = "gpu")]
            Self::Adapter(choice, ..) => {
                let settings = crate::nn::gpu::GpuSettings::from_env();
                let gpu = crate::nn::gpu::Gpu::open_with(*choice, &[program], &settings).ok()?;
                Some(Box::new(move |program, inputs| {
                    gpu.run(&[program], &[*inputs]).is_ok()
                }))
            }
        }
    }

    /// Billions of floating-point operations a second in a large matrix product: on the CPU of the
    /// crate `gemm`, on adapters of the kernel that the networks use.
    fn peak(&self, settings: &InferenceBench) -> f64 {
        let n = match self.kind() {
            "gpu" => 4096,
            "software" => 256,
            _ => 1024,
        };
        let quick = InferenceBench {
            runs: 10,
            seconds: 0.5,
            ..settings.clone()
        };
        let times = match self {
            Self::Cpu => {
                let (a, b) = (vec![0.5; n * n], vec![0.25; n * n]);
                let mut y = vec![0.0; n * n];
                let before = thread_seconds();
                let times = quick.times(&mut || {
                    let (a, b) = (Operand::new(&a, n), Operand::new(&b, n));
                    matmul(MatMut::new(&mut y, n, n), a, b, n, false, settings.threads);
                    true
                });
                // On a busy machine a run is longer than the time that it has a core.
                match thread_seconds()
                    .zip(before)
                    .filter(|_| settings.threads <= 1)
                {
                    Some((after, before)) => vec![1e3 * (after - before) / times.len() as f64],
                    None => times,
                }
            }
            #[cfg(feature = "gpu")]
            Self::Adapter(..) => {
                let program = product_program(n);
                let mission = SampleMission::default();
                let (raster, values) = (mission.raster(8), vec![0.5; n * n]);
                let given: [&[f32]; 1] = [&values];
                let inputs = Inputs {
                    given: &given,
                    ..mission.inputs(&raster)
                };
                match self.open(&program, 1) {
                    Some(mut run) => quick.times(&mut || run(&program, &inputs)),
                    None => Vec::new(),
                }
            }
        };
        let best = times.iter().copied().fold(f64::INFINITY, f64::min);
        2e-6 * (n as f64).powi(3) / best
    }
}

/// A program of one product of square matrices of this size.
#[cfg(feature = "gpu")]
fn product_program(n: usize) -> Program {
    use crate::nn::program::{Activation, Extent, Op, Source};
    let mut program = Program {
        resolution: 8,
        ..Program::default()
    };
    let x = program.matrix(Extent::Fixed(n), n);
    program.input(Source::Given(0), x);
    let weight = program.constant(vec![0.25; n * n.next_multiple_of(16)]);
    let bias = program.constant(vec![0.0; n]);
    let y = program.matrix(Extent::Fixed(n), n);
    program.push(Op::Linear {
        x,
        second: None,
        weight,
        bias,
        activation: Activation::None,
        y,
    });
    program.output = Some(y.rows(0, 1));
    program
}
