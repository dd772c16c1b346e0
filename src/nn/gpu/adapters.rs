//! Finding adapters and opening devices.

use std::sync::{Arc, Mutex};

use wgpu::{Adapter, DeviceType, Features, Limits};

use crate::nn::device::{AdapterSummary, DeviceChoice, DeviceKind, Fallback};

/// The backends that are looked at. OpenGL is left out: its adapters do not tell software from
/// hardware reliably.
const BACKENDS: wgpu::Backends = wgpu::Backends::PRIMARY;

/// Abilities that are used where they are there, and never required.
const WELCOME: Features = Features::SHADER_F16
    .union(Features::SUBGROUP)
    .union(Features::PIPELINE_CACHE);

/// An open device.
#[derive(Debug)]
pub(super) struct Opened {
    pub(super) name: String,
    pub(super) kind: DeviceKind,
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    /// Whether it unpacks 16-bit floats; all do but some old ones.
    pub(super) half: bool,
    /// The abilities beyond the defaults that it was opened with: those of [`WELCOME`] that it has.
    pub(super) features: Features,
    pub(super) info: wgpu::AdapterInfo,
    /// What went wrong outside every error scope, first of all the loss of the device.
    pub(super) trouble: Arc<Mutex<Option<String>>>,
}

fn adapters() -> Vec<Adapter> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = BACKENDS;
    let instance = wgpu::Instance::new(descriptor);
    pollster::block_on(instance.enumerate_adapters(BACKENDS))
}

fn kind(adapter: &Adapter) -> DeviceKind {
    match adapter.get_info().device_type {
        DeviceType::DiscreteGpu => DeviceKind::Discrete,
        DeviceType::IntegratedGpu => DeviceKind::Integrated,
        DeviceType::VirtualGpu => DeviceKind::Virtual,
        DeviceType::Cpu => DeviceKind::Software,
        DeviceType::Other => DeviceKind::Other,
    }
}

/// All adapters; opens the drivers' loader.
pub(crate) fn list() -> Vec<AdapterSummary> {
    adapters()
        .iter()
        .map(|adapter| {
            let (info, features, limits) =
                (adapter.get_info(), adapter.features(), adapter.limits());
            AdapterSummary {
                kind: kind(adapter),
                backend: info.backend.to_string(),
                driver: format!("{} {}", info.driver, info.driver_info)
                    .trim()
                    .to_owned(),
                name: info.name,
                f16: features.contains(Features::SHADER_F16),
                subgroups: features.contains(Features::SUBGROUP),
                timestamps: features.contains(Features::TIMESTAMP_QUERY),
                pipeline_cache: features.contains(Features::PIPELINE_CACHE),
                largest_buffer: limits.max_buffer_size,
                largest_binding: limits.max_storage_buffer_binding_size,
            }
        })
        .collect()
}

/// Opens the best adapter of the wanted kind. `largest` is the size in bytes of the largest buffer
/// that will be bound: limits above the defaults are asked for only when it needs them.
pub(super) fn open(wanted: DeviceChoice, largest: u64) -> Result<Opened, Fallback> {
    let software = wanted == DeviceChoice::Software;
    let best = adapters()
        .into_iter()
        .filter(|a| (kind(a) == DeviceKind::Software) == software)
        .min_by_key(|a| kind(a) as u8)
        .ok_or(Fallback::NoAdapter {
            wanted: if software { wanted } else { DeviceChoice::Gpu },
        })?;
    let name = best.get_info().name;
    let unfit = |reason: String| Fallback::Unfit {
        device: name.clone(),
        reason,
    };
    let mut limits = Limits::default();
    limits.max_storage_buffer_binding_size = limits.max_storage_buffer_binding_size.max(largest);
    limits.max_buffer_size = limits.max_buffer_size.max(largest);
    let descriptor = wgpu::DeviceDescriptor {
        label: Some("nngtl"),
        required_limits: limits,
        required_features: best.features() & WELCOME,
        ..Default::default()
    };
    let (device, queue) =
        pollster::block_on(best.request_device(&descriptor)).map_err(|e| unfit(e.to_string()))?;
    let trouble = Arc::new(Mutex::new(None));
    let note = |trouble: &Arc<Mutex<Option<String>>>, text: String| {
        log::debug!("device: {text}");
        if let Ok(mut first) = trouble.lock() {
            first.get_or_insert(text);
        }
    };
    let (sink, lost) = (Arc::clone(&trouble), Arc::clone(&trouble));
    device.on_uncaptured_error(Arc::new(move |error| note(&sink, error.to_string())));
    device.set_device_lost_callback(move |reason, text| note(&lost, format!("{reason:?} {text}")));
    Ok(Opened {
        kind: kind(&best),
        half: best
            .get_downlevel_capabilities()
            .flags
            .contains(wgpu::DownlevelFlags::SHADER_F16_IN_F32),
        name,
        features: best.features() & WELCOME,
        info: best.get_info(),
        device,
        queue,
        trouble,
    })
}
