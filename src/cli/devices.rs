//! `nngtl devices`.

use std::fmt::Write as _;

use serde_json::json;

use super::console::{Console, seconds};
use super::failure::{Failure, JSON_VERSION};
use crate::nn::device::{AdapterSummary, DeviceKind, adapters};
use crate::nn::{DeviceChoice, Estimate, LoadOptions, Predictor};

/// What `auto` would take for one mission with the built-in networks, and why.
struct Choice {
    device: String,
    estimate: Option<Estimate>,
}

pub(super) fn run(console: &Console) -> Result<(), Failure> {
    let adapters = adapters();
    let choice = choice();
    let text = if console.json() {
        let object = json!({
            "version": JSON_VERSION,
            "outcome": "listed",
            "adapters": adapters,
            "cpu_cores": cores(),
            "auto": choice.device,
            "estimate_seconds": choice.estimate,
            "gpu_sooner_from_missions": choice.estimate.and_then(|e| e.missions_for_gpu()),
        });
        format!("{object}\n")
    } else {
        describe(&adapters, &choice)
    };
    Ok(console.result(&text)?)
}

fn choice() -> Choice {
    match Predictor::embedded(DeviceChoice::Auto) {
        Ok(predictor) => Choice {
            device: predictor.device().to_owned(),
            estimate: Some(predictor.estimate(&LoadOptions::default())),
        },
        // Without networks there is nothing to run; the CPU is what a search uses.
        Err(_) => Choice {
            device: "cpu".to_owned(),
            estimate: None,
        },
    }
}

fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

fn describe(adapters: &[AdapterSummary], choice: &Choice) -> String {
    let mut text = format!("cpu: {} cores\n", cores());
    for a in adapters {
        let kind = serde_json::to_value(a.kind).unwrap_or_default();
        let kind = kind.as_str().unwrap_or("unknown").to_owned();
        let abilities = [
            (a.f16, "16-bit floats"),
            (a.subgroups, "subgroups"),
            (a.timestamps, "timestamps"),
            (a.pipeline_cache, "kernel cache"),
        ];
        let abilities: Vec<&str> = abilities.iter().filter(|x| x.0).map(|x| x.1).collect();
        let _ = writeln!(text, "{} ({kind}, {}, {})", a.name, a.backend, a.driver);
        let _ = writeln!(
            text,
            "  buffers up to {} MiB, bound up to {} MiB; {}",
            a.largest_buffer >> 20,
            a.largest_binding >> 20,
            if abilities.is_empty() {
                "no extras".to_owned()
            } else {
                abilities.join(", ")
            }
        );
    }
    if adapters.is_empty() {
        text.push_str("no Vulkan, Metal or DirectX adapter: the networks run on the cpu\n");
    }
    let why = match choice.estimate {
        Some(e) => {
            let present = adapters.iter().any(|a| a.kind != DeviceKind::Software);
            let many = match e.missions_for_gpu() {
                Some(n) => format!("it would be sooner from {n} missions in one go on"),
                None => "it would never be sooner".to_owned(),
            };
            format!(
                "\n  one mission with the built-in networks takes about {} on the cpu, and {} on a hardware GPU, its start included; {many}{}",
                seconds(e.cpu),
                seconds(e.gpu),
                if present { "" } else { "; there is none here" }
            )
        }
        None => String::new(),
    };
    let _ = writeln!(text, "auto takes: {}{why}", choice.device);
    text
}
