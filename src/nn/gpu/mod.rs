//! Runs programs on a graphics adapter, through wgpu.
//!
//! Kernels stand in `shaders/`, one per operation, each with a CPU twin of its name. Weights and
//! values stay on the device: an inference is one upload of the encoded mission, one submission
//! for both networks, and one read-back. What both networks see is uploaded once. Default limits
//! and no features suffice; a program with a buffer above the default binding size asks for that
//! much more, and 16-bit arithmetic, subgroup operations and the driver's cache of compiled kernels
//! are used where they are there ([`GpuSettings`]).

mod adapters;
mod cache;
pub mod kernels;
mod layout;
mod lower;
mod params;
mod pipelines;
mod session;
mod settings;
mod uploads;

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use adapters::Opened;
use cache::KernelCache;
use kernels::{Tile, TileRule};
use layout::Layout;
use lower::Dispatch;
use pipelines::Pipelines;
use session::GpuSession;
use uploads::{EdgeBuffers, Uploads};

pub(crate) use adapters::list;
pub use settings::{CACHE_VARIABLE, GpuSettings, NARROW_VARIABLE, SUBGROUPS_VARIABLE, Use};

use super::device::{DeviceChoice, DeviceKind, Fallback};
use super::inputs::Inputs;
use super::program::Program;

/// How long a submission may take before the device counts as lost.
const PATIENCE: Duration = Duration::from_secs(120);

/// An open device with programs on it. Clones share the device and take turns.
#[derive(Clone, Debug)]
pub struct Gpu {
    name: String,
    kind: DeviceKind,
    inner: Arc<Mutex<Inner>>,
}

#[derive(Debug)]
struct Inner {
    opened: Opened,
    layout: Layout,
    tiles: TileRule,
    abilities: Abilities,
    cache: Option<KernelCache>,
    pipelines: Pipelines,
    sessions: Vec<GpuSession>,
    edges: EdgeBuffers,
    readback: Option<wgpu::Buffer>,
    /// Bytes of inputs that were uploaded so far.
    sent: u64,
}

/// What of an adapter's abilities is used.
#[derive(Clone, Copy, Debug)]
struct Abilities {
    /// Whether kernels unpack 16-bit floats.
    half: bool,
    /// Whether there is arithmetic in 16-bit floats, and whether to use it.
    f16: bool,
    narrow: Use,
    subgroups: bool,
    hardware: bool,
}

impl Abilities {
    fn new(opened: &Opened, settings: &GpuSettings) -> Self {
        let hardware = opened.kind != DeviceKind::Software;
        let has = |feature| opened.features.contains(feature);
        Self {
            half: opened.half,
            f16: has(wgpu::Features::SHADER_F16),
            narrow: settings.narrow,
            subgroups: settings
                .subgroups
                .decide(has(wgpu::Features::SUBGROUP), hardware),
            hardware,
        }
    }

    /// Whether the products of this program are computed in 16-bit floats. By default where its
    /// weights were rounded to them anyway, on hardware, which computes two in the time of one.
    fn narrow(&self, program: &Program) -> bool {
        self.narrow.decide(self.f16, self.hardware && program.half)
    }
}

impl Gpu {
    /// Opens the best adapter of the wanted kind with default settings, and uploads the programs'
    /// weights.
    ///
    /// # Errors
    /// No such adapter, or it cannot hold these programs.
    pub fn open(wanted: DeviceChoice, programs: &[&Program]) -> Result<Self, Fallback> {
        Self::open_with(wanted, programs, &GpuSettings::default())
    }

    /// As [`Self::open`], with settings.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub fn open_with(
        wanted: DeviceChoice,
        programs: &[&Program],
        settings: &GpuSettings,
    ) -> Result<Self, Fallback> {
        let buffers = programs.iter().flat_map(|p| {
            let fixed = p
                .buffers
                .iter()
                .map(|b| b.len(super::program::GraphSize::default()));
            fixed.chain(p.constants.iter().map(|c| c.len()))
        });
        let largest = 4 * buffers.max().unwrap_or(0) as u64;
        let guarded = |f: &mut dyn FnMut() -> Result<Self, Fallback>| {
            catch_unwind(AssertUnwindSafe(f)).unwrap_or_else(|_| {
                let reason = "its driver broke while it was opened".to_owned();
                Err(Fallback::Unfit {
                    device: wanted.to_string(),
                    reason,
                })
            })
        };
        guarded(&mut || {
            let opened = adapters::open(wanted, largest)?;
            let (name, kind) = (opened.name.clone(), opened.kind);
            let unfit = |reason| Fallback::Unfit {
                device: name.clone(),
                reason,
            };
            let (device, queue) = (&opened.device, &opened.queue);
            let abilities = Abilities::new(&opened, settings);
            let made = scoped(device, || {
                let layout = Layout::new(device);
                let sessions = programs
                    .iter()
                    .map(|p| GpuSession::new(device, queue, p, &abilities))
                    .collect();
                (layout, sessions)
            });
            let (layout, sessions) = made.map_err(unfit)?;
            let cache = settings.kernel_cache.as_ref().and_then(|folder| {
                let keeps = opened.features.contains(wgpu::Features::PIPELINE_CACHE);
                let open = || KernelCache::open(device, &opened.info, folder);
                // A driver that cannot open its cache has none.
                keeps.then(|| scoped(device, open).ok().flatten()).flatten()
            });
            let inner = Inner {
                opened,
                layout,
                tiles: if kind == DeviceKind::Software {
                    Tile::for_software
                } else {
                    Tile::for_hardware
                },
                abilities,
                cache,
                pipelines: Pipelines::default(),
                sessions,
                edges: EdgeBuffers::default(),
                readback: None,
                sent: 0,
            };
            Ok(Self {
                name,
                kind,
                inner: Arc::new(Mutex::new(inner)),
            })
        })
    }

    /// The adapter's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The kind of adapter.
    #[must_use]
    pub fn kind(&self) -> DeviceKind {
        self.kind
    }

    /// Replaces the programs on the device, keeping its compiled kernels.
    ///
    /// # Errors
    /// If the device cannot hold them.
    pub fn reload(&self, programs: &[&Program]) -> Result<(), Fallback> {
        let mut inner = self.lock();
        let Opened { device, queue, .. } = &inner.opened;
        let abilities = inner.abilities;
        let sessions = scoped(device, || {
            programs
                .iter()
                .map(|p| GpuSession::new(device, queue, p, &abilities))
                .collect()
        });
        inner.sessions = sessions.map_err(|reason| Fallback::Unfit {
            device: self.name.clone(),
            reason,
        })?;
        Ok(())
    }

    /// Replaces the rule by which products get their tiles: to tune it, or to test all of them.
    pub fn use_tiles(&self, rule: TileRule) {
        self.lock().tiles = rule;
    }

    /// Bytes of inputs that were uploaded so far: for tests that nothing is sent twice.
    #[doc(hidden)]
    #[must_use]
    pub fn uploaded(&self) -> u64 {
        self.lock().sent
    }

    /// Runs the programs that [`Self::open`] was given, each on its inputs, in one submission, and
    /// returns their outputs.
    ///
    /// # Errors
    /// If the device fails; it is of no use afterwards.
    pub fn run(
        &self,
        programs: &[&Program],
        inputs: &[Inputs<'_>],
    ) -> Result<Vec<Vec<f32>>, Fallback> {
        let mut outputs = self.run_many(programs, &[inputs])?;
        Ok(outputs.pop().unwrap_or_default())
    }

    /// As [`Self::run`] for several missions, one after the other on the device with a submission
    /// each, and one read-back for all of them.
    ///
    /// # Errors
    /// As [`Self::run`].
    pub fn run_many(
        &self,
        programs: &[&Program],
        missions: &[&[Inputs<'_>]],
    ) -> Result<Vec<Vec<Vec<f32>>>, Fallback> {
        let mut inner = self.lock();
        let outcome = catch_unwind(AssertUnwindSafe(|| inner.run_soundly(programs, missions)))
            .unwrap_or_else(|_| Err("its driver broke".to_owned()));
        outcome.map_err(|reason| {
            // It may wait for results for ever.
            inner.readback = None;
            Fallback::Lost {
                device: self.name.clone(),
                reason,
            }
        })
    }

    /// Destroys the device as if it had been lost: for tests of what happens then.
    #[doc(hidden)]
    pub fn lose(&self) {
        self.lock().opened.device.destroy();
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        // A panic of the driver leaves nothing half done that a later run would trust.
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Inner {
    /// Runs in 16-bit floats, where that is asked for, as long as their range suffices.
    fn run_soundly(
        &mut self,
        programs: &[&Program],
        missions: &[&[Inputs<'_>]],
    ) -> Result<Vec<Vec<Vec<f32>>>, String> {
        let outputs = self.run(programs, missions)?;
        let narrow = self.sessions.iter().any(|session| session.narrow);
        let finite = || outputs.iter().flatten().flatten().all(|v| v.is_finite());
        if !narrow || finite() {
            return Ok(outputs);
        }
        log::warn!(
            "{}: values do not fit into 16-bit floats, computed in 32 bits from here on",
            self.opened.name
        );
        self.sessions.iter_mut().for_each(|s| s.narrow = false);
        self.run(programs, missions)
    }

    fn run(
        &mut self,
        programs: &[&Program],
        missions: &[&[Inputs<'_>]],
    ) -> Result<Vec<Vec<Vec<f32>>>, String> {
        let Self {
            opened,
            layout,
            tiles,
            cache,
            pipelines,
            sessions,
            edges,
            readback,
            sent,
            ..
        } = self;
        let Opened {
            device,
            queue,
            trouble,
            ..
        } = opened;
        let lengths = |inputs: &[Inputs<'_>]| -> Vec<u64> {
            let pairs = programs.iter().zip(inputs);
            pairs
                .map(|(p, i)| GpuSession::output_bytes(p, i.size()))
                .collect()
        };
        let lengths: Vec<Vec<u64>> = missions.iter().map(|inputs| lengths(inputs)).collect();
        let total = lengths.iter().flatten().sum::<u64>().max(4);
        if readback.as_ref().is_none_or(|b| b.size() < total) {
            *readback = None;
        }
        let mut compiled = 0;
        scoped(device, || {
            let target = readback.get_or_insert_with(|| readback_buffer(device, total));
            let mut at = 0;
            for (inputs, lengths) in missions.iter().zip(&lengths) {
                let numbers = edges.upload(device, queue, inputs, sent);
                let mut uploads = Uploads::default();
                let prepared: Vec<Vec<Dispatch>> = sessions
                    .iter_mut()
                    .zip(programs.iter().zip(*inputs))
                    .zip(&numbers)
                    .map(|((session, (program, input)), &number)| {
                        let on = (&*device, &*queue, &*layout, *tiles);
                        session.prepare(on, program, input, edges.get(number), &mut uploads)
                    })
                    .collect();
                *sent += uploads.bytes;
                let kept = cache.as_ref().map(KernelCache::pipelines);
                compiled += pipelines.make(device, layout, kept, prepared.iter().flatten());
                let mut encoder = device.create_command_encoder(&wgpu::CommandEncoderDescriptor {
                    label: Some("inference"),
                });
                uploads.record(&mut encoder);
                for (k, dispatches) in prepared.iter().enumerate() {
                    let size = inputs[k].size();
                    sessions[k].record(&mut encoder, pipelines, dispatches);
                    sessions[k].record_output(&mut encoder, programs[k], size, target, at);
                    at += lengths[k];
                }
                // Uploads for the next mission come after this one's work: the queue keeps order.
                queue.submit([encoder.finish()]);
            }
            target.map_async(wgpu::MapMode::Read, 0..total, |_| {});
        })?;
        let wait = wgpu::PollType::Wait {
            submission_index: None,
            timeout: Some(PATIENCE),
        };
        device.poll(wait).map_err(|e| e.to_string())?;
        if let Some(reason) = trouble.lock().ok().and_then(|t| t.clone()) {
            return Err(reason);
        }
        let buffer = readback.as_ref().ok_or("no memory to read back to")?;
        let mut outputs = Vec::new();
        {
            let view = buffer
                .get_mapped_range(0..total)
                .map_err(|e| e.to_string())?;
            let mut at = 0;
            for lengths in &lengths {
                let mut values = Vec::new();
                for length in lengths {
                    let bytes = &view[at as usize..(at + length) as usize];
                    values.push(bytemuck::pod_collect_to_vec(bytes));
                    at += length;
                }
                outputs.push(values);
            }
        }
        buffer.unmap();
        // Only now: some drivers compile when a kernel runs first.
        if let (Some(cache), true) = (cache, compiled > 0) {
            cache.keep();
        }
        Ok(outputs)
    }
}

fn readback_buffer(device: &wgpu::Device, size: u64) -> wgpu::Buffer {
    device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("results"),
        size,
        usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    })
}

/// Runs `work` and returns the first error that the device reports meanwhile.
fn scoped<T>(device: &wgpu::Device, work: impl FnOnce() -> T) -> Result<T, String> {
    use wgpu::ErrorFilter::{Internal, OutOfMemory, Validation};
    let scopes = [Internal, OutOfMemory, Validation].map(|filter| device.push_error_scope(filter));
    let result = work();
    // Scopes are popped in the reverse of their order.
    let mut first = None;
    for scope in scopes.into_iter().rev() {
        let error = pollster::block_on(scope.pop());
        first = first.or(error);
    }
    match first {
        None => Ok(result),
        Some(error) => Err(error.to_string()),
    }
}
