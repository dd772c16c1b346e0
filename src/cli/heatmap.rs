//! `nngtl heatmap`.

use std::fmt::Write as _;

use serde_json::json;

use super::args::HeatmapArgs;
use super::console::{Console, seconds};
use super::failure::{Failure, JSON_VERSION};
use super::files;
use crate::automaton::StateId;
use crate::mission::{self, Options, Prediction};

pub(super) fn run(args: &HeatmapArgs, console: &Console) -> Result<(), Failure> {
    files::heatmap_format(&args.out)?;
    files::check_folders([args.out.as_path()])?;
    let scenario = files::scenario(&args.mission, console)?;
    let task = mission::task_within(&scenario, &(&args.limits).into())?;
    let options = Options {
        device: args.network.device.into(),
        model: args.network.model.clone(),
        ..Options::default()
    };
    let prediction = mission::predict(&scenario, &task, &options)?;
    if let Some(notice) = &prediction.notice {
        console.warn(notice);
    }
    let bytes = files::heatmap_bytes(&args.out, &prediction.guidance.heatmap)?;
    files::write(&args.out, &bytes, console)?;
    let text = if console.json() {
        let object = json!({
            "version": JSON_VERSION,
            "outcome": "predicted",
            "scenario": scenario.name,
            "device": prediction.device,
            "model_hash": prediction.model_hash,
            "states": prediction.guidance.states,
            "initial": numbers(&task.nba.initial),
            "accepting": numbers(&task.feasible),
            "notices": prediction.notice.as_slice(),
            "seconds": { "encode": prediction.encode, "infer": prediction.infer },
            "heatmap": args.out,
        });
        format!("{object}\n")
    } else {
        let roles = |q: usize| {
            let state = StateId(q as u32);
            let initial = task.nba.initial.contains(&state).then_some("initial");
            let feasible = task.feasible.contains(&state).then_some("accepting");
            [initial, feasible]
                .into_iter()
                .flatten()
                .collect::<Vec<_>>()
                .join(", ")
        };
        describe(&scenario.name, &prediction, roles)
    };
    Ok(console.result(&text)?)
}

fn numbers(states: &[StateId]) -> Vec<u32> {
    states.iter().map(|q| q.0).collect()
}

fn describe(name: &str, prediction: &Prediction, roles: impl Fn(usize) -> String) -> String {
    let mut text = format!(
        "{name}: predicted on {} in {} (encoding {})\nstate  probability\n",
        prediction.device,
        seconds(prediction.infer),
        seconds(prediction.encode),
    );
    for (q, p) in prediction.guidance.states.iter().enumerate() {
        let line = format!("{q:>5}  {p:.3}        {}", roles(q));
        let _ = writeln!(text, "{}", line.trim_end());
    }
    text
}
