//! `nngtl transfer`.

use std::fmt::Write as _;
use std::path::Path;
use std::time::Instant;

use nalgebra::Point2;
use serde_json::json;

use super::args::{SamplerName, TransferArgs};
use super::console::{Console, count, seconds};
use super::failure::Failure;
use super::{files, library, plan};
use crate::mission;
use crate::plan::Waypoint;
use crate::planner::{Progress, Stop};
use crate::transfer::{LibraryFile, Reused, learn};

pub(super) fn run(args: &TransferArgs, console: &Console) -> Result<(), Failure> {
    let began = Instant::now();
    if args.plan.sampler == SamplerName::Exact {
        let why = "transfer planning samples: choose another sampler, or use `nngtl plan --sampler exact`";
        return Err(Failure::input(why));
    }
    // Before a mission of many seconds is translated.
    std::fs::metadata(&args.library).map_err(|e| {
        let says = format!("{}: cannot read the library: {e}", args.library.display());
        Failure::input(says)
    })?;
    let (scenario, task, translate) = plan::read(&args.plan, console)?;
    let plan = &args.plan;
    let outputs = [&plan.out, &plan.svg, &plan.png, &plan.heatmap]
        .into_iter()
        .flatten();
    let outputs: Vec<&Path> = outputs.map(|p| p.as_path()).collect();
    files::keep_inputs(&[&args.library], &outputs)?;
    if args.learn {
        files::check_folders([args.library.as_path()])?;
    }
    let (system, start) = mission::world(&scenario)?;
    let loading = Instant::now();
    let loaded = library::load(&args.library, &*system, console)?;
    let load_seconds = loading.elapsed().as_secs_f64();
    if args.learn && !loaded.same_map {
        library::keep(&args.library, &loaded)?;
    }
    let options = plan::options(&args.plan);
    let skills = &loaded.library;
    let search = |stop: &Stop, observe: &mut dyn FnMut(Progress)| {
        mission::transfer_task(&scenario, task, skills, &options, stop, observe)
    };
    let ((mut planned, reused), ended) = plan::watched(&scenario, &options, console, search)?;
    plan::finish(&mut planned, ended, began, translate, console);
    let mut legs = reused_legs(&planned.path.prefix, &reused.prefix_legs);
    legs.extend(reused_legs(&planned.path.suffix, &reused.suffix_legs));
    plan::write_files(&args.plan, &scenario, &planned, &legs, console)?;
    let mut learned = None;
    if args.learn {
        // Read again: another run may have learned meanwhile.
        let mut library = LibraryFile::read(&args.library)?.bind(&*system).library;
        let count = learn(&mut library, &*system, start, &planned.path);
        library.to_file(&*system).write(&args.library)?;
        console.note(&format!("wrote {}", args.library.display()));
        learned = Some(count);
    }
    let text = if console.json() {
        let mut object = plan::to_json(&args.plan, &scenario, &planned);
        if let (Some(files), true) = (object["files"].as_array_mut(), args.learn) {
            files.push(json!(args.library));
        }
        object["reuse"] = json!({
            "subtasks": reused.counts.subtasks,
            "matched": reused.counts.matched,
            "graph_seconds": reused.graph_seconds,
            "layout_seconds": reused.layout_seconds,
            "load_seconds": load_seconds,
            "prefix_legs": reused.prefix_legs,
            "suffix_legs": reused.suffix_legs,
            "learned": learned,
            "same_map": loaded.same_map,
            "dropped": library::dropped_json(&loaded.dropped),
        });
        format!("{object}\n")
    } else {
        let mut text = plan::describe(&scenario, &planned);
        describe(&mut text, &reused, load_seconds, learned);
        text
    };
    Ok(console.result(&text)?)
}

fn reused_legs(points: &[Waypoint], reused: &[bool]) -> Vec<(Point2<f64>, Point2<f64>)> {
    let legs = points.windows(2).zip(reused);
    legs.filter(|&(w, &reused)| reused && w[0].at != w[1].at)
        .map(|(w, _)| (w[0].at, w[1].at))
        .collect()
}

fn describe(text: &mut String, reused: &Reused, load: f64, learned: Option<usize>) {
    let legs = reused.prefix_legs.iter().chain(&reused.suffix_legs);
    let (all, taken) = legs.fold((0, 0), |(n, k), &r| (n + 1, k + usize::from(r)));
    let counts = &reused.counts;
    let _ = writeln!(
        text,
        "  reuse   {} of {} subtasks have a skill ({:.1} %), {taken} of {all} legs are reused",
        counts.matched,
        counts.subtasks,
        counts.percent()
    );
    let _ = writeln!(
        text,
        "  matched in {}; library loaded in {}, laid out in {}",
        seconds(reused.graph_seconds),
        seconds(load),
        seconds(reused.layout_seconds)
    );
    if let Some(learned) = learned {
        let _ = writeln!(text, "  learned {}, new or better", count(learned, "skill"));
    }
}
