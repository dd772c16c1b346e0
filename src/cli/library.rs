//! `nngtl library`.

use std::fmt::Write as _;
use std::path::Path;

use nalgebra::Point2;
use serde_json::{Value, json};

use super::args::{LibraryBuildArgs, LibraryMergeArgs, LibraryShowArgs, SamplerName};
use super::console::{Console, count, seconds};
use super::failure::{Failure, JSON_VERSION};
use super::files;
use crate::mission::{self, Options, SamplerChoice};
use crate::render::Picture;
use crate::scenario::Scenario;
use crate::system::TransitionSystem;
use crate::transfer::{BuildSettings, Dropped, Library, LibraryError, LibraryFile, Loaded};

/// Pixels of a PNG for each pixel of the SVG.
const PNG_SCALE: f64 = 1.5;

/// Of the skills that do not hold on a map, so many are told one by one.
const TOLD: usize = 3;

impl From<LibraryError> for Failure {
    fn from(e: LibraryError) -> Self {
        Self::input(e.to_string())
    }
}

/// Reads a library for a scenario, and says which skills do not hold on its map.
pub(super) fn load(
    path: &Path,
    system: &dyn TransitionSystem,
    console: &Console,
) -> Result<Loaded, Failure> {
    let loaded = LibraryFile::read(path)?.bind(system);
    let name = path.display();
    if !loaded.same_map {
        console.warn(&format!(
            "{name}: made on another map, or another state of this one; every skill was checked, {} hold and {} do not",
            loaded.library.skills().len(),
            loaded.dropped.len()
        ));
    }
    for dropped in loaded.dropped.iter().take(TOLD) {
        let number = dropped.skill + 1;
        console.note(&format!(
            "{name}: skill {number} left out: {}",
            dropped.reason
        ));
    }
    if let Some(more) = loaded.dropped.len().checked_sub(TOLD + 1) {
        console.note(&format!(
            "{name}: and {} left out; `nngtl library show --scenario` marks them",
            count(more + 1, "more skill")
        ));
    }
    Ok(loaded)
}

/// Refuses to write a library of another map, or of another state of this one, under this map's name: its
/// skills that do not hold here would be lost.
pub(super) fn keep(path: &Path, loaded: &Loaded) -> Result<(), Failure> {
    let kept = loaded.library.skills().len();
    Err(Failure::input(format!(
        "{}: made on another map, or another state of this one: learning here would keep {} and lose {}; build a library of this map (`nngtl library build`) and learn into that",
        path.display(),
        count(kept, "skill"),
        loaded.dropped.len()
    )))
}

/// Skills that do not hold, for programs.
pub(super) fn dropped_json(dropped: &[Dropped]) -> Vec<Value> {
    let told = |d: &Dropped| json!({ "skill": d.skill, "reason": d.reason.to_string() });
    dropped.iter().map(told).collect()
}

pub(super) fn build(args: &LibraryBuildArgs, console: &Console) -> Result<(), Failure> {
    let outputs = [Some(&args.out), args.svg.as_ref(), args.png.as_ref()];
    let outputs: Vec<&Path> = outputs.into_iter().flatten().map(|p| p.as_path()).collect();
    files::keep_inputs(&[&args.mission.scenario], &outputs)?;
    files::check_folders(outputs)?;
    let sampler = match args.sampler {
        SamplerName::Uniform | SamplerName::Auto => SamplerChoice::Uniform,
        SamplerName::Guided => SamplerChoice::Guided,
        SamplerName::Biased | SamplerName::Directed | SamplerName::Exact => {
            let why = "a library is built with uniform or guided sampling: choose one of them";
            return Err(Failure::input(why));
        }
    };
    let scenario = files::scenario(&args.mission, console)?;
    let (system, _) = mission::world(&scenario)?;
    let known = match args.extend && args.out.exists() {
        true => {
            let loaded = load(&args.out, &*system, console)?;
            if !loaded.same_map {
                keep(&args.out, &loaded)?;
            }
            Some(loaded.library)
        }
        false => None,
    };
    let task = mission::task_within(&scenario, &(&args.limits).into())?;
    let options = Options {
        sampler,
        device: args.network.device.into(),
        model: args.network.model.clone(),
        ..Options::default()
    };
    let settings = BuildSettings {
        seed: args.seed,
        samples: args.samples,
        nodes: args.nodes,
        time_limit: args.time_limit,
        ..BuildSettings::default()
    };
    let stop = super::interrupt::stop_on_interrupt();
    let bar = console.progress(settings.samples, "learning");
    let began = std::time::Instant::now();
    let learned = mission::build_library(&scenario, &task, &options, &settings, &stop, &mut |p| {
        bar.set_position(p.samples);
        bar.set_message(format!(
            "{} of {} subtasks, {} nodes",
            p.found, p.subtasks, p.nodes
        ));
    });
    bar.finish_and_clear();
    let (built, notice) = learned?;
    if let Some(notice) = &notice {
        console.warn(notice);
    }
    if stop.is_raised() {
        console.warn("interrupted: this is what was learned so far");
    }
    let took = began.elapsed().as_secs_f64();
    if args.time_limit.is_some_and(|limit| took >= limit) {
        console.warn("the time limit ended the build: this is what was learned so far");
    }
    let mut library = built.library;
    if let Some(mut before) = known {
        before.merge(&*system, &library);
        library = before;
    }
    if library.skills().is_empty() {
        let why = match built.subtasks {
            0 => "the mission has no subtask that asks for a path".to_owned(),
            n => format!(
                "no path was found for any of its {} within {}; give it {}",
                count(n, "subtask"),
                count(built.samples as usize, "sample"),
                if built.samples < args.samples {
                    "more time"
                } else {
                    "more --samples"
                },
            ),
        };
        return Err(Failure::negative(
            "not-found",
            format!("{}: nothing was learned: {why}", scenario.name),
        ));
    }
    library.to_file(&*system).write(&args.out)?;
    console.note(&format!("wrote {}", args.out.display()));
    draw(
        &scenario,
        &library,
        args.svg.as_deref(),
        args.png.as_deref(),
        console,
    )?;
    let text = match console.json() {
        true => {
            let object = json!({
                "version": JSON_VERSION,
                "outcome": "built",
                "notices": notice.as_slice(),
                "scenario": scenario.name,
                "file": args.out,
                "skills": library.skills().len(),
                "pairs": library.pairs(),
                "subtasks": built.subtasks,
                "found": built.found,
                "subtrees": built.subtrees,
                "samples": built.samples,
                "nodes": built.nodes,
                "seconds": took,
            });
            format!("{object}\n")
        }
        false => format!(
            "{}: {} between {} of places\n  learned  {} of {} in {}\n  effort   {} samples, {} nodes, {}\n",
            args.out.display(),
            count(library.skills().len(), "skill"),
            count(library.pairs(), "pair"),
            built.found,
            count(built.subtasks, "subtask"),
            count(built.subtrees, "subtree"),
            built.samples,
            built.nodes,
            seconds(took),
        ),
    };
    Ok(console.result(&text)?)
}

pub(super) fn show(args: &LibraryShowArgs, console: &Console) -> Result<(), Failure> {
    let file = LibraryFile::read(&args.library)?;
    let mut checked = None;
    if let Some(path) = &args.scenario {
        let wanted = super::args::MissionArgs {
            scenario: path.clone(),
            pick: args.pick.clone(),
            task: None,
            task_of: None,
            weight: None,
        };
        let scenario = files::scenario(&wanted, console)?;
        let (system, _) = mission::world(&scenario)?;
        let loaded = load(&args.library, &*system, console)?;
        let (svg, png) = (args.svg.as_deref(), args.png.as_deref());
        draw(&scenario, &loaded.library, svg, png, console)?;
        checked = Some(loaded);
    }
    if console.json() {
        let checked = checked.map(|loaded| {
            let dropped = dropped_json(&loaded.dropped);
            json!({ "same_map": loaded.same_map, "dropped": dropped })
        });
        let object = json!({
            "version": JSON_VERSION,
            "outcome": "shown",
            "library": file,
            "checked": checked,
        });
        return Ok(console.result(&format!("{object}\n"))?);
    }
    let lost: Vec<usize> = checked
        .iter()
        .flat_map(|c| &c.dropped)
        .map(|d| d.skill)
        .collect();
    let mut text = format!(
        "{}: {} over {}, map {}…\n",
        args.library.display(),
        count(file.skills.len(), "skill"),
        file.regions.join(", "),
        file.map.get(..12).unwrap_or(&file.map)
    );
    for (i, skill) in file.skills.iter().enumerate() {
        let end = |k: usize| match skill.letters[k].is_empty() {
            true => format!("({:.3}, {:.3})", skill.path[k][0], skill.path[k][1]),
            false => skill.letters[k].join("+"),
        };
        let last = skill.path.len().saturating_sub(1);
        let mut passed: Vec<String> = skill.letters[1..last.max(1)]
            .iter()
            .filter(|names| !names.is_empty())
            .map(|names| format!("{{{}}}", names.join(",")))
            .collect();
        passed.sort();
        passed.dedup();
        let _ = writeln!(
            text,
            "  {:>3}  {} ↔ {}  cost {:.4}, {} waypoints, passes {}{}",
            i + 1,
            end(0),
            end(last),
            skill.cost,
            skill.path.len(),
            if passed.is_empty() {
                "no region".to_owned()
            } else {
                passed.join(" ")
            },
            if lost.contains(&i) {
                "; does not hold on this map"
            } else {
                ""
            },
        );
    }
    Ok(console.result(&text)?)
}

pub(super) fn merge(args: &LibraryMergeArgs, console: &Console) -> Result<(), Failure> {
    files::check_folders([args.out.as_path()])?;
    let mut merged = LibraryFile::read(&args.libraries[0])?;
    let mut added = 0;
    for path in &args.libraries[1..] {
        added += merged.merge(LibraryFile::read(path)?, path)?;
    }
    merged.write(&args.out)?;
    console.note(&format!("wrote {}", args.out.display()));
    let skills = merged.skills.len();
    let text = match console.json() {
        true => {
            let object = json!({
                "version": JSON_VERSION,
                "outcome": "merged",
                "file": args.out,
                "skills": skills,
                "added": added,
            });
            format!("{object}\n")
        }
        false => format!(
            "{}: {}, {added} of them new to the first library\n",
            args.out.display(),
            count(skills, "skill"),
        ),
    };
    Ok(console.result(&text)?)
}

/// Draws the map with the skills as bands.
fn draw(
    scenario: &Scenario,
    library: &Library,
    svg: Option<&Path>,
    png: Option<&Path>,
    console: &Console,
) -> Result<(), Failure> {
    if svg.is_none() && png.is_none() {
        return Ok(());
    }
    let skills = library.skills().iter();
    let legs: Vec<(Point2<f64>, Point2<f64>)> = skills
        .flat_map(|s| s.path().windows(2).map(|w| (w[0].at, w[1].at)))
        .collect();
    let picture = Picture::new(&scenario.workspace)
        .start(scenario.start)
        .title(&scenario.name)
        .subtitle(count(library.skills().len(), "skill"))
        .bands("skill", legs);
    if let Some(path) = svg {
        files::write(path, picture.to_svg().as_bytes(), console)?;
    }
    if let Some(path) = png {
        let png = picture.to_png(PNG_SCALE);
        files::write(
            path,
            &png.map_err(|e| Failure::input(e.to_string()))?,
            console,
        )?;
    }
    Ok(())
}
